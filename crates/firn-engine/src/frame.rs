//! What a backend is asked to do in one frame, and what comes back.
//!
//! A frame is plain data, so that the GPU and the CPU backends do the same work for the same frame.

mod edit;

use std::collections::TryReserveError;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use firn_snow::alpine::Surface;
use firn_snow::{
    Cell, Column, ColumnRect, ColumnTotals, Contact, Exchanged, Floor, Grid, Material, Pressing,
    Sample, TILE_COLUMNS,
};

use crate::reserve::try_filled;

use super::made::{Made, Maker};
use super::published::Published;

pub use edit::{Contents, Deposit, Edit, Moves, Placement, Stamp, Weathering};

/// A snowpack's row in the backend's tables.
pub type Slot = u32;

/// Bytes of a slot's mass, thickness, temperature and stress.
pub const BYTES_PER_CELL: u64 = 16;

/// Bytes of device memory that the cells of a snowpack take: whole tiles, whatever snow lies there.
pub fn cell_bytes(grid: &Grid) -> u64 {
    grid.padded_cells().saturating_mul(BYTES_PER_CELL)
}

/// Slots that a device keeps beside those of a column of alpine snow: two rows for its surface, and room in which
/// a step of weather is worked out, a number for each cell.
pub(crate) fn slots_beside(height: u32) -> u32 {
    2 + height.div_ceil(4)
}

/// Bytes of device memory that a snowpack takes: its cells, and what alpine snow has beside them.
pub fn device_bytes(grid: &Grid, alpine: bool) -> u64 {
    let beside = if alpine { slots_beside(grid.height) } else { 0 };
    let beside = grid.padded_columns().saturating_mul(beside.into());
    cell_bytes(grid).saturating_add(beside.saturating_mul(BYTES_PER_CELL))
}

/// Units that it costs to evaluate the contact of an object with so many columns under it. On a device each
/// object has a workgroup, which takes its time however few columns there are.
pub fn contact_units(columns: u64) -> u64 {
    const OBJECT: u64 = 1024;
    const COLUMN: u64 = 2;
    OBJECT + COLUMN * columns
}

/// What a snowpack is made with.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants.
    pub material: Material,
    /// Ground elevation of each column \[m\], row by row; empty for level ground at 0.
    pub ground: Arc<[f64]>,
    /// What each column begins with beside its cells, where the snow is alpine.
    pub surface: Option<Surface>,
}

/// Everything that is to happen in one frame; sessions are independent of each other.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// One entry for each snowpack that has something to do.
    pub work: Vec<Work>,
}

/// One snowpack's part of a frame, in the order of its fields.
#[derive(Clone, Debug, Default)]
pub struct Work {
    /// The snowpack.
    pub slot: Slot,
    /// Changes, in order of arrival.
    pub edits: Vec<Edit>,
    /// Wakes every tile: something that all cells depend on has changed.
    pub wake: bool,
    /// Cycles to run after the edits.
    pub run: Run,
    /// How objects move in each of these cycles, where any does.
    pub moves: Vec<Moves>,
    /// How snow gives way under objects in them. Where that is another way than before, it comes with `wake`.
    pub pressing: Pressing,
    /// Report tiles that changed since the last report, and the contacts.
    pub publish: bool,
    /// Sum the masses of all cells, after the cycles.
    pub tally: bool,
    /// Tiles whose cells are to be read back after the cycles.
    pub gather: Vec<u32>,
    /// Columns of which cells are to be read back after the cycles.
    pub columns: Vec<ColumnRead>,
    /// Boxes of the fixed grid that are to be sampled after the cycles.
    pub samples: Vec<SampleBox>,
    /// Rectangles of columns of alpine snow that are to be summed up after the cycles.
    pub totals: Vec<ColumnRect>,
    /// Goes on with work that an earlier frame has left. All of that is known: but for this, `publish` and
    /// `limit`, nothing is said.
    pub resume: bool,
    /// About how many units may be done in this frame, a unit being a cell that is looked at once; all of
    /// them where there is none. What is left is done by frames that resume it, and reported by the last.
    /// Nothing else is to be done to the snowpack before that. At least something is done in each frame.
    pub limit: Option<u64>,
}

