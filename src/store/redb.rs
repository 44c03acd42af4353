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
use super::{Content, Damage, Kind, Loaded, Row, Store, StoreError, Write, salvage};

const ROWS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows");

/// A second copy of rows that are kept twice, on other pages.
const MARKS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("marks");

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
    /// What was found in a damaged file, until it takes the file's place.
    found: Option<Found>,
}

/// What was found in a damaged file. It lies in a new file already.
struct Found {
    directory: Directory,
    /// None are left here once they are loaded.
    rows: Rows,
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
        let file = path.clone();
        let open: Open = Box::new(move |check| builder(check).open(&file));
        let damage = match attempt(|| open(true)) {
            Ok(database) => {
                directory.sync().map_err(unusable_io)?;
                let place = Some(Place::of(path).map_err(unusable_io)?);
                return Ok(RedbStore { place, ..RedbStore::holding(open, Some(database)) });
            }
            Err(Failure::Damage(why)) => why,
            Err(Failure::Other(why)) => return Err(unusable(why)),
        };
        warn!("{} is damaged ({damage}); looking for what is sound", path.display());
        RedbStore::salvaged(open, directory, &damage)
            .map_err(|error| failed(format!("the damaged store {}: {error}", path.display())))
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
        RedbStore { open, database, place: None, batch: 1, population, clock, found: None }
    }

    /// Makes a new file of what is sound in a damaged one, beside it.
    fn salvaged(open: Open, directory: Directory, damage: &str) -> io::Result<RedbStore> {
        let (rows, missing) = salvage::salvage(&fs::read(directory.file())?);
        info!("{} sound rows found in {}", rows.len(), directory.file().display());
        directory.remove_new_file()?;
        let database = builder(false).create(directory.new_file()).map_err(io::Error::other)?;
        put_all(&database, &rows).map_err(io::Error::other)?;
        let what = format!("{} was damaged: {damage}", directory.file().display());
        let found = Found { directory, rows, damage: Damage { what, missing } };
        Ok(RedbStore { found: Some(found), ..RedbStore::holding(open, None) })
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
            let mut rows = transaction.open_table(ROWS)?;
            let mut marks = transaction.open_table(MARKS)?;
            for write in writes.iter().chain(&more).chain([&clock]) {
                carry_out(write, self.batch, &mut rows)?;
                if is_written_twice(write) {
                    carry_out(write, self.batch, &mut marks)?;
                }
            }
        }
        transaction.commit()?;
        self.population.enter(&turn);
        Ok(())
    }

    fn read(&self) -> Result<(Rows, Option<Damage>), redb::Error> {
        let (mut sound, mut damage) = (Rows::new(), None);
        let Some(database) = &self.database else { return Ok((sound, None)) };
        let transaction = database.begin_read()?;
        let rows = match transaction.open_table(ROWS) {
            Ok(rows) => rows,
            // Nothing has been written yet.
            Err(redb::TableError::TableDoesNotExist(_)) => return Ok((sound, None)),
            Err(error) => return Err(error.into()),
        };
        for row in rows.iter()? {
            let (name, sealed) = row?;
            match frame::open(sealed.value()) {
                Some((row, content)) => drop(sound.insert(row, content)),
                None => {
                    let what = format!("a row can't be read: {:?}", Row::named(name.value()));
                    damage = Some(Damage { what, missing: Vec::new() });
                }
            }
        }
        Ok((sound, damage))
    }
}

impl Store for RedbStore {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        let (mut rows, damage) = match &mut self.found {
            Some(found) => (std::mem::take(&mut found.rows), Some(found.damage.clone())),
            None => self.read().map_err(failed)?,
        };
        if let Some(place) = &self.place {
            salvage::lock_doubtful(&mut rows, place.path());
        }
        // A row that was planted in a damaged file may have any number.
        let newest = rows.values().map(|content| content.batch).max();
        self.batch = newest.map_or(self.batch, |newest| newest.saturating_add(UNFINISHED));
        self.population = Population::of(&mut rows).map_err(failed)?;
        let clock = rows.remove(&CLOCK);
        self.clock = StoreClock::decode(clock.as_ref().map(|content| &content.bytes[..]));
        let (next_key, clock) = (self.population.next_key(), self.clock.clone());
        Ok(Loaded { rows, next_key, clock, damage })
    }

    fn take_over(&mut self) -> Result<(), StoreError> {
        let Some(Found { directory, .. }) = self.found.take() else { return Ok(()) };
        let path = directory.file();
        let unusable = |error| failed(format!("the damaged store {}: {error}", path.display()));
        let kept = directory.keep_aside().map_err(unusable)?;
        warn!("the damaged file is kept as {}", kept.display());
        directory.replace().map_err(unusable)?;
        self.place = Some(Place::of(path.clone()).map_err(unusable)?);
        self.database = Some((self.open)(false).map_err(failed)?);
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

/// Writes rows into an empty database, as they were.
fn put_all(database: &Database, rows: &Rows) -> Result<(), redb::Error> {
    let transaction = begin(database)?;
    {
        let mut table = transaction.open_table(ROWS)?;
        let mut twice = transaction.open_table(MARKS)?;
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
