//! How much of each column an outline covers.

use super::body::Position;
use super::grid::{ColumnRect, Grid};
use super::shape::{Shape, Turn};

/// Samples along each side of a column.
const SIDE: u32 = 8;

/// How much of each column an outline covers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coverage {
    /// The columns, as far as they are in the grid.
    pub columns: ColumnRect,
    /// The share of each that is covered, row by row, in parts of [`Coverage::WHOLE`].
    pub shares: Vec<u8>,
}

impl Coverage {
    /// The share of a column that is covered whole.
    pub const WHOLE: u32 = SIDE * SIDE;

    /// Samples an outline; `None` where it covers nothing of the grid.
    pub fn new(grid: &Grid, shape: &Shape, centre: Position, turn: Turn) -> Option<Coverage> {
        let h = grid.cell_size;
        let reach = shape.reach(turn);
        let along = |low: f64, high: f64, cells: u32| {
            let first = ((low / h).floor().max(0.0) as u32).min(cells);
            (first, ((high / h).ceil().max(0.0) as u32).clamp(first, cells))
        };
        let (x0, x1) = along(centre.x + reach.x0, centre.x + reach.x1, grid.width);
        let (z0, z1) = along(centre.z + reach.z0, centre.z + reach.z1, grid.depth);
        let columns = ColumnRect { x0, z0, x1, z1 };
        let width = (x1 - x0) as usize;
        let mut shares = vec![0u8; width * (z1 - z0) as usize];
        let step = h / f64::from(SIDE);
        for row in z0 * SIDE..z1 * SIDE {
            let Some((low, high)) = shape.chord(turn, (f64::from(row) + 0.5) * step - centre.z)
            else {
                continue;
            };
            // Samples of the row that lie within the chord.
            let first = ((centre.x + low) / step - 0.5).ceil().max(f64::from(x0 * SIDE)) as u32;
            let end = ((centre.x + high) / step + 0.5).floor().min(f64::from(x1 * SIDE)) as u32;
            let line = (row / SIDE - z0) as usize * width;
            for x in first / SIDE..end.div_ceil(SIDE) {
                let samples = end.min((x + 1) * SIDE).saturating_sub(first.max(x * SIDE));
                shares[line + (x - x0) as usize] += samples as u8;
            }
        }
        if shares.iter().all(|share| *share == 0) {
            return Coverage::of_speck(grid, shape, centre);
        }
        Some(Coverage { columns, shares })
    }

    /// An upper bound of the columns that an outline covers, found without sampling it.
    pub fn most_columns(grid: &Grid, shape: &Shape, turn: Turn) -> u64 {
        let reach = shape.reach(turn);
        let along = |extent: f64, cells: u32| {
            ((extent / grid.cell_size) as u64).saturating_add(2).min(cells.into())
        };
        along(reach.x1 - reach.x0, grid.width) * along(reach.z1 - reach.z0, grid.depth)
    }

    /// The coverage of an outline that lies between all samples.
    fn of_speck(grid: &Grid, shape: &Shape, centre: Position) -> Option<Coverage> {
        let along = |metres: f64, cells: u32| {
            let column = (metres / grid.cell_size).floor();
            (0.0..f64::from(cells)).contains(&column).then_some(column as u32)
        };
        let (x, z) = (along(centre.x, grid.width)?, along(centre.z, grid.depth)?);
        let part = (shape.area() / grid.column_area() * f64::from(Coverage::WHOLE))
            .clamp(1.0, f64::from(Coverage::WHOLE));
        Some(Coverage {
            columns: ColumnRect { x0: x, z0: z, x1: x + 1, z1: z + 1 },
            shares: vec![part as u8],
        })
    }

    /// The columns (x, z) of which some is covered, row by row.
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let ColumnRect { x0, z0, x1, z1 } = self.columns;
        let places = (z0..z1).flat_map(move |z| (x0..x1).map(move |x| (x, z)));
        places.zip(&self.shares).filter(|(_, share)| **share > 0).map(|(place, _)| place)
    }

    /// How many columns are covered, in whole or in part.
    pub fn covered(&self) -> u64 {
        self.shares.iter().filter(|share| **share > 0).count() as u64
    }

    /// The share of column (x, z), which must be among its columns.
    #[inline]
    pub fn share(&self, x: u32, z: u32) -> u32 {
        let ColumnRect { x0, z0, x1, .. } = self.columns;
        let index = (z - z0) as usize * (x1 - x0) as usize + (x - x0) as usize;
        self.shares[index].into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { width: 40, depth: 40, height: 20, cell_size: 0.05 };

    fn covered(coverage: &Coverage) -> f64 {
        let sum: u32 = coverage.shares.iter().map(|&share| u32::from(share)).sum();
        f64::from(sum) / f64::from(Coverage::WHOLE) * GRID.column_area()
    }

    #[test]
    fn shares_add_up_to_the_area_wherever_an_outline_lies() {
        let shapes = [
            Shape::Box { width: 0.1, depth: 0.3 },
            Shape::Disk { radius: 0.2 },
            Shape::Capsule { length: 0.5, radius: 0.05 },
        ];
        for shape in shapes {
            for i in 0..20 {
                let centre = Position { x: 1.0 + 0.007 * f64::from(i), z: 1.013 };
                let turn = Turn::new(17.0 * f64::from(i));
                let coverage = Coverage::new(&GRID, &shape, centre, turn).expect("in the grid");
                let error = (covered(&coverage) / shape.area() - 1.0).abs();
                assert!(error < 0.1, "{shape:?} at {i}: {error}");
            }
        }
    }

    #[test]
    fn a_box_on_whole_columns_covers_just_them() {
        let shape = Shape::Box { width: 0.1, depth: 0.05 };
        let coverage =
            Coverage::new(&GRID, &shape, Position { x: 0.1, z: 0.075 }, Turn::NONE).unwrap();
        let whole: Vec<_> = coverage.iter().collect();
        assert_eq!(whole, [(1, 1), (2, 1)]);
        assert!(whole.iter().all(|&(x, z)| coverage.share(x, z) == Coverage::WHOLE));
    }

    #[test]
    fn a_speck_covers_some_of_its_column_and_nothing_outside() {
        let speck = Shape::Disk { radius: 0.001 };
        let at = |x, z| Coverage::new(&GRID, &speck, Position { x, z }, Turn::NONE);
        assert_eq!(at(0.07, 0.02).unwrap().shares, [1]);
        assert_eq!(at(-0.5, 0.02), None);
        let large = Shape::Box { width: 9.0, depth: 9.0 };
        let all = Coverage::new(&GRID, &large, Position { x: 0.0, z: 0.0 }, Turn::NONE).unwrap();
        assert_eq!(all.columns, GRID.all());
        assert!(all.shares.iter().all(|&share| u32::from(share) == Coverage::WHOLE));
    }
}
