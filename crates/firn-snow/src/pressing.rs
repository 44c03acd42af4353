//! How snow gives way under what stands on it.

#[cfg(feature = "serde")]
mod fields;

use crate::grid::CELL;

/// How snow gives way under what stands on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Pressing {
    /// It creeps, as under its own weight.
    #[default]
    Creep,
    /// It is pressed to where it carries the load. This is the time \[s\] in which a full cell would be pressed
    /// flat, 0 for at once.
    Within(f64),
}

impl Pressing {
    /// The longest time \[s\].
    pub const LONGEST: f64 = 10.0;

    /// Thickness quanta by which a cell is pressed at the most in a cycle of `dt` seconds, at least 1; none
    /// where it creeps.
    pub fn step(self, dt: f64) -> Option<u32> {
        let Pressing::Within(seconds) = self else { return None };
        let full = f64::from(CELL);
        Some((full * dt / seconds).ceil().clamp(1.0, full) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_pressed_by_its_share_of_the_time() {
        assert_eq!(Pressing::Creep.step(0.25), None);
        assert_eq!(Pressing::Within(0.25).step(1.0 / 60.0), Some(CELL.div_ceil(15)));
        assert_eq!(Pressing::Within(10.0).step(1e-12), Some(1));
        assert_eq!(Pressing::Within(0.1).step(0.25), Some(CELL));
        assert_eq!(Pressing::Within(0.0).step(1.0 / 60.0), Some(CELL), "at once");
    }
}
