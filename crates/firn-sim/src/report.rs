//! What a simulation came through.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Instant;

/// What a simulation came through.
#[derive(Debug)]
pub struct Report {
    began: Instant,
    /// Faults of each kind.
    faults: BTreeMap<&'static str, u64>,
    /// Requests that were sent, and those that were acknowledged.
    pub requests: (u64, u64),
    /// Starts after the first.
    pub restarts: u64,
    /// Times that everything was compared.
    pub checks: u64,
    /// Times that a session fell asleep.
    pub hibernations: u64,
    /// Of all that was done to the disk.
    pub fingerprint: u64,
    /// Streams that went on exactly from where another ended.
    pub recovered: u64,
}

impl Report {
    /// Nothing yet.
    pub fn new() -> Report {
        Report {
            began: Instant::now(),
            faults: BTreeMap::new(),
            requests: (0, 0),
            restarts: 0,
            checks: 0,
            hibernations: 0,
            fingerprint: 0,
            recovered: 0,
        }
    }

    /// Counts a fault.
    pub fn fault(&mut self, kind: &'static str) {
        *self.faults.entry(kind).or_default() += 1;
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.began.elapsed().as_secs_f64();
        let all: u64 = self.faults.values().sum();
        let (sent, acknowledged) = self.requests;
        write!(f, "{seconds:.1} s, {all} faults (")?;
        for (place, (kind, count)) in self.faults.iter().enumerate() {
            let comma = if place > 0 { ", " } else { "" };
            write!(f, "{comma}{kind} {count}")?;
        }
        write!(
            f,
            "), {sent} requests, {acknowledged} acknowledged, {} restarts, {} hibernations, {} streams resumed, \
             {} comparisons; disk {:016x}",
            self.restarts, self.hibernations, self.recovered, self.checks, self.fingerprint
        )
    }
}
