//! The data directory, and the store's file in it.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use crate::machine;

/// Name of the file.
const FILE: &str = "firn.redb";

/// Name of the file that is to take its place.
const NEW_FILE: &str = "firn.redb.new";

/// Name of the copy that a running server makes for a backup.
const COPY: &str = "firn.redb.backup";

/// The data directory.
#[derive(Clone, Debug)]
pub(super) struct Directory(PathBuf);

impl Directory {
    /// Makes it for the server's user alone, where it is not there.
    pub fn prepare(path: &Path) -> io::Result<Directory> {
        let mut builder = fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.recursive(true).create(path)?;
        Ok(Directory(path.to_owned()))
    }

    /// The store's file.
    pub fn file(&self) -> PathBuf {
        self.0.join(FILE)
    }

    /// A data directory that is there.
    pub fn existing(path: &Path) -> io::Result<Directory> {
        let directory = Directory(path.to_owned());
        fs::metadata(directory.file())?;
        Ok(directory)
    }

    /// The file that is to take its place.
    pub fn new_file(&self) -> PathBuf {
        self.0.join(NEW_FILE)
    }

    /// Removes a new file that an earlier start left: it holds nothing that is not in the store's.
    pub fn remove_new_file(&self) -> io::Result<()> {
        remove(&self.new_file())
    }

    /// The copy that a running server makes for a backup.
    pub fn copy(&self) -> PathBuf {
        self.0.join(COPY)
    }

    /// Removes a copy, as one that a server left when it was killed.
    pub fn remove_copy(&self) -> io::Result<()> {
        remove(&self.copy())
    }

    /// Bytes of the store's file.
    pub fn length(&self) -> io::Result<u64> {
        Ok(fs::metadata(self.file())?.len())
    }

    /// Refuses a copy that may fill the disk: then changes would be refused as well.
    pub fn check_room(&self) -> io::Result<()> {
        let (needed, free) = (self.length()?, self.free());
        match free {
            Some(free) if free < needed => Err(io::Error::new(
                ErrorKind::StorageFull,
                format!(
                    "{free} bytes are free there, and a copy of the store may take {needed}: make room, or \
                     give unused pages of the store back with `firn store compact`"
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Bytes that are free, where that is known.
    #[cfg(unix)]
    fn free(&self) -> Option<u64> {
        let disk = rustix::fs::statvfs(&self.0).ok()?;
        Some(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Elsewhere it shows when the disk is full.
    #[cfg(not(unix))]
    fn free(&self) -> Option<u64> {
        None
    }

    /// Puts the new file in the place of the store's, so that there is one of them at any moment.
    pub fn replace(&self) -> io::Result<()> {
        fs::rename(self.new_file(), self.file())?;
        self.sync()
    }

    /// Keeps the store's file under another name too, which nothing has had and says `why`. Returns where.
    pub fn keep_aside(&self, why: &str) -> io::Result<PathBuf> {
        let since = machine::date().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis();
        let names = (0u32..).map(|number| match number {
            0 => format!("{FILE}.{why}-{since}"),
            number => format!("{FILE}.{why}-{since}-{number}"),
        });
        for aside in names.map(|name| self.0.join(name)) {
            match link_or_copy(&self.file(), &aside) {
                Ok(()) => return self.sync().map(|()| aside),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    /// Sees to it that names of new files outlive a power cut.
    pub fn sync(&self) -> io::Result<()> {
        sync_names(&self.0)
    }
}

/// Sees to it that names of new files in a directory outlive a power cut.
#[cfg(unix)]
pub fn sync_names(directory: &Path) -> io::Result<()> {
    File::open(directory)?.sync_all()
}

/// Other systems do so by themselves.
#[cfg(not(unix))]
pub fn sync_names(_: &Path) -> io::Result<()> {
    Ok(())
}

/// Makes a file that is not there, for this user alone.
pub fn new_file(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.read(true).write(true).create_new(true).open(path)
}

/// Removes a file, if it is there.
fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Gives a file a second name that is not taken; file systems without such get a copy.
pub fn link_or_copy(from: &Path, to: &Path) -> io::Result<()> {
    match fs::hard_link(from, to) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => {
            let mut copy = OpenOptions::new().write(true).create_new(true).open(to)?;
            let copied = io::copy(&mut File::open(from)?, &mut copy).and_then(|_| copy.sync_all());
            // A part of it is worse than nothing.
            copied.inspect_err(|_| drop(fs::remove_file(to)))
        }
        done => done,
    }
}

/// The very file that is found by a name, so that it can be told whether it still is.
#[derive(Debug)]
pub(super) struct Place {
    path: PathBuf,
    file: Identity,
}

impl Place {
    /// What is found there now.
    pub fn of(path: PathBuf) -> io::Result<Place> {
        let file = identify(&path)?;
        Ok(Place { path, file })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the same file is found there still.
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self) -> Result<(), String> {
        let path = self.path.display();
        let advice = "put the data directory back where it was, or restart the server";
        match identify(&self.path) {
            Ok(file) if file == self.file => Ok(()),
            Ok(_) => Err(format!("{path} is another file than the one that was opened; {advice}")),
            Err(error) => Err(format!("{path} is not there any more ({error}); {advice}")),
        }
    }
}

/// Device and number of a file.
#[cfg(unix)]
type Identity = (u64, u64);

#[cfg(unix)]
fn identify(path: &Path) -> io::Result<Identity> {
    use std::os::unix::fs::MetadataExt;
    let file = fs::metadata(path)?;
    Ok((file.dev(), file.ino()))
}

/// Other systems let nobody remove a file that is open.
#[cfg(not(unix))]
type Identity = ();

#[cfg(not(unix))]
fn identify(path: &Path) -> io::Result<Identity> {
    fs::metadata(path).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_aside_is_never_written_over() {
        let data = tempfile::tempdir().unwrap();
        let directory = Directory::prepare(data.path()).unwrap();
        let kept: Vec<PathBuf> = (0..20)
            .map(|i| {
                fs::write(directory.new_file(), format!("{i}")).unwrap();
                directory.replace().unwrap();
                directory.keep_aside("damaged").unwrap()
            })
            .collect();
        for (i, path) in kept.iter().enumerate() {
            assert_eq!(fs::read_to_string(path).unwrap(), i.to_string(), "{}", path.display());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_took_the_place_of_another_is_not_that() {
        let data = tempfile::tempdir().unwrap();
        let path = data.path().join("file");
        fs::write(&path, "a").unwrap();
        let place = Place::of(path.clone()).unwrap();
        fs::write(&path, "b").unwrap();
        assert_eq!(place.check(), Ok(()));
        let away = data.path().join("away");
        fs::rename(&path, &away).unwrap();
        assert!(place.check().unwrap_err().contains("not there"));
        fs::write(&path, "b").unwrap();
        assert!(place.check().unwrap_err().contains("another file"));
        fs::rename(&away, &path).unwrap();
        assert_eq!(place.check(), Ok(()));
    }
}
