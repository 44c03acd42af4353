//! Rows made of what firn-snow knows, and back.

use firn_snow::{CELL, Footing, Grid, Material, gold_prefactor};

use crate::frame::{Layout, Slot};
use crate::gpu::pages::Place;

use super::{ColumnCell, Contact, Elevation, LOADED, NO_SESSION, Session, Tile, join};

impl From<firn_snow::Elevation> for Elevation {
    fn from(elevation: firn_snow::Elevation) -> Elevation {
        Elevation { cells: elevation.cells(), fraction: elevation.fraction() }
    }
}

impl From<Elevation> for firn_snow::Elevation {
    fn from(row: Elevation) -> firn_snow::Elevation {
        firn_snow::Elevation::of_cells(row.cells, row.fraction)
    }
}

impl Session {
    /// The row of a snowpack.
    pub fn new(layout: &Layout, first_tile: u32) -> Session {
        let grid = &layout.grid;
        let row = Session {
            first_tile,
            tiles_x: grid.tiles_x(),
            width: grid.width,
            depth: grid.depth,
            height: grid.height,
            metres: grid.cell_size as f32 / CELL as f32,
            ..Session::default()
        };
        row.with_material(grid, &layout.material)
    }

    /// The row with other material constants.
    pub fn with_material(self, grid: &Grid, material: &Material) -> Session {
        // Quanta of thickness are 2⁶ times as fine as those of mass.
        let density = 64.0 / grid.cell_size;
        Session {
            hardness_law: material.hardness_law as u32,
            load_distribution: material.load_distribution as u32,
            stiffness_exponent: material.stiffness_exponent as f32,
            density: density as f32,
            densest: (density / material.densest()) as f32,
            gold: gold_prefactor(material.grain_size_mm),
            ..self
        }
    }
}

impl Tile {
    /// A tile of a snowpack, with an object's footprint on it or with none.
    pub fn new(session: Slot, place: Place, grid: &Grid, tile: u32, loaded: bool) -> Tile {
        let rect = grid.tile_rect(tile);
        let loaded = if loaded { LOADED } else { 0 };
        let shape = (rect.x1 - rect.x0) | ((rect.z1 - rect.z0) << 8) | loaded;
        Tile { session, page: place.page, row: place.row, shape }
    }

    /// A tile of nobody.
    pub const NOBODYS: Tile = Tile { session: NO_SESSION, page: 0, row: 0, shape: 0 };
}

impl From<&firn_snow::Contact> for Contact {
    fn from(contact: &firn_snow::Contact) -> Self {
        let last_support = contact.last_cycle.map_or(0, |footing| footing.support);
        Contact {
            bottom: contact.bottom.into(),
            reference: contact.reference.into(),
            support_low: contact.support as u32,
            support_high: (contact.support >> 32) as u32,
            area: contact.area,
            pressure: contact.pressure,
            width: contact.area.sqrt(),
            resting: u32::from(contact.resting),
            last_bottom: contact
                .last_cycle
                .map_or(Elevation::NONE, |footing| footing.bottom.into()),
            last_support_low: last_support as u32,
            last_support_high: (last_support >> 32) as u32,
        }
    }
}

impl From<Contact> for firn_snow::Contact {
    fn from(row: Contact) -> Self {
        let support = join(row.last_support_low, row.last_support_high);
        let last_cycle = (row.last_bottom != Elevation::NONE)
            .then(|| Footing { bottom: row.last_bottom.into(), support });
        firn_snow::Contact {
            bottom: row.bottom.into(),
            reference: row.reference.into(),
            support: join(row.support_low, row.support_high),
            area: row.area,
            pressure: row.pressure,
            resting: row.resting != 0,
            last_cycle,
        }
    }
}

impl From<ColumnCell> for firn_snow::Cell {
    fn from(row: ColumnCell) -> Self {
        let ColumnCell { mass, thickness, temperature, stress } = row;
        firn_snow::Cell { mass, thickness, temperature, stress }
    }
}
