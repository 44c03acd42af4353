//! What is asked for.

use serde::Serialize;
use utoipa::ToSchema;

use super::camera::{Camera, Projection};
use super::{Field, Scale};

/// Shortest and longest side of a picture, in pixels.
pub const SIDES: (u32, u32) = (16, 4096);

/// Most pixels of a picture: a little more than 3840 × 2160.
pub const MOST_PIXELS: u32 = 1 << 23;

/// What is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(default = "grid")]
pub enum View {
    /// The fixed grid, as boxes.
    #[default]
    Grid,
    /// The surface of the snow.
    Surface,
    /// A vertical cut.
    Section,
}

impl View {
    /// Every view by its name.
    pub const ALL: [(&'static str, View); 3] =
        [("grid", View::Grid), ("surface", View::Surface), ("section", View::Section)];
}

/// What is around the snow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(default = "light")]
pub enum Background {
    /// White, with dark writing.
    #[default]
    Light,
    /// Nearly black, with light writing.
    Dark,
    /// Nothing, with writing that is read on white and on black.
    Transparent,
}

impl Background {
    /// Every background by its name.
    pub const ALL: [(&'static str, Background); 3] = [
        ("light", Background::Light),
        ("dark", Background::Dark),
        ("transparent", Background::Transparent),
    ];

    /// Its colour.
    pub fn colour(self) -> [u8; 4] {
        match self {
            Background::Light => [255, 255, 255, 255],
            Background::Dark => [13, 17, 23, 255],
            Background::Transparent => [0; 4],
        }
    }

    /// The colour of writing on it.
    pub fn ink(self) -> [u8; 3] {
        match self {
            Background::Light => [36, 41, 47],
            Background::Dark => [230, 237, 243],
            Background::Transparent => [128, 136, 144],
        }
    }
}

/// A horizontal axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(default = "x")]
pub enum Axis {
    /// Along the rows of columns.
    #[default]
    X,
    /// Across them.
    Z,
}

impl Axis {
    /// Both axes by their names.
    pub const ALL: [(&'static str, Axis); 2] = [("x", Axis::X), ("z", Axis::Z)];

    /// Its name.
    pub fn name(self) -> &'static str {
        Axis::ALL[self as usize].0
    }
}

/// A picture that is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// What is shown.
    pub view: View,
    /// What the colours show.
    pub field: Field,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Where it is seen from; a section always from its side.
    pub camera: Camera,
    /// The axis that a section runs along.
    pub along: Axis,
    /// The value of the first colour; the least one shown where it is not given.
    pub min: Option<f32>,
    /// The value of the last colour; the greatest one shown where it is not given.
    pub max: Option<f32>,
    /// Whether sides are shaded and cells have outlines. A section has neither.
    pub shading: bool,
    /// Whether a legend stands beside it, where there is room.
    pub legend: bool,
    /// Whether objects are shown.
    pub colliders: bool,
    /// What is around the snow.
    pub background: Background,
}

impl Default for Picture {
    fn default() -> Self {
        Picture {
            view: View::Grid,
            field: Field::Density,
            width: 800,
            height: 600,
            camera: Camera {
                yaw: 35.0,
                pitch: 30.0,
                zoom: 1.0,
                projection: Projection::Perspective,
            },
            along: Axis::X,
            min: None,
            max: None,
            shading: true,
            legend: true,
            colliders: true,
            background: Background::Light,
        }
    }
}

impl Picture {
    /// Colours for some values.
    pub fn scale(&self, values: impl Iterator<Item = f32>) -> Scale {
        Scale::new(self.field, values, self.min, self.max)
    }

    /// The camera that is used.
    pub fn camera(&self) -> Camera {
        let yaw = match self.along {
            Axis::X => 0.0,
            Axis::Z => -90.0,
        };
        match self.view {
            View::Section => {
                Camera { yaw, pitch: 0.0, zoom: 1.0, projection: Projection::Parallel }
            }
            View::Grid | View::Surface => self.camera,
        }
    }
}
