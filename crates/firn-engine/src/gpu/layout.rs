//! The tables that host and kernels share, as `shaders/shared/layout.wgsl` declares them.

mod convert;
mod weather;

use bytemuck::{Pod, Zeroable};

pub use weather::{
    ALONG_X, ColumnTotals, ExchangeResult, SURFACE_ROWS, SWEEPS_BACK, ShadeJob, Shelter,
    WeatherJob, WeatherStep, surface_of, words_of,
};

/// `Run.flags`: all tiles are to be woken.
pub const WAKE: u32 = 1;
/// `Run.flags`: changed tiles are to be packed.
pub const PUBLISH: u32 = 2;
/// `Run.flags`: contacts have been evaluated for the first cycle, after the edits of this frame.
pub const EDITED: u32 = 4;
/// `Run.flags`: no tile sleeps.
pub const ALWAYS_AWAKE: u32 = 8;
/// `Run.flags`: a part of the cycles is done, on tiles that the host lists.
pub const PARTED: u32 = 16;
/// `Pass.flags`: nothing may be skipped.
pub const AFTER_EDITS: u32 = 1;
/// `Pass.flags`: a list of tiles is gone through from its end.
pub const BACKWARDS: u32 = 2;
/// `Pass.flags`: the listed tiles are those under objects, after the first cycle.
pub const UNDER_OBJECTS: u32 = 4;
/// `Pass.flags`: the host has listed just the tiles that the kernel is for.
pub const LISTED: u32 = 8;
/// `Pass.flags`: it is one of the steps of a cycle in which objects move.
pub const STEPPED: u32 = 16;
/// A tile's state: a cell changed in the last cycle, or was disturbed since.
pub const AWAKE: u32 = 1;
/// A tile's state: a height changed since the last publication.
pub const DIRTY: u32 = 2;
/// `Tile.shape`: an object's footprint covers a column of it.
pub const LOADED: u32 = 1 << 31;
/// `Operation.kind`: snow falls.
pub const DEPOSIT: u32 = 0;
/// `Operation.kind`: snow is cleared.
pub const CLEAR: u32 = 1;
/// `Operation.kind`: snow is laid, under objects too.
pub const LAY: u32 = 2;
/// `Operation.kind`: snow is cleared, under objects too.
pub const STRIP: u32 = 3;
/// `Tile.session` of a tile that no session owns.
pub const NO_SESSION: u32 = u32::MAX;
/// `Collider.first_lift` of a flat footprint.
pub const NONE: u32 = u32::MAX;

/// An elevation as a device holds it: whole cells above level 0, and quanta above those.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Elevation {
    /// Whole cells, rounded down.
    pub cells: i32,
    /// Quanta above them.
    pub fraction: u32,
}

impl Elevation {
    /// No elevation: the last bottom of an object that has been through no cycle where it stands, and the
    /// floor of cells that are counted from each column's ground.
    pub const NONE: Elevation = Elevation { cells: 0, fraction: u32::MAX };
}

/// A snowpack's constants.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Session {
    /// First of its tiles; they stand in one row of the table.
    pub first_tile: u32,
    /// Tiles along x.
    pub tiles_x: u32,
    /// Columns along x.
    pub width: u32,
    /// Columns along z.
    pub depth: u32,
    /// Slots of a column.
    pub height: u32,
    /// [`firn_snow::HardnessLaw`].
    pub hardness_law: u32,
    /// [`firn_snow::LoadDistribution`].
    pub load_distribution: u32,
    /// Exponent n of the stiffness law.
    pub stiffness_exponent: f32,
    /// Density of one mass quantum in one thickness quantum \[kg/m³\].
    pub density: f32,
    /// Thickness quanta of one mass quantum at the largest density.
    pub densest: f32,
    /// Length of one thickness quantum \[m\].
    pub metres: f32,
    /// Gold's hardness at 20 kg/m³ and −3 °C \[Pa\].
    pub gold: f32,
}

