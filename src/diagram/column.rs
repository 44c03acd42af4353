//! Diagrams of columns of snow: density over depth, and hardness over density (thesis, chapters 4
//! and 6).

use firn_protocol::{ColumnView, LayerView};
use firn_snow::Material;
use plotters::style::RGBColor;

use super::axis::Axis;
use super::chart::{Band, Chart, Dots, Line, Weight};
use super::number;

/// Colours that people with any colour vision can tell apart (Okabe and Ito).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
const WEAK: RGBColor = RGBColor(255, 226, 190);
const CELL: RGBColor = RGBColor(40, 40, 40);

/// The colour of what something is compared with.
pub const REFERENCE: RGBColor = RGBColor(90, 90, 90);

/// Colours of snow at 0, −5, −10 and −15 °C and below.
const TEMPERATURES: [RGBColor; 4] =
    [RGBColor(170, 30, 20), RGBColor(235, 140, 0), RGBColor(60, 160, 110), RGBColor(20, 80, 190)];
const COLOUR_STEP: f64 = -5.0;

/// How far a temperature \[°C\] may be from a whole degree for the law's curve to be drawn.
const NEAR_DEGREE: f64 = 0.05;

/// Most curves of the law.
const MOST_DEGREES: usize = 10;

const DEPTH: &str = "depth below the surface [m]";

/// Colours for one line after the other.
pub fn colours() -> impl Iterator<Item = RGBColor> {
    COLOURS.into_iter().cycle()
}

/// A column as it is now: its density over depth with its weak layers, and below that its hardness
/// over density.
pub fn profile(title: &str, column: &ColumnView, material: &Material) -> [Chart; 2] {
    let titled = |what: &str| format!("{title}: {what}");
    let mut density = density_over_depth(titled("density"), &[("density", column)]);
    density.bands = weak_bands(column);
    [density, hardness_over_density(titled("hardness"), &column.layers, material)]
}

/// Density over depth of some columns.
pub fn density_over_depth(title: String, columns: &[(&str, &ColumnView)]) -> Chart {
    let lines: Vec<Line> = (columns.iter().zip(colours()))
        .map(|((label, column), colour)| Line {
            label: (*label).to_owned(),
            colour,
            weight: Weight::Usual,
            points: over_depth(column, |layer| layer.density),
        })
        .collect();
    let densities = || lines.iter().flat_map(|line| &line.points).map(|p| p.0);
    let (least, most) = (-greatest(densities().map(|density| -density)), greatest(densities()));
    Chart {
        title,
        x: Axis::new("density [kg/m³]", (least / 5.0 - 0.5).floor() * 5.0, 1.03 * most),
        y: depth_axis(columns.iter().map(|(_, column)| *column)),
        bands: Vec::new(),
        lines,
        dots: Vec::new(),
    }
}

/// The law at each whole degree that there is snow of, and on it what the snow has: cells come to
/// rest where their hardness has grown to the stress.
pub fn hardness_over_density(title: String, layers: &[LayerView], material: &Material) -> Chart {
    let densest = 1.05 * greatest(layers.iter().map(|layer| layer.density));
    let least = layers.iter().map(|layer| layer.density).fold(densest, f64::min) * 0.9;
    let law = |degree: i32| {
        let steps = (0..=40).map(move |i| least + (densest - least) * f64::from(i) / 40.0);
        steps.map(move |density| {
            let hardness = material.hardness(density as f32, degree as f32);
            (density, f64::from(hardness))
        })
    };
    let lines: Vec<Line> = whole_degrees(layers)
        .into_iter()
        .map(|degree| Line {
            label: format!("law at {} °C", number(f64::from(degree), 0)),
            colour: temperature_colour(f64::from(degree)),
            weight: Weight::Usual,
            points: law(degree).collect(),
        })
        .collect();
    let dots = |label: &str, colour, filled, value: fn(&LayerView) -> f64| Dots {
        label: label.to_owned(),
        colour,
        filled,
        points: layers.iter().map(|layer| (layer.density, value(layer))).collect(),
    };
    let dots = vec![
        dots("hardness of a cell", CELL, true, |layer| layer.hardness),
        dots("stress on it", REFERENCE, false, |layer| layer.stress),
    ];
    let values = dots.iter().flat_map(|dots| &dots.points);
    let hardest = greatest(values.chain(lines.iter().flat_map(|line| &line.points)).map(|p| p.1));
    Chart {
        title,
        x: Axis::new("density [kg/m³]", least, densest),
        y: Axis::new("hardness, stress [Pa]", 0.0, 1.05 * hardest),
        bands: Vec::new(),
        lines,
        dots,
    }
}

fn temperature_colour(celsius: f64) -> RGBColor {
    let last = TEMPERATURES.len() - 1;
    let place = (celsius / COLOUR_STEP).clamp(0.0, last as f64);
    let from = (place as usize).min(last - 1);
    let mixed = |of: fn(RGBColor) -> u8| {
        let (a, b) = (f64::from(of(TEMPERATURES[from])), f64::from(of(TEMPERATURES[from + 1])));
        (a + (b - a) * (place - from as f64)) as u8
    };
    RGBColor(mixed(|c| c.0), mixed(|c| c.1), mixed(|c| c.2))
}

/// Whole degrees that there is snow of, from the warmest to the coldest; where there are none, or
/// too many, those next to the warmest and to the coldest snow.
fn whole_degrees(layers: &[LayerView]) -> Vec<i32> {
    let degree = |layer: &LayerView| layer.temperature.round() as i32;
    let near =
        layers.iter().filter(|l| (l.temperature - l.temperature.round()).abs() < NEAR_DEGREE);
    let mut degrees: Vec<i32> = near.map(degree).collect();
    degrees.sort_unstable_by(|a, b| b.cmp(a));
    degrees.dedup();
    if degrees.is_empty() || degrees.len() > MOST_DEGREES {
        let ends = [layers.iter().map(degree).max(), layers.iter().map(degree).min()];
        degrees = ends.into_iter().flatten().collect();
        degrees.dedup();
    }
    degrees
}

/// A value that is constant in each cell, from the surface down.
pub fn over_depth(column: &ColumnView, value: impl Fn(&LayerView) -> f64) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for layer in column.layers.iter().rev() {
        let bottom = column.height - layer.bottom;
        points.push((value(layer), bottom - layer.thickness));
        points.push((value(layer), bottom));
    }
    points
}

/// An axis down to the ground of the highest of some columns.
pub fn depth_axis<'a>(columns: impl Iterator<Item = &'a ColumnView>) -> Axis {
    let deepest = greatest(columns.map(|column| column.height));
    Axis { down: true, ..Axis::new(DEPTH, 0.0, deepest) }
}

/// The weak layers of a column.
pub fn weak_bands(column: &ColumnView) -> Vec<Band> {
    let bands = column.weak_layers.iter().map(|weak| Band {
        label: "weak layer".to_owned(),
        colour: WEAK,
        from: column.height - weak.bottom - weak.thickness,
        to: column.height - weak.bottom,
    });
    bands.collect()
}

/// The greatest of some values.
pub fn greatest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, f64::max)
}
