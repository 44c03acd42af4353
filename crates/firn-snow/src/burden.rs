//! Snow that lies on an object instead of under it.

use super::column::Cell;

/// Parts of a degree in which heat is counted, so that a sum does not depend on its order.
const DEGREE: f32 = 256.0;

/// Snow that lies on an object: a sum over the columns under it, in whole quanta.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Burden {
    /// Areal mass, in quanta of one column.
    pub mass: u128,
    /// Thickness, in quanta.
    pub thickness: u128,
    /// Mass times temperature, in quanta times 1/256 °C.
    pub heat: i128,
}

impl Burden {
    /// Snow of a mass, a thickness, both in quanta, and a temperature \[°C\] on each of some columns.
    pub fn of(columns: u64, mass: u64, thickness: u64, celsius: f32) -> Burden {
        let mass = u128::from(columns) * u128::from(mass);
        Burden {
            mass,
            thickness: u128::from(columns) * u128::from(thickness),
            // What may be told of temperatures is far from the ends of the number.
            heat: mass as i128 * (celsius * DEGREE).round() as i128,
        }
    }

    /// Part of a cell's snow, by its mass in quanta of one column.
    pub fn part(mass: u128, cell: &Cell) -> Burden {
        let celsius = (cell.celsius() * DEGREE).round() as i128;
        let thickness = mass * u128::from(cell.thickness) / u128::from(cell.mass.max(1));
        Burden { mass, thickness: thickness.max(1), heat: mass as i128 * celsius }
    }

    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.mass == 0
    }

    /// Adds more.
    pub fn add(&mut self, other: Burden) {
        self.mass += other.mass;
        self.thickness += other.thickness;
        self.heat += other.heat;
    }

    /// Cuts off what is thicker than so many quanta. Returns the mass of that.
    pub fn cut(&mut self, thickest: u128) -> u128 {
        if self.thickness <= thickest {
            return 0;
        }
        let left = self.mass * thickest / self.thickness;
        let cut = self.mass - left;
        *self = match left {
            0 => Burden::default(),
            _ => Burden { mass: left, thickness: thickest, heat: self.heat_of(left) },
        };
        cut
    }

    /// Heat of a part of it, by the part's mass.
    fn heat_of(&self, mass: u128) -> i128 {
        self.heat * mass as i128 / self.mass.max(1) as i128
    }

    /// Takes off what some of the columns have of it, out of so many that it lies on, each the same whole quanta of
    /// mass, and no denser than it is. Returns what each of them gets; nothing where that is less than a quantum.
    pub fn take(&mut self, columns: u64, of: u64) -> Option<Cell> {
        let of = u128::from(of.max(1));
        let mass = u32::try_from(self.mass / of).ok()?;
        let thickness = u32::try_from(self.thickness.div_ceil(of)).ok()?;
        if columns == 0 || mass == 0 || thickness == 0 {
            return None;
        }
        let taken = u128::from(columns) * u128::from(mass);
        let temperature = (self.heat / self.mass as i128) as f32 / DEGREE;
        let left = self.mass - taken;
        // What is left keeps the temperature of all of it.
        self.heat = self.heat_of(left);
        let laid = u128::from(columns) * u128::from(thickness);
        self.thickness = self.thickness.saturating_sub(laid);
        self.mass = left;
        if left == 0 {
            *self = Burden::default();
        }
        Some(Cell { mass, thickness, temperature, stress: 0.0 })
    }

    /// Whether it is not impossible: neither more than a field of the highest columns holds, nor warmer than ice.
    pub fn is_sound(&self) -> bool {
        const MOST: u128 = 1 << 60;
        const COLDEST: i128 = -300 * 256;
        let Burden { mass, thickness, heat } = *self;
        mass < MOST
            && thickness < MOST
            && (mass > 0 || thickness == 0)
            && (mass as i128 * COLDEST..=0).contains(&heat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn density(burden: &Burden) -> f64 {
        burden.mass as f64 / burden.thickness as f64
    }

    #[test]
    fn what_is_taken_and_what_is_left_are_all_of_it() {
        let mut burden = Burden::of(7, 1_000_003, 5_000_001, -3.2);
        burden.add(Burden::of(3, 999, 7, -11.7));
        let all = burden;
        let mut laid = Burden::default();
        for (columns, of) in [(2, 10), (3, 8), (1, 5), (4, 4)] {
            let Some(cell) = burden.take(columns, of) else { continue };
            assert!((-3.3..=-3.1).contains(&cell.temperature), "{}", cell.temperature);
            laid.mass += u128::from(columns) * u128::from(cell.mass);
            laid.thickness += u128::from(columns) * u128::from(cell.thickness);
            let (own, before) = (f64::from(cell.mass) / f64::from(cell.thickness), density(&all));
            assert!(own <= before * 1.001, "{own} is denser than {before}");
            assert!(burden.is_sound(), "{burden:?}");
        }
        assert_eq!(laid.mass + burden.mass, all.mass);
        assert!((laid.thickness + burden.thickness).abs_diff(all.thickness) < 20);
        assert!(burden.mass < 4);
    }

    #[test]
    fn what_is_too_thick_is_cut() {
        let mut burden = Burden::of(10, 600, 100, -2.0);
        assert_eq!(burden.cut(1000), 0);
        assert_eq!(burden.cut(250), 4500);
        assert_eq!(burden, Burden { mass: 1500, thickness: 250, heat: 1500 * -512 });
        assert_eq!(burden.cut(0), 1500);
        assert_eq!(burden, Burden::default());
    }

    #[test]
    fn less_than_a_quantum_a_column_stays() {
        let mut burden = Burden::of(1, 5, 9, -1.0);
        assert_eq!(burden.take(3, 6), None);
        assert_eq!(burden, Burden::of(1, 5, 9, -1.0));
        assert_eq!(burden.take(0, 1), None, "no column is left");
    }
}
