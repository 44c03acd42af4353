//! Objects on the snow, as far as they stand in the region.

use std::f32::consts::TAU;

use firn_protocol::ColliderView;
use firn_snow::Shape;
use glam::Vec3;

use crate::render::Snow;

use super::{ALL_FACES, OBJECT, Prism, Scene};

/// Corners of a disk.
const CORNERS: u32 = 48;

/// Adds the objects. Boxes end where the region does. Of a disk that is `cut` by a region one
/// column thin its chord is shown; otherwise it is shown where its centre is in the region.
pub fn add(scene: &mut Scene, snow: &Snow, cut: bool) {
    let [(x0, z0), _] = snow.place(0);
    let [_, (x1, z1)] = snow.place(snow.columns() - 1);
    for collider in &snow.colliders {
        let bottom = collider.bottom as f32;
        let centre = Vec3::new(collider.position.x as f32, bottom, collider.position.z as f32);
        let height = height(collider);
        let round = matches!(collider.shape, Shape::Disk { .. });
        if round && !cut {
            let inside = (x0..x1).contains(&centre.x) && (z0..z1).contains(&centre.z);
            if inside {
                cylinder(scene, centre, collider.shape.half_extents().0 as f32, height);
            }
            continue;
        }
        let (half_x, half_z) = collider.shape.half_extents();
        let mut half = Vec3::new(half_x as f32, 0.0, half_z as f32);
        if round {
            half = chord(half.x, centre, Vec3::new(x1 - x0, 0.0, z1 - z0), (x0, z0));
        }
        let low = (centre - half).max(Vec3::new(x0, bottom, z0));
        let high = (centre + half).min(Vec3::new(x1, bottom, z1)) + height * Vec3::Y;
        if low.x < high.x && low.z < high.z {
            let (low, high) = (low.to_array(), high.to_array());
            scene.prisms.push(Prism { low, value: 0.0, high, paint: OBJECT, faces: ALL_FACES });
            scene.bounds.reach(high.into());
        }
    }
}

/// Half extents of a disk where the middle of a thin region cuts it.
fn chord(radius: f32, centre: Vec3, extent: Vec3, (x0, z0): (f32, f32)) -> Vec3 {
    let half = |distance: f32| (radius * radius - distance * distance).max(0.0).sqrt();
    if extent.x < extent.z {
        Vec3::new(radius, 0.0, half(x0 + extent.x / 2.0 - centre.x))
    } else {
        Vec3::new(half(z0 + extent.z / 2.0 - centre.z), 0.0, radius)
    }
}

/// How high an object is drawn \[m\]: it has no height of its own.
fn height(collider: &ColliderView) -> f32 {
    let (half_x, half_z) = collider.shape.half_extents();
    half_x.min(half_z).max(0.15) as f32
}

fn cylinder(scene: &mut Scene, bottom: Vec3, radius: f32, height: f32) {
    let out = |i: u32| {
        let angle = TAU * i as f32 / CORNERS as f32;
        Vec3::new(angle.cos(), 0.0, angle.sin())
    };
    let top = bottom + height * Vec3::Y;
    for i in 0..CORNERS {
        let (from, to) = (radius * out(i), radius * out(i + 1));
        let side = [bottom + from, bottom + to, top + to, top + from];
        scene.quadrangle(side, (out(i) + out(i + 1)).normalize(), OBJECT);
        scene.quadrangle([top, top + from, top + to, top], Vec3::Y, OBJECT);
    }
    scene.bounds.reach(top - radius * (Vec3::X + Vec3::Z));
    scene.bounds.reach(top + radius * (Vec3::X + Vec3::Z));
}
