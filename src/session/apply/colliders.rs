//! Changes of the objects on the snow.

use std::collections::BTreeSet;
use std::sync::Arc;

use firn_engine::frame::{Edit, Placement};
use firn_protocol::{ColliderBatch, ColliderPatch, ColliderSpec};
use firn_snow::{Contact, Footprint, Grid, Shape};

use crate::machine;
use crate::quote::quote;
use crate::session::change::Change;
use crate::session::error::{Check, Invalid, SessionError};
use crate::session::orders::ReplyKind;
use crate::session::reach::Reach;
use crate::session::simulation::{Collider, Simulation};

/// Most entries of a batch of colliders.
const LARGEST_BATCH: usize = 4096;

impl Simulation {
    pub(super) fn put_collider(
        &mut self,
        spec: &ColliderSpec,
        most: Option<usize>,
    ) -> Result<ReplyKind, SessionError> {
        let mut check = Check::default();
        let id: Arc<str> = Arc::from(spec.id.as_deref().unwrap_or_default());
        let created = !self.colliders.contains_key(&id);
        if let Some(most) = most.filter(|most| created && self.colliders.len() >= *most) {
            check.reject("", format!("a session may have at most {most} colliders"));
        }
        let edit = self.check_collider(&mut check, "", &id, spec);
        check.finish()?;
        let rows = edit.iter().map(|(_, collider, _)| collider.reach.words()).sum();
        self.take_rows(self.rows_of([&*id]), rows, most)?;
        self.place(edit);
        Ok(ReplyKind::Collider { id, created })
    }

    pub(super) fn patch_collider(
        &mut self,
        id: &str,
        patch: &ColliderPatch,
        most: Option<usize>,
    ) -> Result<ReplyKind, SessionError> {
        let old = self.known_collider(id)?;
        let spec = ColliderSpec {
            id: Some(id.to_owned()),
            mass: patch.mass.unwrap_or(old.mass),
            shape: patch.shape.unwrap_or(old.shape),
            position: patch.position.unwrap_or(old.position),
        };
        self.put_collider(&spec, most)
    }

    pub(super) fn apply_batch(
        &mut self,
        batch: &ColliderBatch,
        most: Option<usize>,
    ) -> Result<ReplyKind, SessionError> {
        if batch.put.len() + batch.delete.len() > LARGEST_BATCH {
            let detail = format!("a batch may have at most {LARGEST_BATCH} entries");
            return Err(SessionError::Invalid(vec![Invalid::new("", detail)]));
        }
        let mut check = Check::default();
        let mut ids: BTreeSet<&str> = self.colliders.keys().map(|id| &**id).collect();
        for (i, id) in batch.delete.iter().enumerate() {
            if !ids.remove(id.as_str()) {
                check.reject(format!("/delete/{i}"), format!("there is no collider {}", quote(id)));
            }
        }
        let mut named: BTreeSet<&str> = BTreeSet::new();
        let mut placed = Vec::with_capacity(batch.put.len());
        for (i, spec) in batch.put.iter().enumerate() {
            let Some(id) = &spec.id else {
                check.reject(format!("/put/{i}/id"), "is missing; a batch names its colliders");
                continue;
            };
            if !named.insert(id) {
                check.reject(
                    format!("/put/{i}/id"),
                    format!("{} stands twice in the batch", quote(id)),
                );
            }
            ids.insert(id);
            let at = format!("/put/{i}");
            placed.push(self.check_collider(&mut check, &at, &Arc::from(id.as_str()), spec));
        }
        if let Some(most) = most.filter(|most| ids.len() > *most) {
            check.reject("/put", format!("a session may have at most {most} colliders"));
        }
        check.finish()?;
        let put = batch.put.iter().filter_map(|spec| spec.id.as_deref());
        let left = batch.delete.iter().map(String::as_str).filter(|id| !named.contains(*id));
        let rows = placed.iter().flatten().map(|(_, collider, _)| collider.reach.words()).sum();
        self.take_rows(self.rows_of(put.chain(left)), rows, most)?;
        for id in &batch.delete {
            self.remove_collider(id);
        }
        placed.into_iter().for_each(|edit| self.place(edit));
        Ok(ReplyKind::Stamp)
    }

