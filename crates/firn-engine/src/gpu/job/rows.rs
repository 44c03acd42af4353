//! Rows of tiles in which a round of edits changes snow.

use std::ops::Range;

use firn_snow::ColumnRect;

use crate::frame::{Edit, Weathering};
use crate::gpu::resident::Resident;

use super::part::{Part, Step};
use super::steps::{EDIT, cells_of};
use super::{Job, Stage};

impl Job {
    /// The next rows of tiles in which the round changes snow, about as many as fit, and their units. Whole tiles count
    /// where snow falls or is cleared; of stamps only the columns that they cover.
    pub(super) fn take_rows(
        &mut self,
        resident: &Resident,
        most: u64,
        tiles: ColumnRect,
    ) -> (Range<u32>, u64) {
        let falls = |edit: &Edit| !matches!(edit, Edit::Stamp(_));
        let fallen = self.snowed_by(falls).map_or(0, |rect| u64::from(rect.x1 - rect.x0));
        let fallen = fallen * cells_of(resident) * EDIT;
        let first = self.next;
        let mut rows = vec![fallen; (tiles.z1 - first) as usize];
        for (_, edit) in self.round() {
            let Edit::Stamp(stamp) = edit else { continue };
            let own = stamp.coverage.columns.tiles();
            for z in own.z0.max(first)..own.z1 {
                rows[(z - first) as usize] += stamp.units_in(z, resident.layout.grid.height);
            }
        }
        let mut units = 0;
        for row in rows {
            if self.next > first && units + row > most {
                break;
            }
            units += row;
            self.next += 1;
        }
        (first..self.next, units)
    }

    /// Takes the steps of weather of the round on the next rows of tiles, about as many as fit. Steps that shade are taken
    /// at once: where light falls depends on the snow of all columns before them.
    pub(super) fn take_weather(&mut self, resident: &Resident, most: u64, part: &mut Part) {
        let weatherings = self.round().iter().filter_map(|(_, edit)| match edit {
            Edit::Weather(weathering) => Some(weathering),
            _ => None,
        });
        let shades = weatherings.clone().any(|weathering| weathering.shades());
        let steps: usize = weatherings.map(|weathering| weathering.steps.len()).sum();
        let cells = u64::from(resident.row.tiles_x) * cells_of(resident);
        let row = Weathering::UNITS * cells * steps as u64;
        let rows = resident.layout.grid.tiles_z();
        let fitting = if shades { u64::MAX } else { most / row.max(1) };
        let first = self.next;
        let count = u32::try_from(fitting).unwrap_or(u32::MAX).max(1);
        self.next = first.saturating_add(count).min(rows);
        part.add(row * u64::from(self.next - first), Step::Weather(first..self.next));
        if self.next == rows {
            self.enter(Stage::Objects);
        }
    }

    /// The smallest rectangle of tiles in which the round changes snow, if it does anywhere.
    pub(super) fn snowed(&self) -> Option<ColumnRect> {
        self.snowed_by(|_| true)
    }

    /// The same for some of its edits.
    fn snowed_by(&self, counts: impl Fn(&Edit) -> bool) -> Option<ColumnRect> {
        let edits = self.round().iter().filter(|(_, edit)| counts(edit));
        let tiles = edits.filter_map(|(_, edit)| Some(edit.columns()?.tiles()));
        tiles.reduce(|all, own| all.hull(&own))
    }
}
