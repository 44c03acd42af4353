//! The surface of the snow, through the middles of the columns, and what it is cut through at the
//! edges.

use std::ops::RangeInclusive;

use glam::Vec3;

use crate::render::{Field, Picture, Snow};

use super::{EARTH, MAPPED, Paint, SNOW, Scene, Vertex};

/// Slopes on two sides of a point that differ by more than this make a step rather than a hill.
const STEP: f32 = 1.5;

/// The value of each column's highest snow cell, not a number on bare ground; or its elevation.
fn values(field: Field, snow: &Snow) -> Vec<f32> {
    let value = |column| {
        let top = snow.top(column);
        let shown = match field {
            Field::Position => Some(top),
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
            let (value, paint) = sheet.colour(x, z, &values);
            let value = if value.is_nan() { 0.0 } else { scene.scale.place(value) };
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

/// An index and the ones beside it, as far as there are such.
fn around(index: usize, count: usize) -> RangeInclusive<usize> {
    index.saturating_sub(1)..=(index + 1).min(count - 1)
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

    /// A point's value and paint. Bare ground at the foot of a wall of snow has the value of that
    /// snow, so that the wall is of one colour down to the ground.
    fn colour(&self, x: usize, z: usize, values: &[f32]) -> (f32, Paint) {
        let column = self.column(x, z);
        let paint = if self.snow.depth[column] > 0.0 { MAPPED } else { EARTH };
        if !values[column].is_nan() {
            return (values[column], paint);
        }
        let (columns, rows) = (around(x, self.width), around(z, self.depth));
        let beside = rows.flat_map(|z| columns.clone().map(move |x| values[self.column(x, z)]));
        (beside.fold(f32::NAN, f32::max), paint)
    }

    /// Across the slope of the surface. Beside a step that is the slope of the level side: the step
    /// itself is drawn as a wall with sharp edges.
    fn normal(&self, x: usize, z: usize) -> Vec3 {
        let here = self.point(x, z, Snow::top);
        let slope = |before: Vec3, after: Vec3, axis: Vec3| {
            let rise = |from: Vec3, to: Vec3| (to.y - from.y) / (to - from).dot(axis);
            match (before == here, after == here) {
                (false, false) => {
                    let (low, high) = (rise(before, here), rise(here, after));
                    let level = if low.abs() < high.abs() { low } else { high };
                    if (high - low).abs() > STEP { level } else { rise(before, after) }
                }
                (true, _) => rise(here, after),
                (_, true) => rise(before, here),
            }
        };
        let (columns, rows) = (around(x, self.width), around(z, self.depth));
        let beside = |x: usize, z: usize| self.point(x, z, Snow::top);
        let along_x = slope(beside(*columns.start(), z), beside(*columns.end(), z), Vec3::X);
        let along_z = slope(beside(x, *rows.start()), beside(x, *rows.end()), Vec3::Z);
        Vec3::new(-along_x, 1.0, -along_z).normalize()
    }
}
