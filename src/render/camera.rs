//! Where a scene is seen from.

use std::f32::consts::PI;

use glam::camera::rh::proj::directx;
use glam::camera::rh::view;
use glam::{Mat4, Vec3, Vec4};
use serde::Serialize;
use utoipa::ToSchema;

/// Angle of view of a perspective picture before the scene is fitted into it: 25°.
const ANGLE: f32 = 25.0 * PI / 180.0;

/// A box around everything that is shown \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest x, y and z.
    pub low: Vec3,
    /// Highest x, y and z.
    pub high: Vec3,
}

impl Bounds {
    fn corners(&self) -> impl Iterator<Item = Vec3> {
        let ends = [self.low, self.high];
        (0..8).map(move |i| Vec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z))
    }

    /// Extends it to a point.
    pub fn reach(&mut self, point: Vec3) {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
    }
}

/// A direction to look from. Everything is fitted into the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Degrees around the vertical: 0 looks along −z with x to the right, 90 along −x.
    pub yaw: f32,
    /// Degrees downwards: 0 looks level, 90 straight down.
    pub pitch: f32,
    /// How much larger than fitted.
    pub zoom: f32,
    /// How what is far away is shown.
    pub projection: Projection,
}

/// How what is far away is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(default = "perspective")]
pub enum Projection {
    /// Smaller.
    #[default]
    Perspective,
    /// As large as what is near.
    Parallel,
}

impl Projection {
    /// Both by their names.
    pub const ALL: [(&'static str, Projection); 2] =
        [("perspective", Projection::Perspective), ("parallel", Projection::Parallel)];
}

/// How a camera sees a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// From metres to clip space.
    pub clip: Mat4,
    /// Where the camera is; a direction, with w = 0, where it is parallel.
    pub eye: Vec4,
    /// Direction to the light: it comes over the camera's left shoulder.
    pub light: Vec3,
}

impl Camera {
    /// Sees everything within the bounds in an area of the picture, whose extents are in pixels.
    pub fn sight(&self, bounds: &Bounds, extent: (f32, f32)) -> Sight {
        let (yaw, pitch) = (self.yaw.to_radians(), self.pitch.to_radians());
        let back = direction(yaw, pitch);
        let up = direction(yaw, pitch + PI / 2.0);
        let centre = (bounds.low + bounds.high) / 2.0;
        let radius = ((bounds.high - bounds.low).length() / 2.0).max(1e-3);
        // As near as a ball around everything is still whole.
        let parallel = self.projection == Projection::Parallel;
        let distance = if parallel { 2.0 * radius } else { radius / (ANGLE / 2.0).sin() };
        let eye = centre + back * distance;
        let (near, far) = (0.99 * (distance - radius), 1.01 * (distance + radius));
        let projection = if parallel {
            directx::orthographic(-radius, radius, -radius, radius, near, far)
        } else {
            directx::perspective(ANGLE, 1.0, near, far)
        };
        let seen = projection * view::look_to_mat4(eye, -back, up);
        Sight {
            clip: fit(&seen, bounds, extent, self.zoom) * seen,
            eye: if parallel { back.extend(0.0) } else { eye.extend(1.0) },
            light: direction(yaw - 0.7, 1.05),
        }
    }
}

/// A direction from its angle around the vertical and above the horizon, in radians.
fn direction(yaw: f32, pitch: f32) -> Vec3 {
    Vec3::new(yaw.sin() * pitch.cos(), pitch.sin(), yaw.cos() * pitch.cos())
}

/// Moves and scales a picture so that the bounds fill it.
fn fit(seen: &Mat4, bounds: &Bounds, extent: (f32, f32), zoom: f32) -> Mat4 {
    let points = || bounds.corners().map(|corner| seen.project_point3(corner));
    let low = points().fold(Vec3::INFINITY, Vec3::min);
    let high = points().fold(Vec3::NEG_INFINITY, Vec3::max);
    let size = (high - low).max(Vec3::splat(1e-6));
    let pixels = (extent.0 / size.x).min(extent.1 / size.y) * zoom;
    let scale = Vec3::new(2.0 * pixels / extent.0, 2.0 * pixels / extent.1, 1.0);
    let shift = (low + high) / 2.0 * scale;
    Mat4::from_translation(Vec3::new(-shift.x, -shift.y, 0.0)) * Mat4::from_scale(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds =
        Bounds { low: Vec3::new(1.0, -0.5, 2.0), high: Vec3::new(11.0, 5.0, 7.0) };

    #[test]
    fn everything_is_in_the_picture_and_fills_it() {
        for (_, projection) in Projection::ALL {
            for (yaw, pitch) in [(0.0, 0.0), (35.0, 30.0), (-120.0, 90.0), (270.0, 5.0)] {
                let camera = Camera { yaw, pitch, zoom: 1.0, projection };
                let sight = camera.sight(&BOUNDS, (600.0, 400.0));
                let corners: Vec<Vec3> =
                    BOUNDS.corners().map(|corner| sight.clip.project_point3(corner)).collect();
                let reach = |of: fn(&Vec3) -> f32| corners.iter().map(of).fold(0.0, f32::max);
                let (x, y) = (reach(|corner| corner.x.abs()), reach(|corner| corner.y.abs()));
                assert!(x <= 1.0001 && y <= 1.0001, "{yaw} {pitch}: {x} {y}");
                assert!(x.max(y) > 0.9999, "{yaw} {pitch}: {x} {y}");
                assert!(corners.iter().all(|corner| (0.0..=1.0).contains(&corner.z)));
            }
        }
    }

    #[test]
    fn yaw_0_has_x_to_the_right_and_y_up() {
        let camera = Camera { yaw: 0.0, pitch: 0.0, zoom: 1.0, projection: Projection::Parallel };
        let sight = camera.sight(&BOUNDS, (100.0, 100.0));
        let (low, high) =
            (sight.clip.project_point3(BOUNDS.low), sight.clip.project_point3(BOUNDS.high));
        assert!(low.x < high.x && low.y < high.y && high.z < low.z);
        assert_eq!(sight.eye, Vec4::new(0.0, 0.0, 1.0, 0.0));
    }
}
