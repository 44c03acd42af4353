//! Probes: how deep something would sink, without putting it on the snow.

use firn_engine::frame::TileCells;
use firn_protocol::{Probe, ProbeBatch, ProbeReply, ProbeView};
use firn_snow::{Column, GRAVITY, Grid, Material, SurfaceLoad};

use crate::core::session::{Check, FRAME_RATE, Gathered, SessionError};
use crate::session::handle::Session;

/// Most probes of one request.
const LARGEST_BATCH: usize = 1024;

/// Length of the cycles that are assumed where time stands still \[s\].
const CYCLE_AT_REST: f64 = 1.0 / FRAME_RATE;

impl Session {
    /// How deep loads would sink: the equilibrium of the columns that they stand on.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range.
    pub async fn probe(&self, batch: ProbeBatch) -> Result<ProbeReply, SessionError> {
        let grid = self.spec.grid;
        check(&batch, &grid)?;
        let mut tiles: Vec<u32> = batch.probes.iter().map(|probe| place(probe, &grid).0).collect();
        tiles.sort_unstable();
        tiles.dedup();
        let gathered = self.gather(tiles.clone()).await?;
        let dt = self.mirror().clock.steady_cycle().unwrap_or(CYCLE_AT_REST);
        let evaluation = move || evaluate(&batch.probes, &tiles, &gathered, &grid, dt);
        tokio::task::spawn_blocking(evaluation)
            .await
            .map_err(|_| SessionError::Internal("evaluating the probes failed".to_owned()))
    }
}

/// Checks every probe of a batch.
fn check(batch: &ProbeBatch, grid: &Grid) -> Result<(), SessionError> {
    let mut check = Check::default();
    let count = batch.probes.len();
    if !(1..=LARGEST_BATCH).contains(&count) {
        check.reject("/probes", format!("{count} probes; 1 to {LARGEST_BATCH} are answered"));
        return check.finish();
    }
    for (i, probe) in batch.probes.iter().enumerate() {
        let at = |field| format!("/probes/{i}/{field}");
        for (field, metres, columns) in [("x", probe.x, grid.width), ("z", probe.z, grid.depth)] {
            check.range(at(field), metres, 0.0, f64::from(columns) * grid.cell_size, "m");
        }
        // The ranges that colliders have.
        if !(probe.mass > 0.0 && probe.mass <= 1e9) {
            let detail = format!("{} is not above 0 and up to 1000000000 kg", probe.mass);
            check.reject(at("mass"), detail);
        }
        check.range(at("area"), probe.area, 1e-6, 1e12, "m²");
    }
    check.finish()
}

/// Tile of the column it stands on, and the column's index in it.
fn place(probe: &Probe, grid: &Grid) -> (u32, u32) {
    // The far edge belongs to the last column.
    let column = |metres: f64, columns: u32| ((metres / grid.cell_size) as u32).min(columns - 1);
    grid.locate(column(probe.x, grid.width), column(probe.z, grid.depth))
}

/// What becomes of a probe on its column.
fn view(probe: &Probe, column: &Column, grid: &Grid, material: &Material, dt: f64) -> ProbeView {
    let pressure = probe.mass * GRAVITY / probe.area;
    let load = SurfaceLoad { pressure: pressure as f32, width: probe.area.sqrt() as f32 };
    let rest = column.equilibrium(grid, material, load, dt as f32);
    let sunk = u64::from(column.height() - rest.height());
    let surface = column.surface_hardness(grid, material);
    ProbeView {
        sink_depth: grid.metres(sunk),
        surface_hardness: surface.map_or(0.0, f64::from),
        pressure,
        carries: surface.is_some_and(|hardness| pressure <= f64::from(hardness)),
    }
}

/// Evaluates probes on tiles, which are in ascending order.
fn evaluate(
    probes: &[Probe],
    tiles: &[u32],
    gathered: &Gathered,
    grid: &Grid,
    dt: f64,
) -> ProbeReply {
    let column = |probe: &Probe| {
        let (tile, column) = place(probe, grid);
        let cells = tiles.binary_search(&tile).ok().and_then(|i| gathered.tiles.get(i));
        Column { cells: cells.map_or_else(Vec::new, |c: &TileCells| c.column(column).collect()) }
    };
    let view = |probe: &Probe| view(probe, &column(probe), grid, &gathered.material, dt);
    ProbeReply { stamp: gathered.stamp, probes: probes.iter().map(view).collect() }
}
