//! Cuts a column into cells of full thickness, the last one thinner.
//!
//! New cells are written over old ones in place: source cells are at most one cell thick, so that
//! a new cell's index never exceeds its source's.

use super::column::{Cell, mixed};
use super::grid::CELL;

/// Re-cuts a column's cells, from the ground up. Mass and thickness of the whole are unchanged to
/// the quantum; every new cell has mass; stresses are to be evaluated anew.
pub fn recut(cells: &mut Vec<Cell>) {
    let mut new = Cell::default();
    let mut finished = 0;
    let mut below = None;
    for i in 0..cells.len() {
        let mut source = Source::new(below, cells[i], cells.get(i + 1).copied());
        below = Some(cells[i]);
        while source.taken_thickness < source.cell.thickness {
            source.pour(&mut new);
            if new.thickness == CELL {
                cells[finished] = new;
                finished += 1;
                new = Cell::default();
            }
        }
    }
    if new.thickness > 0 {
        cells[finished] = new;
        finished += 1;
    }
    cells.truncate(finished);
}

/// An old cell, and what has been taken from it so far.
struct Source {
    cell: Cell,
    /// Slope of density over relative height, as a part of the cell's density.
    density_slope: f32,
    /// Slope of temperature over the fraction of mass \[°C\].
    temperature_slope: f32,
    taken_mass: u32,
    taken_thickness: u32,
}

impl Source {
    #[inline]
    fn new(below: Option<Cell>, cell: Cell, above: Option<Cell>) -> Source {
        let (mut density_slope, mut temperature_slope) = (0.0, 0.0);
        if let (Some(below), Some(above)) = (below, above) {
            density_slope = van_leer(density(below), density(cell), density(above)) / density(cell);
            temperature_slope = van_leer(below.temperature, cell.temperature, above.temperature);
        }
        Source { cell, density_slope, temperature_slope, taken_mass: 0, taken_thickness: 0 }
    }

    /// Moves a piece into a new cell: as much as the cell has room for.
    #[inline]
    fn pour(&mut self, new: &mut Cell) {
        let left = self.cell.thickness - self.taken_thickness;
        let piece = left.min(CELL - new.thickness);
        let mut mass = self.cell.mass - self.taken_mass;
        if piece < left {
            // At least a quantum is kept for the last piece. Every new cell holds the last piece
            // of some source, because sources are no thicker than it is: so every one has mass.
            mass = self.mass_of(piece).min(mass - 1);
        }
        let temperature = self.temperature_of(mass);
        new.temperature = if new.mass == 0 {
            temperature
        } else {
            mixed(new.temperature, new.mass, temperature, mass)
        };
        new.mass += mass;
        new.thickness += piece;
        self.taken_mass += mass;
        self.taken_thickness += piece;
    }

    /// Mass of the next piece of a thickness, with density linear over height.
    #[inline]
    fn mass_of(&self, piece: u32) -> u32 {
        let thickness = self.cell.thickness as f32;
        let u0 = self.taken_thickness as f32 / thickness;
        let u1 = (self.taken_thickness + piece) as f32 / thickness;
        let (v0, v1) = (u0 - 0.5, u1 - 0.5);
        let fraction = (u1 - u0) + self.density_slope * (v1 * v1 - v0 * v0) / 2.0;
        (fraction * self.cell.mass as f32).max(0.0) as u32
    }

    /// Mean temperature of the next piece of a mass, with temperature linear over mass.
    #[inline]
    fn temperature_of(&self, mass: u32) -> f32 {
        let whole = self.cell.mass as f32;
        let w0 = self.taken_mass as f32 / whole;
        let w1 = (self.taken_mass + mass) as f32 / whole;
        self.cell.temperature + self.temperature_slope * ((w0 + w1) / 2.0 - 0.5)
    }
}

/// Density in mass quanta per thickness quantum.
#[inline]
fn density(cell: Cell) -> f32 {
    cell.mass as f32 / cell.thickness as f32
}

