//! Changes, checked and turned into what the next frame has to do.

use std::collections::BTreeSet;
use std::sync::Arc;

use tracing::warn;

use crate::engine::frame::{Edit, Placement};
use crate::snow::{ColumnRect, Contact, Footprint, Grid, Material, Shape};

use super::change::{
    Change, Clearing, ColliderBatch, ColliderPatch, ColliderSpec, Region, SettingsPatch, Snowfall,
};
use super::error::{Check, SessionError};
use super::journal::Event;
use super::once::Once;
use super::orders::{Answer, Reply, ReplyKind};
use super::simulation::{Collider, Simulation};
use super::view::{Applied, Settings};

/// Most entries of a batch of colliders.
const LARGEST_BATCH: usize = 4096;

impl Simulation {
    /// Takes a change into the next frame, or refuses it whole.
    pub(super) fn change(
        &mut self,
        mut change: Change,
        once: Option<Once>,
        most_colliders: usize,
        answer: Answer<Applied>,
    ) {
        name_collider(&mut change);
        let tick = self.clock.tick();
        match self.apply(&change, most_colliders) {
            Ok(kind) => {
                self.log.record(tick, Event::Change(change));
                self.next.replies.push(Reply::Change { kind, once, answer: Some(answer) });
            }
            // Nobody is left to be told where this fails.
            Err(error) => drop(answer.send(Err(error))),
        }
    }

    /// Takes a change into the next frame that was taken before.
    pub(super) fn repeat_change(&mut self, change: &Change) {
        match self.apply(change, usize::MAX) {
            Ok(kind) => {
                self.next.replies.push(Reply::Change { kind, once: None, answer: None });
            }
            Err(error) => {
                let session = &self.session.id;
                warn!(session, "a change in the journal can't be repeated: {error}");
            }
        }
    }

    fn apply(&mut self, change: &Change, most: usize) -> Result<ReplyKind, SessionError> {
        match change {
            Change::Snowfall(snowfall) => self.apply_snowfall(snowfall),
            Change::Clearing(clearing) => self.apply_clearing(clearing),
            Change::AirTemperature(air) => {
                let mut check = Check::default();
                check.temperature("/celsius", air.celsius);
                check.finish()?;
                self.settings.air_temperature = air.celsius;
                self.next.changed = true;
                Ok(ReplyKind::AirTemperature)
            }
            Change::Settings(patch) => self.apply_settings(patch),
            Change::CreateCollider(spec) => {
                if let Some(id) = spec.id.as_deref().filter(|id| self.colliders.contains_key(*id)) {
                    return Err(SessionError::Conflict(format!(
                        "there is a collider '{id}' already; PUT replaces it"
                    )));
                }
                self.put_collider(spec, most)
            }
            Change::PutCollider(spec) => self.put_collider(spec, most),
            Change::PatchCollider { id, patch } => self.patch_collider(id, patch, most),
            Change::DeleteCollider { id } => {
                self.known_collider(id)?;
                self.remove_collider(id);
                Ok(ReplyKind::Stamp)
            }
            Change::Colliders(batch) => self.apply_batch(batch, most),
        }
    }

    fn apply_snowfall(&mut self, snowfall: &Snowfall) -> Result<ReplyKind, SessionError> {
        let grid = self.session.spec.grid;
        let mut check = Check::default();
        check.snow_depth("/depth", snowfall.depth, &grid);
        let density = snowfall.density.unwrap_or(self.material.fresh_density);
        check.snow_density("/density", density, &self.material);
        let celsius = snowfall.temperature.unwrap_or(self.settings.air_temperature);
        check.temperature("/temperature", celsius);
        let columns = columns_in(snowfall.region.as_ref(), &grid, &mut check);
        check.finish()?;
        Ok(self.deposit(columns, snowfall.depth, density, celsius))
    }

    fn apply_clearing(&mut self, clearing: &Clearing) -> Result<ReplyKind, SessionError> {
        let grid = self.session.spec.grid;
        let mut check = Check::default();
        let highest = f64::from(grid.height) * grid.cell_size;
        check.range("/depth", clearing.depth, 0.0, highest, "m");
        let columns = columns_in(clearing.region.as_ref(), &grid, &mut check);
        check.finish()?;
        let depth = grid.thickness_quanta(clearing.depth) as u32;
        self.disturb();
        self.next.edits.push(Edit::Clear { columns, depth });
        Ok(ReplyKind::Clearing { edit: self.next.edits.len() - 1 })
    }

    fn apply_settings(&mut self, patch: &SettingsPatch) -> Result<ReplyKind, SessionError> {
        let old = self.settings;
        let mut new = old;
        new.air_temperature = patch.air_temperature.unwrap_or(old.air_temperature);
        new.time_scale = patch.time_scale.unwrap_or(old.time_scale);
        new.tick_rate = patch.tick_rate.unwrap_or(old.tick_rate);
        new.paused = patch.paused.unwrap_or(old.paused);
        new.snowfall_rate = patch.snowfall_rate.unwrap_or(old.snowfall_rate);
        new.idle_timeout_s = patch.idle_timeout_s.unwrap_or(old.idle_timeout_s);
        new.delete_after_s = patch.delete_after_s.unwrap_or(old.delete_after_s);
        let exponent = patch.stiffness_exponent.unwrap_or(self.material.stiffness_exponent);

        let mut check = Check::default();
        check.settings(&new);
        check.range("/stiffness_exponent", exponent, 3.0, 6.0, "");
        check.finish()?;

        let weather = |s: &Settings| (s.time_scale, s.tick_rate, s.snowfall_rate);
        if weather(&new) != weather(&old) {
            self.falling.mark(self.clock.tick(), self.snowing());
        }
        if (new.time_scale, new.tick_rate) != (old.time_scale, old.tick_rate) {
            self.clock.set_rate(new.tick_rate, new.time_scale);
            self.wake();
        }
        if exponent != self.material.stiffness_exponent {
            self.material = Material { stiffness_exponent: exponent, ..self.material };
            self.next.edits.push(Edit::SetMaterial(self.material));
            self.wake();
        }
        self.next.changed |= new != old || !self.next.edits.is_empty();
        self.settings = new;
        Ok(ReplyKind::Settings)
    }

