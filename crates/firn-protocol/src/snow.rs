//! Readings of the snow: columns with their layers, and the mass ledger.

use firn_snow::alpine::HandHardness;
use serde::{Deserialize, Serialize};

use crate::session::Stamp;

/// What the cells of the fixed grid are counted from, along y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// The lowest ground of the session.
    #[default]
    Lowest,
    /// The ground of each column.
    Ground,
}

/// One column's material cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ColumnView {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Snow depth \[m\].
    pub height: f64,
    /// Mass \[kg\].
    pub mass: f64,
    /// Mass over volume \[kg/m³\]; 0 where there is no snow.
    pub mean_density: f64,
    /// The material cells, from the ground up.
    pub layers: Vec<LayerView>,
    /// Layers less dense than what lies above and below, from the ground up.
    pub weak_layers: Vec<WeakLayerView>,
    /// What alpine snow has beside.
    #[serde(flatten)]
    #[cfg_attr(feature = "schema", schema(value_type = AlpineColumn))]
    pub alpine: Option<AlpineColumn>,
}

/// What a column of alpine snow has beside its layers; other snow has none of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AlpineColumn {
    /// Mass of ice and water on a square metre \[kg/m²\].
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub snow_water_equivalent: f64,
    /// Mass of liquid water on it \[kg/m²\].
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub liquid_water: f64,
    /// Temperature of the surface of snow or ground \[°C\].
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub skin_temperature: f64,
    /// Part of the short wave that is sent back, as it is seen.
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub albedo: f64,
    /// Water that has run off since the session began \[kg/m²\].
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub runoff: f64,
}

/// One material cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LayerView {
    /// Height of its lower face above the ground \[m\].
    pub bottom: f64,
    /// Thickness \[m\].
    pub thickness: f64,
    /// Density \[kg/m³\].
    pub density: f64,
    /// Temperature \[°C\].
    pub temperature: f64,
    /// Hardness \[Pa\].
    pub hardness: f64,
    /// Vertical stress on it, its own weight included \[Pa\].
    pub stress: f64,
    /// Mass \[kg\].
    pub mass: f64,
    /// Liquid water in it \[kg/m²\], where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false))]
    pub liquid_water: Option<f64>,
    /// Hardness by hand, where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = HandHardness, required = false))]
    pub hand_hardness: Option<HandHardness>,
}

/// A maximal run of cells with a density of at most 0.8 of the least dense of the densest cell
/// above and the densest cell below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct WeakLayerView {
    /// Height of its lower face above the ground \[m\].
    pub bottom: f64,
    /// Thickness \[m\].
    pub thickness: f64,
    /// Mean density \[kg/m³\].
    pub density: f64,
    /// Mean temperature, weighted by mass \[°C\].
    pub temperature: f64,
    /// 1 − the smallest ratio of a cell's density to that of the cells around.
    pub contrast: f64,
}

/// The mass ledger of a session.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct MassView {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Mass of the snow, summed over its cells \[kg\]; in alpine snow with what has fallen and is too thin for a cell.
    pub present: f64,
    /// Mass that has fallen \[kg\], the refused part included.
    pub fallen: f64,
    /// Mass that found no room \[kg\].
    pub refused: f64,
    /// Mass that was cleared \[kg\].
    pub cleared: f64,
    /// Mass that lies on objects \[kg\].
    #[serde(default)]
    pub carried: f64,
    /// Mass that rained \[kg\], where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false))]
    pub rained: Option<f64>,
    /// Mass of vapour that settled on the snow \[kg\], where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false))]
    pub deposited: Option<f64>,
    /// Mass that left as vapour \[kg\], where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false))]
    pub sublimated: Option<f64>,
    /// Mass of water that ran off \[kg\], where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false))]
    pub runoff: Option<f64>,
    /// fallen − refused − cleared − present − carried, in quanta of 2⁻¹⁸ kg/m² in one column: always 0. In alpine snow
    /// what rained and was deposited is added, and what ran off and sublimated is taken off.
    pub imbalance_quanta: i64,
}
