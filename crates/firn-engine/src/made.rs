//! What takes long about making a snowpack. Any thread does it, before a backend takes the snowpack in.

use std::collections::TryReserveError;

use firn_snow::Snowpack;

use crate::reserve::ask_for;

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
    pub(super) layout: Layout,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) enum Kind {
    Columns(Box<Snowpack>),
    /// All is written by the backend itself, a part at a time.
    Rows,
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

    fn try_make(self, layout: Layout) -> Result<Made, TryReserveError> {
        let Layout { grid, material, ground, surface } = &layout;
        let kind = match self {
            Maker::Columns { always_awake } => {
                ask_for(Snowpack::bytes(grid))?;
                let snowpack = Snowpack::new(*grid, *material, ground, always_awake)?;
                Kind::Columns(Box::new(match surface {
                    Some(surface) => snowpack.with_surfaces(*surface),
                    None => snowpack,
                }))
            }
            Maker::Rows => Kind::Rows,
        };
        Ok(Made { layout, kind })
    }
}
