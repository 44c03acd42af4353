//! Rows in one file, by [`redb`].

use std::fmt;
use std::fs;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use redb::{
    Database, DatabaseError, Durability, ReadableDatabase, ReadableTable, StorageError, Table,
    TableDefinition, WriteTransaction,
};
use tracing::{info, warn};

use super::clock::StoreClock;
use super::directory::{Directory, Place};
use super::frame::{self, NAME};
use super::open::{Failure, attempt, builder};
use super::roster::{NOBODY, Population, is_kept_twice};
use super::{
    Content, Damage, Format, Kind, Loaded, Row, Store, StoreError, Write, refusal, salvage,
};

const ROWS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows2");

/// A second copy of rows that are kept twice, on other pages.
const HEADS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("heads2");

/// Rows of the first format.
const FIRST_ROWS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows");

/// The row of the format.
const FORMAT: Row = Row { session: NOBODY, kind: Kind::Format, number: 0 };

/// The row of the store's clock.
const CLOCK: Row = Row { session: NOBODY, kind: Kind::Clock, number: 0 };

/// Batches that an earlier life of the store may have begun and not ended, at the most: parts of them
/// may be found in the file, and no other batch has their numbers.
const UNFINISHED: u64 = 1 << 32;

/// Opens the database; `true` asks for a check of everything in it.
pub type Open = Box<dyn Fn(bool) -> Result<Database, DatabaseError> + Send>;

/// Rows in a redb database.
///
/// After an error the database is closed, and opened again for the next batch.
pub struct RedbStore {
    open: Open,
    database: Option<Database>,
    /// Where the file has to be, where it is one.
    place: Option<Place>,
    /// Number of the next batch.
    batch: u64,
    population: Population,
    clock: StoreClock,
    /// Whether the format is written.
    stamped: bool,
    /// Whether what was read was damaged.
    damaged: bool,
    directory: Option<Directory>,
    /// What was found in a damaged file, until it is loaded.
    found: Option<Found>,
}

/// What was found in a damaged file.
struct Found {
    rows: Rows,
    format: Format,
    damage: Damage,
}

type Rows = std::collections::BTreeMap<Row, Content>;

impl RedbStore {
    /// Opens the store of a data directory, and makes both where they are not there. Of a damaged
    /// file what is sound is looked for; see [`Store::take_over`].
    ///
    /// # Errors
    /// Where the directory can't be used or another server uses it.
    pub fn in_directory(directory: &Path) -> Result<RedbStore, StoreError> {
        let place = || directory.display();
        let unusable = |error: String| failed(format!("the data directory {}: {error}", place()));
        let unusable_io = |error: io::Error| unusable(error.to_string());
        let directory = Directory::prepare(directory).map_err(unusable_io)?;
        let path = directory.file();
        if !path.try_exists().map_err(unusable_io)? {
            // Under its own name there is never a file that was not finished.
            directory.remove_new_file().map_err(unusable_io)?;
            match attempt(|| builder(false).create(directory.new_file())) {
                Ok(database) => drop(database),
                Err(Failure::Damage(why) | Failure::Other(why)) => return Err(unusable(why)),
            }
            directory.replace().map_err(unusable_io)?;
        }
        RedbStore::of(directory).map_err(|error| unusable(error.to_string()))
    }

    /// Opens the store of a data directory that is there, to look into it.
    ///
    /// # Errors
    /// Where there is none, it can't be read or a server uses it.
    pub fn existing(directory: &Path) -> Result<RedbStore, StoreError> {
        let place = directory.display();
        let unusable = |error: &dyn fmt::Display| failed(format!("no store in {place}: {error}"));
        let directory = Directory::existing(directory).map_err(|error| unusable(&error))?;
        RedbStore::of(directory).map_err(|error| unusable(&error))
    }

    fn of(directory: Directory) -> io::Result<RedbStore> {
        let path = directory.file();
        let file = path.clone();
        let open: Open = Box::new(move |check| builder(check).open(&file));
        let damage = match attempt(|| open(true)) {
            Ok(database) => {
                directory.sync()?;
                let place = Some(Place::of(path)?);
                let store = RedbStore::holding(open, Some(database));
                return Ok(RedbStore { place, directory: Some(directory), ..store });
            }
            Err(Failure::Damage(why)) => why,
            Err(Failure::Other(why)) => return Err(io::Error::other(why)),
        };
        warn!("{} is damaged ({damage}); looking for what is sound", path.display());
        let (rows, missing, format) = salvage::salvage(&fs::read(&path)?);
        info!("{} sound rows found in {}", rows.len(), path.display());
        let what = format!("{} was damaged: {damage}", path.display());
        let found = Some(Found { rows, format, damage: Damage { what, missing } });
        let directory = Some(directory);
        Ok(RedbStore { found, directory, ..RedbStore::holding(open, None) })
    }

