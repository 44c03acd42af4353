//! Reading the snow at points: what is known on the host at once, and the cells of the columns there from
//! the device, all of them in one frame.

use std::fmt;
use std::sync::Arc;

use firn_protocol::{Load, SampleBatch};
use firn_snow::{Column, GRAVITY, Grid, SurfaceLoad, TILE_COLUMNS};

use crate::core::session::{Check, FRAME_RATE, Gathered, Place, Request, SessionError, gather};
use crate::session::handle::Session;

/// Length of the cycles that are assumed where time stands still \[s\].
const CYCLE_AT_REST: f64 = 1.0 / FRAME_RATE;

/// Longest time that a load is tried for \[s\].
const LONGEST: f64 = 3600.0;

/// Most cycles that the loads of one request are tried for, all of them together.
const MOST_CYCLES: f64 = (1_u32 << 20) as f64;

/// Memory that a cell of a column takes while an answer is made of it \[bytes\]: as it comes from the device,
/// and as it is passed on.
const BYTES_PER_CELL: u64 = 32;

/// Makes an answer of what was found.
type Evaluate<T> = Box<dyn FnOnce(Found) -> T + Send>;

/// Something that is to be read, checked, with a place among the requests that wait.
pub struct Reading<T> {
    session: Arc<Session>,
    place: Place,
    /// Columns that are wanted, ascending, each as tile · 64 + column; and how many of their topmost cells.
    columns: Vec<u32>,
    cells: u32,
    surface: Option<Arc<SampleBatch>>,
    answer_bytes: usize,
    evaluate: Evaluate<T>,
}

/// What was found.
pub(super) struct Found {
    columns: Vec<u32>,
    pub gathered: Gathered,
}

/// An answer that only has to be worked out.
pub struct Evaluation<T> {
    session: Arc<Session>,
    columns: Vec<u32>,
    surface: Option<Arc<SampleBatch>>,
    /// None where no cells were wanted.
    gathered: Option<Gathered>,
    evaluate: Evaluate<T>,
}

impl<T> Reading<T> {
    /// Takes a place for a request of some bytes, whose answer takes `answer_bytes` of them.
    ///
    /// # Errors
    /// [`SessionError::TooManyWaiting`].
    pub(super) fn new(
        session: &Arc<Session>,
        bytes: usize,
        answer_bytes: usize,
        evaluate: impl FnOnce(Found) -> T + Send + 'static,
    ) -> Result<Reading<T>, SessionError> {
        Ok(Reading {
            session: session.clone(),
            place: session.waiting.enter(bytes)?,
            columns: Vec::new(),
            cells: 0,
            surface: None,
            answer_bytes,
            evaluate: Box::new(evaluate),
        })
    }

    /// Wants the topmost cells of the columns that some points are on.
    pub(super) fn with_cells(
        self,
        points: impl Iterator<Item = [f64; 2]>,
        cells: u32,
    ) -> Reading<T> {
        let grid = &self.session.spec.grid;
        let mut columns: Vec<u32> = points.map(|point| column_at(point, grid)).collect();
        columns.sort_unstable();
        columns.dedup();
        Reading { columns, cells, ..self }
    }

    /// Wants the surface at the points of a batch, at the same moment.
    pub(super) fn with_surface(self, batch: Arc<SampleBatch>) -> Reading<T> {
        Reading { surface: Some(batch), ..self }
    }

    /// Memory that reading it takes, and making the answer \[bytes\].
    pub fn bytes(&self) -> u64 {
        self.columns.len() as u64 * u64::from(self.cells) * BYTES_PER_CELL
            + self.answer_bytes as u64
    }

    /// Memory that the answer takes, about \[bytes\].
    pub fn answer_bytes(&self) -> usize {
        self.answer_bytes
    }

    /// The session.
    pub fn session(&self) -> &Arc<Session> {
        &self.session
    }

