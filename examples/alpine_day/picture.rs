//! A picture of the day: how warm it was, and below how deep the walker sank.

use std::path::Path;

use firn::diagram::{Axis, Chart, Line, Weight, draw};
use plotters::style::RGBColor;

use crate::{Failure, Hour};

/// Writes the picture of some hours, the day having begun at an hour of the clock.
pub fn write(file: &Path, first_hour: f64, hours: &[Hour]) -> Result<(), Failure> {
    let line = |label: &str, colour, value: fn(&Hour) -> f64| Line {
        label: label.to_owned(),
        colour,
        weight: Weight::Usual,
        points: hours.iter().map(|hour| (hour.hour, value(hour))).collect(),
    };
    let warmth = vec![
        line("air", RGBColor(200, 90, 40), |hour| hour.air),
        line("skin of the snow", RGBColor(40, 90, 180), |hour| hour.skin),
    ];
    let sink = vec![line("walker, 80 kg", RGBColor(40, 40, 40), |hour| 100.0 * hour.sink)];
    let charts = [
        chart("A clear day of April", "temperature [°C]", first_hour, warmth),
        chart("How deep a walker sinks", "sink depth [cm]", first_hour, sink),
    ];
    Ok(std::fs::write(file, draw(&charts)?)?)
}

fn chart(title: &str, label: &'static str, first_hour: f64, lines: Vec<Line>) -> Chart {
    let values = || lines.iter().flat_map(|line| line.points.iter().map(|(_, value)| *value));
    let low = values().fold(0.0, f64::min);
    let high = values().fold(low + 1.0, f64::max);
    let clock =
        |hour: u32| (f64::from(hour), format!("{:02.0}:00", (first_hour + f64::from(hour)) % 24.0));
    let marks = (0..=24).step_by(4).map(clock).collect();
    Chart {
        title: title.to_owned(),
        x: Axis { marks, ..Axis::new("hour [UTC]", 0.0, 24.0) },
        y: Axis::new(label, low.floor(), high.ceil()),
        bands: Vec::new(),
        lines,
        dots: Vec::new(),
    }
}