impl Work {
    /// What goes on with work of which something is left.
    pub fn resume(slot: Slot, publish: bool, limit: Option<u64>) -> Work {
        Work { slot, publish, resume: true, limit, ..Work::default() }
    }

    /// Whether cells are read, with their stresses.
    pub fn reads_cells(&self) -> bool {
        !self.gather.is_empty() || !self.columns.is_empty() || !self.samples.is_empty()
    }
}

/// Columns that are to be read, all of them equally deep.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnRead {
    /// The columns, each as tile · 64 + column in the tile.
    pub columns: Vec<u32>,
    /// Cells of each that are read at the most, counted from the top; at least 1.
    pub cells: u32,
}

impl ColumnRead {
    /// Cells that are read at the most.
    pub fn cells(&self) -> u64 {
        self.columns.len() as u64 * u64::from(self.cells)
    }
}

/// A box of the fixed grid, inside of the snowpack's columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleBox {
    /// The columns.
    pub columns: ColumnRect,
    /// Where cells along y are counted from.
    pub floor: Floor,
    /// First cell along y.
    pub y0: u32,
    /// Cells along y.
    pub height: u32,
    /// Length of a cycle \[s\], for the indent.
    pub dt: f64,
}

impl SampleBox {
    /// Cells in the box.
    pub fn cells(&self) -> u64 {
        self.columns.columns() * u64::from(self.height)
    }
}

/// A number of equal cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Run {
    /// Cycles.
    pub cycles: u32,
    /// Simulated time Δt of each \[s\].
    pub dt: f64,
}

/// What a frame did.
#[derive(Debug, Default)]
pub struct Outcome {
    /// One entry for each entry of the frame's `work`, in its order.
    pub work: Vec<WorkOutcome>,
    /// Time that the device took for it.
    pub took: Duration,
    /// Heights of the tiles that changed, of all snowpacks that published.
    pub published: Published,
}

/// What one snowpack's part of a frame did.
#[derive(Clone, Debug, Default)]
pub struct WorkOutcome {
    /// The snowpack.
    pub slot: Slot,
    /// Something of its work is left, and what follows is not told yet.
    pub unfinished: bool,
    /// Units that were done in this frame, about.
    pub units: u64,
    /// For each edit, the mass quanta it refused (`Deposit`, `Lay`) or removed (`Clear`, `Strip`), or its largest dent in
    /// thickness quanta (`Stamp`); first for those of the work, then for those of its moves.
    pub edits: Vec<u64>,
    /// 1 + index of the last cycle of the run in which a cell changed; 0 where none did. An object that moves
    /// counts as a change.
    pub last_change: u32,
    /// Numbers of its tiles in the outcome's `published`; none where it did not publish.
    pub tiles: Range<u32>,
    /// Tiles that are awake; counted where the snowpack published.
    pub active_tiles: u32,
    /// Mass quanta in all cells, where a tally was asked for.
    pub mass: u64,
    /// Contacts in ascending order of ids, where the snowpack published.
    pub contacts: Vec<(Arc<str>, Contact)>,
    /// Cells of the tiles in `gather`, in its order.
    pub gathered: Vec<TileCells>,
    /// The topmost cells of the columns in `columns`, read by read in its order.
    pub columns: Vec<Vec<Column>>,
    /// The boxes in `samples`, in its order: x fastest, then y, then z.
    pub samples: Vec<Vec<Sample>>,
    /// The columns in `totals`, in its order, row by row.
    pub totals: Vec<Vec<ColumnTotals>>,
    /// What came and went in the steps of weather, beside what fell.
    pub exchanged: Exchanged,
}

/// All cells of one tile: index = slot · 64 + column, as in the arena.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileCells {
    /// Areal mass in quanta; 0 where a slot is empty.
    pub mass: Vec<u32>,
    /// Thickness in quanta; 0 where a slot is empty.
    pub thickness: Vec<u32>,
    /// Temperature \[°C\].
    pub temperature: Vec<f32>,
    /// Vertical stress σ \[Pa\].
    pub stress: Vec<f32>,
    /// What each column of alpine snow has beside its cells; empty where the snow is none.
    pub surfaces: Vec<Surface>,
}

