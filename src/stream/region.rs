//! Regions of columns, clipped to the grid and widened to whole tiles.

use firn_protocol::{ColliderView, ColumnRegion};
use firn_snow::{ColumnRect, Grid, TILE_SIDE};

use crate::session::Invalid;

/// The columns of a region that lie in the grid; all where there is no region, which stands at a JSON
/// pointer of the client's message.
///
/// # Errors
/// Where the region is empty or misses the grid.
pub fn columns_in(
    region: Option<ColumnRegion>,
    grid: &Grid,
    at: &str,
) -> Result<ColumnRect, Invalid> {
    let Some(region) = region else { return Ok(grid.all()) };
    for (field, extent) in [("width", region.width), ("depth", region.depth)] {
        if extent == 0 {
            return Err(Invalid::new(format!("{at}/{field}"), "0 is not at least 1 column"));
        }
    }
    let span = |first: i64, extent: u64, columns: u32| {
        let clip = |column: i64| column.clamp(0, i64::from(columns)) as u32;
        (clip(first), clip(first.saturating_add_unsigned(extent)))
    };
    let (x0, x1) = span(region.column_x, region.width, grid.width);
    let (z0, z1) = span(region.column_z, region.depth, grid.depth);
    if x0 == x1 || z0 == z1 {
        let detail = format!("holds none of the grid's {} × {} columns", grid.width, grid.depth);
        return Err(Invalid::new(at, detail));
    }
    Ok(ColumnRect { x0, z0, x1, z1 })
}

/// The columns of a rectangle of tiles, clipped to the grid.
pub fn columns_of(tiles: &ColumnRect, grid: &Grid) -> ColumnRect {
    ColumnRect {
        x0: tiles.x0 * TILE_SIDE,
        z0: tiles.z0 * TILE_SIDE,
        x1: (tiles.x1 * TILE_SIDE).min(grid.width),
        z1: (tiles.z1 * TILE_SIDE).min(grid.depth),
    }
}

/// Whether an object's bounding box meets a rectangle of columns.
pub fn meets(collider: &ColliderView, columns: &ColumnRect, grid: &Grid) -> bool {
    let (low, high) = collider.body.bounds();
    let overlaps = |low: f64, high: f64, from: u32, to: u32| {
        high > f64::from(from) * grid.cell_size && low < f64::from(to) * grid.cell_size
    };
    overlaps(low.x, high.x, columns.x0, columns.x1)
        && overlaps(low.z, high.z, columns.z0, columns.z1)
}

#[cfg(test)]
mod tests {
    use firn_snow::{Body, Position, Shape};

    use super::*;

    #[test]
    fn a_collider_is_in_view_where_its_box_overlaps() {
        let grid = Grid::default();
        let columns = ColumnRect { x0: 8, z0: 0, x1: 16, z1: 8 };
        let collider = |x: f64| ColliderView {
            id: "a".to_owned(),
            body: Body {
                mass: 1.0,
                shape: Some(Shape::Box { width: 0.5, depth: 0.5 }),
                position: Position { x, z: 1.0 },
                ..Body::default()
            },
            bottom: 0.0,
            sink_depth: 0.0,
            contact_area: 0.0,
            pressure: 0.0,
            burden: 0.0,
            resting: false,
        };
        assert!(!meets(&collider(1.3), &columns, &grid));
        assert!(meets(&collider(1.4), &columns, &grid));
        assert!(meets(&collider(3.4), &columns, &grid));
        assert!(!meets(&collider(3.5), &columns, &grid));
    }
}
