//! Names that sessions have, and places of sessions that are being made.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::{AddAssign, Bound, SubAssign};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use firn_protocol::SessionSpec;
use firn_snow::Grid;

use crate::core::Directory;
use crate::core::session::{Limits, Outlet, SessionError};
use crate::core::tenant::{Quotas, Tenant};
use crate::machine;
use crate::session::handle::Session;

/// Sessions by name; a name is taken from the moment its creation begins.
#[derive(Debug, Default)]
pub(crate) struct Names(RwLock<Table>);

/// Names, and sums over them that are kept up to date rather than made anew.
#[derive(Debug, Default)]
struct Table {
    entries: BTreeMap<String, Entry>,
    size: Size,
    /// By the name of the tenant; none of those that hold nothing.
    tenants: HashMap<String, Holding>,
    /// Sessions that outlived the last stop and are not back yet, by their keys.
    returning: BTreeMap<u64, Arc<Session>>,
}

/// What limits count of some grids, in whole tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Size {
    columns: u64,
    cells: u64,
}

#[derive(Debug)]
struct Entry {
    size: Size,
    tenant: Option<Arc<Tenant>>,
    /// `None` while the session is being made.
    session: Option<Arc<Session>>,
}

/// What one tenant has.
#[derive(Debug, Default)]
struct Holding {
    names: BTreeSet<String>,
    size: Size,
}

impl Size {
    fn of(grid: &Grid) -> Size {
        Size { columns: grid.padded_columns(), cells: grid.padded_cells() }
    }
}

impl AddAssign for Size {
    fn add_assign(&mut self, other: Size) {
        self.columns += other.columns;
        self.cells += other.cells;
    }
}

impl SubAssign for Size {
    fn sub_assign(&mut self, other: Size) {
        self.columns -= other.columns;
        self.cells -= other.cells;
    }
}

impl Table {
    fn insert(&mut self, id: &str, entry: Entry) {
        self.remove(id);
        self.size += entry.size;
        if let Some(tenant) = &entry.tenant {
            let holding = self.tenants.entry(tenant.name.clone()).or_default();
            holding.size += entry.size;
            holding.names.insert(id.to_owned());
        }
        self.entries.insert(id.to_owned(), entry);
    }

    fn remove(&mut self, id: &str) {
        let Some(entry) = self.entries.remove(id) else { return };
        self.size -= entry.size;
        let Some(tenant) = entry.tenant else { return };
        if let Some(holding) = self.tenants.get_mut(&tenant.name) {
            holding.size -= entry.size;
            holding.names.remove(id);
            if holding.names.is_empty() {
                self.tenants.remove(&tenant.name);
            }
        }
    }

    /// Whether the server has room for one more session of a size.
    fn has_room(&self, size: Size, limits: &Limits) -> Result<(), SessionError> {
        if self.entries.len() >= limits.sessions {
            return Err(SessionError::ServerFull(format!(
                "the server holds its {} sessions already; delete one first",
                limits.sessions
            )));
        }
        let Size { columns, cells } = self.size;
        let sizes = [
            ("columns", size.columns, columns, limits.columns),
            ("cells", size.cells, cells, limits.cells),
        ];
        match sizes.into_iter().find(|(_, more, held, most)| *more > most.saturating_sub(*held)) {
            None => Ok(()),
            Some((what, more, held, most)) => Err(SessionError::ServerFull(format!(
                "{more} {what} more than the {held} held already would exceed the server's {most}; \
                 delete a session first"
            ))),
        }
    }

    /// Whether a tenant may have one more session of a size.
    fn allows(&self, tenant: &Tenant, size: Size) -> Result<(), SessionError> {
        let Quotas { sessions: most_sessions, cells: most_cells, .. } = tenant.quotas();
        let holding = self.tenants.get(&tenant.name);
        let (sessions, held) = holding.map_or((0, 0), |held| (held.names.len(), held.size.cells));
        let (name, cells) = (&tenant.name, size.cells);
        match (most_sessions, most_cells) {
            (Some(most), _) if sessions >= most => Err(SessionError::QuotaReached(format!(
                "the tenant '{name}' holds {sessions} sessions, and its quota `sessions` is \
                 {most}; delete one first"
            ))),
            (_, Some(most)) if cells > most.saturating_sub(held) => {
                Err(SessionError::QuotaReached(format!(
                    "{cells} cells more than the {held} that the tenant '{name}' holds would \
                     exceed its quota `cells` of {most}; delete a session first"
                )))
            }
            _ => Ok(()),
        }
    }
}

