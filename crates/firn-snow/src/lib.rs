//! The physics of the snowpack in plain Rust: the reference that every kernel is tested against.
//!
//! A [`Snowpack`] is a grid of columns. In each lie cells of snow on top of each other, with a mass, a
//! thickness, a temperature and a stress. Where the stress on a cell exceeds its hardness it is compacted,
//! cycle by cycle, under the weight of what lies above and of objects. Masses and thicknesses are whole
//! quanta, so that mass is conserved exactly. It knows no GPU and no network; `docs/model.md` holds the
//! equations and where they come from.
//!
//! ```
//! use firn_snow::{CELL, Grid, MASS_QUANTA, Material, Snowpack};
//!
//! let grid = Grid { width: 8, depth: 8, height: 20, cell_size: 0.2 };
//! let mut snowpack = Snowpack::new(grid, Material::default(), &[], false)?;
//!
//! // Three metres of fresh snow of 20 kg/m³ at −5 °C, everywhere.
//! let refused = snowpack.deposit(grid.all(), 15 * CELL, (60.0 * MASS_QUANTA) as u32, -5.0);
//! assert_eq!(refused, 0);
//! snowpack.evaluate();
//!
//! // A minute in cycles of a sixtieth of a second: the snow settles, and not a quantum gets lost.
//! let (height, mass) = (snowpack.column(3, 3).height(), snowpack.mass());
//! snowpack.run(3600, 1.0 / 60.0);
//! assert!(snowpack.column(3, 3).height() < height);
//! assert_eq!(snowpack.mass(), mass);
//! # Ok::<(), std::collections::TryReserveError>(())
//! ```
//!
//! With the feature `serde` what a client tells of a snowpack can be read and written, with `schema` it has
//! a JSON schema too.

pub mod alpine;
mod body;
mod burden;
mod column;
mod column_set;
mod contact;
mod coverage;
mod elevation;
mod footprint;
mod grid;
mod material;
mod motion;
mod path;
mod preset;
mod pressing;
mod recut;
mod sample;
mod shape;
mod snowpack;
pub mod weather;

pub use body::{Body, Cover, MOST_FOOTPRINTS, Part, Position};
pub use burden::Burden;
pub use column::{Cell, Column, SurfaceLoad};
pub use column_set::ColumnSet;
pub use contact::{CONTACT_DEPTH, Contact, Footing, share, share_units};
pub use coverage::Coverage;
pub use elevation::Elevation;
pub use footprint::Footprint;
pub use grid::{
    CELL, ColumnRect, Grid, MASS_QUANTA, MAX_COLUMN_MASS, MAX_RELIEF_CELLS, TILE_COLUMNS, TILE_SIDE,
};
pub use material::{
    GRAVITY, HardnessLaw, LoadDistribution, Material, REFERENCE_CELL_SIZE, gold_prefactor,
};
pub use motion::{MOST_PATH_POINTS, MOST_STEPS, Motion, path_length};
pub use path::{columns_along, rows_along};
pub use preset::Preset;
pub use pressing::Pressing;
pub use sample::{Content, Floor, Sample, sample_column};
pub use shape::{Extent, MOST_CORNERS, Shape, Turn};
pub use snowpack::{ColumnTotals, Exchanged, Progress, Snowpack};
