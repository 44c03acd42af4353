//! Colours for values, and the numbers beside them.

use super::Field;

/// Colours of a map.
pub const COLOURS: usize = 256;

/// A range of values spread over a map of colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// What is shown.
    pub field: Field,
    /// The value of the first colour, and of all below it.
    pub from: f32,
    /// The value of the last colour, and of all above it.
    pub to: f32,
    colours: [[u8; 3]; COLOURS],
}

impl Scale {
    /// Covers some values, unless the ends are given. Where the field is [`Field::Overpressure`],
    /// an end that is not given lies as far from 0 as the other one.
    pub fn new(
        field: Field,
        values: impl Iterator<Item = f32>,
        least: Option<f32>,
        most: Option<f32>,
    ) -> Scale {
        let empty = (f32::INFINITY, f32::NEG_INFINITY);
        let found = values.fold(empty, |(a, b), value| (a.min(value), b.max(value)));
        let (mut from, mut to) = if found == empty { (0.0, 0.0) } else { found };
        if field.is_diverging() {
            let reach = least.or(most).map_or(to.max(-from), f32::abs);
            (from, to) = (-reach, reach);
        }
        let missing = (field.least_range() - (to - from)).max(0.0);
        (from, to) = (from - missing / 2.0, to + missing / 2.0);
        let (mut from, mut to) = (least.unwrap_or(from), most.unwrap_or(to));
        if from >= to && least.is_some() {
            to = from + field.least_range();
        } else if from >= to {
            from = to - field.least_range();
        }
        let colours = std::array::from_fn(|i| field.colour(i as f64 / (COLOURS - 1) as f64));
        Scale { field, from, to, colours }
    }

    /// Where a value lies, from 0 to 1.
    pub fn place(&self, value: f32) -> f32 {
        ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }

    /// The colour of a value, as red, green and blue (sRGB).
    pub fn colour(&self, value: f32) -> [u8; 3] {
        self.colours[(self.place(value) * (COLOURS - 1) as f32 + 0.5) as usize]
    }

    /// All colours, in the order of places.
    pub fn colours(&self) -> &[[u8; 3]; COLOURS] {
        &self.colours
    }

    /// Round numbers within the range, not more than about `most`, and how they are written.
    pub fn ticks(&self, most: u32) -> Vec<(f32, String)> {
        ticks(self.from, self.to, most)
    }
}

/// Multiples of 1, 2 or 5 times a power of ten from `from` to `to`, not more than about `most`.
pub(super) fn ticks(from: f32, to: f32, most: u32) -> Vec<(f32, String)> {
    let (from, to) = (f64::from(from), f64::from(to));
    let least = (to - from) / f64::from(most.max(1));
    let power = least.log10().floor();
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * 10f64.powf(power));
    let step = step.into_iter().find(|step| *step >= least * 0.999).unwrap_or(to - from);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    // A tick at an end is there although the division may round it out.
    let (first, last) = ((from / step - 1e-4).ceil() as i64, (to / step + 1e-4).floor() as i64);
    (first..=last)
        .map(|i| {
            let value = i as f64 * step;
            (value as f32, format!("{value:.digits$}"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(from: f32, to: f32, most: u32) -> Vec<String> {
        ticks(from, to, most).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_numbers_within_the_range() {
        assert_eq!(written(20.0, 60.0, 5), ["20", "30", "40", "50", "60"]);
        assert_eq!(written(-3.5, -2.5, 5), ["-3.4", "-3.2", "-3.0", "-2.8", "-2.6"]);
        assert_eq!(written(-1234.5, 1234.5, 6), ["-1000", "-500", "0", "500", "1000"]);
        assert_eq!(written(0.0, 0.1, 5), ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10"]);
    }

    #[test]
    fn a_scale_covers_its_values_and_ends_where_it_is_told() {
        let scale = Scale::new(Field::Density, [20.0, 60.0, 33.0].into_iter(), None, None);
        assert_eq!((scale.from, scale.to), (20.0, 60.0));
        assert_eq!(scale.colour(20.0), [68, 1, 84], "the darkest of viridis");
        assert_eq!(scale.colour(19.0), scale.colour(20.0));
        let told = Scale::new(Field::Density, [20.0].into_iter(), Some(0.0), Some(100.0));
        assert_eq!((told.from, told.to), (0.0, 100.0));
        let beyond = Scale::new(Field::Density, [20.0].into_iter(), Some(50.0), None);
        assert_eq!((beyond.from, beyond.to), (50.0, 51.0));
        let none = Scale::new(Field::Density, std::iter::empty(), None, None);
        assert_eq!((none.from, none.to), (-0.5, 0.5));
    }

    #[test]
    fn overpressure_has_its_middle_at_0_and_is_red_above() {
        let scale = Scale::new(Field::Overpressure, [-300.0, 20.0].into_iter(), None, None);
        assert_eq!((scale.from, scale.to), (-300.0, 300.0));
        let [red, _, blue] = scale.colour(300.0);
        assert!(red > 80 && blue < 60, "{red} {blue}");
        let told = Scale::new(Field::Overpressure, [-300.0].into_iter(), None, Some(50.0));
        assert_eq!((told.from, told.to), (-50.0, 50.0));
    }
}
