//! The fixed grid: a box for every cell that can be seen.

use crate::render::{Field, Snow};

use super::{EARTH, MAPPED, Prism, Scene};

/// The values of all snow cells.
pub fn values(field: Field, snow: &Snow) -> Vec<f32> {
    (0..snow.columns())
        .flat_map(|column| snow.snow_cells(column))
        .map(|cell| field.of(cell.sample, cell.middle))
        .collect()
}

/// Adds the cells, and the ground that they stand on. Air is left out, and so is what is
/// surrounded on all sides.
pub fn add(scene: &mut Scene, snow: &Snow, field: Field) {
    for column in 0..snow.columns() {
        let [(x0, z0), (x1, z1)] = snow.place(column);
        let (ground, top) = (snow.ground[column], snow.top(column));
        let hidden = lowest_around(snow, column);
        let prism = |bottom, top, value, paint| Prism {
            low: [x0, bottom, z0],
            value,
            high: [x1, top, z1],
            paint,
        };
        if ground > 0.0 && (ground > hidden || ground >= top) {
            scene.prisms.push(prism(0.0, ground, 0.0, EARTH));
        }
        let mut cells = snow.snow_cells(column).peekable();
        while let Some(cell) = cells.next() {
            if cell.top > hidden || cells.peek().is_none() {
                let value = scene.scale.place(field.of(cell.sample, cell.middle));
                scene.prisms.push(prism(cell.bottom, cell.top, value, MAPPED));
            }
        }
    }
}

/// The elevation below which all four neighbours of a column hide it.
fn lowest_around(snow: &Snow, column: usize) -> f32 {
    let (width, columns) = (snow.width(), snow.columns());
    let x = column % width;
    if x == 0 || x + 1 == width || column < width || column + width >= columns {
        return f32::NEG_INFINITY;
    }
    let around = [column - 1, column + 1, column - width, column + width];
    around.into_iter().map(|neighbour| snow.top(neighbour)).fold(f32::INFINITY, f32::min)
}
