//! How near a season comes to what was measured.

use time::Date;

use super::daily::Day;
use super::evaluation::{Evaluation, Measured};
use super::run::Season;

/// A day with less snow counts as free of it \[m\]: depths are measured to a centimetre, and what is left of a melting
/// pack then lies in patches.
const FREE_OF_SNOW: f64 = 0.02;

/// How far the model is from what was measured, on days that have both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Root of the mean square of the differences.
    pub rmse: f64,
    /// Mean of the differences, positive where the model has more.
    pub bias: f64,
    /// Number of days.
    pub days: usize,
}

/// The first day without snow after the deepest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeltOut {
    /// In the model.
    pub model: Date,
    /// As measured.
    pub measured: Date,
}

/// How near a season comes to what was measured. There is nothing where nothing was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scores {
    /// Depth of snow \[m\].
    pub depth: Option<Score>,
    /// Snow water equivalent \[kg/m²\].
    pub water: Option<Score>,
    /// Temperature of the surface \[K\].
    pub skin: Option<Score>,
    /// The first day without snow.
    pub melt_out: Option<MeltOut>,
}

impl MeltOut {
    /// Days by which the model is late.
    pub fn days_late(&self) -> i64 {
        (self.model - self.measured).whole_days()
    }
}

impl Scores {
    /// Compares a season with what was measured on its whole days.
    pub fn new(season: &Season, evaluation: &Evaluation) -> Scores {
        let score = |model: fn(&Day) -> f64, measured: fn(&Measured) -> Option<f64>| {
            let days = season.days.iter().filter(|day| day.is_whole());
            score(days.filter_map(|day| Some(model(day) - measured(&evaluation.on(day.date))?)))
        };
        Scores {
            depth: score(|day| day.depth, |day| day.depth),
            water: score(|day| day.water, |day| day.water),
            skin: score(|day| day.skin, skin_of_snow),
            melt_out: melt_outs(season, evaluation),
        }
    }
}

/// The measured temperature of the surface. Snow is not warmer than 0 °C: where it lies, what was measured above that
/// is the sensor's error.
fn skin_of_snow(day: &Measured) -> Option<f64> {
    let snow = day.depth.is_some_and(|depth| depth >= FREE_OF_SNOW);
    if snow { day.skin.map(|skin| skin.min(0.0)) } else { day.skin }
}

fn score(differences: impl Iterator<Item = f64>) -> Option<Score> {
    let (mut days, mut sum, mut squares) = (0, 0.0, 0.0);
    for difference in differences {
        days += 1;
        sum += difference;
        squares += difference * difference;
    }
    let count = f64::from(u32::try_from(days).ok()?);
    (days > 0).then(|| Score { rmse: (squares / count).sqrt(), bias: sum / count, days })
}

fn melt_outs(season: &Season, evaluation: &Evaluation) -> Option<MeltOut> {
    let days = || season.days.iter().filter(|day| day.is_whole());
    let measured = days().filter_map(|day| Some((day.date, evaluation.on(day.date).depth?)));
    Some(MeltOut {
        model: melt_out(days().map(|day| (day.date, day.depth)))?,
        measured: melt_out(measured)?,
    })
}

/// The first day without snow after the deepest, where there was snow.
fn melt_out(depths: impl Iterator<Item = (Date, f64)>) -> Option<Date> {
    let (mut deepest, mut free) = (FREE_OF_SNOW, None);
    for (date, depth) in depths {
        if depth > deepest {
            (deepest, free) = (depth, None);
        } else if deepest > FREE_OF_SNOW && depth < FREE_OF_SNOW {
            free = free.or(Some(date));
        }
    }
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    fn melts_on(depths: &[f64]) -> Option<i32> {
        let days = (1..).zip(depths);
        let dated = days.map(|(day, &depth)| (Date::from_julian_day(day).unwrap(), depth));
        melt_out(dated).map(Date::to_julian_day)
    }

    #[test]
    fn snow_melts_out_after_its_deepest_day() {
        assert_eq!(melts_on(&[0.0, 0.2, 0.0, 0.5, 0.3, 0.019, 0.03, 0.0]), Some(6));
        assert_eq!(melts_on(&[0.0, 0.2, 0.5, 0.4]), None);
        assert_eq!(melts_on(&[0.0, 0.005, 0.0]), None);
        assert_eq!(melts_on(&[]), None);
    }

    #[test]
    fn snow_is_not_warmer_than_its_melting_point() {
        let on = |depth, skin| {
            skin_of_snow(&Measured { depth, skin: Some(skin), ..Measured::default() })
        };
        assert_eq!(on(Some(0.5), 1.1), Some(0.0));
        assert_eq!(on(Some(0.5), -1.1), Some(-1.1));
        assert_eq!(on(Some(0.0), 1.1), Some(1.1));
        assert_eq!(on(None, 1.1), Some(1.1));
    }

    #[test]
    fn a_score_is_of_differences() {
        let both = score([1.0, -3.0].into_iter()).unwrap();
        assert_eq!((both.rmse, both.bias, both.days), (5f64.sqrt(), -1.0, 2));
        assert_eq!(score(std::iter::empty()), None);
    }
}
