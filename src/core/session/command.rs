//! What is done with a snowpack: a change of a client that was checked and completed, so that it can't fail
//! any more.

use std::sync::Arc;

use firn_engine::frame::Stamp;
use firn_engine::parallel;
use firn_protocol::{Settings, WeatherInput};
use firn_snow::{Body, ColumnRect, Coverage, Grid, Position, Shape, SurfaceLoad, Turn};
use serde::{Deserialize, Serialize};

use crate::core::session::{Ground, Told};

/// What is done with a snowpack. It needs nothing but the state before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Command {
    /// So much falls on each of some columns, in quanta.
    Deposit { columns: ColumnRect, depth: u64, mass: u64, celsius: f32 },
    /// Columns are cleared to a depth in quanta, but for those on which objects stand. Clearings that were stored before
    /// there was a choice spare none.
    Clear {
        columns: ColumnRect,
        depth: u32,
        #[serde(default)]
        spares: bool,
    },
    /// Columns along a path are cleared to a depth in quanta.
    ClearPath { path: Vec<[f64; 2]>, width: f64, depth: u32 },
    /// All settings, as they become.
    Settings {
        settings: Settings,
        stiffness_exponent: f64,
        /// The weather that goes with them, where that becomes another.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        weather: Option<Arc<WeatherInput>>,
    },
    /// The weather is another from now on.
    Weather(Arc<WeatherInput>),
    /// Objects are taken away, then put.
    Objects { removed: Vec<Arc<str>>, put: Vec<(Arc<str>, Body)> },
    /// Loads press prints into the snow.
    Stamps(Vec<Stamping>),
    /// The snow lies on other ground.
    Ground(Ground),
    /// Back to the state that the session was created in.
    Reset,
}

/// A load that presses a print.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Stamping {
    pub shape: Shape,
    pub position: Position,
    pub heading: f64,
    /// \[Pa\]
    pub pressure: f64,
}

impl Stamping {
    /// What it presses; `None` where it covers nothing.
    pub fn print(&self, grid: &Grid) -> Option<Arc<Stamp>> {
        let coverage = Coverage::new(grid, &self.shape, self.position, Turn::new(self.heading))?;
        let width = self.shape.area().sqrt() as f32;
        let load = SurfaceLoad { pressure: self.pressure as f32, width };
        Some(Arc::new(Stamp { coverage, load }))
    }
}

/// What each of many loads presses; `None` where it covers nothing.
pub(crate) fn prints(stamps: &[Stamping], grid: &Grid) -> Vec<Option<Arc<Stamp>>> {
    parallel::each(stamps.iter().collect(), |stamping: &Stamping| stamping.print(grid))
}

/// A command, and what its answer will say.
#[derive(Debug)]
pub(crate) struct Decision {
    pub command: Command,
    pub told: Told,
}

/// What of a snowfall finds no room in any column, whatever lies in it: a column has so many cells.
pub(crate) struct Kept {
    pub depth: u32,
    pub mass: u32,
    /// Mass of each column that is refused, in quanta.
    pub refused: u64,
}

impl Kept {
    /// Of a depth and a mass, in quanta of one column.
    pub fn of(depth: u64, mass: u64, grid: &Grid) -> Kept {
        let room = u64::from(grid.height) * u64::from(firn_snow::CELL);
        let (depth, kept) = if depth > room {
            (room, (u128::from(mass) * u128::from(room) / u128::from(depth)) as u64)
        } else {
            (depth, mass)
        };
        Kept { depth: depth as u32, mass: kept as u32, refused: mass - kept }
    }
}
