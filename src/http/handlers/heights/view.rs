//! What heights are told as.

use firn_protocol::Stamp;
use firn_snow::Grid;
use serde::{Serialize, Serializer};
use utoipa::ToSchema;

use super::quantities::Quantity;

/// Heights of a region.
#[derive(Debug, Serialize, ToSchema)]
pub struct HeightsView {
    /// When this holds.
    #[serde(flatten)]
    pub(super) stamp: Stamp,
    /// First column.
    pub(super) origin: Origin,
    /// Samples along x.
    pub(super) width: u32,
    /// Samples along z.
    pub(super) depth: u32,
    /// Columns from one sample to the next.
    pub(super) stride: u32,
    /// Side of a column \[m\].
    pub(super) cell_size: f64,
    /// The quantity in `heights`, unless these are depths or elevations.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Quantity, required = false)]
    pub(super) quantity: Option<Quantity>,
    /// Snow depths \[m\], or elevations or the quantity where those are asked for, row by row: index = z · width + x.
    #[schema(value_type = Vec<f64>)]
    pub(super) heights: Values,
}

/// The value of each column of a region.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(super) enum Values {
    /// Depths or elevations.
    Heights(Heights),
    /// Another quantity.
    Others(Vec<f32>),
}

/// A column.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct Origin {
    /// Along x.
    pub(super) column_x: u32,
    /// Along z.
    pub(super) column_z: u32,
}

/// Snow depths as 32-bit floats, little-endian, row by row.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct Floats(Vec<u8>);

/// A 16-bit grey image, one pixel per sample: metres = grey · `Firn-Height-Scale` +
/// `Firn-Height-Offset`. Both are the same for all images of a session's snow, and of its surface.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct GreyImage(Vec<u8>);

/// A NumPy array file (version 1.0): 32-bit floats, little-endian, C order, shape (depth, width).
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct NumpyArray(Vec<u8>);

/// Heights as they were copied out of the mirror.
#[derive(Debug)]
pub(super) struct Heights {
    pub(super) grid: Grid,
    /// Thicknesses of the snow, in quanta; none for elevations of the ground.
    pub(super) quanta: Option<Vec<u32>>,
    /// Elevations of the ground \[m\]; none for depths.
    pub(super) ground: Option<Vec<f64>>,
}

impl Heights {
    /// How many they are.
    pub(super) fn count(&self) -> usize {
        let ground = || self.ground.as_ref().map_or(0, Vec::len);
        self.quanta.as_ref().map_or_else(ground, Vec::len)
    }

    /// Each of them \[m\].
    pub(super) fn metres(&self) -> impl Iterator<Item = f64> {
        let depth = |i: usize| {
            self.quanta.as_ref().map_or(0.0, |quanta| self.grid.metres(quanta[i].into()))
        };
        let ground = |i: usize| self.ground.as_ref().map_or(0.0, |ground| ground[i]);
        (0..self.count()).map(move |i| depth(i) + ground(i))
    }
}

impl Serialize for Heights {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.metres())
    }
}
