//! What came of a run beside hostile clients.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::{Alone, Got, Measured, Scenario};

/// Bytes of a MiB.
const MIB: f64 = (1 << 20) as f64;

/// What a neighbour got alone, and beside each hostile client.
#[derive(Clone, Debug, Serialize)]
pub struct HostileReport {
    /// Length of each measurement \[s\].
    pub seconds: f64,
    /// Part of the full sizes and counts.
    pub scale: f64,
    /// Whether it was ended early.
    pub interrupted: bool,
    /// With nobody beside it.
    pub baseline: Measured,
    /// Beside each of them.
    pub beside: Vec<Beside>,
}

/// A neighbour beside a hostile client.
#[derive(Clone, Debug, Serialize)]
pub struct Beside {
    /// What the hostile client does.
    pub scenario: Scenario,
    /// What the neighbour got.
    pub neighbour: Measured,
    /// How often something came of a hostile request: a status, or what happened instead.
    pub outcomes: BTreeMap<String, u64>,
    /// The server's memory.
    pub memory: Option<Rise>,
    /// What the hostile session got before the neighbour came, where that was measured.
    pub alone: Option<Alone>,
}

/// Resident memory of the server \[bytes\].
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Rise {
    /// With both sessions, before the hostile client begins.
    pub before: u64,
    /// The most that was seen.
    pub peak: u64,
}

impl fmt::Display for HostileReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let early = if self.interrupted { " (interrupted)" } else { "" };
        writeln!(f, "a neighbour, {:.1} s each, scale {}{early}", self.seconds, self.scale)?;
        writeln!(
            f,
            "{:<10} {:>8} {:>6} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}  hostile requests",
            "beside",
            "ticks/s",
            "share",
            "changes",
            "refused",
            "p50 ms",
            "p99 ms",
            "max ms",
            "+MiB"
        )?;
        row(f, "nobody", &self.baseline, None)?;
        writeln!(f)?;
        for Beside { scenario, neighbour, outcomes, memory, .. } in &self.beside {
            row(f, scenario.name(), neighbour, *memory)?;
            let outcomes = outcomes.iter().map(|(what, count)| format!("{count} × {what}"));
            writeln!(f, "  {}", outcomes.collect::<Vec<_>>().join(", "))?;
        }
        for beside in &self.beside {
            if let Some(alone) = &beside.alone {
                writeln!(f, "{} alone: {alone}", beside.scenario.name())?;
            }
        }
        Ok(())
    }
}

/// A line of the table, without its end.
fn row(f: &mut fmt::Formatter, name: &str, got: &Measured, memory: Option<Rise>) -> fmt::Result {
    let Measured { ticks_per_second, tick_share, changes, refused, change_ms } = got;
    let share = format!("{:.0} %", 100.0 * tick_share);
    write!(f, "{name:<10} {ticks_per_second:>8.1} {share:>6} {changes:>8} {refused:>8}")?;
    match change_ms {
        Some(times) => write!(f, " {:>8.1} {:>8.1} {:>8.1}", times.p50, times.p99, times.max)?,
        None => write!(f, " {:>8} {:>8} {:>8}", "-", "-", "-")?,
    }
    match memory {
        Some(Rise { before, peak }) => {
            write!(f, " {:>8.0}", peak.saturating_sub(before) as f64 / MIB)
        }
        None => write!(f, " {:>8}", "-"),
    }
}

impl fmt::Display for Alone {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "live {}; stepped {}", self.live, self.stepped)
    }
}

impl fmt::Display for Got {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Got { charged_share, frame_share, ticks_per_second } = self;
        let (charged, frames) = (100.0 * charged_share, 100.0 * frame_share);
        let ticks = ticks_per_second.map_or("too few".to_owned(), |ticks| format!("{ticks:.2}"));
        write!(f, "frames {frames:.0} % of the time, charged {charged:.0} %, {ticks} ticks/s")
    }
}
