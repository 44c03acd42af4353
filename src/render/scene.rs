//! What is drawn: boxes and triangles, made of the snow.

mod bodies;
mod cells;
mod surface;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::camera::Bounds;
use super::scale::Scale;
use super::{Picture, Snow, View};

/// Colours of what is no snow, and of snow cut through where the surface is what is shown.
type Paint = [u8; 4];
const MAPPED: Paint = [0; 4];
const EARTH: Paint = [126, 111, 94, 255];
const OBJECT: Paint = [178, 102, 68, 255];
const SNOW: Paint = [223, 230, 238, 255];

/// Thickness of the ground below the lowest elevation, as a part of the extent of what is shown.
const BASE: f32 = 0.012;

/// All faces of a box.
const ALL_FACES: u32 = 0b11_11_11;

/// A box. Laid out as `shaders/render/prisms.wgsl` takes it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Prism {
    /// Its lowest corner \[m\].
    pub low: [f32; 3],
    /// Place in the colour map, from 0 to 1.
    pub value: f32,
    /// Its highest corner \[m\].
    pub high: [f32; 3],
    /// A colour in place of the map's, where its alpha is 255.
    pub paint: [u8; 4],
    /// Faces that can be seen, a bit each: those towards lower x, higher x, lower y and so on.
    pub faces: u32,
}

/// A corner of a triangle. Laid out as `shaders/render/mesh.wgsl` takes it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Where it is \[m\].
    pub position: [f32; 3],
    /// Place in the colour map, from 0 to 1.
    pub value: f32,
    /// Across the surface; of length 1.
    pub normal: [f32; 3],
    /// A colour in place of the map's, where its alpha is 255.
    pub paint: [u8; 4],
}

/// Everything that is drawn.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Boxes.
    pub prisms: Vec<Prism>,
    /// Corners of triangles.
    pub vertices: Vec<Vertex>,
    /// Triangles, three corners each.
    pub indices: Vec<u32>,
    /// A box around all of it.
    pub bounds: Bounds,
    /// Colours of the values shown.
    pub scale: Scale,
}

impl Scene {
    /// What a picture shows of the snow.
    pub fn new(picture: &Picture, snow: &Snow) -> Scene {
        let mut scene = match picture.view {
            View::Surface => surface::scene(picture, snow),
            View::Grid | View::Section => cells::scene(picture, snow),
        };
        scene.prisms.push(base(snow));
        if picture.colliders {
            bodies::add(&mut scene, snow, picture.view == View::Section);
        }
        scene
    }

    /// Nothing yet, where there is to be snow.
    fn empty(snow: &Snow, scale: Scale) -> Scene {
        let (low, high) = extent(snow);
        let bounds = Bounds { low, high };
        Scene { prisms: Vec::new(), vertices: Vec::new(), indices: Vec::new(), bounds, scale }
    }

    /// Adds a quadrangle by its corners, in a circle.
    fn quadrangle(&mut self, corners: [Vec3; 4], normal: Vec3, paint: Paint) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners.map(|corner| Vertex {
            position: corner.to_array(),
            value: 0.0,
            normal: normal.to_array(),
            paint,
        }));
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }
}

/// The corners of a box around the region and its snow.
fn extent(snow: &Snow) -> (Vec3, Vec3) {
    let [(x0, z0), _] = snow.place(0);
    let [_, (x1, z1)] = snow.place(snow.columns() - 1);
    let top = (0..snow.columns()).map(|column| snow.top(column)).fold(snow.cell_size, f32::max);
    let thickness = BASE * (x1 - x0).max(z1 - z0).max(top);
    (Vec3::new(x0, -thickness, z0), Vec3::new(x1, top, z1))
}

/// The ground below the lowest elevation.
fn base(snow: &Snow) -> Prism {
    let (low, high) = extent(snow);
    Prism {
        low: low.to_array(),
        value: 0.0,
        high: [high.x, 0.0, high.z],
        paint: EARTH,
        faces: ALL_FACES,
    }
}
