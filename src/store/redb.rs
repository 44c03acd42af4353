//! Rows in one file, by [`redb`].

use std::fmt;
use std::fs;
use std::io::{self, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use redb::{Database, DatabaseError};
use tracing::{info, warn};

use super::clock::StoreClock;
use super::directory::{Directory, Place};
use super::moment::{Flaw, Moment, Rows};
use super::open::{Failure, attempt, builder};
use super::roster::Population;
use super::tables::{
    CLOCK, FORMAT, HEADS, ROWS, begin, carry_out, check_format, failed, is_written_twice, put_all,
    stamp,
};
use super::{
    Compacted, Content, Damage, Format, Kind, Loaded, Row, Store, StoreError, Write, frame,
    no_file, salvage,
};

/// Batches that an earlier life of the store may have begun and not ended, at the most: parts of them
/// may be found in the file, and no other batch has their numbers.
const UNFINISHED: u64 = 1 << 32;

/// What a second server on a directory is told.
const IN_USE: &str = "another server uses it already";

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
                Err(Failure::InUse) => return Err(unusable(IN_USE.to_owned())),
                Err(Failure::Damage(why) | Failure::Other(why)) => return Err(unusable(why)),
            }
            directory.replace().map_err(unusable_io)?;
        }
        let store = RedbStore::of(directory.clone()).map_err(unusable_io)?;
        // Nobody else is at work in the directory from here on.
        if let Err(error) = directory.remove_copy() {
            warn!("{}: {error}; it is no longer needed: remove it", directory.copy().display());
        }
        Ok(store)
    }

    /// Opens the store of a data directory that is there, to look into it.
    ///
    /// # Errors
    /// [`StoreError::InUse`] where a server uses it; where there is none, or it can't be read.
    pub fn existing(directory: &Path) -> Result<RedbStore, StoreError> {
        let place = directory.display();
        let unusable = |error: &dyn fmt::Display| failed(format!("no store in {place}: {error}"));
        let directory = Directory::existing(directory).map_err(|error| unusable(&error))?;
        RedbStore::of(directory).map_err(|error| match error.kind() {
            ErrorKind::ResourceBusy => StoreError::InUse(format!("a running server uses {place}")),
            _ => unusable(&error),
        })
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
            Err(Failure::InUse) => return Err(io::Error::new(ErrorKind::ResourceBusy, IN_USE)),
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
        let (turn, more) = self.population.turn(writes);
        let clock = Write::Put(CLOCK, self.clock.encode());
        let transaction = begin(self.database()?)?;
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

    fn read_all(&self) -> Result<(Rows, Format, Option<Damage>), redb::Error> {
        let Some(database) = &self.database else {
            return Ok((Rows::new(), Format::Present, None));
        };
        let moment = Moment::of(database, None)?;
        // Restore points are read when somebody wants them; where all goes into a new file, they are part of it.
        let (mut rows, format, mut flaws) = moment.rows(Some(Kind::Point))?;
        if !flaws.is_empty() {
            (rows, ..) = moment.rows(None)?;
        }
        let damage = flaws.pop().map(|Flaw { row, what }| {
            let what = format!("a row can't be read: {row:?}, {what}");
            Damage { what, missing: Vec::new() }
        });
        Ok((rows, format, damage))
    }

    /// The database, opened again where a failure has closed it.
    fn database(&mut self) -> Result<&mut Database, redb::Error> {
        Ok(match &mut self.database {
            Some(database) => database,
            closed => closed.insert((self.open)(false)?),
        })
    }

    /// Does something with the file. Where that fails it is closed: redb gives up on a file after an error, by its own
    /// word or by a panic.
    fn attempt<T>(
        &mut self,
        act: impl FnOnce(&mut RedbStore) -> Result<T, redb::Error>,
    ) -> Result<T, StoreError> {
        let done = match catch_unwind(AssertUnwindSafe(|| act(self))) {
            Ok(done) => done.map_err(failed),
            Err(_) => Err(failed("using the store panicked")),
        };
        if done.is_err() {
            let database = self.database.take();
            // Closing it may fail as writing did.
            let _ = catch_unwind(AssertUnwindSafe(|| drop(database)));
        }
        done
    }

    /// The directory of a file that is sound.
    fn sound_directory(&self) -> Result<Directory, StoreError> {
        let directory = self.directory.clone().ok_or_else(no_file)?;
        if self.damaged || self.found.is_some() {
            return Err(failed(format!(
                "{} is damaged; `firn store check` lists what is whole in it, and the next start takes \
                 that over into a new file",
                directory.file().display()
            )));
        }
        Ok(directory)
    }

    /// Makes a new file of some rows, beside the present one, and puts it in its place.
    fn replace(&mut self, directory: &Directory, rows: &Rows, why: &str) -> io::Result<()> {
        directory.remove_new_file()?;
        let database = builder(false).create(directory.new_file()).map_err(io::Error::other)?;
        let own = self.population.rows().into_iter().chain([(CLOCK, self.clock.encode())]);
        let content = |bytes| Content { batch: self.batch, bytes };
        let own: Rows = own.map(|(row, bytes)| (row, content(bytes))).collect();
        let sealed = |(row, Content { batch, bytes }): (&Row, &Content)| {
            Ok((*row, frame::seal(row, *batch, bytes)))
        };
        let all = rows.iter().chain(&own).map(sealed);
        put_all(&database, all, self.batch).map_err(io::Error::other)?;
        // An open database keeps its file locked.
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
            None => self.read_all().map_err(failed)?,
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
        self.damaged = false;
        Ok(())
    }

    fn check(&mut self) -> Result<(), StoreError> {
        self.place.as_ref().map_or(Ok(()), Place::check).map_err(StoreError::Gone)
    }

    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError> {
        self.check()?;
        let written = self.attempt(|store| store.write(writes));
        // Parts of a batch that failed may be found in the file: no other has its number.
        self.batch = self.batch.saturating_add(1);
        // What lies in a file that nobody finds is not stored; it stays open, so that it can be copied.
        written.and_then(|()| self.check())
    }

    fn read(&mut self, row: Row) -> Result<Option<Vec<u8>>, StoreError> {
        self.attempt(|store| Moment::of(store.database()?, None)?.row(row))
    }

    fn moment(&mut self) -> Result<Moment, StoreError> {
        let directory = self.sound_directory()?;
        self.check()?;
        self.attempt(|store| Moment::of(store.database()?, Some(directory)))
    }

    fn compact(&mut self) -> Result<Compacted, StoreError> {
        let directory = self.sound_directory()?;
        self.check()?;
        let before = directory.length().map_err(failed)?;
        self.attempt(|store| store.database()?.compact().map(drop).map_err(redb::Error::from))?;
        Ok(Compacted { before, after: directory.length().map_err(failed)? })
    }
}

impl fmt::Debug for RedbStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RedbStore").field("batch", &self.batch).finish_non_exhaustive()
    }
}
