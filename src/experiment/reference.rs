//! What an outcome is compared with: the thesis's figures, and those of an independent program in
//! double precision, the oracle.

use crate::diagram::number;

/// What the oracle says of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// A value, and how far off it one may be.
    Near {
        /// The oracle's value.
        value: f64,
        /// Largest difference.
        tolerance: f64,
    },
    /// No less.
    AtLeast(f64),
    /// No more.
    AtMost(f64),
    /// Nothing.
    Anything,
}

impl Expected {
    /// A height \[m\]: given to a millimetre, to be met within two.
    pub(super) fn height(metres: f64) -> Expected {
        Expected::Near { value: metres, tolerance: 0.0025 }
    }

    /// A value that has to be met but for the rounding of its last binary digits.
    pub(super) fn exactly(value: f64) -> Expected {
        Expected::Near { value, tolerance: 1e-9 }
    }

    /// Whether a value is as expected; what is no number never is.
    pub fn holds(&self, found: f64) -> bool {
        match *self {
            Expected::Near { value, tolerance } => (found - value).abs() <= tolerance,
            Expected::AtLeast(least) => found >= least,
            Expected::AtMost(most) => found <= most,
            Expected::Anything => !found.is_nan(),
        }
    }

    fn text(&self, digits: usize) -> String {
        match *self {
            Expected::Near { value, .. } => number(value, digits),
            Expected::AtLeast(least) => format!("≥ {}", number(least, digits)),
            Expected::AtMost(most) => format!("≤ {}", number(most, digits)),
            Expected::Anything => "–".to_owned(),
        }
    }
}

/// One quantity of a study: what the thesis has, what is expected, what was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What it is, with its unit.
    pub quantity: String,
    /// The thesis's words.
    pub thesis: String,
    /// The oracle's value.
    pub expected: Expected,
    /// Our value.
    pub found: f64,
    /// Digits to be shown after the point.
    pub digits: usize,
}

impl Row {
    pub(super) fn new(quantity: impl Into<String>, digits: usize, found: f64) -> Row {
        let thesis = "–".to_owned();
        Row { quantity: quantity.into(), thesis, expected: Expected::Anything, found, digits }
    }

    pub(super) fn thesis(self, words: impl Into<String>) -> Row {
        Row { thesis: words.into(), ..self }
    }

    pub(super) fn expect(self, expected: Expected) -> Row {
        Row { expected, ..self }
    }

    /// The row as cells of a table: quantity, thesis, oracle, Firn.
    pub(super) fn cells(&self) -> [String; 4] {
        [
            self.quantity.clone(),
            self.thesis.clone(),
            self.expected.text(self.digits),
            number(self.found, self.digits),
        ]
    }

    /// A sentence about a value that is not as expected.
    pub(super) fn deviation(&self) -> Option<String> {
        if self.expected.holds(self.found) {
            return None;
        }
        let digits = self.digits + 2;
        let tolerance = match self.expected {
            Expected::Near { tolerance, .. } => format!(" ± {tolerance}"),
            _ => String::new(),
        };
        Some(format!(
            "{} is {}, but {}{tolerance} was expected",
            self.quantity,
            number(self.found, digits),
            self.expected.text(digits)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_beyond_tolerance_is_told() {
        let row = |found| Row::new("height [m]", 3, found).expect(Expected::height(4.685));
        assert_eq!(row(4.6872).deviation(), None);
        let told = row(4.7).deviation().expect("it deviates");
        assert_eq!(told, "height [m] is 4.70000, but 4.68500 ± 0.0025 was expected");
        assert!(row(f64::NAN).deviation().is_some());
    }

    #[test]
    fn limits_include_themselves() {
        assert!(Expected::AtLeast(0.8).holds(0.8) && !Expected::AtLeast(0.8).holds(0.79));
        assert!(Expected::AtMost(-14.9).holds(-14.9) && !Expected::AtMost(-14.9).holds(-14.8));
        assert!(!Expected::Anything.holds(f64::NAN));
    }
}