    /// Finds the cells, where any are wanted.
    ///
    /// # Errors
    /// [`SessionError::Unavailable`].
    pub async fn find(self) -> Result<Evaluation<T>, SessionError> {
        let Reading { session, place, columns, cells, surface, evaluate, .. } = self;
        let gathered = match cells {
            0 => None,
            _ => {
                let (columns, surface) = (gather::reads(&columns, cells), surface.clone());
                let request = |reply| Request::Gather { columns, totals: None, surface, reply };
                Some(session.ask_in(place, request).await?)
            }
        };
        Ok(Evaluation { session, columns, surface, gathered, evaluate })
    }
}

impl<T> Evaluation<T> {
    /// Works the answer out. That takes a while, where loads are tried.
    pub fn finish(self) -> T {
        let Evaluation { session, columns, surface, gathered, evaluate } = self;
        let known = || session.gathered(None, Vec::new(), surface.as_deref());
        evaluate(Found { columns, gathered: gathered.unwrap_or_else(known) })
    }
}

impl<T> fmt::Debug for Reading<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reading").field("columns", &self.columns.len()).finish_non_exhaustive()
    }
}

impl<T> fmt::Debug for Evaluation<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Evaluation").field("session", &self.session.id).finish_non_exhaustive()
    }
}

impl Found {
    /// Place of the column that a point is on among those that were read.
    pub fn place(&self, point: [f64; 2], grid: &Grid) -> usize {
        let found = self.columns.binary_search(&column_at(point, grid));
        found.expect("the columns of all points were read")
    }
}

impl Session {
    /// Length of its cycles \[s\].
    pub(super) fn steady_cycle(&self) -> f64 {
        self.mirror().clock.steady_cycle().unwrap_or(CYCLE_AT_REST)
    }
}

/// The column that a point is on, as tile · 64 + column. The far edge belongs to the last column.
fn column_at([x, z]: [f64; 2], grid: &Grid) -> u32 {
    let column = |metres: f64, columns: u32| ((metres / grid.cell_size) as u32).min(columns - 1);
    let (tile, column) = grid.locate(column(x, grid.width), column(z, grid.depth));
    tile * TILE_COLUMNS + column
}

/// Loads of one request that are tried for some time.
#[derive(Debug, Default)]
pub(super) struct Cycles(f64);

impl Cycles {
    /// Notes what is wrong with a load that is tried at some points, in cycles of `dt` seconds; `at` is the pointer to one
    /// of its fields.
    pub fn check(
        &mut self,
        check: &mut Check,
        load: &Load,
        points: usize,
        dt: f64,
        at: impl Fn(&str) -> String,
    ) {
        // The ranges that objects have.
        if !(load.mass > 0.0 && load.mass <= 1e9) {
            let detail = format!("{} is not above 0 and up to 1000000000 kg", load.mass);
            check.reject(at("mass"), detail);
        }
        check.range(at("area"), load.area, 1e-6, 1e12, "m²");
        let Some(duration) = load.duration else { return };
        check.range(at("duration"), duration, 0.0, LONGEST, "s");
        self.0 += points as f64 * (duration / dt);
        if self.0 > MOST_CYCLES && check.passed() {
            let detail = format!(
                "{duration} s are {:.0} cycles of {dt:.4} s; all loads of a request are tried for at most {MOST_CYCLES} \
                 cycles together: ask for fewer points or a shorter time",
                duration / dt
            );
            check.reject(at("duration"), detail);
        }
    }
}

/// How deep a load sinks into a column \[m\].
pub(super) fn sink(column: &Column, load: &Load, gathered: &Gathered, grid: &Grid) -> f64 {
    let pressure = load.mass * GRAVITY / load.area;
    let surface = SurfaceLoad { pressure: pressure as f32, width: load.area.sqrt() as f32 };
    let dt = gathered.cycle.unwrap_or(CYCLE_AT_REST);
    let step = gathered.pressing.step(dt);
    let pressed = match load.duration {
        None => column.equilibrium(grid, &gathered.material, surface, step.is_some(), dt as f32),
        Some(duration) => {
            let cycles = (duration / dt).round() as u32;
            column.after(grid, &gathered.material, surface, step, dt as f32, cycles)
        }
    };
    grid.metres(u64::from(column.height() - pressed.height()))
}
