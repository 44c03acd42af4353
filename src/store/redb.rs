//! Rows in one file, by [`redb`].

use std::fmt;
use std::fs;
use std::io::{self, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use redb::{
    Builder, Database, DatabaseError, Durability, ReadableDatabase, ReadableTable, StorageError,
    TableDefinition,
};
use tracing::{info, warn};

use super::frame::{self, NAME};
use super::{Kind, Loaded, Row, Store, StoreError, Write, salvage};

/// Name of the file in the data directory.
const FILE: &str = "firn.redb";

/// Memory for pages of the file \[bytes\]. Rows are read once, at the start.
const CACHE: usize = 64 << 20;

const ROWS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows");

/// Opens the database; `true` asks for a check of everything in it.
pub type Open = Box<dyn Fn(bool) -> Result<Database, DatabaseError> + Send>;

/// Rows in a redb database.
///
/// After an error the database is closed, and opened again for the next batch.
pub struct RedbStore {
    open: Open,
    database: Option<Database>,
    /// Number of the next batch.
    batch: u64,
    loaded: Option<Loaded>,
}

impl RedbStore {
    /// Opens the store of a data directory, and makes both where they are not there. A damaged
    /// file is moved aside, and what is sound in it is taken over into a new one.
    ///
    /// # Errors
    /// Where the directory can't be used or another server uses it.
    pub fn in_directory(directory: &Path) -> Result<RedbStore, StoreError> {
        let place = || directory.display();
        fs::create_dir_all(directory)
            .map_err(|error| StoreError(format!("the data directory {}: {error}", place())))?;
        let path = directory.join(FILE);
        let file = path.clone();
        let open: Open = Box::new(move |check| builder(check).create(&file));
        let damage = match attempt(|| open(true)) {
            Ok(database) => return Ok(RedbStore::holding(open, database)),
            Err(Failure::Damage(why)) => why,
            Err(Failure::Other(why)) => {
                return Err(StoreError(format!("the data directory {}: {why}", place())));
            }
        };
        warn!("{} is damaged ({damage}); looking for what is sound", path.display());
        RedbStore::salvaged(open, &path, &damage)
            .map_err(|error| StoreError(format!("the damaged store {}: {error}", path.display())))
    }

    /// A store in a database of some making, for tests of what happens when storage fails.
    ///
    /// # Errors
    /// Where it can't be opened.
    pub fn with(open: Open) -> Result<RedbStore, StoreError> {
        let database = open(true).map_err(failed)?;
        Ok(RedbStore::holding(open, database))
    }

    fn holding(open: Open, database: Database) -> RedbStore {
        RedbStore { open, database: Some(database), batch: 1, loaded: None }
    }

    /// Moves a damaged file aside, and makes a new one of the sound rows in it.
    fn salvaged(open: Open, path: &Path, damage: &str) -> io::Result<RedbStore> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut aside = PathBuf::from(path);
        aside.set_extension(format!("redb.damaged-{}", since.as_millis()));
        fs::rename(path, &aside)?;
        let rows = salvage::scan(&fs::read(&aside)?);
        info!("{} sound rows found in {}", rows.len(), aside.display());
        let batch = rows.values().map(|content| content.batch).max().unwrap_or(0) + 1;
        let database = open(false).map_err(io::Error::other)?;
        let mut store = RedbStore { batch, ..RedbStore::holding(open, database) };
        let writes: Vec<Write> =
            rows.iter().map(|(row, content)| Write::Put(*row, content.bytes.clone())).collect();
        store.commit(&writes).map_err(io::Error::other)?;
        let damage = format!("{damage}; it is kept as {}", aside.display());
        store.loaded = Some(Loaded { rows, damage: Some(damage) });
        Ok(store)
    }

    fn write(&mut self, writes: &[Write]) -> Result<(), redb::Error> {
        let database = match &mut self.database {
            Some(database) => database,
            closed => closed.insert((self.open)(false)?),
        };
        let mut transaction = database.begin_write()?;
        transaction.set_durability(Durability::Immediate)?;
        {
            let mut rows = transaction.open_table(ROWS)?;
            for write in writes {
                match write {
                    Write::Put(row, content) => {
                        let sealed = frame::seal(row, self.batch, content);
                        rows.insert(&row.name()[..], &sealed[..])?;
                    }
                    Write::Remove(row) => {
                        rows.remove(&row.name()[..])?;
                    }
                    Write::RemoveEntries { session, before } => {
                        let entry =
                            |number| Row { session: *session, kind: Kind::Entry, number }.name();
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
            }
        }
        transaction.commit()?;
        Ok(())
    }

    fn read(&self) -> Result<Loaded, redb::Error> {
        let mut loaded = Loaded::default();
        let Some(database) = &self.database else { return Ok(loaded) };
        let transaction = database.begin_read()?;
        let rows = match transaction.open_table(ROWS) {
            Ok(rows) => rows,
            // Nothing has been written yet.
            Err(redb::TableError::TableDoesNotExist(_)) => return Ok(loaded),
            Err(error) => return Err(error.into()),
        };
        for row in rows.iter()? {
            let (name, sealed) = row?;
            match frame::open(sealed.value()) {
                Some((row, content)) => drop(loaded.rows.insert(row, content)),
                None => {
                    let what = Row::named(name.value());
                    loaded.damage = Some(format!("a row can't be read: {what:?}"));
                }
            }
        }
        Ok(loaded)
    }
}

impl Store for RedbStore {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        let loaded = match self.loaded.take() {
            Some(loaded) => loaded,
            None => self.read().map_err(failed)?,
        };
        let newest = loaded.rows.values().map(|content| content.batch).max();
        self.batch = self.batch.max(newest.unwrap_or(0) + 1);
        Ok(loaded)
    }

    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError> {
        // redb gives up on a file after an error, by its own word or by a panic.
        let written = catch_unwind(AssertUnwindSafe(|| self.write(writes)));
        let written = match written {
            Ok(written) => written.map_err(failed),
            Err(_) => Err(StoreError("writing to the store panicked".to_owned())),
        };
        match &written {
            Ok(()) => self.batch += 1,
            Err(_) => {
                let database = self.database.take();
                // Closing it may fail as writing did.
                let _ = catch_unwind(AssertUnwindSafe(|| drop(database)));
            }
        }
        written
    }
}

impl fmt::Debug for RedbStore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RedbStore").field("batch", &self.batch).finish_non_exhaustive()
    }
}