/// The van Leer slope of a value between its neighbours.
#[inline]
fn van_leer(below: f32, value: f32, above: f32) -> f32 {
    let (lower, upper) = (value - below, above - value);
    if lower * upper > 0.0 { 2.0 * lower * upper / (lower + upper) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cell(mass: u32, thickness: u32, temperature: f32) -> Cell {
        Cell { mass, thickness, temperature, stress: 0.0 }
    }

    #[test]
    fn full_cells_stay_as_they_are() {
        let cells: Vec<Cell> =
            (0..5).map(|i| cell(1000 + 300 * i, CELL, -1.5 * i as f32)).collect();
        let mut cut = cells.clone();
        cut.push(cell(77, CELL / 3, -9.0));
        let expected = cut.clone();
        recut(&mut cut);
        assert_eq!(cut, expected);
        let mut nothing = Vec::new();
        recut(&mut nothing);
        assert!(nothing.is_empty());
    }

    #[test]
    fn halves_join_to_a_whole() {
        let mut cells =
            vec![cell(600, CELL / 2, -2.0), cell(200, CELL / 2, -6.0), cell(500, CELL / 2, -8.0)];
        recut(&mut cells);
        assert_eq!(cells, [cell(800, CELL, -3.0), cell(500, CELL / 2, -8.0)]);
    }

    #[test]
    fn a_cut_cell_is_denser_where_its_denser_neighbour_is() {
        let thickness = CELL / 4 * 3;
        let mut cells = vec![
            cell(900_000, thickness, -2.0),
            cell(600_000, thickness, -4.0),
            cell(300_000, thickness, -6.0),
        ];
        recut(&mut cells);
        // Density falls by half of its mean over the cell: its lower third holds 1/3 + 1/18 of it.
        assert!(cells[0].mass.abs_diff(900_000 + 600_000 / 18 * 7) < 10, "{:?}", cells[0]);
        let piece = -4.0 - 2.0 * (7.0 / 36.0 - 0.5);
        let mean = (900_000.0 * -2.0 + 233_333.0 * piece) / 1_133_333.0;
        assert!((cells[0].temperature - mean).abs() < 1e-3, "{} {mean}", cells[0].temperature);
        assert_eq!(cells.iter().map(|c| c.mass).sum::<u32>(), 1_800_000);
    }

    #[test]
    fn snow_of_one_temperature_keeps_it_exactly() {
        let mut cells: Vec<Cell> = (1..40).map(|i| cell(77_777 * i, CELL / 40 * i, -7.3)).collect();
        recut(&mut cells);
        assert!(cells.iter().all(|c| c.temperature == -7.3));
    }

    #[test]
    fn every_new_cell_has_mass_even_where_there_is_hardly_any() {
        let mut cells = vec![cell(1, CELL / 3 * 2, -3.0); 30];
        recut(&mut cells);
        assert!(cells.iter().all(|c| c.mass > 0), "{cells:?}");
        assert_eq!(cells.iter().map(|c| c.mass).sum::<u32>(), 30);
        let mut cells = vec![cell(5, CELL - 1, -3.0), cell(1 << 28, CELL, -3.0)];
        recut(&mut cells);
        assert_eq!(cells.len(), 2);
        assert!(cells[1].mass > 0);
    }

    fn any_cell() -> impl Strategy<Value = Cell> {
        let mass = prop_oneof![1..4_u32, 1..5_000_000_u32];
        let thickness = prop_oneof![1..100_u32, 1..=CELL, Just(CELL)];
        (mass, thickness, -40.0..0.0_f32).prop_map(|(m, d, t)| cell(m, d, t))
    }

    proptest! {
        #[test]
        fn a_recut_loses_nothing(cells in prop::collection::vec(any_cell(), 0..60)) {
            let sums = |cells: &[Cell]| {
                (cells.iter().map(|c| c.mass).sum::<u32>(),
                 cells.iter().map(|c| c.thickness).sum::<u32>())
            };
            let mut cut = cells.clone();
            recut(&mut cut);
            prop_assert_eq!(sums(&cut), sums(&cells));
            if let Some((last, full)) = cut.split_last() {
                prop_assert!(full.iter().all(|c| c.thickness == CELL));
                prop_assert!((1..=CELL).contains(&last.thickness));
            }
            prop_assert!(cut.iter().all(|c| c.mass > 0));
            let range = |t: f32| cells.iter().any(|c| c.temperature >= t - 1e-4)
                && cells.iter().any(|c| c.temperature <= t + 1e-4);
            prop_assert!(cut.iter().all(|c| range(c.temperature)));
            let once = cut.clone();
            recut(&mut cut);
            prop_assert_eq!(cut, once, "a second re-cut has nothing to do");
        }
    }
}
