//! The four figures of a study: density over depth, hardness over density, height over time, and
//! stress against hardness over depth.

use firn_protocol::LayerView;
use firn_snow::Material;
use plotters::style::RGBColor;

use crate::diagram::{
    Axis, Band, Chart, Dots, Line, REFERENCE, Weight, colours, density_over_depth, depth_axis,
    greatest, hardness_over_density, number, over_depth, weak_bands,
};

use super::study::{Profile, Study};

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
    let columns: Vec<_> =
        study.profiles.iter().map(|profile| (profile.label.as_str(), &profile.column)).collect();
    Chart { bands: weak_layers(study), ..density_over_depth(study.title.clone(), &columns) }
}

fn hardness(study: &Study) -> Chart {
    let layers: Vec<LayerView> = last(study).flat_map(|(p, _)| p.column.layers.clone()).collect();
    hardness_over_density(study.title.clone(), &layers, &Material::default())
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
        y: depth_axis(last(study).map(|(profile, _)| &profile.column)),
        bands: weak_layers(study),
        lines,
        dots: Vec::new(),
    }
}

/// The final states, in the colours that all profiles have.
fn last(study: &Study) -> impl Iterator<Item = (&Profile, RGBColor)> {
    study.profiles.iter().zip(colours()).filter(|(profile, _)| profile.last)
}

/// The weak layers of the final state, where there is one final state.
fn weak_layers(study: &Study) -> Vec<Band> {
    let mut states = last(study);
    match (states.next(), states.next()) {
        (Some((profile, _)), None) => weak_bands(&profile.column),
        _ => Vec::new(),
    }
}
