//! How far an object reaches over the snow, wherever it stands: what it takes on the device and what it
//! costs follow from that.

use firn_engine::frame::contact_units;
use firn_snow::{Grid, Shape, TILE_COLUMNS, TILE_SIDE};

/// Words of four bytes of an object itself in the device's tables.
const WORDS: u64 = 12;

/// What lies under an object at the most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Reach {
    columns: u64,
    /// Rows of columns.
    rows: u64,
    pub tiles: u64,
}

impl Reach {
    /// Of an outline.
    pub fn new(shape: &Shape, grid: &Grid) -> Reach {
        let (width, depth) = match *shape {
            Shape::Box { width, depth } => (width, depth),
            Shape::Disk { radius } => (2.0 * radius, 2.0 * radius),
        };
        let columns = |extent: f64, most: u32| {
            ((extent / grid.cell_size).ceil() as u64).saturating_add(1).min(most.into())
        };
        let (columns, rows) = (columns(width, grid.width), columns(depth, grid.depth));
        let tiles = |columns: u64| columns.div_ceil(TILE_SIDE.into()) + 1;
        Reach { columns: columns * rows, rows, tiles: tiles(columns) * tiles(rows) }
    }

    /// Words of four bytes that it takes in the device's tables: for itself, two for each row of columns
    /// under it, and one for each tile.
    pub fn words(&self) -> u64 {
        WORDS + 2 * self.rows + self.tiles
    }

    /// Units of a cycle that it costs beside the snow: its contact, and its load on the cells below.
    pub fn units(&self, grid: &Grid) -> u64 {
        contact_units(self.columns) + self.tiles * u64::from(TILE_COLUMNS * grid.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firn_snow::{Footprint, Position};

    #[test]
    fn an_object_takes_no_more_than_it_says_wherever_it_stands() {
        let grid = Grid { width: 100, depth: 60, height: 9, cell_size: 0.2 };
        let shapes = [
            Shape::Box { width: 0.1, depth: 0.1 },
            Shape::Box { width: 1.6, depth: 1.6 },
            Shape::Box { width: 3.3, depth: 7.9 },
            Shape::Disk { radius: 2.45 },
        ];
        for shape in shapes {
            let reach = Reach::new(&shape, &grid);
            for step in 0..40 {
                let position = Position { x: 8.0 + 0.05 * f64::from(step), z: 5.9 };
                let footprint = Footprint::new(&grid, &shape, position).unwrap();
                let tiles = footprint.tiles(&grid).len();
                let needed = 2 * footprint.spans.len() + tiles;
                assert!(WORDS + needed as u64 <= reach.words(), "{shape:?} {position:?}");
                assert!(u64::from(footprint.columns) <= reach.columns, "{shape:?} {position:?}");
                assert!(tiles as u64 <= reach.tiles, "{shape:?} {position:?}");
            }
        }
    }
}
