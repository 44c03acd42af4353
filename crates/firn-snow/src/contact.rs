//! How objects that stand on the snow touch it.

use super::elevation::Elevation;
use super::footprint::Footprint;
use super::grid::CELL;
use super::material::GRAVITY;

/// Depth δ = h/20 over which contact is soft, in thickness quanta.
pub const CONTACT_DEPTH: u32 = (CELL + 10) / 20;

/// How high an object stands on the snow, and on how much of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Footing {
    /// Elevation of the bottom.
    pub bottom: Elevation,
    /// Σ of the columns' shares s, in units of 1/`CONTACT_DEPTH`.
    pub support: u64,
}

/// How an object touches the snow, as evaluated after edits and before every cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Contact {
    /// Elevation of the bottom.
    pub bottom: Elevation,
    /// Bottom when the object was placed or last moved.
    pub reference: Elevation,
    /// Σ of the columns' shares s, in units of 1/`CONTACT_DEPTH`.
    pub support: u64,
    /// Contact area A \[m²\].
    pub area: f32,
    /// Pressure q \[Pa\] on the area in contact.
    pub pressure: f32,
    /// Whether the footing was that of the last cycle before it, when it was evaluated.
    pub resting: bool,
    /// Footing in the last cycle so far; none where there was none since the object was put there.
    ///
    /// What is evaluated is compared with it, not with the evaluation before: so it makes no
    /// difference how often contact is evaluated between two cycles.
    pub last_cycle: Option<Footing>,
}

impl Contact {
    /// Evaluates contact of an object with a mass \[kg\] over the footprints it stands on, each with the elevations
    /// of its columns, less its underside's lift over them. `widths` get how wide the load of each spreads \[m\].
    #[inline]
    pub fn evaluate<'a, E>(
        mass: f64,
        footprints: impl Iterator<Item = (&'a Footprint, E)> + Clone,
        widths: &mut [f32],
    ) -> Contact
    where
        E: Iterator<Item = Elevation> + Clone,
    {
        let surfaces = footprints.clone().flat_map(|(_, elevations)| elevations);
        let bottom = surfaces.max().unwrap_or_default();
        let (mut support, mut area) = (0, 0.0);
        for ((footprint, elevations), width) in footprints.zip(widths) {
            let shares = elevations.map(|e| u64::from(share_units(bottom, e))).sum::<u64>();
            let own = shares + u64::from(footprint.overhang) * u64::from(CONTACT_DEPTH);
            let full = u64::from(footprint.columns) * u64::from(CONTACT_DEPTH);
            let touching = footprint.area as f32 * (own as f32 / full as f32);
            *width = touching.sqrt();
            area += touching;
            support += own;
        }
        let pressure = (mass * GRAVITY) as f32 / area;
        Contact { bottom, reference: bottom, support, area, pressure, ..Contact::default() }
    }

    /// How high and on how much it stands.
    #[inline]
    pub fn footing(&self) -> Footing {
        Footing { bottom: self.bottom, support: self.support }
    }
}

/// A column's share s of contact in units of 1/`CONTACT_DEPTH`: 1 at the bottom's level, 0 from δ
/// below it.
#[inline]
pub fn share_units(bottom: Elevation, surface: Elevation) -> u32 {
    let below = (bottom - surface).clamp(0, CONTACT_DEPTH.into());
    CONTACT_DEPTH - below as u32
}

/// A column's share s of contact, from 0 to 1.
#[inline]
pub fn share(bottom: Elevation, surface: Elevation) -> f32 {
    share_units(bottom, surface) as f32 / CONTACT_DEPTH as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Position, Shape, Turn};

    #[test]
    fn contact_is_soft_over_a_twentieth_of_a_cell() {
        let shape = Shape::Box { width: 0.8, depth: 0.2 };
        let grid = Grid { width: 10, depth: 6, height: 20, cell_size: 0.2 };
        let footprint = Footprint::new(&grid, &shape, Position { x: 0.8, z: 0.5 }, Turn::NONE);
        assert_eq!(footprint.columns, 4);
        let top = Elevation::of_cells(5, 0);
        // Half of δ below the top carries half, δ and more below it nothing, a chasm neither.
        let depths = [0, CONTACT_DEPTH / 2, CONTACT_DEPTH, 3 * CONTACT_DEPTH];
        let below = |depth: u32| Elevation(top.0 - i64::from(depth));
        let chasm = Elevation::of_cells(-65_536, 9);
        let elevations = depths.map(below).into_iter().chain([chasm]);
        let mut widths = [0.0];
        let footprints = std::iter::once((&footprint, elevations));
        let contact = Contact::evaluate(10.0, footprints, &mut widths);
        assert_eq!(widths, [contact.area.sqrt()]);
        assert_eq!((contact.bottom, contact.reference), (top, top));
        let half = u64::from(CONTACT_DEPTH - CONTACT_DEPTH / 2);
        assert_eq!(contact.support, u64::from(CONTACT_DEPTH) + half);
        assert!((contact.area - 0.16 * 1.5 / 4.0).abs() < 1e-6);
        assert!((contact.pressure - 98.1 / 0.06).abs() < 0.01);
        assert_eq!(share(top, top), 1.0);
        assert_eq!(share(top, chasm), 0.0);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_contact_that_was_saved_without_its_last_cycle_is_read() {
        let (bottom, reference) = (Elevation(7), Elevation(9));
        let contact = Contact { bottom, reference, support: 5, ..Contact::default() };
        let mut saved = serde_json::to_value(contact).unwrap();
        assert!(saved.as_object_mut().unwrap().remove("last_cycle").is_some());
        assert_eq!(serde_json::from_value::<Contact>(saved).unwrap(), contact);
    }
}
