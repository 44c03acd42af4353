//! What is read of the snow when all else is done.

use std::collections::BTreeSet;

use firn_snow::{ColumnRect, Floor, REFERENCE_CELL_SIZE, TILE_COLUMNS};

use crate::frame::Work;
use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{ColumnJob, Elevation, Pass, SampleJob};
use crate::gpu::resident::{Resident, Residents};
use crate::gpu::survey::Totals;

use super::{Planner, tiles_in};

impl Planner<'_> {
    /// Plans what is reported of the snowpacks.
    pub fn reports(&mut self, residents: &Residents, work: &[Work], totals: &Totals) {
        let (first, count) = (totals.groups.start, totals.groups.len() as u32);
        self.dispatch(KernelId::Publish, 0, Pass { first, count, ..Pass::default() }, count);
        if totals.tally {
            self.tallies(residents, work);
        }
        if totals.column_cells > 0 {
            self.columns(residents, work);
        }
        if totals.samples > 0 {
            self.samples(residents, work);
        }
        if totals.columns > 0 {
            self.totals(residents, work);
        }
    }

    fn tallies(&mut self, residents: &Residents, work: &[Work]) {
        for resident in work.iter().filter(|w| w.tally).filter_map(|w| residents.get(w.slot)) {
            let pages: BTreeSet<u32> = resident.lot.places.iter().map(|place| place.page).collect();
            let (first, count) = (resident.lot.tiles.start, resident.lot.places.len() as u32);
            for page in pages {
                let pass = Pass { first, count, page, ..Pass::default() };
                self.dispatch(KernelId::Tally, page, pass, count);
            }
        }
    }

    /// Plans the columns that are read.
    fn columns(&mut self, residents: &Residents, work: &[Work]) {
        let mut first = 0;
        for (work, read) in work.iter().flat_map(|w| w.columns.iter().map(move |c| (w, c))) {
            let Some(resident) = residents.get(work.slot) else { continue };
            let orders = &mut self.tables.orders;
            let job = orders.column_jobs.push(ColumnJob {
                first_column: orders.column_lists.len(),
                columns: read.columns.len() as u32,
                cells: read.cells,
                first,
            });
            let before = resident.lot.tiles.start * TILE_COLUMNS;
            orders.column_lists.extend(read.columns.iter().map(|column| before + column));
            let tiles = read.columns.iter().map(|column| column / TILE_COLUMNS);
            let pages: BTreeSet<u32> = tiles.map(|tile| resident.page(tile)).collect();
            let groups = read.cells().div_ceil(64) as u32;
            for page in pages {
                let pass = Pass { first: job, page, ..Pass::default() };
                self.dispatch(KernelId::Columns, page, pass, groups);
            }
            first += read.cells() as u32;
        }
    }

    /// Plans the boxes of the fixed grid that are asked for.
    fn samples(&mut self, residents: &Residents, work: &[Work]) {
        let mut first = 0;
        for (work, wanted) in work.iter().flat_map(|w| w.samples.iter().map(move |s| (w, s))) {
            let Some(resident) = residents.get(work.slot) else { continue };
            let floor = match wanted.floor {
                Floor::Level(level) => level.into(),
                Floor::Ground => Elevation::NONE,
            };
            let job = self.tables.orders.sample_jobs.push(SampleJob {
                session: work.slot,
                first,
                x0: wanted.columns.x0,
                y0: wanted.y0,
                z0: wanted.columns.z0,
                width: wanted.columns.x1 - wanted.columns.x0,
                height: wanted.height,
                depth: wanted.columns.z1 - wanted.columns.z0,
                rate: (wanted.dt / REFERENCE_CELL_SIZE) as f32,
                floor,
            });
            self.read_columns(KernelId::Sample, resident, job, wanted.columns);
            first += wanted.cells() as u32;
        }
    }

    /// Plans the rectangles of columns that are summed up.
    fn totals(&mut self, residents: &Residents, work: &[Work]) {
        let mut first = 0;
        for (work, &columns) in work.iter().flat_map(|w| w.totals.iter().map(move |c| (w, c))) {
            let Some(resident) = residents.get(work.slot) else { continue };
            let job = self.tables.orders.sample_jobs.push(SampleJob {
                session: work.slot,
                first,
                x0: columns.x0,
                z0: columns.z0,
                width: columns.x1 - columns.x0,
                depth: columns.z1 - columns.z0,
                ..SampleJob::default()
            });
            self.read_columns(KernelId::Totals, resident, job, columns);
            first += columns.columns() as u32;
        }
    }

    /// Has a kernel read the columns of a rectangle, a thread for each, page by page.
    fn read_columns(
        &mut self,
        kernel: KernelId,
        resident: &Resident,
        job: u32,
        columns: ColumnRect,
    ) {
        let tiles = tiles_in(columns, resident.row.tiles_x);
        let pages: BTreeSet<u32> = tiles.map(|tile| resident.page(tile)).collect();
        let groups = columns.columns().div_ceil(64) as u32;
        for page in pages {
            let pass = Pass { first: job, page, ..Pass::default() };
            self.dispatch(kernel, page, pass, groups);
        }
    }
}
