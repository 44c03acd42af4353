//! The columns under an outline.

use std::collections::BTreeMap;

use super::body::Position;
use super::grid::{CELL, Grid, TILE_SIDE};
use super::shape::{EDGE_SLACK, Shape, Turn};

/// The columns under an outline: one span of columns for each row along z.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// Row of the first span.
    pub z0: u32,
    /// Columns `[x0, x1)` of each row, as far as they are in the grid; none where the outline has none there.
    pub spans: Vec<(u32, u32)>,
    /// Number n of columns that the outline stands for, those beyond the grid included.
    pub columns: u32,
    /// How many of them are beyond the grid. They are fully supported.
    pub overhang: u32,
    /// True area A₀ \[m²\] that the columns stand for.
    pub area: f64,
    /// How high the underside is above its lowest line over each column of the spans' bounding box, row by row,
    /// in thickness quanta; empty where it is flat.
    pub lifts: Vec<u32>,
}

impl Footprint {
    /// The columns whose centres lie inside an outline, at least the one its centre is in.
    pub fn new(grid: &Grid, shape: &Shape, centre: Position, turn: Turn) -> Footprint {
        let h = grid.cell_size;
        let row = |z: u32| {
            let (low, high) = shape.chord(turn, (f64::from(z) + 0.5) * h - centre.z)?;
            let x0 = ((centre.x + low) / h - 0.5).ceil().max(0.0) as u32;
            let x1 = ((centre.x + high) / h - 0.5).floor() + 1.0;
            let x1 = (x1.max(0.0) as u32).min(grid.width);
            (x0 < x1).then_some((x0, x1))
        };
        let reach = shape.reach(turn);
        let first = ((centre.z + reach.z0) / h - 1.0).max(0.0) as u32;
        let end = (((centre.z + reach.z1) / h + 2.0).max(0.0) as u32).min(grid.depth);
        // Rows of a thin outline across the grid may have no column between others that do.
        let mut rows: Vec<(u32, (u32, u32))> =
            (first..end).map(|z| (z, row(z).unwrap_or((0, 0)))).collect();
        let is_empty = |row: &(u32, (u32, u32))| row.1.0 == row.1.1;
        rows.truncate(rows.iter().rposition(|row| !is_empty(row)).map_or(0, |last| last + 1));
        rows.drain(..rows.iter().position(|row| !is_empty(row)).unwrap_or(0));

        let sides = [
            (centre.x, reach.x0, reach.x1, grid.width),
            (centre.z, reach.z0, reach.z1, grid.depth),
        ];
        let hangs_over = sides.into_iter().any(|(centre, low, high, cells)| {
            centre + low < -EDGE_SLACK || centre + high > f64::from(cells) * h + EDGE_SLACK
        });
        let mut columns: u32 = rows.iter().map(|(_, (x0, x1))| x1 - x0).sum();
        if let Some((x, z)) = column_at(grid, centre).filter(|_| columns == 0) {
            // A shape too thin to hold the centre of a column holds none: it stands on its own.
            (rows, columns) = (vec![(z, (x, x + 1))], 1);
        }
        let mut footprint = Footprint {
            z0: rows.first().map_or(0, |row| row.0),
            spans: rows.into_iter().map(|(_, span)| span).collect(),
            columns,
            overhang: 0,
            area: shape.area(),
            lifts: Vec::new(),
        };
        if hangs_over {
            let all = (footprint.area / (h * h)).round().clamp(1.0, 1e9) as u32;
            footprint.overhang = all.saturating_sub(columns);
            footprint.columns += footprint.overhang;
        }
        footprint.lift(grid, shape, centre, turn);
        footprint
    }

    /// Notes how high an underside that is not flat is over each column.
    fn lift(&mut self, grid: &Grid, shape: &Shape, centre: Position, turn: Turn) {
        let h = grid.cell_size;
        let (x0, x1) = self.extent();
        for z in self.z0..self.z0 + self.spans.len() as u32 {
            for x in x0..x1 {
                let (dx, dz) = (f64::from(x) + 0.5, f64::from(z) + 0.5);
                let lift = shape.lift(turn, dx * h - centre.x, dz * h - centre.z);
                let quanta = lift.map(|lift| (lift / h * f64::from(CELL)).round() as u32);
                self.lifts.extend(quanta);
            }
        }
    }

