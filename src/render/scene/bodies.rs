//! Objects on the snow, as far as they stand in the region.

use std::f64::consts::{PI, TAU};

use firn_snow::{Position, Shape, Turn};
use glam::Vec3;

use crate::render::Snow;

use super::{ALL_FACES, OBJECT, Prism, Scene};

/// Corners of a circle.
const CORNERS: u32 = 48;

/// Adds the objects. Boxes along the axes end where the region does, other shapes are shown where their centre
/// is in it. Of anything that is `cut` by a region one column thin its chord is shown.
pub fn add(scene: &mut Scene, snow: &Snow, cut: bool) {
    let [(x0, z0), _] = snow.place(0);
    let [_, (x1, z1)] = snow.place(snow.columns() - 1);
    let region = Region { low: Vec3::new(x0, 0.0, z0), high: Vec3::new(x1, 0.0, z1) };
    for collider in &snow.colliders {
        let bottom = collider.bottom as f32;
        for (shape, centre, turn) in collider.body.outlines() {
            let foot = Vec3::new(centre.x as f32, bottom, centre.z as f32);
            let (inside, height) = (region.has(foot), height(shape, turn));
            let along_axes = turn.sin == 0.0 || turn.cos == 0.0;
            if cut {
                if let Some((low, high)) = region.chord(shape, centre, turn) {
                    region.slab(scene, low + bottom * Vec3::Y, high, bottom + height);
                }
            } else if along_axes && matches!(shape, Shape::Box { .. }) {
                let reach = shape.reach(turn);
                let low = foot + Vec3::new(reach.x0 as f32, 0.0, reach.z0 as f32);
                let high = foot + Vec3::new(reach.x1 as f32, 0.0, reach.z1 as f32);
                region.slab(scene, low, high, bottom + height);
            } else if let (true, Shape::Wheel { width, radius }) = (inside, shape) {
                wheel(scene, foot, turn, *width, *radius);
            } else if inside {
                let ring = ring(shape, turn).into_iter();
                let ring: Vec<Vec3> =
                    ring.map(|(x, z)| foot + Vec3::new(x as f32, 0.0, z as f32)).collect();
                extrude(scene, &ring, height * Vec3::Y);
            }
        }
    }
}

/// The columns that are shown.
struct Region {
    low: Vec3,
    high: Vec3,
}

impl Region {
    fn has(&self, place: Vec3) -> bool {
        (self.low.x..self.high.x).contains(&place.x) && (self.low.z..self.high.z).contains(&place.z)
    }

    /// Where the middle of a thin region cuts an outline.
    fn chord(&self, shape: &Shape, centre: Position, turn: Turn) -> Option<(Vec3, Vec3)> {
        let (extent, middle) = (self.high - self.low, (self.low + self.high) / 2.0);
        if extent.x < extent.z {
            let (from, to) = shape.chord_along_z(turn, f64::from(middle.x) - centre.x)?;
            let along = |z: f64| (centre.z + z) as f32;
            let low = Vec3::new(self.low.x, 0.0, along(from));
            Some((low, Vec3::new(self.high.x, 0.0, along(to))))
        } else {
            let (from, to) = shape.chord(turn, f64::from(middle.z) - centre.z)?;
            let along = |x: f64| (centre.x + x) as f32;
            let low = Vec3::new(along(from), 0.0, self.low.z);
            Some((low, Vec3::new(along(to), 0.0, self.high.z)))
        }
    }

    /// Adds a box along the axes, as far as it is in the region.
    fn slab(&self, scene: &mut Scene, low: Vec3, high: Vec3, top: f32) {
        let low = Vec3::new(low.x.max(self.low.x), low.y, low.z.max(self.low.z));
        let high = Vec3::new(high.x.min(self.high.x), top, high.z.min(self.high.z));
        if low.x < high.x && low.z < high.z {
            let (low, high) = (low.to_array(), high.to_array());
            scene.prisms.push(Prism { low, value: 0.0, high, paint: OBJECT, faces: ALL_FACES });
            scene.bounds.reach(high.into());
        }
    }
}

/// How high an object is drawn \[m\]: it has no height of its own.
fn height(shape: &Shape, turn: Turn) -> f32 {
    let reach = shape.reach(turn);
    let half = (reach.x1 - reach.x0).min(reach.z1 - reach.z0) / 2.0;
    half.max(0.15) as f32
}

/// Corners of an outline around its centre, in order; those of rounded ends are many.
fn ring(shape: &Shape, turn: Turn) -> Vec<(f64, f64)> {
    let arc = |radius: f64, front: f64, from: f64, corners: u32, of: f64| {
        (0..corners).map(move |i| {
            let angle = from + of * f64::from(i) / f64::from(corners - 1);
            turn.to_world(radius * angle.cos(), front + radius * angle.sin())
        })
    };
    match *shape {
        Shape::Disk { radius } => arc(radius, 0.0, 0.0, CORNERS + 1, TAU).skip(1).collect(),
        Shape::Capsule { length, radius } => {
            let front = length / 2.0 - radius;
            let ends = [(front, 0.0), (-front, PI)];
            let ends = ends.into_iter();
            ends.flat_map(|(front, from)| arc(radius, front, from, CORNERS / 2, PI)).collect()
        }
        _ => shape.corners(turn),
    }
}

/// A cylinder that stands on its rim.
fn wheel(scene: &mut Scene, foot: Vec3, turn: Turn, width: f64, radius: f64) {
    let place = |right: f64, forward: f64, up: f64| {
        let (x, z) = turn.to_world(right, forward);
        foot + Vec3::new(x as f32, up as f32, z as f32)
    };
    let corner = |i: u32| {
        let angle = TAU * f64::from(i) / f64::from(CORNERS);
        place(-width / 2.0, radius * angle.cos(), radius + radius * angle.sin())
    };
    let ring: Vec<Vec3> = (0..CORNERS).map(corner).collect();
    extrude(scene, &ring, place(width / 2.0, 0.0, 0.0) - place(-width / 2.0, 0.0, 0.0));
}

/// A prism between a flat, convex ring of corners and the same ring moved `along`.
fn extrude(scene: &mut Scene, ring: &[Vec3], along: Vec3) {
    let middle = ring.iter().sum::<Vec3>() / ring.len() as f32;
    let next = ring.iter().cycle().skip(1);
    for (&from, &to) in ring.iter().zip(next) {
        let out = (from + to) / 2.0 - middle;
        let normal = (to - from).cross(along);
        let normal = if normal.dot(out) < 0.0 { -normal } else { normal };
        scene.quadrangle(
            [from, to, to + along, from + along],
            normal.normalize_or(Vec3::Y),
            OBJECT,
        );
        let cap = along.normalize_or(Vec3::Y);
        scene.quadrangle([middle + along, from + along, to + along, middle + along], cap, OBJECT);
        scene.quadrangle([middle, from, to, middle], -cap, OBJECT);
    }
    for &corner in ring {
        scene.bounds.reach(corner + along);
    }
}
