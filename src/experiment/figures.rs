//! The four figures of a study: density over depth, hardness over density, height over time, and
//! stress against hardness over depth.

use plotters::style::RGBColor;

use crate::session::{ColumnView, LayerView};
use crate::snow::Material;

use super::chart::{Axis, Band, Chart, Dots, Line, Weight};
use super::number;
use super::study::{Profile, Study};

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
const REFERENCE: RGBColor = RGBColor(90, 90, 90);

/// Colours of snow at 0, −5, −10 and −15 °C and below.
const TEMPERATURES: [RGBColor; 4] =
    [RGBColor(170, 30, 20), RGBColor(235, 140, 0), RGBColor(60, 160, 110), RGBColor(20, 80, 190)];
const COLOUR_STEP: f64 = -5.0;

/// How far a temperature \[°C\] may be from a whole degree for the law's curve to be drawn.
const NEAR_DEGREE: f64 = 0.05;

const DEPTH: &str = "depth below the surface [m]";

/// Each figure with the word that its file is named after.
pub(super) fn all(study: &Study) -> [(&'static str, Chart); 4] {
    [
        ("density", density(study)),
        ("hardness", hardness(study)),
        ("height", height(study)),
        ("stress", stress(study)),
    ]
}

fn density(study: &Study) -> Chart {
    let lines: Vec<Line> = (study.profiles.iter().zip(colours()))
        .map(|(profile, colour)| Line {
            label: profile.label.clone(),
            colour,
            weight: Weight::Usual,
            points: over_depth(&profile.column, |layer| layer.density),
        })
        .collect();
    let densities = || lines.iter().flat_map(|line| &line.points).map(|p| p.0);
    let (least, most) = (-greatest(densities().map(|density| -density)), greatest(densities()));
    Chart {
        title: study.title.clone(),
        x: Axis::new("density [kg/m³]", (least / 5.0 - 0.5).floor() * 5.0, 1.03 * most),
        y: depth_axis(study.profiles.iter()),
        bands: weak_layers(study),
        lines,
        dots: Vec::new(),
    }
}

/// The law at each whole degree that there is snow of, and on it what the snow has: cells come to
/// rest where their hardness has grown to the stress.
fn hardness(study: &Study) -> Chart {
    let layers: Vec<LayerView> = last(study).flat_map(|(p, _)| p.column.layers.clone()).collect();
    let densest = 1.05 * greatest(layers.iter().map(|layer| layer.density));
    let least = layers.iter().map(|layer| layer.density).fold(densest, f64::min) * 0.9;
    let degrees = whole_degrees(&layers);
    let law = |degree: i32| {
        let steps = (0..=40).map(move |i| least + (densest - least) * f64::from(i) / 40.0);
        steps.map(move |density| {
            let hardness = Material::default().hardness(density as f32, degree as f32);
            (density, f64::from(hardness))
        })
    };
    let lines = degrees.iter().map(|&degree| Line {
        label: format!("law at {} °C", number(f64::from(degree), 0)),
        colour: temperature_colour(f64::from(degree)),
        weight: Weight::Usual,
        points: law(degree).collect(),
    });
    let lines: Vec<Line> = lines.collect();
    let dots = |label: &str, colour, filled, value: fn(&LayerView) -> f64| Dots {
        label: label.to_owned(),
        colour,
        filled,
        points: layers.iter().map(|layer| (layer.density, value(layer))).collect(),
    };
    let dots = vec![
        dots("hardness of a cell", RGBColor(40, 40, 40), true, |layer| layer.hardness),
        dots("stress on it", REFERENCE, false, |layer| layer.stress),
    ];
    let values = dots.iter().flat_map(|dots| &dots.points);
    let hardest = greatest(values.chain(lines.iter().flat_map(|line| &line.points)).map(|p| p.1));
    Chart {
        title: study.title.clone(),
        x: Axis::new("density [kg/m³]", least, densest),
        y: Axis::new("hardness, stress [Pa]", 0.0, 1.05 * hardest),
        bands: Vec::new(),
        lines,
        dots,
    }
}

fn height(study: &Study) -> Chart {
    let mut lines: Vec<Line> = (study.histories.iter().zip(colours()))
        .map(|(history, colour)| Line {
            label: history.label.clone(),
            colour,
            weight: Weight::Usual,
            points: history.points.clone(),
        })
        .collect();
    let points = || study.histories.iter().flat_map(|history| &history.points);
    let end = greatest(points().map(|p| p.0));
    if let Some(height) = study.thesis_height {
        lines.push(Line {
            label: format!("thesis: {} m", number(height, 1)),
            colour: REFERENCE,
            weight: Weight::Thin,
            points: vec![(0.0, height), (end, height)],
        });
    }
    let mut dots = Vec::new();
    if !study.oracle_heights.is_empty() {
        dots.push(Dots {
            label: "oracle".to_owned(),
            colour: REFERENCE,
            filled: true,
            points: study.oracle_heights.clone(),
        });
    }
    let (highest, lowest) = (greatest(points().map(|p| p.1)), -greatest(points().map(|p| -p.1)));
    let margin = (0.08 * (highest - lowest)).max(0.05);
    Chart {
        title: study.title.clone(),
        x: Axis::new("simulated time [s]", 0.0, end),
        y: Axis::new("height [m]", (lowest - margin).max(0.0), highest + margin),
        bands: Vec::new(),
        lines,
        dots,
    }
}

fn stress(study: &Study) -> Chart {
    let mut lines = Vec::new();
    for (profile, colour) in last(study) {
        let name =
            if last(study).count() > 1 { format!(", {}", profile.label) } else { String::new() };
        let mut line = |what: &str, weight, value: fn(&LayerView) -> f64| {
            let points = over_depth(&profile.column, value);
            lines.push(Line { label: format!("{what}{name}"), colour, weight, points });
        };
        line("stress", Weight::Broad, |layer| layer.stress);
        line("hardness", Weight::Usual, |layer| layer.hardness);
    }
    let most = greatest(lines.iter().flat_map(|line| &line.points).map(|p| p.0));
    Chart {
        title: study.title.clone(),
        x: Axis::new("stress, hardness [Pa]", 0.0, 1.05 * most),
        y: depth_axis(last(study).map(|(profile, _)| profile)),
        bands: weak_layers(study),
        lines,
        dots: Vec::new(),
    }
}

/// The final states, in the colours that all profiles have.
fn last(study: &Study) -> impl Iterator<Item = (&Profile, RGBColor)> {
    study.profiles.iter().zip(colours()).filter(|(profile, _)| profile.last)
}

fn colours() -> impl Iterator<Item = RGBColor> {
    COLOURS.into_iter().cycle()
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

/// Whole degrees that there is snow of, from the warmest to the coldest.
fn whole_degrees(layers: &[LayerView]) -> Vec<i32> {
    let near =
        layers.iter().filter(|l| (l.temperature - l.temperature.round()).abs() < NEAR_DEGREE);
    let mut degrees: Vec<i32> = near.map(|layer| layer.temperature.round() as i32).collect();
    degrees.sort_unstable_by(|a, b| b.cmp(a));
    degrees.dedup();
    degrees
}

/// A value that is constant in each cell, from the surface down.
fn over_depth(column: &ColumnView, value: impl Fn(&LayerView) -> f64) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for layer in column.layers.iter().rev() {
        let bottom = column.height - layer.bottom;
        points.push((value(layer), bottom - layer.thickness));
        points.push((value(layer), bottom));
    }
    points
}

fn depth_axis<'a>(profiles: impl Iterator<Item = &'a Profile>) -> Axis {
    let deepest = greatest(profiles.map(|profile| profile.column.height));
    Axis { down: true, ..Axis::new(DEPTH, 0.0, deepest) }
}

/// The weak layers of the final state, where there is one final state.
fn weak_layers(study: &Study) -> Vec<Band> {
    let mut states = last(study);
    let (Some((Profile { column, .. }, _)), None) = (states.next(), states.next()) else {
        return Vec::new();
    };
    let bands = column.weak_layers.iter().map(|weak| Band {
        label: "weak layer".to_owned(),
        colour: WEAK,
        from: column.height - weak.bottom - weak.thickness,
        to: column.height - weak.bottom,
    });
    bands.collect()
}

/// The greatest of some values.
fn greatest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, f64::max)
}