impl Names {
    fn read(&self) -> RwLockReadGuard<'_, Table> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Table> {
        self.0.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn reserve(
        &self,
        id: &str,
        tenant: Option<Arc<Tenant>>,
        size: Size,
        limits: &Limits,
    ) -> Result<(), SessionError> {
        let mut table = self.write();
        if table.entries.contains_key(id) {
            return Err(SessionError::Conflict(format!("there is a session '{id}' already")));
        }
        if let Some(tenant) = &tenant {
            table.allows(tenant, size)?;
        }
        table.has_room(size, limits)?;
        table.insert(id, Entry { size, tenant, session: None });
        Ok(())
    }

    /// Expects a session back that outlived the last stop.
    pub(crate) fn expect(&self, session: Session) {
        self.write().returning.insert(session.key, Arc::new(session));
    }

    /// How many names are taken.
    pub(crate) fn count(&self) -> usize {
        self.read().entries.len()
    }

    /// A session by its name.
    pub(crate) fn get(&self, id: &str) -> Option<Arc<Session>> {
        self.read().entries.get(id).and_then(|entry| entry.session.clone())
    }

    /// Up to `limit` sessions in ascending order of their names, those after `after`; one tenant's
    /// where one is named.
    pub(crate) fn list(
        &self,
        tenant: Option<&str>,
        after: Option<&str>,
        limit: usize,
    ) -> Vec<Arc<Session>> {
        let range = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
        let table = self.read();
        let made = |entry: &Entry| entry.session.clone();
        match tenant {
            None => {
                let entries = table.entries.range::<str, _>(range).map(|(_, entry)| entry);
                entries.filter_map(made).take(limit).collect()
            }
            Some(tenant) => {
                let names = table.tenants.get(tenant).map(|held| held.names.range::<str, _>(range));
                let entries = names.into_iter().flatten().filter_map(|id| table.entries.get(id));
                entries.filter_map(made).take(limit).collect()
            }
        }
    }
}

impl Directory for Names {
    fn recover(&self, session: &Outlet) {
        let mut table = self.write();
        let Some(session) = table.returning.remove(&session.key) else { return };
        let (size, tenant) = (Size::of(&session.spec.grid), session.tenant.clone());
        let entry = Entry { size, tenant, session: Some(session.clone()) };
        table.insert(&session.id, entry);
    }

    /// Frees its name where the session has it: while one is being made the name is its place's, perhaps already
    /// that of the next one.
    fn forget(&self, session: &Outlet) {
        let mut table = self.write();
        table.returning.remove(&session.key);
        let holder = table.entries.get(&session.id).and_then(|entry| entry.session.as_ref());
        if holder.is_some_and(|holder| holder.key == session.key) {
            table.remove(&session.id);
        }
        // Before anybody else has the table: who keeps a place for it looks at this.
        session.gone.cancel();
    }
}

/// A place for a session that is being made; given back where that fails or is abandoned.
pub(crate) struct Place {
    names: Arc<Names>,
    pub(crate) id: String,
    pub(crate) tenant: Option<Arc<Tenant>>,
    kept: bool,
}

impl Place {
    /// Takes a name, or makes one, and the room that a session needs.
    pub(crate) fn reserve(
        names: Arc<Names>,
        id: Option<String>,
        tenant: Option<Arc<Tenant>>,
        spec: &SessionSpec,
        limits: &Limits,
    ) -> Result<Place, SessionError> {
        let id = id.unwrap_or_else(|| machine::ulid().to_string());
        names.reserve(&id, tenant.clone(), Size::of(&spec.grid), limits)?;
        Ok(Place { names, id, tenant, kept: false })
    }

