//! Objects on the snow: what they stand on, and where.

use super::footprint::Footprint;
use super::grid::Grid;
use super::motion::Motion;
use super::shape::{Shape, Turn};

/// Most footprints of an object. A device sums up their contact side by side.
pub const MOST_FOOTPRINTS: usize = 16;

/// A horizontal position \[m\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Position {
    /// Along x \[m\].
    pub x: f64,
    /// Along z \[m\].
    pub z: f64,
}

/// One of several outlines on which an object stands: a foot, or a wheel.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Part {
    /// Its outline from above.
    pub shape: Shape,
    /// Where its centre is, seen from the object's \[m\]: x to the object's right, z forward.
    pub offset: Position,
    /// How far it is turned against the object \[°\], clockwise from above.
    #[cfg_attr(feature = "serde", serde(default))]
    #[cfg_attr(feature = "schema", schema(minimum = -36_000, maximum = 36_000))]
    pub heading: f64,
}

/// A rigid, level object that stands on the snow.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Body {
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: f64,
    /// Outline from above; none where it stands on several `footprints`.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub shape: Option<Shape>,
    /// The outlines on which it stands, where it is not one `shape`.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    #[cfg_attr(feature = "schema", schema(max_items = 16))]
    pub footprints: Vec<Part>,
    /// Where its centre is \[m\].
    pub position: Position,
    /// Compass bearing of its front \[°\]: 0 along +z (north), 90 along +x (east).
    #[cfg_attr(feature = "serde", serde(default))]
    #[cfg_attr(feature = "schema", schema(minimum = -36_000, maximum = 36_000))]
    pub heading: f64,
    /// Whether it is held up and does not press the snow.
    #[cfg_attr(feature = "serde", serde(default))]
    pub airborne: bool,
    /// Whether snow that falls on its columns lies on it, not under it.
    ///
    /// Objects that were stored before there was a choice let it fall through.
    #[cfg_attr(feature = "serde", serde(default))]
    pub shelters: bool,
    /// How it moves by itself.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub motion: Motion,
}

/// What an object keeps from the columns under it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cover {
    /// Snow that falls there lies on the object.
    pub snow: bool,
    /// Clearings leave the snow on which it stands.
    pub clearings: bool,
}

impl Default for Body {
    fn default() -> Body {
        Body {
            mass: 0.0,
            shape: None,
            footprints: Vec::new(),
            position: Position::default(),
            heading: 0.0,
            airborne: false,
            shelters: true,
            motion: Motion::default(),
        }
    }
}

impl Part {
    /// Memory that it takes \[bytes\].
    pub fn bytes(&self) -> usize {
        size_of::<Part>() + self.shape.heap_bytes()
    }
}

impl Body {
    /// The outlines on which it stands, each with where its centre is and how it is turned.
    pub fn outlines(&self) -> impl Iterator<Item = (&Shape, Position, Turn)> {
        let whole = self.shape.iter().map(|shape| (shape, self.position, Turn::new(self.heading)));
        let turn = Turn::new(self.heading);
        let parts = self.footprints.iter().map(move |part| {
            let (x, z) = turn.to_world(part.offset.x, part.offset.z);
            let centre = Position { x: self.position.x + x, z: self.position.z + z };
            (&part.shape, centre, Turn::new(self.heading + part.heading))
        });
        whole.chain(parts)
    }

    /// The columns under each of its outlines; `None` where none of them is in the grid.
    pub fn on(&self, grid: &Grid) -> Option<Vec<Footprint>> {
        let footprints: Vec<Footprint> = self
            .outlines()
            .map(|(shape, centre, turn)| Footprint::new(grid, shape, centre, turn))
            .collect();
        footprints.iter().any(|footprint| !footprint.spans.is_empty()).then_some(footprints)
    }

