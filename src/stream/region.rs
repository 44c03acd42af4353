//! Regions of columns, widened to whole tiles.

use firn_protocol::ColumnRegion;
use firn_snow::{ColumnRect, Grid, TILE_SIDE};

use crate::session::Invalid;

/// The tiles that a region of columns meets; all of the grid's where there is none.
///
/// # Errors
/// Where the region is empty or misses the grid.
pub fn tiles_of(region: Option<ColumnRegion>, grid: &Grid) -> Result<ColumnRect, Invalid> {
    let Some(region) = region else { return Ok(grid.all().tiles()) };
    for (pointer, extent) in [("/region/width", region.width), ("/region/depth", region.depth)] {
        if extent == 0 {
            return Err(Invalid::new(pointer, "0 is not at least 1 column"));
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
        return Err(Invalid::new("/region", detail));
    }
    Ok(ColumnRect { x0, z0, x1, z1 }.tiles())
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

/// What two rectangles have in common, if anything.
pub fn overlap(a: &ColumnRect, b: &ColumnRect) -> Option<ColumnRect> {
    let rect = ColumnRect {
        x0: a.x0.max(b.x0),
        z0: a.z0.max(b.z0),
        x1: a.x1.min(b.x1),
        z1: a.z1.min(b.z1),
    };
    (rect.x0 < rect.x1 && rect.z0 < rect.z1).then_some(rect)
}
