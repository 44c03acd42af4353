//! Times of one thing measured many times.

use std::time::Duration;

use serde::Serialize;

/// How measured times \[s\] spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// A quarter are at most this.
    pub lower_quartile: f64,
    /// Half are at most this.
    pub median: f64,
    /// Three quarters are at most this.
    pub upper_quartile: f64,
    /// The greatest.
    pub max: f64,
    /// How many there are.
    pub samples: usize,
}

impl Spread {
    /// The spread of times; `None` where there are none.
    pub fn of(mut times: Vec<Duration>) -> Option<Spread> {
        times.sort_unstable();
        let last = times.len().checked_sub(1)?;
        // The nearest of the times: nothing is interpolated that was not measured.
        let at = |part: f64| times[(part * last as f64).round() as usize].as_secs_f64();
        Some(Spread {
            min: at(0.0),
            lower_quartile: at(0.25),
            median: at(0.5),
            upper_quartile: at(0.75),
            max: at(1.0),
            samples: times.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_times_that_were_measured() {
        let times = [5, 1, 4, 2, 3].map(Duration::from_secs).to_vec();
        let Spread { min, lower_quartile, median, upper_quartile, max, samples } =
            Spread::of(times).unwrap();
        assert_eq!([min, lower_quartile, median, upper_quartile, max], [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(samples, 5);
        assert_eq!(Spread::of(Vec::new()), None);
    }
}
