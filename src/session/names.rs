//! Names that sessions have, and places of sessions that are being made.

use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use super::error::SessionError;
use super::handle::Session;
use super::spec::{Limits, SessionSpec};

/// Sessions by name; a name is taken from the moment its creation begins.
#[derive(Debug, Default)]
pub(super) struct Names(RwLock<BTreeMap<String, Entry>>);

#[derive(Debug)]
struct Entry {
    cells: u64,
    /// `None` while the session is being made.
    session: Option<Arc<Session>>,
}

impl Names {
    fn read(&self) -> RwLockReadGuard<'_, BTreeMap<String, Entry>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, BTreeMap<String, Entry>> {
        self.0.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn reserve(&self, id: &str, cells: u64, limits: &Limits) -> Result<(), SessionError> {
        let mut names = self.write();
        if names.contains_key(id) {
            return Err(SessionError::Conflict(format!("there is a session '{id}' already")));
        }
        if names.len() >= limits.sessions {
            return Err(SessionError::ServerFull(format!(
                "the server holds its {} sessions already; delete one first",
                limits.sessions
            )));
        }
        let held: u64 = names.values().map(|entry| entry.cells).sum();
        if held + cells > limits.cells {
            return Err(SessionError::ServerFull(format!(
                "{cells} cells more than the {held} held already would exceed the server's {}; \
                 delete a session first",
                limits.cells
            )));
        }
        names.insert(id.to_owned(), Entry { cells, session: None });
        Ok(())
    }

    /// Enters a session that outlived the last stop.
    pub(super) fn recover(&self, session: Arc<Session>) {
        let entry = Entry { cells: session.spec.grid.cells(), session: Some(session.clone()) };
        self.write().insert(session.id.clone(), entry);
    }

    /// A session by its name.
    pub(super) fn get(&self, id: &str) -> Option<Arc<Session>> {
        self.read().get(id).and_then(|entry| entry.session.clone())
    }

    /// Up to `limit` sessions in ascending order of their names, those after `after`.
    pub(super) fn list(&self, after: Option<&str>, limit: usize) -> Vec<Arc<Session>> {
        let from = after.map_or(Bound::Unbounded, Bound::Excluded);
        self.read()
            .range::<str, _>((from, Bound::Unbounded))
            .filter_map(|(_, entry)| entry.session.clone())
            .take(limit)
            .collect()
    }

    /// How many names are taken.
    pub(super) fn count(&self) -> usize {
        self.read().len()
    }

    /// Forgets a session.
    pub(super) fn remove(&self, id: &str) {
        self.write().remove(id);
    }
}

/// A place for a session that is being made; given back where that fails or is abandoned.
pub(super) struct Place {
    names: Arc<Names>,
    pub(super) id: String,
    kept: bool,
}

impl Place {
    /// Takes a name, or makes one, and the room that a session needs.
    pub(super) fn reserve(
        names: Arc<Names>,
        id: Option<String>,
        spec: &SessionSpec,
        limits: &Limits,
    ) -> Result<Place, SessionError> {
        let id = id.unwrap_or_else(|| ulid::Ulid::generate().to_string());
        names.reserve(&id, spec.grid.cells(), limits)?;
        Ok(Place { names, id, kept: false })
    }

    /// Gives it to the session that was made for it.
    pub(super) fn keep(mut self, session: Arc<Session>) {
        if let Some(entry) = self.names.write().get_mut(&self.id) {
            entry.session = Some(session);
        }
        self.kept = true;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if !self.kept {
            self.names.remove(&self.id);
        }
    }
}
