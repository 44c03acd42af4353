//! The fixed grid: a box for every cell that can be seen.

use crate::render::{Field, Picture, Snow};

use super::{EARTH, MAPPED, Prism, Scene};

/// Faces of a box: above, and those towards the neighbours that [`around`] finds.
const ABOVE: u32 = 1 << 3;
const BESIDE: [u32; 4] = [1 << 0, 1 << 1, 1 << 4, 1 << 5];

/// The cells, and the ground that they stand on. Air is left out, and so is what is surrounded on
/// all sides.
pub fn scene(picture: &Picture, snow: &Snow) -> Scene {
    let (mut prisms, mut values) = (Vec::new(), Vec::new());
    for column in 0..snow.columns() {
        add_column(&mut prisms, &mut values, picture.field, snow, column);
    }
    let scale = picture.scale(values.iter().copied());
    let cells = prisms.iter_mut().filter(|prism| prism.paint == MAPPED);
    cells.zip(values).for_each(|(prism, value)| prism.value = scale.place(value));
    Scene { prisms, ..Scene::empty(snow, scale) }
}

/// Adds what can be seen of a column, and the values of its cells.
fn add_column(
    prisms: &mut Vec<Prism>,
    values: &mut Vec<f32>,
    field: Field,
    snow: &Snow,
    column: usize,
) {
    let [(x0, z0), (x1, z1)] = snow.place(column);
    let around = around(snow, column);
    let faces = |top: f32, last: bool| {
        let beside = around.iter().zip(BESIDE).filter(|(hidden, _)| top > **hidden);
        beside.map(|(_, face)| face).sum::<u32>() + if last { ABOVE } else { 0 }
    };
    let mut add = |bottom, top, paint, last| {
        let faces = faces(top, last);
        if faces != 0 {
            let (low, high) = ([x0, bottom, z0], [x1, top, z1]);
            prisms.push(Prism { low, value: 0.0, high, paint, faces });
        }
        faces != 0
    };
    let mut cells = snow.snow_cells(column).peekable();
    let ground = snow.ground[column];
    if ground > 0.0 {
        add(0.0, ground, EARTH, cells.peek().is_none());
    }
    while let Some(cell) = cells.next() {
        if add(cell.bottom, cell.top, MAPPED, cells.peek().is_none()) {
            values.push(field.of(cell.sample, cell.middle));
        }
    }
}

/// The elevations below which the neighbours of a column hide it: those at lower and at higher x,
/// then at lower and at higher z. Nothing hides it at the edges of what is shown.
fn around(snow: &Snow, column: usize) -> [f32; 4] {
    let (width, columns) = (snow.width(), snow.columns());
    let x = column % width;
    let neighbours = [
        (x > 0).then(|| column - 1),
        (x + 1 < width).then_some(column + 1),
        column.checked_sub(width),
        Some(column + width).filter(|next| *next < columns),
    ];
    neighbours.map(|next| next.map_or(f32::NEG_INFINITY, |next| snow.top(next)))
}