    /// Checks an object, and makes the edit that puts it where it is sound.
    fn check_collider(
        &self,
        check: &mut Check,
        at: &str,
        id: &Arc<str>,
        spec: &ColliderSpec,
    ) -> Option<(Arc<str>, Collider, Edit)> {
        let grid = &self.session.spec.grid;
        let collider = Collider {
            mass: spec.mass,
            shape: spec.shape,
            position: spec.position,
            contact: Contact::default(),
            reach: Reach::new(&spec.shape, grid),
        };
        let placement = collider.check(check, at, id, grid)?;
        // A change of mass alone doesn't move an object: the depth it has sunk goes on counting.
        let placed = self
            .colliders
            .get(id)
            .is_none_or(|old| old.shape != collider.shape || old.position != collider.position);
        let edit = Edit::PutCollider { id: id.clone(), collider: placement, placed };
        Some((id.clone(), collider, edit))
    }

    /// What some of the objects take in the device's tables.
    pub(super) fn rows_of<'i>(&self, ids: impl IntoIterator<Item = &'i str>) -> u64 {
        let known = ids.into_iter().filter_map(|id| self.colliders.get(id));
        known.map(|collider| collider.reach.words()).sum()
    }

    /// Takes rows in the device's tables for objects, in place of others. What was allowed before is
    /// not refused.
    pub(super) fn take_rows(
        &mut self,
        others: u64,
        rows: u64,
        most: Option<usize>,
    ) -> Result<(), SessionError> {
        let all = self.object_rows.taken() - others + rows;
        match most {
            Some(_) => self.object_rows.try_take(all),
            None => {
                self.object_rows.take(all);
                Ok(())
            }
        }
    }

    fn place(&mut self, checked: Option<(Arc<str>, Collider, Edit)>) {
        let Some((id, collider, edit)) = checked else { return };
        self.disturb(collider.reach.tiles);
        self.next.changed = true;
        self.colliders.insert(id, collider);
        self.next.edits.push(edit);
    }

    pub(super) fn remove_collider(&mut self, id: &str) {
        if let Some((id, collider)) = self.colliders.remove_entry(id) {
            self.disturb(collider.reach.tiles);
            self.next.changed = true;
            self.next.edits.push(Edit::RemoveCollider { id });
        }
    }

    pub(super) fn known_collider(&self, id: &str) -> Result<Collider, SessionError> {
        let unknown = || SessionError::NotFound { kind: "collider", id: id.to_owned() };
        self.colliders.get(id).cloned().ok_or_else(unknown)
    }
}

/// Gives an object a name that has none, so that it has the same one when the change is repeated.
pub(super) fn name_collider(change: &mut Change) {
    if let Change::CreateCollider(spec) | Change::PutCollider(spec) = change {
        spec.id.get_or_insert_with(|| machine::ulid().to_string());
    }
}

impl Collider {
    /// Notes what is wrong with an object; where it stands if nothing is.
    pub(in crate::session) fn check(
        &self,
        check: &mut Check,
        at: &str,
        id: &str,
        grid: &Grid,
    ) -> Option<Arc<Placement>> {
        check.id(format!("{at}/id"), id);
        check.range(format!("{at}/mass"), self.mass, f64::MIN_POSITIVE, 1e9, "kg");
        let sides: &[(&str, f64)] = match self.shape {
            Shape::Box { width, depth } => &[("width", width), ("depth", depth)],
            Shape::Disk { radius } => &[("radius", radius)],
        };
        for (side, length) in sides {
            check.range(format!("{at}/shape/{side}"), *length, 1e-3, 1e6, "m");
        }
        if !check.passed() {
            return None;
        }
        let Some(footprint) = Footprint::new(grid, &self.shape, self.position) else {
            let (width, depth) = (f64::from(grid.width), f64::from(grid.depth));
            check.reject(
                format!("{at}/position"),
                format!(
                    "the footprint reaches beyond the grid, which is 0 to {} m along x and 0 to \
                     {} m along z",
                    width * grid.cell_size,
                    depth * grid.cell_size
                ),
            );
            return None;
        };
        Some(Arc::new(Placement { mass: self.mass, footprint }))
    }
}
