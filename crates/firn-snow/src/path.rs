//! Columns along a path, as a plough takes them.

use super::body::Position;
use super::column_set::ColumnSet;
use super::footprint::Footprint;
use super::grid::{ColumnRect, Grid};
use super::shape::{Shape, Turn};

/// The columns whose centres lie within half a width \[m\] of a path through some points \[x, z\], as rectangles that
/// do not overlap. Each leg has one column at least, where it is in the grid.
pub fn columns_along(grid: &Grid, path: &[[f64; 2]], width: f64) -> Vec<ColumnRect> {
    let mut columns = ColumnSet::default();
    for leg in path.windows(2) {
        let [[from_x, from_z], [to_x, to_z]] = [leg[0], leg[1]];
        let (x, z) = (to_x - from_x, to_z - from_z);
        let shape = Shape::Capsule { length: x.hypot(z) + width, radius: width / 2.0 };
        let middle = Position { x: (from_x + to_x) / 2.0, z: (from_z + to_z) / 2.0 };
        let footprint = Footprint::new(grid, &shape, middle, Turn::new(x.atan2(z).to_degrees()));
        for (z, &span) in (footprint.z0..).zip(&footprint.spans) {
            columns.add(z, span);
        }
    }
    columns.rects()
}

/// Rows of columns that a path is looked for in, leg by leg, at the most.
pub fn rows_along(grid: &Grid, path: &[[f64; 2]], width: f64) -> u64 {
    let rows = |leg: &[[f64; 2]]| {
        let rows = ((leg[1][1] - leg[0][1]).abs() + width) / grid.cell_size + 2.0;
        (rows as u64).min(u64::from(grid.depth))
    };
    path.windows(2).map(rows).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { width: 40, depth: 30, height: 20, cell_size: 0.25 };

    /// Distance of a point from a path.
    fn distance(path: &[[f64; 2]], [x, z]: [f64; 2]) -> f64 {
        let from = |leg: &[[f64; 2]]| {
            let (dx, dz) = (leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]);
            let along = (x - leg[0][0]) * dx + (z - leg[0][1]) * dz;
            let part = (along / (dx * dx + dz * dz).max(1e-12)).clamp(0.0, 1.0);
            (x - leg[0][0] - part * dx).hypot(z - leg[0][1] - part * dz)
        };
        path.windows(2).map(from).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_straight_run_is_one_rectangle() {
        let along_x = columns_along(&GRID, &[[-5.0, 3.0], [50.0, 3.0]], 1.0);
        assert_eq!(along_x, [ColumnRect { x0: 0, z0: 10, x1: 40, z1: 14 }]);
        let along_z = columns_along(&GRID, &[[3.0, -5.0], [3.0, 50.0]], 1.0);
        assert_eq!(along_z, [ColumnRect { x0: 10, z0: 0, x1: 14, z1: 30 }]);
        assert_eq!(columns_along(&GRID, &[[-5.0, -5.0], [-9.0, -5.0]], 1.0), []);
    }

    #[test]
    fn a_path_takes_the_columns_near_it_and_each_once() {
        let paths: [&[[f64; 2]]; 3] = [
            &[[1.0, 1.0], [6.0, 4.5], [2.0, 6.1]],
            &[[1.1, 1.0], [8.2, 1.3], [8.2, 1.3], [1.2, 1.5], [8.0, 6.0]],
            &[[0.0, 0.0], [9.9, 7.4]],
        ];
        for path in paths {
            for width in [0.4, 1.0, 2.7] {
                let rects = columns_along(&GRID, path, width);
                for z in 0..GRID.depth {
                    for x in 0..GRID.width {
                        let centre = [x, z].map(|i| (f64::from(i) + 0.5) * GRID.cell_size);
                        let inside = distance(path, centre) <= width / 2.0 + 1e-6;
                        let found = rects.iter().filter(|rect| rect.contains(x, z)).count();
                        assert_eq!(found, usize::from(inside), "({x}, {z}) of {path:?}, {width} m");
                    }
                }
            }
        }
    }
}