    fn put_collider(
        &mut self,
        spec: &ColliderSpec,
        most: usize,
    ) -> Result<ReplyKind, SessionError> {
        let mut check = Check::default();
        let id: Arc<str> = Arc::from(spec.id.as_deref().unwrap_or_default());
        let created = !self.colliders.contains_key(&id);
        if created && self.colliders.len() >= most {
            check.reject("", format!("a session may have at most {most} colliders"));
        }
        let edit = self.check_collider(&mut check, "", &id, spec);
        check.finish()?;
        self.place(edit);
        Ok(ReplyKind::Collider { id, created })
    }

    fn patch_collider(
        &mut self,
        id: &str,
        patch: &ColliderPatch,
        most: usize,
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

    fn apply_batch(
        &mut self,
        batch: &ColliderBatch,
        most: usize,
    ) -> Result<ReplyKind, SessionError> {
        let mut check = Check::default();
        if batch.put.len() + batch.delete.len() > LARGEST_BATCH {
            check.reject("", format!("a batch may have at most {LARGEST_BATCH} entries"));
        }
        let mut ids: BTreeSet<&str> = self.colliders.keys().map(|id| &**id).collect();
        for (i, id) in batch.delete.iter().enumerate() {
            if !ids.remove(id.as_str()) {
                check.reject(format!("/delete/{i}"), format!("there is no collider '{id}'"));
            }
        }
        let mut named = BTreeSet::new();
        let mut placed = Vec::with_capacity(batch.put.len());
        for (i, spec) in batch.put.iter().enumerate() {
            let Some(id) = &spec.id else {
                check.reject(format!("/put/{i}/id"), "is missing; a batch names its colliders");
                continue;
            };
            if !named.insert(id) {
                check.reject(format!("/put/{i}/id"), format!("'{id}' stands twice in the batch"));
            }
            ids.insert(id);
            let at = format!("/put/{i}");
            placed.push(self.check_collider(&mut check, &at, &Arc::from(id.as_str()), spec));
        }
        if ids.len() > most {
            check.reject("/put", format!("a session may have at most {most} colliders"));
        }
        check.finish()?;
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
        let collider = Collider {
            mass: spec.mass,
            shape: spec.shape,
            position: spec.position,
            contact: Contact::default(),
        };
        let placement = collider.check(check, at, id, &self.session.spec.grid)?;
        // A change of mass alone doesn't move an object: the depth it has sunk goes on counting.
        let placed = self
            .colliders
            .get(id)
            .is_none_or(|old| old.shape != collider.shape || old.position != collider.position);
        let edit = Edit::PutCollider { id: id.clone(), collider: placement, placed };
        Some((id.clone(), collider, edit))
    }

    fn place(&mut self, checked: Option<(Arc<str>, Collider, Edit)>) {
        let Some((id, collider, edit)) = checked else { return };
        self.disturb();
        self.next.changed = true;
        self.colliders.insert(id, collider);
        self.next.edits.push(edit);
    }

    fn remove_collider(&mut self, id: &str) {
        if let Some((id, _)) = self.colliders.remove_entry(id) {
            self.disturb();
            self.next.changed = true;
            self.next.edits.push(Edit::RemoveCollider { id });
        }
    }

    fn known_collider(&self, id: &str) -> Result<Collider, SessionError> {
        let unknown = || SessionError::NotFound { kind: "collider", id: id.to_owned() };
        self.colliders.get(id).cloned().ok_or_else(unknown)
    }
}

/// Gives an object a name that has none, so that it has the same one when the change is repeated.
fn name_collider(change: &mut Change) {
    if let Change::CreateCollider(spec) | Change::PutCollider(spec) = change {
        spec.id.get_or_insert_with(|| ulid::Ulid::generate().to_string());
    }
}

impl Collider {
    /// Notes what is wrong with an object; where it stands if nothing is.
    pub(super) fn check(
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

/// Columns of a region, clipped to the grid; every column where there is none.
fn columns_in(region: Option<&Region>, grid: &Grid, check: &mut Check) -> ColumnRect {
    let Some(region) = region else { return grid.all() };
    let columns = |low: f64, extent: f64, cells: u32| {
        let first = |edge: f64| (edge / grid.cell_size - 0.5).ceil().clamp(0.0, f64::from(cells));
        (first(low) as u32, first(low + extent) as u32)
    };
    let (x0, x1) = columns(region.x, region.width, grid.width);
    let (z0, z1) = columns(region.z, region.depth, grid.depth);
    for (field, extent) in [("width", region.width), ("depth", region.depth)] {
        if extent <= 0.0 {
            check.reject(format!("/region/{field}"), format!("{extent} is not above 0 m"));
        }
    }
    if x0 >= x1 || z0 >= z1 {
        check.reject("/region", "holds no centre of a column of the grid");
    }
    ColumnRect { x0, z0, x1: x1.max(x0), z1: z1.max(z0) }
}
