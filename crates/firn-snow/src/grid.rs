//! The grid a snowpack stands on and the integer quanta its state is stored in.

/// Thickness quanta in one cell of side h: thickness is stored in quanta of h·2⁻²⁴.
pub const CELL: u32 = 1 << 24;

/// Mass quanta in 1 kg/m²: areal mass is stored in quanta of 2⁻¹⁸ kg/m².
pub const MASS_QUANTA: f64 = (1 << 18) as f64;

/// Columns along one side of a tile, the unit of allocation, sleep and change tracking.
pub const TILE_SIDE: u32 = 8;

/// Columns in a tile.
pub const TILE_COLUMNS: u32 = TILE_SIDE * TILE_SIDE;

/// Largest areal mass of a column \[kg/m²\], so that it fits its integer.
pub const MAX_COLUMN_MASS: f64 = 16_000.0;

/// Largest difference between two ground elevations, in cells.
pub const MAX_RELIEF_CELLS: u32 = 65_536;

/// Size of a snowpack: columns along x and z, slots along y.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Grid {
    /// Columns along x.
    #[cfg_attr(feature = "schema", schema(minimum = 1))]
    pub width: u32,
    /// Columns along z.
    #[cfg_attr(feature = "schema", schema(minimum = 1))]
    pub depth: u32,
    /// Slots for material cells in each column.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 255))]
    pub height: u32,
    /// Side h of a fresh cell \[m\].
    #[cfg_attr(feature = "schema", schema(minimum = 0.02, maximum = 2.0))]
    pub cell_size: f64,
}

impl Default for Grid {
    fn default() -> Self {
        Grid { width: 50, depth: 50, height: 50, cell_size: 0.2 }
    }
}

/// Columns `[x0, x1) × [z0, z1)` of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ColumnRect {
    /// First column along x.
    pub x0: u32,
    /// First column along z.
    pub z0: u32,
    /// End along x, exclusive.
    pub x1: u32,
    /// End along z, exclusive.
    pub z1: u32,
}

impl ColumnRect {
    /// Number of columns.
    #[inline]
    pub fn columns(&self) -> u64 {
        u64::from(self.x1 - self.x0) * u64::from(self.z1 - self.z0)
    }

    /// Whether column (x, z) is inside.
    #[inline]
    pub fn contains(&self, x: u32, z: u32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.z0..self.z1).contains(&z)
    }

    /// What it has in common with another rectangle, if anything.
    #[inline]
    pub fn overlap(&self, other: &ColumnRect) -> Option<ColumnRect> {
        let rect = ColumnRect {
            x0: self.x0.max(other.x0),
            z0: self.z0.max(other.z0),
            x1: self.x1.min(other.x1),
            z1: self.z1.min(other.z1),
        };
        (rect.x0 < rect.x1 && rect.z0 < rect.z1).then_some(rect)
    }

    /// The smallest rectangle that holds this and another.
    #[inline]
    pub fn hull(&self, other: &ColumnRect) -> ColumnRect {
        ColumnRect {
            x0: self.x0.min(other.x0),
            z0: self.z0.min(other.z0),
            x1: self.x1.max(other.x1),
            z1: self.z1.max(other.z1),
        }
    }

    /// The tiles that the rectangle meets, as a rectangle of tile coordinates.
    #[inline]
    pub fn tiles(&self) -> ColumnRect {
        ColumnRect {
            x0: self.x0 / TILE_SIDE,
            z0: self.z0 / TILE_SIDE,
            x1: self.x1.div_ceil(TILE_SIDE),
            z1: self.z1.div_ceil(TILE_SIDE),
        }
    }
}

impl Grid {
    /// Columns in the grid.
    #[inline]
    pub fn columns(&self) -> u64 {
        u64::from(self.width) * u64::from(self.depth)
    }

    /// Columns of all tiles, those beyond the edges of the grid too: memory is taken for whole tiles.
    #[inline]
    pub fn padded_columns(&self) -> u64 {
        let tiles = u64::from(self.tiles_x()) * u64::from(self.tiles_z());
        tiles.saturating_mul(TILE_COLUMNS.into())
    }

    /// Slots in those columns.
    #[inline]
    pub fn padded_cells(&self) -> u64 {
        self.padded_columns().saturating_mul(self.height.into())
    }

    /// Tiles along x.
    #[inline]
    pub fn tiles_x(&self) -> u32 {
        self.width.div_ceil(TILE_SIDE)
    }

    /// Tiles along z.
    #[inline]
    pub fn tiles_z(&self) -> u32 {
        self.depth.div_ceil(TILE_SIDE)
    }

    /// Tiles in the grid, those at the far edges only partly covered.
    #[inline]
    pub fn tiles(&self) -> u32 {
        self.tiles_x() * self.tiles_z()
    }

    /// Every column.
    #[inline]
    pub fn all(&self) -> ColumnRect {
        ColumnRect { x0: 0, z0: 0, x1: self.width, z1: self.depth }
    }

    /// The columns of a tile that lie inside the grid.
    #[inline]
    pub fn tile_rect(&self, tile: u32) -> ColumnRect {
        let (x0, z0) = (tile % self.tiles_x() * TILE_SIDE, tile / self.tiles_x() * TILE_SIDE);
        ColumnRect {
            x0,
            z0,
            x1: (x0 + TILE_SIDE).min(self.width),
            z1: (z0 + TILE_SIDE).min(self.depth),
        }
    }

    /// Tile that holds column (x, z), and the column's index in it.
    #[inline]
    pub fn locate(&self, x: u32, z: u32) -> (u32, u32) {
        let tile = z / TILE_SIDE * self.tiles_x() + x / TILE_SIDE;
        (tile, z % TILE_SIDE * TILE_SIDE + x % TILE_SIDE)
    }

    /// Area of one column \[m²\].
    #[inline]
    pub fn column_area(&self) -> f64 {
        self.cell_size * self.cell_size
    }

    /// Thickness in metres of a number of quanta.
    #[inline]
    pub fn metres(&self, quanta: u64) -> f64 {
        quanta as f64 * self.cell_size / f64::from(CELL)
    }

    /// Metres to the nearest number of thickness quanta; negative lengths become 0.
    #[inline]
    pub fn thickness_quanta(&self, metres: f64) -> u64 {
        (metres / self.cell_size * f64::from(CELL)).round() as u64
    }

    /// Mass in kg of a number of quanta summed over columns.
    #[inline]
    pub fn kilograms(&self, quanta: u128) -> f64 {
        quanta as f64 / MASS_QUANTA * self.column_area()
    }
}
