//! The surface of the snow, through the middles of the columns, and what it is cut through at the
//! edges.

use glam::Vec3;

use crate::render::{Field, Picture, Snow};

use super::{EARTH, MAPPED, SNOW, Scene, Vertex};

/// The value of each column's highest snow cell, or its elevation; not a number on bare ground.
fn values(field: Field, snow: &Snow) -> Vec<f32> {
    let value = |column| {
        let top = snow.top(column);
        let shown = match field {
            Field::Position => Some(top).filter(|_| snow.depth[column] > 0.0),
            _ => snow.snow_cells(column).last().map(|cell| field.of(cell.sample, top)),
        };
        shown.unwrap_or(f32::NAN)
    };
    (0..snow.columns()).map(value).collect()
}

/// The surface.
pub fn scene(picture: &Picture, snow: &Snow) -> Scene {
    let values = values(picture.field, snow);
    let scale = picture.scale(values.iter().copied().filter(|value| !value.is_nan()));
    let mut scene = Scene::empty(snow, scale);
    let sheet = Sheet::new(snow);
    for z in 0..sheet.depth {
        for x in 0..sheet.width {
            let value = values[sheet.column(x, z)];
            let (value, paint) =
                if value.is_nan() { (0.0, EARTH) } else { (scene.scale.place(value), MAPPED) };
            scene.vertices.push(Vertex {
                position: sheet.point(x, z, Snow::top).to_array(),
                value,
                normal: sheet.normal(x, z).to_array(),
                paint,
            });
        }
    }
    let (width, depth) = (sheet.width as u32, sheet.depth as u32);
    for z in 0..depth - 1 {
        for x in 0..width - 1 {
            let corner = z * width + x;
            let (right, below) = (corner + 1, corner + width);
            scene.indices.extend([corner, right, below, right, below + 1, below]);
        }
    }
    walls(&mut scene, &sheet);
    scene
}

/// An elevation in a column \[m\].
type Elevation = fn(&Snow, usize) -> f32;

/// Closes the edges from the surface to the ground, and down to the lowest ground.
fn walls(scene: &mut Scene, sheet: &Sheet<'_>) {
    let ground: Elevation = |snow, column| snow.ground[column];
    let (last_x, last_z) = (sheet.width - 1, sheet.depth - 1);
    let along_x = (0..last_x)
        .flat_map(|x| [((x, 0), (x + 1, 0), Vec3::NEG_Z), ((x, last_z), (x + 1, last_z), Vec3::Z)]);
    let along_z = (0..last_z)
        .flat_map(|z| [((0, z), (0, z + 1), Vec3::NEG_X), ((last_x, z), (last_x, z + 1), Vec3::X)]);
    for (from, to, normal) in along_x.chain(along_z) {
        let strips: [(Elevation, Elevation, _); 2] =
            [(ground, Snow::top, SNOW), (|_, _| 0.0, ground, EARTH)];
        for (low, high, paint) in strips {
            let [a, b] = [from, to].map(|(x, z)| sheet.point(x, z, low));
            let [d, c] = [from, to].map(|(x, z)| sheet.point(x, z, high));
            if c.y > b.y || d.y > a.y {
                scene.quadrangle([a, b, c, d], normal, paint);
            }
        }
    }
}

/// Points over the middles of the columns, and over the edges of the region.
struct Sheet<'a> {
    snow: &'a Snow,
    /// Points along x: two more than columns.
    width: usize,
    /// Points along z: two more than columns.
    depth: usize,
}

impl Sheet<'_> {
    fn new(snow: &Snow) -> Sheet<'_> {
        let width = snow.width();
        Sheet { snow, width: width + 2, depth: snow.columns() / width + 2 }
    }

    /// The column that a point belongs to.
    fn column(&self, x: usize, z: usize) -> usize {
        let (x, z) = (x.clamp(1, self.width - 2) - 1, z.clamp(1, self.depth - 2) - 1);
        z * self.snow.width() + x
    }

    fn point(&self, x: usize, z: usize, elevation: Elevation) -> Vec3 {
        let column = self.column(x, z);
        let [(x0, z0), (x1, z1)] = self.snow.place(column);
        let place = |index: usize, points: usize, low: f32, high: f32| match index {
            0 => low,
            _ if index + 1 == points => high,
            _ => (low + high) / 2.0,
        };
        Vec3::new(
            place(x, self.width, x0, x1),
            elevation(self.snow, column),
            place(z, self.depth, z0, z1),
        )
    }

    /// Across the slope between the neighbours.
    fn normal(&self, x: usize, z: usize) -> Vec3 {
        let surface = |x: usize, z: usize| self.point(x, z, Snow::top);
        let (left, right) = (x.saturating_sub(1), (x + 1).min(self.width - 1));
        let (back, front) = (z.saturating_sub(1), (z + 1).min(self.depth - 1));
        let along_x = surface(right, z) - surface(left, z);
        let along_z = surface(x, front) - surface(x, back);
        along_z.cross(along_x).normalize_or(Vec3::Y)
    }
}