fn builder(check: bool) -> Builder {
    let mut builder = Builder::new();
    builder.set_cache_size(CACHE).set_check_integrity_on_open(check);
    builder
}

/// Why a file could not be opened.
enum Failure {
    /// What is in it is not what was written.
    Damage(String),
    /// Something that has nothing to do with what is in it.
    Other(String),
}

fn attempt(open: impl Fn() -> Result<Database, DatabaseError>) -> Result<Database, Failure> {
    let opened = catch_unwind(AssertUnwindSafe(open))
        .map_err(|_| Failure::Damage("reading it panicked".to_owned()))?;
    opened.map_err(|error| match &error {
        DatabaseError::DatabaseAlreadyOpen => {
            Failure::Other("another server uses it already".to_owned())
        }
        DatabaseError::Storage(StorageError::Io(io)) => match io.kind() {
            ErrorKind::UnexpectedEof | ErrorKind::InvalidData | ErrorKind::InvalidInput => {
                Failure::Damage(io.to_string())
            }
            _ => Failure::Other(io.to_string()),
        },
        DatabaseError::Storage(StorageError::Corrupted(why)) => Failure::Damage(why.clone()),
        _ => Failure::Other(error.to_string()),
    })
}

fn failed(error: impl fmt::Display) -> StoreError {
    StoreError(error.to_string())
}
