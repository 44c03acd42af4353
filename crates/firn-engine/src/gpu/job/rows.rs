//! Rows of tiles in which a round of edits changes snow.

use std::ops::Range;

use firn_snow::ColumnRect;

use crate::frame::Edit;
use crate::gpu::resident::Resident;

use super::Job;
use super::steps::{EDIT, cells_of};

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