/// What a snowpack does in this frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Run {
    /// Cycles.
    pub cycles: u32,
    /// [`WAKE`], [`PUBLISH`], [`EDITED`], [`ALWAYS_AWAKE`] and [`PARTED`].
    pub flags: u32,
    /// Cycle length over the reference cell size \[s/m\].
    pub rate: f32,
    /// Its row in the table of sums.
    pub tally: u32,
    /// Thickness quanta by which a load presses a cell in a cycle at the most; 0 where snow creeps under it.
    pub press: u32,
}

/// Where a tile is.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Tile {
    /// Its snowpack's row, or [`NO_SESSION`].
    pub session: u32,
    /// Page that holds its cells.
    pub page: u32,
    /// First of its rows of 64 cells in the page.
    pub row: u32,
    /// Columns along x that the snowpack has of it, those along z in the next byte, and [`LOADED`].
    pub shape: u32,
}

/// Sums of one frame over a snowpack.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Tally {
    /// 1 + index of the last cycle in which a cell changed.
    pub last_change: u32,
    /// Tiles that are awake.
    pub active_tiles: u32,
    /// Mass quanta in all cells, low word.
    pub mass_low: u32,
    /// Mass quanta in all cells, high word.
    pub mass_high: u32,
}

/// A footprint of an object in this frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Collider {
    /// Its snowpack's row.
    pub session: u32,
    /// Its row in the table of contacts.
    pub contact: u32,
    /// First row of columns.
    pub z0: u32,
    /// First of its spans.
    pub first_span: u32,
    /// Rows of columns.
    pub rows: u32,
    /// Columns, those beyond the grid included.
    pub columns: u32,
    /// Lowest begin of a span.
    pub x0: u32,
    /// Highest end of a span.
    pub x1: u32,
    /// Area of the footprint \[m²\].
    pub area: f32,
    /// Weight \[N\].
    pub weight: f32,
    /// Not 0 where the depth it has sunk is counted from this evaluation.
    pub placed: u32,
    /// Not 0 where a cycle follows this evaluation.
    pub runs: u32,
    /// Footprints of the object, whose rows follow each other; 0 but in the first of them.
    pub footprints: u32,
    /// Columns that are beyond the grid.
    pub overhang: u32,
    /// First of the lifts over its columns; [`NONE`] where it is flat.
    pub first_lift: u32,
}

/// How an object touches the snow.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Contact {
    /// Elevation of the bottom.
    pub bottom: Elevation,
    /// Bottom when it was placed or last moved.
    pub reference: Elevation,
    /// Σ of shares, low word.
    pub support_low: u32,
    /// Σ of shares, high word.
    pub support_high: u32,
    /// Contact area \[m²\].
    pub area: f32,
    /// Pressure \[Pa\].
    pub pressure: f32,
    /// Width b over which the load spreads \[m\].
    pub width: f32,
    /// Not 0 where bottom and support were those of the last cycle before, when they were evaluated.
    pub resting: u32,
    /// Bottom in the last cycle; [`Elevation::NONE`] where there was none since it was placed.
    pub last_bottom: Elevation,
    /// Σ of shares in the last cycle, low word.
    pub last_support_low: u32,
    /// Σ of shares in the last cycle, high word.
    pub last_support_high: u32,
}

/// A tile and the objects that may stand on it, ascending by their ids.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LoadJob {
    /// The tile.
    pub tile: u32,
    /// First of its loads.
    pub first_load: u32,
    /// Number of its loads.
    pub loads: u32,
    /// Fills the row.
    pub padding: u32,
}

/// A tile and the operations that touch it: some of the table of lists, in order of arrival.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct EditJob {
    /// The tile.
    pub tile: u32,
    /// Where the first of the operations stands in the table of lists.
    pub first_operation: u32,
    /// Number of the operations.
    pub operations: u32,
    /// Columns, bit by bit, on which no snow falls because of objects.
    pub sheltered_low: u32,
    /// The second half of them.
    pub sheltered_high: u32,
    /// Columns on which objects stand.
    pub stood_on_low: u32,
    /// The second half of them.
    pub stood_on_high: u32,
    /// Fills the row.
    pub padding: u32,
}

