//! Figures: what the model says, and on it what was measured.

use plotters::style::RGBColor;
use time::{Date, Month};

use super::daily::Day;
use super::evaluation::{Evaluation, Measured};
use super::run::Season;
use crate::diagram::{Axis, Chart, Dots, Line, REFERENCE, Weight};

/// Most months that are named along an axis.
const MOST_MONTHS: usize = 10;

/// Room above and below what is drawn, as a part of its height.
const MARGIN: f64 = 0.05;

/// The colour of the model.
const MODEL: RGBColor = RGBColor(0, 114, 178);

/// A quantity, and how to see it.
struct Quantity {
    /// The file's name.
    name: &'static str,
    title: &'static str,
    axis: &'static str,
    model: fn(&Day) -> f64,
    measured: fn(&Measured) -> Option<f64>,
    /// Whether days are added up.
    adds_up: bool,
    /// Whether there is a figure of the model alone.
    always: bool,
}

const QUANTITIES: [Quantity; 5] = [
    Quantity {
        name: "depth",
        title: "Depth of snow",
        axis: "depth [m]",
        model: |day| day.depth,
        measured: |day| day.depth,
        adds_up: false,
        always: true,
    },
    Quantity {
        name: "swe",
        title: "Snow water equivalent",
        axis: "water equivalent [kg/m²]",
        model: |day| day.water,
        measured: |day| day.water,
        adds_up: false,
        always: true,
    },
    Quantity {
        name: "surface-temperature",
        title: "Temperature of the surface",
        axis: "daily mean [°C]",
        model: |day| day.skin,
        measured: |day| day.skin,
        adds_up: false,
        always: true,
    },
    Quantity {
        name: "runoff",
        title: "Runoff",
        axis: "runoff since the beginning [kg/m²]",
        model: |day| day.runoff,
        measured: |day| day.runoff,
        adds_up: true,
        always: false,
    },
    Quantity {
        name: "albedo",
        title: "Albedo",
        axis: "albedo",
        model: |day| day.albedo,
        measured: |day| day.albedo,
        adds_up: false,
        always: false,
    },
];

/// Each figure with the name of its file.
pub(super) fn all(season: &Season, evaluation: Option<&Evaluation>) -> Vec<(&'static str, Chart)> {
    let measured = |quantity: &Quantity| evaluation.is_some_and(|all| all.has(quantity.measured));
    let shown = QUANTITIES.iter().filter(|quantity| quantity.always || measured(quantity));
    shown.map(|quantity| (quantity.name, quantity.chart(season, evaluation))).collect()
}

impl Quantity {
    fn chart(&self, season: &Season, evaluation: Option<&Evaluation>) -> Chart {
        let mut model = Vec::new();
        let mut measured = Vec::new();
        let (mut sums, mut seen) = ((0.0, 0.0), false);
        for (index, day) in season.days.iter().enumerate() {
            // A day's mean stands in its middle.
            let x = index as f64 + 0.5;
            let value = (self.model)(day);
            let beside = evaluation.and_then(|all| (self.measured)(&all.on(day.date)));
            seen |= beside.is_some();
            if !self.adds_up {
                model.push((x, value));
                measured.extend(beside.map(|beside| (x, beside)));
            } else if let Some(beside) = beside {
                // Both are added up on days that have both.
                sums = (sums.0 + value, sums.1 + beside);
                model.push((x, sums.0));
                measured.push((x, sums.1));
            }
        }
        let values = || model.iter().chain(&measured).map(|&(_, value)| value);
        let (lowest, highest) =
            values().fold((0.0, 0.0), |(low, high), value| (value.min(low), value.max(high)));
        let margin = MARGIN * (highest - lowest);
        let floor = if lowest < 0.0 { lowest - margin } else { 0.0 };
        let dots = Dots {
            label: "measured".to_owned(),
            colour: REFERENCE,
            filled: false,
            points: measured,
        };
        Chart {
            title: self.title.to_owned(),
            x: dates(&season.days),
            y: Axis::new(self.axis, floor, highest + margin),
            bands: Vec::new(),
            lines: vec![Line {
                label: "Firn".to_owned(),
                colour: MODEL,
                weight: Weight::Usual,
                points: model,
            }],
            dots: if seen { vec![dots] } else { Vec::new() },
        }
    }
}

/// An axis of days from the first one on, with the first days of months.
fn dates(days: &[Day]) -> Axis {
    let mut axis = Axis::new("month", 0.0, days.len() as f64);
    let begins: Vec<(usize, Date)> =
        (days.iter().map(|day| day.date).enumerate()).filter(|(_, date)| date.day() == 1).collect();
    let every = [1, 2, 3, 6].into_iter().find(|every| begins.len() <= MOST_MONTHS * every);
    // As many months apart, or years.
    let months = every.unwrap_or(12) as u8;
    let years = begins.len().div_ceil(12 * MOST_MONTHS).max(1) as i32;
    let marked = |date: Date| {
        (date.month() as u8 - 1).is_multiple_of(months) && (months < 12 || date.year() % years == 0)
    };
    let marks = begins.into_iter().filter(|&(_, date)| marked(date));
    axis.marks = marks.map(|(index, date)| (index as f64, month(date))).collect();
    axis
}

/// The month, and with the first one of a year the year.
fn month(date: Date) -> String {
    let name: String = date.month().to_string().chars().take(3).collect();
    if date.month() == Month::January { format!("{name} {}", date.year()) } else { name }
}