    /// Lowest and highest end of the spans.
    pub fn extent(&self) -> (u32, u32) {
        let full = self.spans.iter().filter(|(x0, x1)| x0 < x1);
        full.fold(None, |extent: Option<(u32, u32)>, &(x0, x1)| {
            Some(extent.map_or((x0, x1), |(low, high)| (low.min(x0), high.max(x1))))
        })
        .unwrap_or_default()
    }

    /// How high the underside is above its lowest line over a column of it, in thickness quanta.
    #[inline]
    pub fn lift_over(&self, x: u32, z: u32) -> u32 {
        if self.lifts.is_empty() {
            return 0;
        }
        let (x0, x1) = self.extent();
        let index = (z - self.z0) as usize * (x1 - x0) as usize + (x - x0) as usize;
        self.lifts.get(index).copied().unwrap_or(0)
    }

    /// Every column (x, z) in the grid, row by row.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.spans.iter().zip(self.z0..).flat_map(|(&(x0, x1), z)| (x0..x1).map(move |x| (x, z)))
    }

    /// Tiles the footprint touches, ascending and without repetition.
    pub fn tiles(&self, grid: &Grid) -> Vec<u32> {
        self.columns_of_tiles(grid).into_iter().map(|(tile, _)| tile).collect()
    }

    /// The same tiles, each with the columns of it that are under the outline, bit by bit.
    pub fn columns_of_tiles(&self, grid: &Grid) -> Vec<(u32, u64)> {
        let mut tiles = BTreeMap::new();
        for (&(x0, x1), z) in self.spans.iter().zip(self.z0..) {
            let mut x = x0;
            while x < x1 {
                let (tile, column) = grid.locate(x, z);
                // Columns up to the end of the tile or of the span, whatever comes first.
                let count = (TILE_SIDE - x % TILE_SIDE).min(x1 - x);
                *tiles.entry(tile).or_insert(0) |= ((1u64 << count) - 1) << column;
                x += count;
            }
        }
        tiles.into_iter().collect()
    }
}

