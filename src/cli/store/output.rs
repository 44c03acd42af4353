//! A file that is there under its name only once it is whole.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::cli::Failure;
use crate::store::{link_or_copy, new_file, sync_names};

/// A file that is being written, under another name beside that which it is to have.
pub struct Output {
    path: PathBuf,
    unfinished: PathBuf,
}

impl Output {
    /// Begins a file.
    ///
    /// # Errors
    /// Where there is one of that name already, or it can't be made.
    pub fn begin(path: &Path) -> Result<(Output, File), Failure> {
        if path.symlink_metadata().is_ok() {
            return Err(taken(path));
        }
        let mut unfinished = path.as_os_str().to_owned();
        unfinished.push(".unfinished");
        let unfinished = PathBuf::from(unfinished);
        let file = new_file(&unfinished).map_err(|error| {
            let advice = match error.kind() {
                ErrorKind::AlreadyExists => {
                    ": it is being written, or was left there; remove it then"
                }
                _ => "",
            };
            Failure::Failed(format!("{}: {error}{advice}", unfinished.display()))
        })?;
        Ok((Output { path: path.to_owned(), unfinished }, file))
    }

    /// Gives the file its name, once all of it is on disk. A file that has come there meanwhile is kept.
    ///
    /// # Errors
    /// Where that can't be done; nothing is left then.
    pub fn finish(self, file: &File) -> Result<(), Failure> {
        let named = file.sync_all().and_then(|()| {
            link_or_copy(&self.unfinished, &self.path)?;
            sync_names(directory(&self.path))
        });
        named.map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => taken(&self.path),
            _ => unwritten(&self.path, &error),
        })
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // Whether it was finished or not, this name is needed no more.
        let _ = fs::remove_file(&self.unfinished);
    }
}

/// That a file can't be written.
pub fn unwritten(path: &Path, error: &io::Error) -> Failure {
    Failure::Failed(format!("{}: {error}", path.display()))
}

fn taken(path: &Path) -> Failure {
    let path = path.display();
    Failure::Failed(format!(
        "{path} is there already, and is not written over: choose another name"
    ))
}

fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