impl TileCells {
    /// A number of slots without snow.
    pub fn empty(slots: u32) -> TileCells {
        let cells = (slots * TILE_COLUMNS) as usize;
        TileCells {
            mass: vec![0; cells],
            thickness: vec![0; cells],
            temperature: vec![0.0; cells],
            stress: vec![0.0; cells],
            surfaces: Vec::new(),
        }
    }

    /// The same, for tiles that are too many to count on memory for all of them.
    ///
    /// # Errors
    /// Where there is no memory for them.
    pub fn try_empty(slots: u32) -> Result<TileCells, TryReserveError> {
        let cells = (slots * TILE_COLUMNS) as usize;
        Ok(TileCells {
            mass: try_filled(cells, 0)?,
            thickness: try_filled(cells, 0)?,
            temperature: try_filled(cells, 0.0)?,
            stress: try_filled(cells, 0.0)?,
            surfaces: Vec::new(),
        })
    }

    /// The occupied cells of one column, from the ground up.
    pub fn column(&self, column: u32) -> impl Iterator<Item = Cell> + '_ {
        (column as usize..self.mass.len())
            .step_by(TILE_COLUMNS as usize)
            .take_while(|&i| self.mass[i] > 0)
            .map(|i| self.cell(i))
    }

    /// What lies at an index, occupied or not.
    pub fn cell(&self, i: usize) -> Cell {
        Cell {
            mass: self.mass[i],
            thickness: self.thickness[i],
            temperature: self.temperature[i],
            stress: self.stress[i],
        }
    }
}

/// The device a backend runs on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Name of the adapter, or `cpu`.
    pub adapter: String,
    /// Graphics interface, or `cpu`.
    pub backend: String,
}

/// Why a backend could not do something.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The device's memory, or the part of it that may be used, is full.
    #[error("device memory is full: {0}")]
    OutOfMemory(String),
    /// There is no adapter that can do the work.
    #[error("no usable graphics adapter: {0}")]
    NoAdapter(String),
    /// The device was lost or misbehaved; nothing more can be done with it.
    #[error("the graphics device failed: {0}")]
    DeviceFailed(String),
}

/// Holds snowpacks and steps them, frame by frame.
///
/// Frames are carried out in the order in which they are submitted. A backend is used from one
/// thread.
pub trait Backend {
    /// The device.
    fn device(&self) -> &DeviceInfo;

    /// What makes the snowpacks that it takes in.
    fn maker(&self) -> Maker;

    /// Takes an empty snowpack into a slot that is free. Returns the units that its first work costs beside
    /// what it says: memory may have to be cleared.
    ///
    /// # Errors
    /// [`EngineError::OutOfMemory`] leaves everything as it was.
    fn take_in(&mut self, slot: Slot, made: Made) -> Result<u64, EngineError>;

    /// Makes an empty snowpack in a slot that is free.
    ///
    /// # Errors
    /// [`EngineError::OutOfMemory`] leaves everything as it was.
    fn create(&mut self, slot: Slot, layout: &Layout) -> Result<(), EngineError> {
        let made = self.maker().make(layout.clone())?;
        self.take_in(slot, made).map(drop)
    }

    /// Frees a snowpack's memory, once the outcome of the last frame it is in has been polled.
    fn release(&mut self, slot: Slot);

    /// Begins a frame.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    fn submit(&mut self, frame: Frame) -> Result<(), EngineError>;

    /// The oldest outcome not yet taken, waiting for it no longer than `patience`.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    fn poll(&mut self, patience: Duration) -> Result<Option<Outcome>, EngineError>;

    /// Bytes of device memory held for snowpacks.
    fn memory(&self) -> u64;

    /// What the frame of the newest outcome was made of, each part with the time that it took on the
    /// device, in order; nothing where these times were not taken.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    fn stage_times(&self) -> Result<Vec<(&'static str, Duration)>, EngineError> {
        Ok(Vec::new())
    }

    /// Loses the device, as when its driver crashes, for tests of what happens then.
    #[doc(hidden)]
    fn lose(&mut self);
}
