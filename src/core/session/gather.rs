//! Views made of the cells themselves, read back from the device on demand.

use firn_engine::frame::ColumnRead;
use firn_protocol::{
    AlpineColumn, ColumnView, LayerView, MassView, Physics, Reference, SampleBatch, SampleFields,
    Stamp,
};
use firn_snow::alpine::HandHardness;
use firn_snow::{
    CELL, Cell, Column, ColumnRect, ColumnTotals, Exchanged, Grid, MASS_QUANTA, Material, Pressing,
    Sample,
};
use serde::{Deserialize, Serialize};

use crate::core::session::{Outlet, Surface};

/// Cells of some columns, and when they were as they are here.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// When.
    pub stamp: Stamp,
    /// Material constants then.
    pub material: Material,
    /// How snow gave way under objects then.
    pub pressing: Pressing,
    /// Length of the cycles then \[s\]; `None` where time stands still.
    pub cycle: Option<f64>,
    /// The columns, in the order asked for.
    pub columns: Vec<Column>,
    /// Columns of alpine snow, summed up.
    pub totals: Vec<ColumnTotals>,
    /// The surface at the points asked for.
    pub surface: SampleFields,
}

impl Outlet {
    /// Columns that were read, and the surface at the points of a batch as the mirror has it. Where nothing is said of
    /// when, it is now.
    pub(crate) fn gathered(
        &self,
        stamp: Option<Stamp>,
        columns: Vec<Column>,
        batch: Option<&SampleBatch>,
    ) -> Gathered {
        let mirror = self.mirror();
        let surface = Surface::new(&mirror);
        Gathered {
            stamp: stamp.unwrap_or_else(|| mirror.stamp_at(self.frame())),
            material: mirror.material,
            pressing: mirror.settings.pressing,
            cycle: mirror.clock.steady_cycle(),
            columns,
            totals: Vec::new(),
            surface: batch.map(|batch| surface.sample(batch)).unwrap_or_default(),
        }
    }
}

/// Cells of columns that are read at once, about.
const CELLS_OF_A_READ: usize = 1 << 16;

/// Reads of the topmost cells of some columns, each as tile · 64 + column.
pub(crate) fn reads(columns: &[u32], cells: u32) -> Vec<ColumnRead> {
    let at_once = (CELLS_OF_A_READ / cells.max(1) as usize).max(1);
    let read = |columns: &[u32]| ColumnRead { columns: columns.to_vec(), cells };
    columns.chunks(at_once).map(read).collect()
}

/// Most cells of the fixed grid that are sampled at a time.
pub const MOST_SAMPLES: u64 = 1 << 20;

/// Cells of the fixed grid that are asked for, inside its columns.
#[derive(Clone, Copy, Debug)]
pub struct CellBox {
    /// The columns.
    pub columns: ColumnRect,
    /// What cells along y are counted from.
    pub reference: Reference,
    /// First cell along y.
    pub y0: u32,
    /// Cells along y.
    pub height: u32,
}

impl CellBox {
    /// Cells in the box.
    pub fn cells(&self) -> u64 {
        self.columns.columns().saturating_mul(self.height.into())
    }
}

/// A box of the fixed grid, and when it was as it is here.
#[derive(Clone, Debug)]
pub struct Sampled {
    /// When.
    pub stamp: Stamp,
    /// The cells: x fastest, then y, then z.
    pub cells: Vec<Sample>,
}

/// Mass that has gone in and out of a snowpack, in quanta summed over its columns: 128 bits, since
/// what falls and is refused has no end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    /// Fallen, the refused part included.
    pub fallen: u128,
    /// Found no room.
    pub refused: u128,
    /// Cleared away.
    pub cleared: u128,
    /// Lies on objects.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub carried: u128,
    /// What came and went with the weather of alpine snow.
    #[serde(default, skip_serializing_if = "Exchange::is_none")]
    pub weather: Exchange,
}

/// Mass that has come and gone with the weather of alpine snow, beside the snow that fell, in quanta summed over columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exchange {
    /// Rained.
    pub rained: u128,
    /// Settled on the snow as hoar or water.
    pub deposited: u128,
    /// Left as vapour.
    pub sublimated: u128,
    /// Ran off.
    pub runoff: u128,
}

impl Exchange {
    fn is_none(&self) -> bool {
        *self == Exchange::default()
    }
}

fn is_zero(mass: &u128) -> bool {
    *mass == 0
}

