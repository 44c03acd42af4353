//! Where in a picture everything is.

use super::canvas::font;
use super::{Picture, View};

/// Characters that the legend is wide: the longest name of a field.
const LEGEND_CHARACTERS: u32 = 12;

/// Characters beside a section for what is written at its vertical axis.
const AXIS_CHARACTERS: u32 = 5;

/// Least pixels across and down beside which a legend stands.
const LEAST_WITH_LEGEND: (u32, u32) = (160, 120);

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Its left edge.
    pub x: u32,
    /// Its upper edge.
    pub y: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

/// Where the parts of a picture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The scene.
    pub scene: Area,
    /// The legend's colours from the greatest value down; its writing stands above and beside.
    pub legend: Option<Area>,
}

impl Layout {
    /// The layout of a picture.
    pub fn new(picture: &Picture) -> Layout {
        let (width, height) = (picture.width, picture.height);
        let character = font(width, height).character_size;
        let large = width >= LEAST_WITH_LEGEND.0 && height >= LEAST_WITH_LEGEND.1;
        let margin = if large { character.height } else { 1 };
        let legend = (picture.legend && large).then(|| {
            let bar = height * 3 / 5;
            let across = LEGEND_CHARACTERS * character.width;
            // Two lines stand above it.
            let y = (height - bar + 2 * character.height) / 2;
            Area { x: width - margin - across, y, width: 2 * character.width, height: bar }
        });
        // Numbers and titles of a section's axes.
        let (left, above, below) = match picture.view {
            View::Section if large => {
                (AXIS_CHARACTERS * character.width, character.height, 3 * character.height)
            }
            _ => (0, 0, 0),
        };
        let right = legend.map_or(width, |legend| legend.x) - margin;
        let scene = Area {
            x: margin + left,
            y: margin + above,
            width: right - margin - left,
            height: height - 2 * margin - above - below,
        };
        Layout { scene, legend }
    }

    /// Whether there is room for the axes of a section.
    pub(super) fn has_axes(&self, picture: &Picture) -> bool {
        picture.view == View::Section && self.scene.x > 1
    }
}
