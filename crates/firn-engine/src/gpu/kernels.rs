//! The compute kernels: one table declares each one's source and what it binds.

mod pipeline;
mod resource;

use super::layout::Pass;

pub use pipeline::Pipeline;
pub use resource::Resource;

/// How a kernel uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only.
    Read,
    /// Read and written.
    Write,
}

/// Bytes of what every dispatch is told as an immediate: its [`Pass`].
pub const PASS_BYTES: u32 = std::mem::size_of::<Pass>() as u32;

/// Threads of the largest workgroup.
pub const LARGEST_WORKGROUP: u32 = 256;

/// One compute kernel.
#[derive(Debug)]
pub struct Kernel {
    /// Name of its file, without the ending.
    pub name: &'static str,
    /// Its entry point.
    pub entry_point: &'static str,
    /// Source, in the order in which it is put together.
    pub source: &'static [&'static str],
    /// What it binds, in the order of the binding numbers.
    pub bindings: &'static [(Resource, Access)],
}

/// Number of a kernel in [`KERNELS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum KernelId {
    /// Lets snow fall and clears it.
    Snowfall,
    /// Presses columns at once.
    Stamp,
    /// Evaluates how objects touch the snow.
    Contact,
    /// Evaluates stresses.
    Stress,
    /// Lists the tiles that are due.
    Schedule,
    /// Compacts cells.
    Compact,
    /// Presses cells under objects.
    Press,
    /// Packs changed tiles.
    Publish,
    /// Sums masses.
    Tally,
    /// Copies the topmost cells of columns.
    Columns,
    /// Samples the fixed grid.
    Sample,
    /// Takes steps of weather.
    Weather,
    /// Finds the columns that see the sun.
    Sweep,
    /// Finds the part of the short wave that falls on each column.
    Shade,
    /// Sums up columns of alpine snow.
    Totals,
}

const LAYOUT: &str = include_str!("../../../../shaders/shared/layout.wgsl");
const MATERIAL: &str = include_str!("../../../../shaders/shared/material.wgsl");
const WET: &str = include_str!("../../../../shaders/shared/wet.wgsl");
const ALPINE: &str = include_str!("../../../../shaders/shared/alpine.wgsl");
const ELEVATION: &str = include_str!("../../../../shaders/shared/elevation.wgsl");
const LOAD: &str = include_str!("../../../../shaders/shared/load.wgsl");
const WIDE: &str = include_str!("../../../../shaders/shared/wide.wgsl");
const RELIEF: &str = include_str!("../../../../shaders/weather/relief.wgsl");
const RECUT: &str = include_str!("../../../../shaders/snowfall/recut.wgsl");

use Access::{Read, Write};
use Resource::*;

