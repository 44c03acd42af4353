//! The physics of the snowpack in plain Rust: the reference that every kernel is tested against.
//!
//! It knows no GPU and no network. `docs/model.md` holds the equations.

mod column;
mod contact;
mod footprint;
mod grid;
mod material;
mod recut;
mod sample;
mod snowpack;

pub use column::{Cell, Column, SurfaceLoad};
pub use contact::{CONTACT_DEPTH, Contact, Footing, elevation, share, share_units};
pub use footprint::{Footprint, Position, Shape};
pub use grid::{
    CELL, ColumnRect, Grid, MASS_QUANTA, MAX_COLUMN_MASS, MAX_TERRAIN_CELLS, TILE_COLUMNS,
    TILE_SIDE,
};
pub use material::{
    GRAVITY, HardnessLaw, LoadDistribution, Material, REFERENCE_CELL_SIZE, gold_prefactor,
};
pub use sample::{Content, Sample, sample_column};
pub use snowpack::Snowpack;
