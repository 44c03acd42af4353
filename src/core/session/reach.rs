//! How far an object reaches over the snow, wherever it stands: what it takes on the device and what it
//! costs follow from that.

use firn_engine::frame::contact_units;
use firn_snow::{Body, Grid, Shape, TILE_COLUMNS, TILE_SIDE, Turn};

/// Words of four bytes of a footprint itself in the device's tables.
const WORDS: u64 = 15;

/// What lies under an object at the most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Reach {
    columns: u64,
    /// Rows of columns.
    rows: u64,
    pub tiles: u64,
    /// Words of four bytes that it takes in the device's tables.
    words: u64,
}

impl Reach {
    /// Of an object, as it is turned, or however it turns.
    pub fn new(object: &Body, grid: &Grid) -> Reach {
        object.outlines().fold(Reach::default(), |all, (shape, _, turn)| {
            let extent = |turn| {
                let reach = shape.reach(turn);
                (reach.x1 - reach.x0, reach.z1 - reach.z0)
            };
            // What turns takes no more than its diagonal, whatever its heading.
            let (width, depth) = extent(Turn::NONE);
            let diagonal = width.hypot(depth);
            let turns = object.motion.turns();
            let own = if turns { (diagonal, diagonal) } else { extent(turn) };
            let own = Reach::of(shape, own, grid);
            Reach {
                columns: all.columns + own.columns,
                rows: all.rows + own.rows,
                tiles: all.tiles + own.tiles,
                words: all.words + own.words,
            }
        })
    }

    /// Of an outline of some extent along x and z \[m\].
    fn of(shape: &Shape, (width, depth): (f64, f64), grid: &Grid) -> Reach {
        let columns = |extent: f64, most: u32| {
            ((extent / grid.cell_size).ceil() as u64).saturating_add(1).min(most.into())
        };
        let (columns, rows) = (columns(width, grid.width), columns(depth, grid.depth));
        let tiles = |columns: u64| columns.div_ceil(TILE_SIDE.into()) + 1;
        let (columns, tiles) = (columns * rows, tiles(columns) * tiles(rows));
        // Two for each row of columns under it, one for each tile, and one for each column where it is round
        // underneath.
        let lifts = if matches!(shape, Shape::Wheel { .. }) { columns } else { 0 };
        Reach { columns, rows, tiles, words: WORDS + 2 * rows + tiles + lifts }
    }

    /// Words of four bytes that it takes in the device's tables.
    pub fn words(&self) -> u64 {
        self.words
    }

    /// Units of a cycle that it costs beside the snow: its contact, and its load on the cells below.
    pub fn units(&self, grid: &Grid) -> u64 {
        contact_units(self.columns) + self.tiles * u64::from(TILE_COLUMNS * grid.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firn_snow::{Motion, Position};

    #[test]
    fn an_object_takes_no_more_than_it_says_wherever_it_stands() {
        let grid = Grid { width: 100, depth: 60, height: 9, cell_size: 0.2 };
        let shapes = [
            Shape::Box { width: 0.1, depth: 0.1 },
            Shape::Box { width: 1.6, depth: 1.6 },
            Shape::Box { width: 3.3, depth: 7.9 },
            Shape::Disk { radius: 2.45 },
            Shape::Capsule { length: 3.0, radius: 0.3 },
            Shape::Polygon { corners: vec![[0.0, -1.0], [0.5, 0.0], [0.0, 2.0]] },
            Shape::Wheel { width: 0.5, radius: 1.1 },
        ];
        for shape in shapes {
            for step in 0..40 {
                let position = Position { x: 8.0 + 0.05 * f64::from(step), z: 5.9 };
                let heading = f64::from(step) * 9.0;
                let shape = Some(shape.clone());
                let object = Body { shape, position, heading, ..Body::default() };
                let reach = Reach::new(&object, &grid);
                let footprint = &object.on(&grid).unwrap()[0];
                let tiles = footprint.tiles(&grid).len();
                let needed = 2 * footprint.spans.len() + tiles + footprint.lifts.len();
                assert!(WORDS + needed as u64 <= reach.words(), "{object:?}");
                assert!(u64::from(footprint.columns) <= reach.columns, "{object:?}");
                assert!(tiles as u64 <= reach.tiles, "{object:?}");
            }
        }
    }

    #[test]
    fn what_turns_takes_the_same_at_every_heading() {
        let grid = Grid { width: 100, depth: 60, height: 9, cell_size: 0.1 };
        let ski = Shape::Box { width: 0.2, depth: 1.8 };
        let wheel = Shape::Wheel { width: 0.3, radius: 0.5 };
        for shape in [ski, wheel] {
            let turning = |heading| Body {
                shape: Some(shape.clone()),
                position: Position { x: 5.03, z: 3.01 },
                heading,
                motion: Motion { turn_rate: 20.0, ..Motion::default() },
                ..Body::default()
            };
            let reserved = Reach::new(&turning(0.0), &grid);
            for heading in (0..360).step_by(7).map(f64::from) {
                let object = turning(heading);
                assert_eq!(Reach::new(&object, &grid), reserved, "at {heading}°");
                let footprint = &object.on(&grid).unwrap()[0];
                let tiles = footprint.tiles(&grid).len();
                let needed = 2 * footprint.spans.len() + tiles + footprint.lifts.len();
                assert!(WORDS + needed as u64 <= reserved.words(), "at {heading}°");
            }
        }
    }
}
