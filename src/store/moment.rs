//! A moment of the store: all that one commit left, read while others follow.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fs::File;
use std::io::{Seek, SeekFrom};

use redb::backends::FileBackend;
use redb::{
    Database, ReadOnlyTable, ReadTransaction, ReadableDatabase, ReadableTable,
    ReadableTableMetadata, TableDefinition, TableError,
};

use firn_engine::reserve::ask_for;

use super::directory::{Directory, new_file};
use super::frame::{self, HEAD, Head};
use super::open::builder;
use super::roster::{Population, is_kept_twice};
use super::tables::{CLOCK, FIRST_ROWS, FORMAT, HEADS, ROWS, check_format, failed, put_all};
use super::{Content, Format, Kind, Row, StoreError, salvage};

/// Rows with what they hold.
pub type Rows = BTreeMap<Row, Content>;

/// Rows by their names, sealed.
type Sealed = TableDefinition<'static, &'static [u8], &'static [u8]>;

type Table = ReadOnlyTable<&'static [u8], &'static [u8]>;

/// All that was committed at some moment. As long as there is one, the file keeps what is replaced or removed.
#[derive(Debug)]
pub struct Moment {
    transaction: ReadTransaction,
    /// Where the file is, where it is one.
    directory: Option<Directory>,
}

/// Something that is wrong with a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flaw {
    /// The row; none where not even its name can be read.
    pub row: Option<Row>,
    /// What is wrong with it.
    pub what: String,
}

/// A moment, read as a whole.
#[derive(Debug)]
pub struct Verified {
    /// The sound rows of sessions.
    pub rows: Rows,
    /// What they mean.
    pub format: Format,
    /// What is wrong with others, or with where they lie.
    pub flaws: Vec<Flaw>,
    /// How many rows are sound, the store's own and second copies among them.
    pub count: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Bytes of the file.
    pub file_bytes: u64,
}

impl Moment {
    /// The present moment of a database.
    pub(super) fn of(
        database: &Database,
        directory: Option<Directory>,
    ) -> Result<Moment, redb::Error> {
        Ok(Moment { transaction: database.begin_read()?, directory })
    }

    /// Every sound row, the format, and what is wrong with others. What rows of a kind hold may be left out.
    pub(super) fn rows(
        &self,
        left_out: Option<Kind>,
    ) -> Result<(Rows, Format, Vec<Flaw>), redb::Error> {
        let (mut rows, mut flaws) = (Rows::new(), Vec::new());
        let format = self.format()?;
        let table = if format == Format::First { FIRST_ROWS } else { ROWS };
        self.walk(table, format, &mut flaws, |row, mut content, _| {
            if left_out == Some(row.kind) {
                content.bytes = Vec::new();
            }
            rows.insert(row, content);
        })?;
        Ok((rows, format, flaws))
    }

    /// What a row holds, where it is there.
    pub(super) fn row(&self, row: Row) -> Result<Option<Vec<u8>>, redb::Error> {
        let Some(table) = self.exists(ROWS)? else { return Ok(None) };
        let Some(sealed) = table.get(&row.name()[..])? else { return Ok(None) };
        let opened = frame::open(Format::Present.magic(), sealed.value());
        let found = opened.filter(|(named, _)| *named == row);
        let damaged = || redb::Error::Corrupted(format!("the checksum of a row is wrong: {row:?}"));
        found.map(|(_, content)| Some(content.bytes)).ok_or_else(damaged)
    }

    /// That of the first Firn names no format, but has its rows elsewhere.
    fn format(&self) -> Result<Format, redb::Error> {
        let is_first = self.exists(ROWS)?.is_none() && self.exists(FIRST_ROWS)?.is_some();
        Ok(if is_first { Format::First } else { Format::Present })
    }

    /// Hands over each sound row of a table, as it is and sealed, in their order.
    fn walk(
        &self,
        table: Sealed,
        format: Format,
        flaws: &mut Vec<Flaw>,
        mut take: impl FnMut(Row, Content, &[u8]),
    ) -> Result<(), redb::Error> {
        // Nothing has been written yet.
        let Some(table) = self.exists(table)? else { return Ok(()) };
        let mut found = 0;
        for row in table.iter()? {
            let (name, sealed) = row?;
            found += 1;
            let named = Row::named(name.value());
            match frame::open(format.magic(), sealed.value()) {
                Some((row, content)) if named == Some(row) => take(row, content, sealed.value()),
                _ => flaws.push(Flaw { row: named, what: "its checksum is wrong".to_owned() }),
            }
        }
        let counted = table.len()?;
        if counted != found {
            let what = format!("the file's index counts {counted} rows, and leads to {found}");
            flaws.push(Flaw { row: None, what });
        }
        Ok(())
    }