    /// A store in a database of some making, for tests of what happens when storage fails.
    ///
    /// # Errors
    /// Where it can't be opened.
    pub fn with(open: Open) -> Result<RedbStore, StoreError> {
        let database = open(true).map_err(failed)?;
        Ok(RedbStore::holding(open, Some(database)))
    }

    fn holding(open: Open, database: Option<Database>) -> RedbStore {
        let (population, clock) = (Population::default(), StoreClock::default());
        RedbStore {
            open,
            database,
            place: None,
            batch: 1,
            population,
            clock,
            stamped: false,
            damaged: false,
            directory: None,
            found: None,
        }
    }

    fn write(&mut self, writes: &[Write]) -> Result<(), redb::Error> {
        let database = match &mut self.database {
            Some(database) => database,
            closed => closed.insert((self.open)(false)?),
        };
        let (turn, more) = self.population.turn(writes);
        let clock = Write::Put(CLOCK, self.clock.encode());
        let transaction = begin(database)?;
        {
            if !self.stamped {
                stamp(&transaction, self.batch)?;
            }
            let mut rows = transaction.open_table(ROWS)?;
            let mut heads = transaction.open_table(HEADS)?;
            for write in writes.iter().chain(&more).chain([&clock]) {
                carry_out(write, self.batch, &mut rows)?;
                if is_written_twice(write) {
                    carry_out(write, self.batch, &mut heads)?;
                }
            }
        }
        transaction.commit()?;
        self.stamped = true;
        self.population.enter(&turn);
        Ok(())
    }

    fn read(&self) -> Result<(Rows, Format, Option<Damage>), redb::Error> {
        let (mut sound, mut damage) = (Rows::new(), None);
        let Some(database) = &self.database else { return Ok((sound, Format::Present, None)) };
        let transaction = database.begin_read()?;
        let (rows, format) = match transaction.open_table(ROWS) {
            Ok(rows) => (rows, Format::Present),
            Err(redb::TableError::TableDoesNotExist(_)) => {
                match transaction.open_table(FIRST_ROWS) {
                    Ok(rows) => (rows, Format::First),
                    // Nothing has been written yet.
                    Err(redb::TableError::TableDoesNotExist(_)) => {
                        return Ok((sound, Format::Present, None));
                    }
                    Err(error) => return Err(error.into()),
                }
            }
            Err(error) => return Err(error.into()),
        };
        for row in rows.iter()? {
            let (name, sealed) = row?;
            match frame::open(format.magic(), sealed.value()) {
                Some((row, content)) => drop(sound.insert(row, content)),
                None => {
                    let what = format!("a row can't be read: {:?}", Row::named(name.value()));
                    damage = Some(Damage { what, missing: Vec::new() });
                }
            }
        }
        Ok((sound, format, damage))
    }

    /// Makes a new file of some rows, beside the present one, and puts it in its place.
    fn replace(&mut self, directory: &Directory, rows: &Rows, why: &str) -> io::Result<()> {
        directory.remove_new_file()?;
        let database = builder(false).create(directory.new_file()).map_err(io::Error::other)?;
        let own = self.population.rows().into_iter().chain([(CLOCK, self.clock.encode())]);
        let content = |bytes| Content { batch: self.batch, bytes };
        let own: Rows = own.map(|(row, bytes)| (row, content(bytes))).collect();
        put_all(&database, rows.iter().chain(&own), self.batch).map_err(io::Error::other)?;
        // The file is locked by whoever has it open.
        drop((database, self.database.take()));
        let kept = directory.keep_aside(why)?;
        warn!("the file that was there is kept as {}", kept.display());
        directory.replace()?;
        self.place = Some(Place::of(directory.file())?);
        Ok(())
    }
}

impl Store for RedbStore {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        let (mut rows, format, damage) = match self.found.take() {
            Some(Found { rows, format, damage }) => (rows, format, Some(damage)),
            None => self.read().map_err(failed)?,
        };
        self.damaged = damage.is_some();
        if let Some(format) = rows.remove(&FORMAT) {
            check_format(&format)?;
            self.stamped = true;
        }
        if let Some(place) = &self.place {
            salvage::lock_doubtful(&mut rows, format, place.path());
        }
        // A row that was planted in a damaged file may have any number.
        let newest = rows.values().map(|content| content.batch).max();
        self.batch = newest.map_or(self.batch, |newest| newest.saturating_add(UNFINISHED));
        self.population = Population::of(&mut rows).map_err(failed)?;
        let clock = rows.remove(&CLOCK);
        self.clock = StoreClock::decode(clock.as_ref().map(|content| &content.bytes[..]));
        let (next_key, clock) = (self.population.next_key(), self.clock.clone());
        Ok(Loaded { rows, next_key, clock, format, damage })
    }

    fn take_over(&mut self, rows: &Rows) -> Result<(), StoreError> {
        let Some(directory) = self.directory.clone() else {
            return Err(failed("a store that is no file can't be replaced"));
        };
        let why = if self.damaged { "damaged" } else { "format-1" };
        let unusable = |error| failed(format!("{}: {error}", directory.file().display()));
        self.replace(&directory, rows, why).map_err(unusable)?;
        self.database = Some((self.open)(false).map_err(failed)?);
        self.stamped = true;
        Ok(())
    }

    fn check(&mut self) -> Result<(), StoreError> {
        self.place.as_ref().map_or(Ok(()), Place::check).map_err(StoreError::Gone)
    }

    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError> {
        self.check()?;
        // redb gives up on a file after an error, by its own word or by a panic.
        let written = catch_unwind(AssertUnwindSafe(|| self.write(writes)));
        let written = match written {
            Ok(written) => written.map_err(failed),
            Err(_) => Err(failed("writing to the store panicked")),
        };
        // Parts of a batch that failed may be found in the file: no other has its number.
        self.batch = self.batch.saturating_add(1);
        if written.is_err() {
            let database = self.database.take();
            // Closing it may fail as writing did.
            let _ = catch_unwind(AssertUnwindSafe(|| drop(database)));
        }
        // What lies in a file that nobody finds is not stored; it stays open, so that it can be copied.
        written.and_then(|()| self.check())
    }
}

