//! What came of a season, as it is told to people.

use std::fmt;

use firn_snow::MASS_QUANTA;

use super::run::{Plan, Season};
use super::scores::{MeltOut, Score, Scores};
use crate::diagram::number;

/// What came of a season, as it is told to people.
#[derive(Clone, Copy, Debug)]
pub struct Report<'a> {
    /// How it was run.
    pub plan: &'a Plan,
    /// What came of it.
    pub season: &'a Season,
    /// How near it comes to what was measured, if anything was.
    pub scores: Option<&'a Scores>,
}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.heading(f)?;
        if let Some(scores) = self.scores {
            writeln!(f)?;
            compared(f, scores)?;
        }
        writeln!(f)?;
        self.balance(f)
    }
}

impl Report<'_> {
    fn heading(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (season, plan) = (self.season, self.plan);
        if let (Some(first), Some(last)) = (season.days.first(), season.days.last()) {
            let days = season.days.len();
            writeln!(f, "{} to {}, {days} days", first.date, last.date)?;
        }
        let (columns, cells) = (season.grid.columns(), season.grid.height);
        let columns =
            if columns == 1 { "1 column".to_owned() } else { format!("{columns} columns") };
        let (size, step, took) = (plan.cell_size, plan.step, season.seconds);
        writeln!(f, "{columns} of {cells} cells of {size} m, steps of {step} s: {took:.2} s")
    }

    /// The ledger in kg/m².
    fn balance(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ledger = &self.season.ledger;
        writeln!(f, "  {:<26}{:>9}", "mass", "kg/m²")?;
        for (name, quanta) in [
            ("snowfall", ledger.fallen),
            ("rainfall", ledger.rained),
            ("deposited", ledger.deposited),
            ("refused", ledger.refused),
            ("sublimated", ledger.sublimated),
            ("runoff", ledger.runoff),
            ("present", ledger.present + ledger.gathered),
        ] {
            let mass = quanta as f64 / MASS_QUANTA / self.season.grid.columns() as f64;
            writeln!(f, "  {name:<26}{:>9}", number(mass, 1))?;
        }
        writeln!(f, "  {:<26}{:>9} quanta", "imbalance", ledger.imbalance())
    }
}

fn compared(f: &mut fmt::Formatter<'_>, scores: &Scores) -> fmt::Result {
    writeln!(f, "  {:<26}{:>9}{:>9}{:>7}", "beside what was measured", "RMSE", "bias", "days")?;
    let mut line = |name: &str, score: Option<Score>, digits: usize| match score {
        None => writeln!(f, "  {name:<26}{:>9}{:>9}{:>7}", "–", "–", 0),
        Some(Score { rmse, bias, days }) => {
            let (rmse, bias) = (number(rmse, digits), number(bias, digits));
            writeln!(f, "  {name:<26}{rmse:>9}{bias:>9}{days:>7}")
        }
    };
    line("depth [m]", scores.depth, 3)?;
    line("water equivalent [kg/m²]", scores.water, 1)?;
    line("surface [°C]", scores.skin, 2)?;
    match scores.melt_out {
        None => writeln!(f, "  {:<26}{:>9}", "melt-out", "–"),
        Some(melt_out) => {
            let MeltOut { model, measured } = melt_out;
            let days = melt_out.days_late();
            let late = match (days.unsigned_abs(), days < 0) {
                (0, _) => "the same day".to_owned(),
                (1, true) => "1 day early".to_owned(),
                (1, false) => "1 day late".to_owned(),
                (days, true) => format!("{days} days early"),
                (days, false) => format!("{days} days late"),
            };
            writeln!(f, "  {:<26}{model}, measured {measured}: {late}", "melt-out")
        }
    }
}
