//! Changes of a snowpack between its cycles.

use std::sync::Arc;

use firn_snow::alpine::WeatherStep;
use firn_snow::{
    ColumnRect, Contact, Cover, Coverage, Footprint, Grid, Material, SurfaceLoad, TILE_SIDE,
};

use super::TileCells;

/// How objects move in a cycle: what changes before each of the equal steps in which it is taken, under objects.
/// Other snow takes it at once. Without steps it is a cycle like others.
#[derive(Clone, Debug, Default)]
pub struct Moves {
    /// Changes before each step: snow that is laid down, then objects that are put.
    pub steps: Vec<Vec<Edit>>,
}

impl Moves {
    /// Steps of the cycle, at least one.
    pub fn count(&self) -> u32 {
        self.steps.len().max(1) as u32
    }

    /// Whether anything is done in the cycle but that snow settles.
    pub fn move_something(&self) -> bool {
        self.steps.iter().any(|step| !step.is_empty())
    }

    /// Columns under each object after each step.
    pub fn placements(&self) -> impl Iterator<Item = &Placement> {
        self.steps.iter().flatten().filter_map(|edit| match edit {
            Edit::PutCollider { collider, .. } => Some(&**collider),
            _ => None,
        })
    }

    /// Tiles over which objects move, some of them told several times.
    pub fn tiles<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = u32> + 'a {
        let footprints = self.placements().flat_map(|placement| &placement.footprints);
        footprints.flat_map(|footprint| footprint.tiles(grid))
    }
}

/// A change of one snowpack.
#[derive(Clone, Debug)]
pub enum Edit {
    /// Snow falls on some columns, but for those that objects shelter.
    Deposit(Deposit),
    /// Snow is laid on some columns, under objects too.
    Lay(Deposit),
    /// Snow is removed above a depth, where no object stands.
    Clear {
        /// The columns.
        columns: ColumnRect,
        /// Depth left standing, in thickness quanta.
        depth: u32,
    },
    /// Snow is removed above a depth, under objects too.
    Strip {
        /// The columns.
        columns: ColumnRect,
        /// Depth left standing, in thickness quanta.
        depth: u32,
    },
    /// Columns are pressed at once.
    Stamp(Arc<Stamp>),
    /// All columns of a snowpack of alpine snow take steps of weather. What these exchange is told apart from
    /// results of edits.
    Weather(Arc<Weathering>),
    /// An object is placed, replaced or moved.
    PutCollider {
        /// Its id; loads add up in ascending order of ids.
        id: Arc<str>,
        /// The object.
        collider: Arc<Placement>,
        /// Whether the depth it has sunk is counted from here.
        placed: bool,
    },
    /// An object is taken away.
    RemoveCollider {
        /// Its id.
        id: Arc<str>,
    },
    /// Other ground under the snow: the elevation of each column \[m\], row by row; empty for level ground at 0.
    SetGround(Arc<[f64]>),
    /// Other material constants. They come with `Work::wake` or a restore.
    SetMaterial(Material),
    /// Everything is replaced by what was saved. Contacts and stresses are not evaluated.
    Restore(Arc<Contents>),
}

impl Edit {
    /// How the results of two parts of it are joined: masses add up, of dents the deepest counts.
    pub fn joining(&self) -> fn(u64, u64) -> u64 {
        match self {
            Edit::Stamp(_) => u64::max,
            _ => u64::saturating_add,
        }
    }

    /// The columns that it changes, where it changes snow.
    pub fn columns(&self) -> Option<ColumnRect> {
        match self {
            Edit::Deposit(fall) | Edit::Lay(fall) => Some(fall.columns),
            Edit::Clear { columns, .. } | Edit::Strip { columns, .. } => Some(*columns),
            Edit::Stamp(stamp) => Some(stamp.coverage.columns),
            Edit::Weather(weathering) => Some(weathering.columns),
            _ => None,
        }
    }
}

/// The cells and objects of a snowpack.
#[derive(Clone, Debug)]
pub struct Contents {
    /// Cells of all tiles.
    pub tiles: Arc<Vec<TileCells>>,
    /// Objects with their contacts, in ascending order of ids.
    pub colliders: Vec<(Arc<str>, Arc<Placement>, Contact)>,
}

/// Fresh snow on every column of a rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deposit {
    /// The columns.
    pub columns: ColumnRect,
    /// Depth in thickness quanta, at most `height` cells.
    pub depth: u32,
    /// Areal mass in quanta.
    pub mass: u32,
    /// Temperature \[°C\].
    pub temperature: f32,
}

/// A load that presses columns at once, each by its share of the way to where it carries the load.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamp {
    /// How much of each column it covers.
    pub coverage: Coverage,
    /// The load.
    pub load: SurfaceLoad,
}

impl Stamp {
    /// Units that it costs where columns have so many slots: their cells.
    pub fn units(&self, height: u32) -> u64 {
        self.coverage.covered() * u64::from(height)
    }

    /// The same of those in a row of tiles.
    pub fn units_in(&self, row: u32, height: u32) -> u64 {
        let Coverage { columns, shares } = &self.coverage;
        let place = |z: u32| {
            let z = z.clamp(columns.z0, columns.z1) - columns.z0;
            z as usize * (columns.x1 - columns.x0) as usize
        };
        let shares = &shares[place(row * TILE_SIDE)..place((row + 1) * TILE_SIDE)];
        shares.iter().filter(|share| **share > 0).count() as u64 * u64::from(height)
    }
}

/// Steps of weather that follow each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Weathering {
    /// All columns of the grid.
    pub columns: ColumnRect,
    /// The steps. Where one shades, it is the only one: where light falls depends on all columns together.
    pub steps: Vec<WeatherStep>,
}

impl Weathering {
    /// Units that a step costs for each cell that a column may have.
    pub const UNITS: u64 = 8;

    /// Edits for steps that follow each other: as many in each as can be taken column by column.
    pub fn edits(grid: &Grid, steps: &[WeatherStep]) -> impl Iterator<Item = Edit> {
        let columns = grid.all();
        let alike = |one: &WeatherStep, next: &WeatherStep| !one.shades && !next.shades;
        steps.chunk_by(alike).map(move |steps| {
            Edit::Weather(Arc::new(Weathering { columns, steps: steps.to_vec() }))
        })
    }

    /// Whether each column has its own part of the short wave.
    pub fn shades(&self) -> bool {
        self.steps.iter().any(|step| step.shades)
    }
}

/// An object's load and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Mass \[kg\], with what lies on it.
    pub mass: f64,
    /// What it keeps from the columns under it.
    pub cover: Cover,
    /// Columns under each of its outlines.
    pub footprints: Vec<Footprint>,
}

impl Placement {
    /// How many columns there are under it.
    pub fn columns(&self) -> u64 {
        self.footprints.iter().map(|footprint| footprint.iter().count() as u64).sum()
    }
}