impl fmt::Debug for RedbStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RedbStore").field("batch", &self.batch).finish_non_exhaustive()
    }
}

/// Begins a batch, to be written whole or not at all.
fn begin(database: &Database) -> Result<WriteTransaction, redb::Error> {
    let mut transaction = database.begin_write()?;
    transaction.set_durability(Durability::Immediate)?;
    // With one phase a damaged commit is taken for one that a crash cut off, and left out.
    transaction.set_two_phase_commit(true);
    Ok(transaction)
}

/// Says what the rows mean, and keeps programs away that would not understand them.
fn stamp(transaction: &WriteTransaction, batch: u64) -> Result<(), redb::Error> {
    let number = Format::Present.number().to_le_bytes();
    transaction.open_table(refusal::ROWS)?;
    let mut rows = transaction.open_table(ROWS)?;
    rows.insert(&FORMAT.name()[..], &frame::seal(&FORMAT, batch, &number)[..])?;
    Ok(())
}

/// Whether this program understands a format.
fn check_format(content: &Content) -> Result<(), StoreError> {
    let number = content.bytes.as_slice().try_into().map(u32::from_le_bytes);
    let known = Format::Present.number();
    match number {
        Ok(number) if number <= known => Ok(()),
        _ => Err(failed(format!(
            "the store has format {number}, and this is Firn {}, which knows formats up to {known}: a newer \
             version has written it, and only such a one reads it",
            env!("CARGO_PKG_VERSION"),
            number = number.unwrap_or(u32::MAX),
        ))),
    }
}

/// Writes rows into an empty database, as they were.
fn put_all<'r>(
    database: &Database,
    rows: impl Iterator<Item = (&'r Row, &'r Content)>,
    batch: u64,
) -> Result<(), redb::Error> {
    let transaction = begin(database)?;
    stamp(&transaction, batch)?;
    {
        let mut table = transaction.open_table(ROWS)?;
        let mut twice = transaction.open_table(HEADS)?;
        for (row, Content { batch, bytes }) in rows {
            let sealed = frame::seal(row, *batch, bytes);
            table.insert(&row.name()[..], &sealed[..])?;
            if is_kept_twice(row.kind) {
                twice.insert(&row.name()[..], &sealed[..])?;
            }
        }
    }
    transaction.commit()?;
    Ok(())
}

fn is_written_twice(write: &Write) -> bool {
    match write {
        Write::Put(row, _) | Write::Remove(row) => is_kept_twice(row.kind),
        Write::RemoveEntries { .. } => false,
        Write::RemoveSession(_) => true,
    }
}

fn carry_out(
    write: &Write,
    batch: u64,
    rows: &mut Table<&[u8], &[u8]>,
) -> Result<(), StorageError> {
    match write {
        Write::Put(row, content) => {
            rows.insert(&row.name()[..], &frame::seal(row, batch, content)[..])?;
        }
        Write::Remove(row) => {
            rows.remove(&row.name()[..])?;
        }
        Write::RemoveEntries { session, before } => {
            let entry = |number| Row { session: *session, kind: Kind::Entry, number }.name();
            let (from, to) = (entry(0), entry(*before));
            rows.retain_in(&from[..]..&to[..], |_, _| false)?;
        }
        Write::RemoveSession(session) => {
            let mut range = [[0; NAME], [0xff; NAME]];
            for end in &mut range {
                end[..8].copy_from_slice(&session.to_be_bytes());
            }
            rows.retain_in(&range[0][..]..=&range[1][..], |_, _| false)?;
        }
    }
    Ok(())
}

fn failed(error: impl fmt::Display) -> StoreError {
    StoreError::Failed(error.to_string())
}
