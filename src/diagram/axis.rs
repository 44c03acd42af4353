//! The axes of a diagram.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;

use super::number;

/// Most numbers along an axis.
pub(super) const LABELS: usize = 9;

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Quantity and unit.
    pub label: &'static str,
    /// Its first value.
    pub from: f64,
    /// Its last value, greater than the first.
    pub to: f64,
    /// Whether values grow downwards.
    pub down: bool,
    /// Where lines go up from it and what is written there; round numbers where there are none.
    pub marks: Vec<(f64, String)>,
}

impl Axis {
    /// An axis upwards or to the right. Where there is nothing between its ends it is 1 long.
    pub fn new(label: &'static str, from: f64, to: f64) -> Axis {
        let from = if from.is_finite() { from } else { 0.0 };
        let to = if to.is_finite() && to > from { to } else { from + 1.0 };
        Axis { label, from, to, down: false, marks: Vec::new() }
    }

    /// Where a value is drawn.
    pub(super) fn place(&self, value: f64) -> f64 {
        if self.down { -value } else { value }
    }

    pub(super) fn range(&self) -> std::ops::Range<f64> {
        if self.down { -self.to..-self.from } else { self.from..self.to }
    }

    /// What plotters draws it by.
    pub(super) fn marked(&self) -> Marked {
        Marked { inner: self.range().into(), places: self.places() }
    }

    /// Where its marks are.
    fn places(&self) -> Vec<f64> {
        if self.marks.is_empty() {
            return RangedCoordf64::from(self.range()).key_points(LABELS);
        }
        self.marks.iter().map(|&(value, _)| self.place(value)).collect()
    }

    /// What is written at a mark.
    pub(super) fn text(&self, place: f64) -> String {
        match self.marks.iter().find(|&&(value, _)| self.place(value) == place) {
            Some((_, text)) => text.clone(),
            None => self.number(place),
        }
    }

    pub(super) fn number(&self, place: f64) -> String {
        let digits = match self.to - self.from {
            span if span < 1.0 => 2,
            span if span < 15.0 => 1,
            _ => 0,
        };
        number(self.place(place), digits)
    }
}

/// An axis with lines at places that are given.
#[derive(Clone)]
pub(super) struct Marked {
    inner: RangedCoordf64,
    places: Vec<f64>,
}

impl Ranged for Marked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, limit: (i32, i32)) -> i32 {
        self.inner.map(place, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.places.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.inner.range()
    }
}