/// Snow that falls, or is cleared.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Operation {
    /// First column along x and z, and their ends.
    pub columns: [u32; 4],
    /// Mass quanta that fall; depth in thickness quanta, of what falls or of what is left standing;
    /// mass quanta of a full cell of what falls; bits of its temperature \[°C\].
    pub snow: [u32; 4],
    /// [`DEPOSIT`], [`CLEAR`], [`LAY`] or [`STRIP`].
    pub kind: u32,
    /// Its row in the table of results.
    pub result: u32,
    /// Fills the row.
    pub padding: [u32; 2],
}

/// A load that presses columns at once.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Stamp {
    /// x0, z0, and behind the last x1, z1.
    pub columns: [u32; 4],
    /// First of the shares that it covers of them, row by row.
    pub first_share: u32,
    /// Its row in the table of results.
    pub result: u32,
    /// Pressure \[Pa\].
    pub pressure: f32,
    /// Width over which it spreads \[m\].
    pub width: f32,
}

/// Mass quanta that an operation refused or cleared.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct OperationResult {
    /// Low word.
    pub low: u32,
    /// High word.
    pub high: u32,
}

/// Which tiles of 64 neighbours are packed for publication, and where the first of them is.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PackedGroup {
    /// A bit for each of the first 32 tiles that changed.
    pub changed_low: u32,
    /// A bit for each of the other 32.
    pub changed_high: u32,
    /// The same for those that are awake.
    pub awake_low: u32,
    /// The same for the other 32.
    pub awake_high: u32,
    /// The first packed one among all that are packed; the others follow in order.
    pub first: u32,
}

/// Columns that are read, all of them equally deep.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ColumnJob {
    /// Where the first of the columns stands in the table of lists.
    pub first_column: u32,
    /// Number of the columns.
    pub columns: u32,
    /// Cells of each that are read at the most, counted from the top.
    pub cells: u32,
    /// Where the first of these cells is put.
    pub first: u32,
}

/// A cell of a column that is read. Its mass is 0 where the column has no more.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ColumnCell {
    /// Areal mass in quanta.
    pub mass: u32,
    /// Thickness in quanta.
    pub thickness: u32,
    /// Temperature \[°C\].
    pub temperature: f32,
    /// Vertical stress \[Pa\].
    pub stress: f32,
}

/// A box of the fixed grid that is asked for.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleJob {
    /// Its snowpack's row.
    pub session: u32,
    /// First of its samples: x fastest, then y, then z.
    pub first: u32,
    /// First column along x.
    pub x0: u32,
    /// First cell along y.
    pub y0: u32,
    /// First column along z.
    pub z0: u32,
    /// Cells along x.
    pub width: u32,
    /// Cells along y.
    pub height: u32,
    /// Cells along z.
    pub depth: u32,
    /// Cycle length over the reference cell size \[s/m\].
    pub rate: f32,
    /// What cells along y are counted from; [`Elevation::NONE`] for each column's ground.
    pub floor: Elevation,
}

/// What one dispatch works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Pass {
    /// First entry of its list.
    pub first: u32,
    /// Entries of its list.
    pub count: u32,
    /// First cycle that is run.
    pub cycle: u32,
    /// Cycles that are run at the most.
    pub cycles: u32,
    /// The page whose cells are bound.
    pub page: u32,
    /// [`AFTER_EDITS`], [`BACKWARDS`], [`UNDER_OBJECTS`], [`LISTED`] and [`STEPPED`].
    pub flags: u32,
    /// Where the length of a list of tiles stands.
    pub length: u32,
    /// What [`Run`] has under the same names, for one of the steps of a cycle in which objects move.
    pub rate: f32,
    /// See `rate`.
    pub press: u32,
}

/// A 64-bit number of two words.
pub fn join(low: u32, high: u32) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}
