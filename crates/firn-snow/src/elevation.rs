//! How high ground, snow surfaces and the bottoms of objects lie.

use std::ops::Sub;

use super::grid::{CELL, Grid};

/// An elevation above level 0, in thickness quanta of h·2⁻²⁴: exact, whatever the relief.
///
/// A device has no 64-bit integers. There it is a number of whole cells and the [fraction](Self::fraction)
/// of one that is left (`shaders/shared/elevation.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(transparent))]
pub struct Elevation(pub i64);

impl Elevation {
    /// The lowest elevation that a device can hold.
    pub const LOWEST: Elevation = Elevation::of_cells(i32::MIN, 0);
    /// The highest.
    pub const HIGHEST: Elevation = Elevation::of_cells(i32::MAX, CELL - 1);

    /// The elevation that is nearest to a number of metres.
    #[inline]
    pub fn new(grid: &Grid, metres: f64) -> Elevation {
        Elevation((metres / grid.cell_size * f64::from(CELL)).round() as i64)
    }

    /// A number of whole cells, and quanta above them.
    #[inline]
    pub const fn of_cells(cells: i32, fraction: u32) -> Elevation {
        Elevation(cells as i64 * CELL as i64 + fraction as i64)
    }

    /// Whole cells below it, rounded down.
    #[inline]
    pub fn cells(self) -> i32 {
        self.0.div_euclid(i64::from(CELL)) as i32
    }

    /// Quanta above those cells, less than [`CELL`].
    #[inline]
    pub fn fraction(self) -> u32 {
        self.0.rem_euclid(i64::from(CELL)) as u32
    }

    /// The elevation of what lies so thick on it, in quanta.
    #[inline]
    pub fn under(self, thickness: u32) -> Elevation {
        Elevation(self.0 + i64::from(thickness))
    }

    /// The elevation so far below it, in quanta.
    #[inline]
    pub fn less(self, depth: u32) -> Elevation {
        Elevation(self.0 - i64::from(depth))
    }

    /// In metres.
    #[inline]
    pub fn metres(self, grid: &Grid) -> f64 {
        self.0 as f64 * grid.cell_size / f64::from(CELL)
    }
}

impl Sub for Elevation {
    type Output = i64;

    /// Quanta from one up to another.
    #[inline]
    fn sub(self, other: Elevation) -> i64 {
        self.0 - other.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_an_elevation_make_it_again() {
        for quanta in [0, 1, -1, i64::from(CELL), -i64::from(CELL), 7 << 40, -(7 << 40) - 3] {
            let elevation = Elevation(quanta);
            assert!(elevation.fraction() < CELL);
            assert_eq!(Elevation::of_cells(elevation.cells(), elevation.fraction()), elevation);
        }
        assert_eq!((Elevation(-1).cells(), Elevation(-1).fraction()), (-1, CELL - 1));
    }

    #[test]
    fn metres_are_told_to_the_quantum_on_any_mountain() {
        let grid = Grid { cell_size: 0.02, ..Grid::default() };
        let peak = Elevation::new(&grid, 8848.86).under(3);
        assert_eq!(Elevation::new(&grid, peak.metres(&grid)), peak);
        assert!((peak.metres(&grid) - 8848.86).abs() < 1e-8);
        let trench = Elevation::new(&grid, -10_935.0);
        assert_eq!(trench.cells(), -546_750);
        assert!((Elevation::LOWEST..=Elevation::HIGHEST).contains(&trench));
    }
}
