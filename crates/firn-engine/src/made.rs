//! What takes long about making a snowpack. Any thread does it, before a backend takes the snowpack in.

use std::collections::TryReserveError;

use firn_snow::{Snowpack, TILE_COLUMNS};

use crate::reserve::{ask_for, try_filled};

use super::frame::{EngineError, Layout};

/// Makes what a backend takes in.
#[derive(Clone, Copy, Debug)]
pub enum Maker {
    /// Columns on the host. No tile of them sleeps where they are to be always awake.
    Columns {
        /// Whether they are.
        always_awake: bool,
    },
    /// Rows of tables on a device.
    Rows,
}

/// An empty snowpack that a backend can take in.
#[derive(Debug)]
pub struct Made {
    /// What it is made with, but for the ground.
    pub(super) layout: Layout,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) enum Kind {
    Columns(Box<Snowpack>),
    /// The ground of each column of each tile; empty where it is level.
    Rows(Vec<u32>),
}

impl Maker {
    /// Makes a snowpack. That takes memory and, for millions of columns, a while.
    ///
    /// # Errors
    /// [`EngineError::OutOfMemory`].
    pub fn make(self, layout: Layout) -> Result<Made, EngineError> {
        let columns = layout.grid.columns();
        self.try_make(layout).map_err(|error| {
            EngineError::OutOfMemory(format!("there is no memory for {columns} columns: {error}"))
        })
    }

    fn try_make(self, mut layout: Layout) -> Result<Made, TryReserveError> {
        let ground = std::mem::take(&mut layout.ground);
        let Layout { grid, material, .. } = layout;
        let kind = match self {
            Maker::Columns { always_awake } => {
                ask_for(Snowpack::bytes(&grid))?;
                Kind::Columns(Box::new(Snowpack::new(grid, material, &ground, always_awake)?))
            }
            Maker::Rows if ground.is_empty() => Kind::Rows(ground),
            Maker::Rows => {
                let mut rows = try_filled(grid.padded_columns() as usize, 0)?;
                for (z, line) in (0..).zip(ground.chunks(grid.width as usize)) {
                    for (x, elevation) in (0..).zip(line) {
                        let (tile, column) = grid.locate(x, z);
                        rows[(tile * TILE_COLUMNS + column) as usize] = *elevation;
                    }
                }
                Kind::Rows(rows)
            }
        };
        Ok(Made { layout, kind })
    }
}