    /// Gives it to the session that was made for it, unless that is no more.
    pub(crate) fn keep(mut self, session: Arc<Session>) {
        let mut table = self.names.write();
        self.kept = !session.gone.is_cancelled();
        if self.kept
            && let Some(entry) = table.entries.get_mut(&self.id)
        {
            entry.session = Some(session);
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if !self.kept {
            self.names.write().remove(&self.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{Driver, WorldConfig};
    use crate::session::tenants::Tenants;
    use crate::session::token::Tokens;
    use firn_engine::cpu::CpuBackend;

    /// As many cells in one tile as 64 times a height.
    fn spec(height: u32) -> SessionSpec {
        let mut spec = SessionSpec::default();
        (spec.grid.width, spec.grid.depth, spec.grid.height) = (1, 1, height);
        spec
    }

    /// Sums as they are kept, and as they come out anew.
    fn sums(names: &Names) -> [(u64, usize, usize); 2] {
        let table = names.read();
        let anew = table.entries.values();
        let held = table.tenants.values();
        let owned = anew.clone().filter(|entry| entry.tenant.is_some());
        [
            (table.size.cells / 64, held.map(|held| held.names.len()).sum(), table.tenants.len()),
            (
                anew.map(|entry| entry.size.cells / 64).sum(),
                owned.clone().count(),
                owned
                    .filter_map(|entry| Some(&entry.tenant.as_ref()?.name))
                    .collect::<BTreeSet<_>>()
                    .len(),
            ),
        ]
    }

    #[test]
    fn what_is_held_is_what_the_names_make() {
        let (names, tenants) = (Arc::<Names>::default(), Tenants::default());
        let quotas = Quotas { sessions: Some(2), cells: Some(640), ..Quotas::default() };
        tenants.set_quotas(&HashMap::from([("a".to_owned(), quotas)]));
        let reserve = |id: &str, tenant: Option<&str>, width| {
            let tenant = tenant.map(|name| tenants.named(name));
            Place::reserve(names.clone(), Some(id.to_owned()), tenant, &spec(width), &Limits::NONE)
        };
        let first = reserve("1", Some("a"), 4).unwrap();
        assert!(matches!(reserve("1", Some("b"), 1), Err(SessionError::Conflict(_))));
        assert!(matches!(reserve("2", Some("a"), 7), Err(SessionError::QuotaReached(_))));
        let second = reserve("2", Some("a"), 6).unwrap();
        assert!(matches!(reserve("3", Some("a"), 0), Err(SessionError::QuotaReached(_))));
        let others = [reserve("3", Some("b"), 50).unwrap(), reserve("4", None, 5).unwrap()];
        assert_eq!(sums(&names), [(65, 3, 2); 2]);
        drop(second);
        assert_eq!(sums(&names), [(59, 2, 2); 2]);
        drop(others);
        assert_eq!(sums(&names), [(4, 1, 1); 2]);
        drop(first);
        assert_eq!(sums(&names), [(0, 0, 0); 2]);
    }

    #[test]
    fn nobody_frees_a_name_that_is_another_ones_by_now() {
        let config = WorldConfig { limits: Limits::NONE, publish_rate: 20.0, sleep: true };
        let backend = Box::new(CpuBackend::new(None, false));
        let (sessions, _world) = Driver::start(backend, config).unwrap();
        let names = Arc::<Names>::default();
        let reserve = || {
            let id = Some("a".to_owned());
            Place::reserve(names.clone(), id, None, &spec(4), &Limits::NONE)
        };
        let hashes = Tokens::generate().unwrap().hashes();
        let make = || Session::new(&sessions, "a".to_owned(), None, spec(4), None, hashes);
        let made = || Arc::new(make().unwrap());
        // A session that could not be made leaves its name free for the next.
        let (failed, place) = (made(), reserve().unwrap());
        names.forget(&failed);
        assert!(matches!(reserve(), Err(SessionError::Conflict(_))));
        drop(place);
        let next = reserve().unwrap();
        names.forget(&failed);
        assert!(matches!(reserve(), Err(SessionError::Conflict(_))));
        // One that ends before it has its name leaves none behind.
        next.keep(failed);
        assert_eq!(names.count(), 0);
        // One that has its name frees it, once.
        let session = made();
        reserve().unwrap().keep(session.clone());
        assert!(names.get("a").is_some());
        names.forget(&session);
        let _next = reserve().unwrap();
        names.forget(&session);
        assert_eq!(names.count(), 1);
    }
}