    fn exists(&self, table: Sealed) -> Result<Option<Table>, redb::Error> {
        match self.transaction.open_table(table) {
            Ok(table) => Ok(Some(table)),
            Err(TableError::TableDoesNotExist(_)) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Reads every row, both copies of those that are kept twice, and the file below them.
    ///
    /// # Errors
    /// Where something can't be read at all.
    pub fn verify(&self) -> Result<Verified, StoreError> {
        let (mut rows, mut flaws) = (Rows::new(), Vec::new());
        let (mut count, mut bytes) = (0, 0);
        let mut heads = HashSet::new();
        let mut see = |sealed: &[u8]| {
            (count, bytes) = (count + 1, bytes + sealed.len() as u64);
            heads.extend(sealed.first_chunk::<HEAD>().copied());
        };
        let format = self.format().map_err(failed)?;
        let table = if format == Format::First { FIRST_ROWS } else { ROWS };
        let keep = |row, content, sealed: &[u8]| {
            see(sealed);
            rows.insert(row, content);
        };
        self.walk(table, format, &mut flaws, keep).map_err(failed)?;
        if format == Format::Present {
            self.compare(&rows, &mut flaws, see).map_err(failed)?;
        }
        let file_bytes = self.look_at_file(format, &mut heads, &mut flaws)?;
        flaws.sort_by_key(|flaw| flaw.row);
        rows.remove(&FORMAT);
        rows.remove(&CLOCK);
        Population::of(&mut rows).map_err(failed)?;
        Ok(Verified { rows, format, flaws, count, bytes, file_bytes })
    }

    /// Compares the second copies of rows with the first ones.
    fn compare(
        &self,
        rows: &Rows,
        flaws: &mut Vec<Flaw>,
        mut see: impl FnMut(&[u8]),
    ) -> Result<(), redb::Error> {
        let twice = rows.keys().filter(|row| is_kept_twice(row.kind));
        let mut missing: BTreeSet<Row> = twice.copied().collect();
        let (mut different, mut damaged) = (Vec::new(), Vec::new());
        self.walk(HEADS, Format::Present, &mut damaged, |row, content, sealed| {
            see(sealed);
            missing.remove(&row);
            if rows.get(&row) != Some(&content) {
                different.push(row);
            }
        })?;
        for flaw in damaged {
            missing.retain(|row| flaw.row != Some(*row));
            flaws.push(Flaw { what: format!("of its second copy: {}", flaw.what), ..flaw });
        }
        let mut note = |row, what: &str| flaws.push(Flaw { row: Some(row), what: what.to_owned() });
        different.into_iter().for_each(|row| note(row, "its two copies differ"));
        missing.into_iter().for_each(|row| note(row, "its second copy is missing"));
        Ok(())
    }

    /// Looks for rows in the file itself: what the database reads may come from memory. A row that is whole anywhere
    /// counts, as salvage would find it there. Returns how long the file is.
    fn look_at_file(
        &self,
        format: Format,
        heads: &mut HashSet<Head>,
        flaws: &mut Vec<Flaw>,
    ) -> Result<u64, StoreError> {
        let Some(directory) = &self.directory else { return Ok(0) };
        let path = directory.file();
        let unreadable = |error| failed(format!("{}: {error}", path.display()));
        let file = File::open(&path).map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        salvage::find_all(format.magic(), file, heads).map_err(unreadable)?;
        for head in heads.iter() {
            let what = "it can't be found in the file whole: what is there is not what was written";
            flaws.push(Flaw { row: frame::row(head), what: what.to_owned() });
        }
        Ok(length)
    }

    /// Makes sure that there is memory to read all of it, as rows and as what they hold.
    ///
    /// # Errors
    /// Where there is not.
    pub fn check_memory(&self) -> Result<(), StoreError> {
        let Some(directory) = &self.directory else { return Ok(()) };
        let bytes = directory.length().map_err(failed)?;
        ask_for(bytes.saturating_mul(2)).map_err(|error| {
            failed(format!(
                "there is no memory to read the {bytes} bytes of the store beside all else: {error}; verify a \
                 backup of it on another machine"
            ))
        })
    }

    /// Copies all of it into a new file in the data directory. The file has no name: it is gone as soon as nobody
    /// has it open.
    ///
    /// # Errors
    /// Where a row is damaged, or the file can't be written.
    pub fn copy(&self) -> Result<File, StoreError> {
        let Some(directory) = &self.directory else { return Err(super::no_file()) };
        let path = directory.copy();
        let unusable =
            |error: &dyn std::fmt::Display| failed(format!("{}: {error}", path.display()));
        directory
            .remove_copy()
            .and_then(|()| directory.check_room())
            .map_err(|error| unusable(&error))?;
        let file = new_file(&path).map_err(|error| unusable(&error))?;
        let copied = self.copy_into(file).map_err(|error| unusable(&error));
        directory.remove_copy().map_err(|error| unusable(&error))?;
        copied
    }

    /// Copies all of it into an empty file, as a file for a data directory. Returns it, from its beginning.
    ///
    /// # Errors
    /// Where a row is damaged, or the file can't be written.
    pub fn copy_into(&self, file: File) -> Result<File, StoreError> {
        if self.format().map_err(failed)? == Format::First {
            return Err(failed(
                "the store is of Firn 0.1: start a server on it first, which makes it one of this version, or \
                 copy the file itself while no server runs",
            ));
        }
        let mut copy = file.try_clone().map_err(failed)?;
        let backend = FileBackend::new(file).map_err(failed)?;
        let database = builder(false).create_with_backend(backend).map_err(failed)?;
        if let Some(table) = self.exists(ROWS).map_err(failed)? {
            let rows = table.iter().map_err(failed)?.map(|row| {
                let (name, sealed) = row.map_err(failed)?;
                sound(Row::named(name.value()), sealed.value())
            });
            put_all(&database, rows, 0)?;
        }
        database.close().map_err(failed)?;
        copy.sync_all().map_err(failed)?;
        copy.seek(SeekFrom::Start(0)).map_err(failed)?;
        Ok(copy)
    }
}

/// A row that is as it was written, and that this program understands.
fn sound(named: Option<Row>, sealed: &[u8]) -> Result<(Row, Vec<u8>), StoreError> {
    let opened = frame::open(Format::Present.magic(), sealed);
    let Some((row, content)) = opened.filter(|(row, _)| named == Some(*row)) else {
        return Err(failed(format!(
            "a row is damaged ({named:?}), and a copy would be as well; `firn store verify` says more"
        )));
    };
    if row == FORMAT {
        check_format(&content)?;
    }
    Ok((row, sealed.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::super::{Kind, RedbStore, Store, Write};
    use super::*;

    #[test]
    fn copies_that_differ_or_are_missing_are_named() {
        let data = tempfile::tempdir().unwrap();
        let anchor = |session| Row { session, kind: Kind::Anchor, number: 0 };
        let writes = [1, 2, 3].map(|session| Write::Put(anchor(session), vec![7; 9]));
        let mut store = RedbStore::in_directory(data.path()).unwrap();
        store.load().unwrap();
        store.commit(&writes).unwrap();
        let sound = store.moment().unwrap().verify().unwrap();
        assert_eq!(sound.flaws, []);
        drop(store);

        let database = Database::open(data.path().join("firn.redb")).unwrap();
        let transaction = database.begin_write().unwrap();
        let mut twice = transaction.open_table(HEADS).unwrap();
        let other = frame::seal(&anchor(1), 5, b"other");
        twice.insert(&anchor(1).name()[..], &other[..]).unwrap();
        twice.remove(&anchor(2).name()[..]).unwrap();
        twice.insert(&anchor(3).name()[..], &b"rubbish"[..]).unwrap();
        drop(twice);
        transaction.commit().unwrap();
        drop(database);

        let mut store = RedbStore::existing(data.path()).unwrap();
        let moment = store.moment().unwrap();
        let found = moment.verify().unwrap();
        let told = found.flaws.iter().map(|flaw| (flaw.row.unwrap().session, &*flaw.what));
        let told: Vec<(u64, &str)> = told.collect();
        let damaged = "of its second copy: its checksum is wrong";
        let expected =
            [(1, "its two copies differ"), (2, "its second copy is missing"), (3, damaged)];
        assert_eq!(told, expected);
        assert_eq!(found.count, sound.count - 2);
        // A copy is made of the first ones, which are sound.
        moment.copy_into(new_file(&data.path().join("copy")).unwrap()).unwrap();
    }
}