/// The column that a position is in, its edges included.
fn column_at(grid: &Grid, position: Position) -> Option<(u32, u32)> {
    let h = grid.cell_size;
    let along = |metres: f64, cells: u32| {
        let inside = (-EDGE_SLACK..=f64::from(cells) * h + EDGE_SLACK).contains(&metres);
        inside.then(|| ((metres / h).max(0.0) as u32).min(cells - 1))
    };
    Some((along(position.x, grid.width)?, along(position.z, grid.depth)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { width: 10, depth: 6, height: 20, cell_size: 0.2 };

    fn columns(shape: &Shape, x: f64, z: f64) -> Vec<(u32, u32)> {
        let footprint = Footprint::new(&GRID, shape, Position { x, z }, Turn::NONE);
        assert_eq!(footprint.overhang, 0);
        assert_eq!(footprint.columns as usize, footprint.iter().count());
        assert_eq!(footprint.area, shape.area());
        footprint.iter().collect()
    }

    #[test]
    fn centres_on_the_edge_are_inside() {
        let plate = Shape::Box { width: 0.4, depth: 0.2 };
        let inside = columns(&plate, 0.5, 0.4);
        assert_eq!(inside, [(1, 1), (2, 1), (3, 1), (1, 2), (2, 2), (3, 2)]);
        assert_eq!(columns(&plate, 0.5001, 0.4), [(2, 1), (3, 1), (2, 2), (3, 2)]);
        assert_eq!(columns(&plate, 0.5 + 5e-7, 0.4), inside, "within the slack");
        assert_eq!(columns(&plate, 0.4, 0.5), [(1, 2), (2, 2)]);
    }

    #[test]
    fn a_shape_between_centres_stands_on_the_column_of_its_centre() {
        assert_eq!(columns(&Shape::Box { width: 0.05, depth: 0.05 }, 0.75, 0.45), [(3, 2)]);
        assert_eq!(columns(&Shape::Box { width: 1.0, depth: 0.02 }, 0.9, 0.45), [(4, 2)]);
        assert_eq!(columns(&Shape::Disk { radius: 0.01 }, 1.99, 1.19), [(9, 5)]);
        assert_eq!(columns(&Shape::Disk { radius: 0.0 }, 2.0, 1.2), [(9, 5)], "the far corner");
    }

    #[test]
    fn a_disk_covers_the_centres_within_its_radius() {
        let disk = Shape::Disk { radius: 0.25 };
        let plus = [(4, 1), (3, 2), (4, 2), (5, 2), (4, 3)];
        assert_eq!(columns(&disk, 0.9, 0.5), plus);
        assert_eq!(columns(&Shape::Disk { radius: 0.2 }, 0.9, 0.5), plus, "on the rim");
        assert_eq!(columns(&disk, 1.0, 0.4).len(), 4);
    }

    #[test]
    fn what_hangs_over_the_grid_counts_as_columns() {
        let footprint =
            |shape: &Shape, x, z| Footprint::new(&GRID, shape, Position { x, z }, Turn::NONE);
        let plate = Shape::Box { width: 1.0, depth: 0.4 };
        for (x, z) in [(0.5, 0.2), (1.5, 1.0)] {
            assert_eq!(footprint(&plate, x, z).overhang, 0, "along the edges at ({x}, {z})");
        }
        for (x, z, inside) in [(0.3, 0.2, 8), (0.5, 0.0, 5), (1.9, 1.2, 3), (0.0, 0.0, 3)] {
            let over = footprint(&plate, x, z);
            let inside_too = over.iter().count();
            assert_eq!((inside_too, over.columns, over.overhang), (inside, 10, 10 - inside as u32));
        }
        for (x, z) in [(-9.0, 0.5), (9.0, 0.5), (1.0, 9.0)] {
            let off = footprint(&plate, x, z);
            assert_eq!((off.spans.len(), off.columns, off.overhang), (0, 10, 10), "({x}, {z})");
        }
        let wide = footprint(&Shape::Disk { radius: 0.7 }, 1.0, 0.6);
        assert_eq!((wide.columns, wide.overhang), (38, 38 - wide.iter().count() as u32));
    }

    #[test]
    fn a_box_turned_by_a_quarter_is_the_turned_box() {
        let (long, wide) =
            (Shape::Box { width: 0.3, depth: 0.9 }, Shape::Box { width: 0.9, depth: 0.3 });
        for (x, z) in [(0.9, 0.5), (0.93, 0.61), (1.0, 0.6)] {
            let at = Position { x, z };
            for quarter in [90.0, -90.0, 270.0, 450.0] {
                let turned = Footprint::new(&GRID, &long, at, Turn::new(quarter));
                assert_eq!(turned, Footprint::new(&GRID, &wide, at, Turn::NONE));
            }
            let half = Footprint::new(&GRID, &long, at, Turn::new(180.0));
            assert_eq!(half, Footprint::new(&GRID, &long, at, Turn::NONE));
        }
    }

    #[test]
    fn a_wheel_is_round_underneath() {
        let grid = Grid { width: 40, depth: 40, height: 20, cell_size: 0.05 };
        let wheel = Shape::Wheel { width: 0.2, radius: 0.3 };
        let footprint = Footprint::new(&grid, &wheel, Position { x: 1.0, z: 1.025 }, Turn::NONE);
        assert_eq!((footprint.z0, footprint.spans.len(), footprint.extent()), (14, 13, (18, 22)));
        let metres = |z| f64::from(footprint.lift_over(19, z)) / f64::from(CELL) * 0.05;
        assert_eq!(metres(20), 0.0, "its lowest line");
        let rim = 0.3 - (0.3_f64 * 0.3 - 0.15 * 0.15).sqrt();
        assert!((metres(17) - rim).abs() < 1e-6 && (metres(23) - rim).abs() < 1e-6);
        assert!((metres(14) - 0.3).abs() < 1e-6, "as high as its axle in front");
    }

    #[test]
    fn a_footprint_lists_its_tiles_once() {
        let grid = Grid { width: 20, depth: 20, ..GRID };
        let plate = Shape::Box { width: 1.0, depth: 1.0 };
        let tiles = |x, z| {
            let footprint = Footprint::new(&grid, &plate, Position { x, z }, Turn::NONE);
            footprint.tiles(&grid)
        };
        assert_eq!(tiles(0.5, 0.5), [0]);
        assert_eq!(tiles(1.6, 1.6), [0, 1, 3, 4]);
        assert_eq!(tiles(3.5, 1.6), [1, 2, 4, 5]);
    }
}
