//! One edit of a snowpack, part by part.

use firn_snow::{Column, ColumnRect, Exchanged, Grid, Snowpack, TILE_COLUMNS, TILE_SIDE};

use crate::frame::{Contents, Edit, Placement, Weathering};

/// Units of a row of tiles on which snow falls, for each of its columns.
const EDIT: u64 = 4;

/// Units of putting an object somewhere, beside its columns.
const OBJECT: u64 = 64;

/// What a part of an edit has done.
pub(super) struct Done {
    /// Mass or dent, as the edit's outcome tells it.
    pub result: u64,
    pub units: u64,
    /// Parts that the edit has.
    pub end: u32,
    /// What the part exchanged with the weather.
    pub exchanged: Exchanged,
}

impl Done {
    fn whole(units: u64) -> Done {
        Done { result: 0, units, end: 1, exchanged: Exchanged::default() }
    }

    /// Changes the columns in a row of tiles, each for so many units.
    fn row(
        columns: ColumnRect,
        row: u32,
        units: u64,
        change: impl FnOnce(ColumnRect) -> u64,
    ) -> Done {
        let part = row_of(columns, row);
        Done { result: change(part), end: rows_of(columns), ..Done::whole(units * part.columns()) }
    }
}

/// Carries out a part of an edit: a row of tiles of what falls or is cleared, a tile of what is restored or gets other
/// ground, all of any other.
pub(super) fn carry_out(edit: &Edit, part: u32, snowpack: &mut Snowpack) -> Done {
    let grid = *snowpack.grid();
    match edit {
        Edit::Deposit(fall) => Done::row(fall.columns, part, EDIT, |row| {
            snowpack.deposit(row, fall.depth, fall.mass, fall.temperature)
        }),
        Edit::Lay(fall) => Done::row(fall.columns, part, EDIT, |row| {
            snowpack.lay(row, fall.depth, fall.mass, fall.temperature)
        }),
        Edit::Clear { columns, depth } => {
            Done::row(*columns, part, EDIT, |row| snowpack.clear(row, *depth))
        }
        Edit::Strip { columns, depth } => {
            Done::row(*columns, part, EDIT, |row| snowpack.strip(row, *depth))
        }
        Edit::Stamp(stamp) => Done::row(stamp.coverage.columns, part, grid.height.into(), |row| {
            snowpack.stamp(row, &[(&stamp.coverage, stamp.load)]).iter().sum::<u32>().into()
        }),
        Edit::Weather(weathering) => weather(weathering, part, snowpack),
        Edit::PutCollider { id, collider, placed } => {
            let Placement { mass, cover, ref footprints } = **collider;
            snowpack.put_collider(id.clone(), mass, cover, footprints.clone(), *placed);
            Done::whole(OBJECT + collider.columns())
        }
        Edit::RemoveCollider { id } => {
            snowpack.remove_collider(id);
            Done::whole(OBJECT)
        }
        Edit::SetGround(ground) => {
            snowpack.set_ground(part, ground);
            Done { end: grid.tiles(), ..Done::whole(TILE_COLUMNS.into()) }
        }
        Edit::SetMaterial(material) => {
            snowpack.set_material(*material);
            Done::whole(grid.tiles().into())
        }
        Edit::Restore(contents) => {
            restore(contents, part, snowpack);
            Done { end: contents.tiles.len() as u32, ..Done::whole(cells_of(&grid)) }
        }
    }
}

/// Has a row of tiles take steps of weather.
fn weather(weathering: &Weathering, row: u32, snowpack: &mut Snowpack) -> Done {
    let grid = *snowpack.grid();
    if row == 0
        && let Some(step) = weathering.steps.iter().find(|step| step.shades)
    {
        snowpack.shade(step);
    }
    let cells = u64::from(grid.tiles_x()) * cells_of(&grid);
    let units = Weathering::UNITS * cells * weathering.steps.len() as u64;
    let exchanged = snowpack.weather(row..row + 1, &weathering.steps);
    Done { end: grid.tiles_z(), exchanged, ..Done::whole(units) }
}

/// Restores a tile, and objects with the last one.
fn restore(contents: &Contents, tile: u32, snowpack: &mut Snowpack) {
    if let Some(cells) = contents.tiles.get(tile as usize) {
        let columns = (0..TILE_COLUMNS).map(|column| cells.column(column).collect());
        snowpack.restore_tile(tile, columns.map(|cells| Column { cells }), &cells.surfaces);
    }
    if tile + 1 >= contents.tiles.len() as u32 {
        let colliders = contents.colliders.iter().map(|(id, placement, contact)| {
            let Placement { mass, cover, ref footprints } = **placement;
            (id.clone(), mass, cover, footprints.clone(), *contact)
        });
        snowpack.restore_colliders(colliders);
    }
}

/// Rows of tiles that columns lie in.
fn rows_of(columns: ColumnRect) -> u32 {
    let tiles = columns.tiles();
    tiles.z1 - tiles.z0
}

/// The columns that lie in one of those rows of tiles.
fn row_of(columns: ColumnRect, row: u32) -> ColumnRect {
    let first = (columns.tiles().z0 + row) * TILE_SIDE;
    ColumnRect { z0: columns.z0.max(first), z1: columns.z1.min(first + TILE_SIDE), ..columns }
}

/// Cells of a tile.
pub(super) fn cells_of(grid: &Grid) -> u64 {
    u64::from(TILE_COLUMNS * grid.height)
}
