//! How an object is turned.

/// A heading θ, with its sine and cosine: forward is (sin θ, cos θ) in (x, z), to the right is
/// (cos θ, −sin θ). It is exact for quarter turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// sin θ.
    pub sin: f64,
    /// cos θ.
    pub cos: f64,
}

impl Turn {
    /// Not turned: forward is along z.
    pub const NONE: Turn = Turn { sin: 0.0, cos: 1.0 };

    /// Of a compass bearing \[°\].
    pub fn new(degrees: f64) -> Turn {
        let degrees = degrees.rem_euclid(360.0);
        // Quarter turns are taken out, so that a box turned by one is a box along the axes.
        let quarters = (degrees / 90.0).round();
        let (sin, cos) = (degrees - 90.0 * quarters).to_radians().sin_cos();
        match quarters as u32 % 4 {
            0 => Turn { sin, cos },
            1 => Turn { sin: cos, cos: -sin },
            2 => Turn { sin: -sin, cos: -cos },
            _ => Turn { sin: -cos, cos: sin },
        }
    }

    /// So far to the right and so far forward, along the axes x and z.
    pub fn to_world(self, right: f64, forward: f64) -> (f64, f64) {
        (right * self.cos + forward * self.sin, forward * self.cos - right * self.sin)
    }

    /// How far forward a place is, seen from the centre along x and z.
    pub fn forward_of(self, x: f64, z: f64) -> f64 {
        x * self.sin + z * self.cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_is_a_compass_bearing() {
        assert_eq!(Turn::new(0.0), Turn::NONE);
        assert_eq!(Turn::new(90.0).to_world(0.0, 2.0), (2.0, 0.0), "east");
        assert_eq!(Turn::new(180.0).to_world(0.0, 2.0), (0.0, -2.0), "south");
        assert_eq!(Turn::new(270.0).to_world(1.0, 0.0), (0.0, 1.0), "heading west, right is north");
        let (x, z) = Turn::new(45.0).to_world(0.0, 2.0_f64.sqrt());
        assert!((x - 1.0).abs() < 1e-12 && (z - 1.0).abs() < 1e-12, "north-east");
        assert!((Turn::new(30.0).forward_of(1.0, 0.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn headings_repeat_after_a_full_turn() {
        for degrees in [-36_000.0, -360.0, 360.0, 720.0, 36_000.0] {
            assert_eq!(Turn::new(degrees), Turn::NONE);
            let (turned, plain) = (Turn::new(degrees + 33.25), Turn::new(33.25));
            assert!((turned.sin - plain.sin).abs() < 1e-12, "{degrees}");
        }
    }
}