    /// The smallest rectangle along the axes that holds it \[m\]: its lowest and its highest corner.
    pub fn bounds(&self) -> (Position, Position) {
        let mut low = Position { x: f64::INFINITY, z: f64::INFINITY };
        let mut high = Position { x: f64::NEG_INFINITY, z: f64::NEG_INFINITY };
        for (shape, centre, turn) in self.outlines() {
            let reach = shape.reach(turn);
            low.x = low.x.min(centre.x + reach.x0);
            low.z = low.z.min(centre.z + reach.z0);
            high.x = high.x.max(centre.x + reach.x1);
            high.z = high.z.max(centre.z + reach.z1);
        }
        (low, high)
    }

    /// Memory that it takes beside its own size \[bytes\].
    pub fn heap_bytes(&self) -> usize {
        let footprints = self.footprints.iter().map(Part::bytes).sum::<usize>();
        let path = size_of_val(&self.motion.path[..]);
        self.shape.as_ref().map_or(0, Shape::heap_bytes) + footprints + path
    }

    /// Whether it stands where another does, and on the same outlines, whatever it weighs and however it moves.
    pub fn stands_as(&self, other: &Body) -> bool {
        let Body { shape, footprints, position, heading, airborne, .. } = other;
        (&self.shape, &self.footprints, self.position, self.heading, self.airborne)
            == (shape, footprints, *position, *heading, *airborne)
    }

    /// What it keeps from the columns under it.
    pub fn cover(&self) -> Cover {
        Cover { snow: self.shelters, clearings: !self.airborne }
    }

    /// What it weighs on the snow \[kg\]: nothing while it is held up.
    pub fn load(&self) -> f64 {
        if self.airborne { 0.0 } else { self.mass }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { width: 40, depth: 40, height: 20, cell_size: 0.1 };

    fn foot(x: f64) -> Part {
        let shape = Shape::Box { width: 0.1, depth: 0.3 };
        Part { shape, offset: Position { x, z: 0.0 }, heading: 0.0 }
    }

    #[test]
    fn feet_stand_beside_each_other_and_turn_with_the_walker() {
        let walker = |heading| Body {
            mass: 80.0,
            footprints: vec![foot(-0.2), foot(0.2)],
            position: Position { x: 2.05, z: 2.05 },
            heading,
            ..Body::default()
        };
        let columns = |heading| -> Vec<Vec<(u32, u32)>> {
            let footprints = walker(heading).on(&GRID).expect("it stands in the grid");
            footprints.iter().map(|footprint| footprint.iter().collect()).collect()
        };
        let north = columns(0.0);
        assert_eq!(north[0], [(18, 19), (18, 20), (18, 21)]);
        assert_eq!(north[1], [(22, 19), (22, 20), (22, 21)]);
        // Heading east, its left foot is to the north.
        let east = columns(90.0);
        assert_eq!(east[0], [(19, 22), (20, 22), (21, 22)]);
        assert_eq!(east[1], [(19, 18), (20, 18), (21, 18)]);
        assert_eq!(columns(450.0), east);
        assert_eq!(columns(-270.0), east);
    }

    #[test]
    fn an_object_stands_where_one_of_its_outlines_has_a_column() {
        let walker = |x| Body {
            footprints: vec![foot(-0.2), foot(0.2)],
            position: Position { x, z: 2.05 },
            ..Body::default()
        };
        let half_out = walker(0.05).on(&GRID).expect("the right foot is in the grid");
        assert_eq!((half_out[0].spans.len(), half_out[0].overhang), (0, 3));
        assert_eq!((half_out[1].spans.len(), half_out[1].overhang), (3, 0));
        assert!(walker(-0.35).on(&GRID).is_none());
    }

    #[test]
    fn bounds_hold_every_outline() {
        let walker = Body {
            footprints: vec![foot(-0.2), foot(0.2)],
            position: Position { x: 2.0, z: 2.0 },
            heading: 90.0,
            ..Body::default()
        };
        let (low, high) = walker.bounds();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(low.x, 1.85) && near(high.x, 2.15), "{low:?} {high:?}");
        assert!(near(low.z, 1.75) && near(high.z, 2.25), "{low:?} {high:?}");
    }
}