/// All kernels, in the order of [`KernelId`].
pub const KERNELS: [Kernel; 15] = [
    Kernel {
        name: "snowfall",
        entry_point: "snowfall",
        source: &[LAYOUT, WIDE, WET, RECUT, include_str!("../../../../shaders/snowfall.wgsl")],
        bindings: &[
            (Sessions, Read),
            (Tiles, Read),
            (States, Write),
            (Heights, Write),
            (Filled, Write),
            (EditJobs, Read),
            (Operations, Read),
            (OperationResults, Write),
            (Mass, Write),
            (Thickness, Write),
            (Temperature, Write),
            (Stress, Write),
            (OperationLists, Read),
        ],
    },
    Kernel {
        name: "stamp",
        entry_point: "stamp",
        source: &[
            LAYOUT,
            MATERIAL,
            WET,
            ALPINE,
            LOAD,
            include_str!("../../../../shaders/stamp.wgsl"),
        ],
        bindings: &[
            (Sessions, Read),
            (Tiles, Read),
            (States, Write),
            (Heights, Write),
            (Filled, Read),
            (EditJobs, Read),
            (OperationLists, Read),
            (Stamps, Read),
            (Shares, Read),
            (OperationResults, Write),
            (Mass, Read),
            (Thickness, Write),
            (Temperature, Read),
        ],
    },
    Kernel {
        name: "contact",
        entry_point: "contact",
        source: &[LAYOUT, ELEVATION, WIDE, include_str!("../../../../shaders/contact.wgsl")],
        bindings: &[
            (Sessions, Read),
            (Runs, Read),
            (Heights, Read),
            (Ground, Read),
            (Colliders, Read),
            (Spans, Read),
            (Contacts, Write),
            (Lifts, Read),
        ],
    },
    Kernel {
        name: "stress",
        entry_point: "evaluate_stress",
        source: &[LAYOUT, ELEVATION, LOAD, include_str!("../../../../shaders/stress.wgsl")],
        bindings: &[
            (Sessions, Read),
            (Runs, Read),
            (Tiles, Read),
            (States, Write),
            (Heights, Read),
            (Filled, Read),
            (Ground, Read),
            (Colliders, Read),
            (Spans, Read),
            (Contacts, Read),
            (LoadJobs, Read),
            (Loads, Read),
            (Mass, Read),
            (Thickness, Read),
            (Stress, Write),
            (Lifts, Read),
        ],
    },
    Kernel {
        name: "schedule",
        entry_point: "schedule",
        source: &[LAYOUT, include_str!("../../../../shaders/schedule.wgsl")],
        bindings: &[(Runs, Read), (Tiles, Read), (States, Write), (PageStarts, Read), (Due, Write)],
    },
    Kernel {
        name: "compact",
        entry_point: "compact",
        source: &[LAYOUT, MATERIAL, include_str!("../../../../shaders/compact.wgsl")],
        bindings: &[
            (Sessions, Read),
            (Runs, Read),
            (Tiles, Read),
            (States, Write),
            (Filled, Read),
            (Heights, Write),
            (Tallies, Write),
            (Due, Read),
            (Mass, Read),
            (Thickness, Write),
            (Temperature, Read),
            (Stress, Read),
        ],
    },
    Kernel {
        name: "press",
        entry_point: "press",
        source: &[LAYOUT, MATERIAL, WET, ALPINE, include_str!("../../../../shaders/press.wgsl")],
        bindings: &[
            (Sessions, Read),
            (Runs, Read),
            (Tiles, Read),
            (States, Write),
            (Filled, Read),
            (Heights, Write),
            (Tallies, Write),
            (Due, Read),
            (Mass, Read),
            (Thickness, Write),
            (Temperature, Read),
            (Stress, Read),
        ],
    },
    Kernel {
        name: "publish",
        entry_point: "publish",
        source: &[LAYOUT, include_str!("../../../../shaders/publish.wgsl")],
        bindings: &[
            (Runs, Read),
            (Tiles, Read),
            (States, Write),
            (Heights, Read),
            (Tallies, Write),
            (PackedCount, Write),
            (PackedGroups, Write),
            (Packed, Write),
        ],
    },
    Kernel {
        name: "tally",
        entry_point: "tally",
        source: &[LAYOUT, include_str!("../../../../shaders/tally.wgsl")],
        bindings: &[(Tiles, Read), (Filled, Read), (Runs, Read), (Tallies, Write), (Mass, Read)],
    },
    Kernel {
        name: "columns",
        entry_point: "columns",
        source: &[LAYOUT, include_str!("../../../../shaders/columns.wgsl")],
        bindings: &[
            (Tiles, Read),
            (Filled, Read),
            (ColumnJobs, Read),
            (ColumnLists, Read),
            (ColumnCells, Write),
            (Mass, Read),
            (Thickness, Read),
            (Temperature, Read),
            (Stress, Read),
        ],
    },
    Kernel {
        name: "sample",
        entry_point: "sample",
        source: &[
            LAYOUT,
            ELEVATION,
            MATERIAL,
            WET,
            ALPINE,
            include_str!("../../../../shaders/sample.wgsl"),
        ],
        bindings: &[
            (Sessions, Read),
            (Tiles, Read),
            (Filled, Read),
            (Ground, Read),
            (SampleJobs, Read),
            (Samples, Write),
            (Mass, Read),
            (Thickness, Read),
            (Temperature, Read),
            (Stress, Read),
        ],
    },
    Kernel {
        name: "weather",
        entry_point: "weather",
        source: &[
            LAYOUT,
            WET,
            include_str!("../../../../shaders/weather/cell.wgsl"),
            include_str!("../../../../shaders/weather/column.wgsl"),
            include_str!("../../../../shaders/weather/conduction.wgsl"),
            include_str!("../../../../shaders/weather/skin.wgsl"),
            include_str!("../../../../shaders/weather/descent.wgsl"),
            include_str!("../../../../shaders/weather/fall.wgsl"),
            include_str!("../../../../shaders/weather/housekeeping.wgsl"),
            include_str!("../../../../shaders/weather.wgsl"),
        ],
        bindings: &[
            (Sessions, Read),
            (Tiles, Read),
            (States, Write),
            (Heights, Write),
            (Filled, Write),
            (WeatherJobs, Read),
            (WeatherSteps, Read),
            (Shelters, Read),
            (Exchanges, Write),
            (Shine, Read),
            (Mass, Write),
            (Thickness, Write),
            (Temperature, Write),
            (Stress, Write),
        ],
    },
    Kernel {
        name: "sweep",
        entry_point: "sweep",
        source: &[LAYOUT, RELIEF, include_str!("../../../../shaders/sweep.wgsl")],
        bindings: LIT,
    },
    Kernel {
        name: "shade",
        entry_point: "shade",
        source: &[LAYOUT, RELIEF, include_str!("../../../../shaders/shade.wgsl")],
        bindings: LIT,
    },
    Kernel {
        name: "totals",
        entry_point: "totals",
        source: &[LAYOUT, WET, include_str!("../../../../shaders/totals.wgsl")],
        bindings: &[
            (Sessions, Read),
            (Tiles, Read),
            (Filled, Read),
            (SampleJobs, Read),
            (ColumnTotals, Write),
            (Mass, Read),
            (Thickness, Read),
            (Temperature, Read),
            (Stress, Read),
        ],
    },
];

/// What `sweep` and `shade` bind.
const LIT: &[(Resource, Access)] =
    &[(Sessions, Read), (Heights, Read), (Ground, Read), (ShadeJobs, Read), (Shine, Write)];