impl Ledger {
    /// Mass that must be present.
    pub fn present(&self) -> u128 {
        self.fallen + self.weather.rained + self.weather.deposited
            - self.refused
            - self.cleared
            - self.carried
            - self.weather.sublimated
            - self.weather.runoff
    }

    /// Whether no more has gone than has come, and no more has come than in a million years of the heaviest snowfalls.
    pub(crate) fn is_sound(&self) -> bool {
        const MOST: u128 = 1 << 120;
        let Exchange { rained, deposited, sublimated, runoff } = self.weather;
        let came = [self.fallen, rained, deposited];
        let went = [self.refused, self.cleared, self.carried, sublimated, runoff];
        let small = came.iter().chain(&went).all(|mass| *mass < MOST);
        small && went.iter().sum::<u128>() <= came.iter().sum()
    }

    /// Enters what steps of weather exchanged.
    pub(crate) fn exchange(&mut self, found: &Exchanged) {
        self.refused += u128::from(found.refused);
        self.weather.deposited += u128::from(found.deposited);
        self.weather.sublimated += u128::from(found.sublimated);
        self.weather.runoff += u128::from(found.runoff);
    }

    /// The ledger beside the mass that is present.
    pub(crate) fn view(
        &self,
        stamp: Stamp,
        present: u128,
        grid: &Grid,
        physics: Physics,
    ) -> MassView {
        let weather = |mass| (physics == Physics::Alpine).then(|| grid.kilograms(mass));
        MassView {
            stamp,
            present: grid.kilograms(present),
            fallen: grid.kilograms(self.fallen),
            refused: grid.kilograms(self.refused),
            cleared: grid.kilograms(self.cleared),
            carried: grid.kilograms(self.carried),
            rained: weather(self.weather.rained),
            deposited: weather(self.weather.deposited),
            sublimated: weather(self.weather.sublimated),
            runoff: weather(self.weather.runoff),
            imbalance_quanta: self.present() as i64 - present as i64,
        }
    }
}

/// Density of a cell \[kg/m³\].
pub(crate) fn density(cell: &Cell, grid: &Grid) -> f64 {
    f64::from(cell.mass) / MASS_QUANTA * f64::from(CELL)
        / (f64::from(cell.thickness) * grid.cell_size)
}

/// The first column gathered.
pub(crate) fn column_view(gathered: &Gathered, grid: &Grid) -> ColumnView {
    let area = grid.column_area();
    let alpine = gathered.material.hardness_law.is_alpine();
    let mut bottom = 0u64;
    let mut mass = 0u128;
    let mut layers = Vec::new();
    for cell in gathered.columns.first().map_or(&[][..], |column| &column.cells) {
        let density = density(cell, grid);
        let hardness = cell.hardness(grid, &gathered.material);
        layers.push(LayerView {
            bottom: grid.metres(bottom),
            thickness: grid.metres(u64::from(cell.thickness)),
            density,
            temperature: f64::from(cell.celsius()),
            hardness: f64::from(hardness),
            stress: f64::from(cell.stress),
            mass: grid.kilograms(cell.mass.into()),
            liquid_water: alpine.then(|| f64::from(cell.water()) / MASS_QUANTA),
            hand_hardness: alpine.then(|| HandHardness::of(hardness)),
        });
        bottom += u64::from(cell.thickness);
        mass += u128::from(cell.mass);
    }
    let height = grid.metres(bottom);
    let mass = grid.kilograms(mass);
    ColumnView {
        stamp: gathered.stamp,
        height,
        mass,
        mean_density: if bottom == 0 { 0.0 } else { mass / (height * area) },
        weak_layers: super::weak::weak_layers(&layers),
        layers,
        alpine: gathered.totals.first().map(|totals| alpine_column(totals, height)),
    }
}

/// What a column of alpine snow has beside its layers, of snow so deep \[m\].
fn alpine_column(totals: &ColumnTotals, depth: f64) -> AlpineColumn {
    let ColumnTotals { mass, water, surface } = totals;
    AlpineColumn {
        snow_water_equivalent: f64::from(*mass) / MASS_QUANTA,
        liquid_water: f64::from(*water) / MASS_QUANTA,
        skin_temperature: surface.skin.into(),
        albedo: surface.seen_albedo(depth as f32).into(),
        runoff: surface.runoff as f64 / MASS_QUANTA,
    }
}
