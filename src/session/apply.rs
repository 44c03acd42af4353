//! Changes, checked and turned into what the next frame has to do.

mod colliders;

use firn_engine::frame::Edit;
use firn_protocol::{Clearing, Region, Settings, SettingsPatch, Snowfall};
use firn_snow::{ColumnRect, Grid, Material};
use tracing::warn;

use crate::quote::quote;

use self::colliders::name_collider;
use super::answer::Answer;
use super::change::Applied;
use super::change::Change;
use super::error::{Check, SessionError};
use super::journal::Event;
use super::once::Once;
use super::orders::{Reply, ReplyKind};
use super::simulation::Simulation;

impl Simulation {
    /// Takes a change into the next frame, or refuses it whole.
    pub(super) fn change(
        &mut self,
        mut change: Change,
        once: Option<Once>,
        most_colliders: usize,
        answer: Answer<Applied>,
    ) {
        self.next.changes += change.entries();
        name_collider(&mut change);
        let tick = self.clock.tick();
        match self.apply(&change, Some(most_colliders)) {
            Ok(kind) => {
                self.log.record(tick, Event::Change(change));
                self.next.replies.push(Reply::Change { kind, once, answer: Some(answer) });
            }
            // Nobody is left to be told where this fails.
            Err(error) => answer.give(Err(error)),
        }
    }

    /// Takes a change into the next frame that was taken before.
    pub(super) fn repeat_change(&mut self, change: &Change) {
        match self.apply(change, None) {
            Ok(kind) => {
                self.next.replies.push(Reply::Change { kind, once: None, answer: None });
            }
            Err(error) => {
                let session = &self.session.id;
                warn!(session, "a change in the journal can't be repeated: {error}");
            }
        }
    }

    /// `most` is how many objects there may be; `None` where the change was allowed before.
    fn apply(&mut self, change: &Change, most: Option<usize>) -> Result<ReplyKind, SessionError> {
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
                        "there is a collider {} already; PUT replaces it",
                        quote(id)
                    )));
                }
                self.put_collider(spec, most)
            }
            Change::PutCollider(spec) => self.put_collider(spec, most),
            Change::PatchCollider { id, patch } => self.patch_collider(id, patch, most),
            Change::DeleteCollider { id } => {
                self.known_collider(id)?;
                self.take_rows(self.rows_of([&**id]), 0, None)?;
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
        self.disturb(columns.tiles().columns());
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
