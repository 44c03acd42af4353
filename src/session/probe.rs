//! Probes: how deep something would sink, without putting it on the snow.

use std::sync::Arc;

use firn_protocol::{Probe, ProbeBatch, ProbeReply, ProbeView};
use firn_snow::{GRAVITY, Grid};
use rayon::prelude::*;

use crate::core::session::{Check, SessionError};
use crate::session::handle::Session;
use crate::session::reading::{Cycles, Found, Reading, sink};

/// Most probes of one request.
const LARGEST_BATCH: usize = 1024;

/// Memory that the answer to a probe takes \[bytes\].
const BYTES_PER_PROBE: usize = 160;

impl Session {
    /// How deep loads would sink into the columns that they stand on.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range; [`SessionError::TooManyWaiting`].
    pub fn probe(
        self: &Arc<Session>,
        batch: ProbeBatch,
    ) -> Result<Reading<ProbeReply>, SessionError> {
        let ProbeBatch { probes } = batch;
        check(&probes, &self.spec.grid, self.steady_cycle())?;
        let (bytes, answer) = (size_of_val(&probes[..]), probes.len() * BYTES_PER_PROBE);
        let points: Vec<[f64; 2]> = probes.iter().map(point).collect();
        let grid = self.spec.grid;
        let evaluate = move |found: Found| {
            let view = |probe: &Probe| view(probe, &found, &grid);
            let probes = probes.par_iter().map(view).collect();
            ProbeReply { stamp: found.gathered.stamp, probes }
        };
        let reading = Reading::new(self, bytes, answer, evaluate)?;
        Ok(reading.with_cells(points.into_iter(), grid.height))
    }
}

fn point(probe: &Probe) -> [f64; 2] {
    [probe.x, probe.z]
}

/// Checks every probe of a batch, in cycles of `dt` seconds.
fn check(probes: &[Probe], grid: &Grid, dt: f64) -> Result<(), SessionError> {
    let mut check = Check::default();
    let count = probes.len();
    if !(1..=LARGEST_BATCH).contains(&count) {
        check.reject("/probes", format!("{count} probes; 1 to {LARGEST_BATCH} are answered"));
        return check.finish();
    }
    let mut cycles = Cycles::default();
    for (i, probe) in probes.iter().enumerate() {
        let at = |field: &str| format!("/probes/{i}/{field}");
        for (field, metres, columns) in [("x", probe.x, grid.width), ("z", probe.z, grid.depth)] {
            check.range(at(field), metres, 0.0, f64::from(columns) * grid.cell_size, "m");
        }
        cycles.check(&mut check, &probe.load(), 1, dt, at);
    }
    check.finish()
}

/// What becomes of a probe on its column.
fn view(probe: &Probe, found: &Found, grid: &Grid) -> ProbeView {
    let gathered = &found.gathered;
    let column = &gathered.columns[found.place(point(probe), grid)];
    let pressure = probe.mass * GRAVITY / probe.area;
    let surface = column.surface_hardness(grid, &gathered.material);
    ProbeView {
        sink_depth: sink(column, &probe.load(), gathered, grid),
        surface_hardness: surface.map_or(0.0, f64::from),
        pressure,
        carries: surface.is_some_and(|hardness| pressure <= f64::from(hardness)),
    }
}
