//! What came of a run.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::Plan;
use super::tally::{Moves, Tally, Times};

/// What came of a run. Messages are those of heights; bytes are their payload, without what
/// WebSocket and TCP put around it.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Sub-protocol of the viewers.
    pub protocol: &'static str,
    /// Sessions.
    pub sessions: usize,
    /// Viewers.
    pub clients: usize,
    /// Viewers that stalled.
    pub slow_clients: usize,
    /// Moving objects in each session.
    pub colliders: usize,
    /// Length of the run \[s\].
    pub seconds: f64,
    /// Whether it was ended early.
    pub interrupted: bool,
    /// Ticks per second that were asked for \[Hz\].
    pub tick_rate: f64,
    /// Ticks per second of the slowest session \[Hz\].
    pub measured_tick_rate: f64,
    /// From a tick to a client that does not stall \[ms\]: the arrival of the first message that
    /// tells the tick, less when the tick was due. The due times are not known to a client; the
    /// least difference between arrival and tick / tick_rate of a session's messages is taken for
    /// their zero, so these are times beyond that of the fastest message.
    pub latency_ms: Option<Percentiles>,
    /// Messages to all viewers.
    pub messages: u64,
    /// Payload of the deltas among them \[bytes\].
    pub delta_bytes: u64,
    /// Columns in the tiles of the deltas.
    pub delta_columns: u64,
    /// Bytes per column of the deltas.
    pub bytes_per_column: Option<f64>,
    /// Batches of moved objects that were acknowledged.
    pub batches: u64,
    /// Batches that were refused.
    pub batches_refused: u64,
    /// From a batch to its ack \[ms\].
    pub ack_ms: Option<Percentiles>,
    /// Most messages that a stalled viewer read until it had caught up with the newest state that
    /// any viewer had seen when its stall ended, those in the sockets' buffers included.
    pub catch_up_messages: Option<u64>,
    /// Stalled viewers that had caught up by the end.
    pub caught_up: usize,
    /// Connections that ended before the run, by cause.
    pub drops: BTreeMap<String, u64>,
    /// The server's memory.
    pub server_memory: Option<Memory>,
}

/// How times are distributed \[ms\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// How many there are.
    pub count: u64,
    /// Half of them are at most this long.
    pub p50: f64,
    /// Nine in ten.
    pub p90: f64,
    /// 99 in a hundred.
    pub p99: f64,
    /// All of them.
    pub max: f64,
}

impl Percentiles {
    pub(super) fn of(times: &Times) -> Option<Percentiles> {
        Some(Percentiles {
            count: times.count(),
            p50: times.quantile(0.5)?,
            p90: times.quantile(0.9)?,
            p99: times.quantile(0.99)?,
            max: times.quantile(1.0)?,
        })
    }
}

impl fmt::Display for Percentiles {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Percentiles { count, p50, p90, p99, max } = self;
        write!(f, "p50 {p50:.1} ms, p90 {p90:.1} ms, p99 {p99:.1} ms, max {max:.1} ms ({count})")
    }
}

/// Resident memory of the server \[bytes\].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Memory {
    /// With the sessions, before any client.
    pub before: u64,
    /// At the end of the run, with every client.
    pub after: u64,
    /// The difference for each client; negative where memory was given back meanwhile.
    pub per_client: i64,
}

impl Report {
    /// The report of what was counted.
    pub(super) fn new(plan: &Plan, tallies: &[Tally], moves: &[Moves]) -> Report {
        let sum = |of: fn(&Tally) -> u64| tallies.iter().map(of).sum::<u64>();
        let (bytes, columns) = (sum(|tally| tally.bytes), sum(|tally| tally.columns));
        let mut drops = BTreeMap::new();
        let causes = tallies.iter().map(|tally| &tally.dropped);
        for cause in causes.chain(moves.iter().map(|moves| &moves.dropped)).flatten() {
            *drops.entry(cause.clone()).or_default() += 1;
        }
        let mut acks = Times::default();
        moves.iter().for_each(|moves| acks.add(&moves.times, 0));
        Report {
            protocol: plan.protocol.name(),
            sessions: plan.sessions,
            clients: plan.clients,
            slow_clients: plan.slow_clients,
            colliders: plan.colliders,
            seconds: 0.0,
            interrupted: false,
            tick_rate: plan.tick_rate,
            measured_tick_rate: 0.0,
            latency_ms: Percentiles::of(&latencies(tallies, plan.sessions)),
            messages: sum(|tally| tally.messages),
            delta_bytes: bytes,
            delta_columns: columns,
            bytes_per_column: (columns > 0).then(|| bytes as f64 / columns as f64),
            batches: moves.iter().map(|moves| moves.acks).sum(),
            batches_refused: moves.iter().map(|moves| moves.refused).sum(),
            ack_ms: Percentiles::of(&acks),
            catch_up_messages: tallies.iter().filter_map(|tally| tally.catch_up).max(),
            caught_up: tallies.iter().filter(|tally| tally.catch_up.is_some()).count(),
            drops,
            server_memory: None,
        }
    }

    pub(super) fn over(self, seconds: f64, measured_tick_rate: f64) -> Report {
        Report { seconds, measured_tick_rate, ..self }
    }

    pub(super) fn interrupted(self, interrupted: bool) -> Report {
        Report { interrupted, ..self }
    }

    pub(super) fn with_memory(self, memory: Option<(u64, u64)>) -> Report {
        let clients = self.clients as i64;
        let server_memory = memory.map(|(before, after)| Memory {
            before,
            after,
            per_client: (after as i64 - before as i64) / clients,
        });
        Report { server_memory, ..self }
    }
}

/// All latencies, those of each session counted from its fastest message.
fn latencies(tallies: &[Tally], sessions: usize) -> Times {
    let mut all = Times::default();
    for session in 0..sessions {
        let of_it = || tallies.iter().filter(|tally| tally.session == session);
        if let Some(zero) = of_it().filter_map(|tally| tally.arrivals.least()).min() {
            of_it().for_each(|tally| all.add(&tally.arrivals, zero));
        }
    }
    all
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Report { sessions, clients, slow_clients, colliders, seconds, .. } = self;
        let early = if self.interrupted { " (interrupted)" } else { "" };
        writeln!(
            f,
            "{sessions} sessions with {colliders} moving objects each, {clients} clients \
             ({}), {slow_clients} of them slow, {seconds:.1} s{early}",
            self.protocol
        )?;
        writeln!(f, "tick rate        {:.2} of {} Hz", self.measured_tick_rate, self.tick_rate)?;
        match &self.latency_ms {
            Some(latency) => writeln!(f, "tick to client   {latency}")?,
            None => writeln!(f, "tick to client   no tick was told")?,
        }
        let rate = self.messages as f64 / seconds;
        writeln!(f, "messages         {}, {rate:.0} per second", self.messages)?;
        let (bytes, columns) = (self.delta_bytes, self.delta_columns);
        write!(f, "deltas           {bytes} bytes for {columns} columns")?;
        match self.bytes_per_column {
            Some(each) => writeln!(f, ", {each:.3} per column")?,
            None => writeln!(f)?,
        }
        if let Some(acks) = &self.ack_ms {
            writeln!(f, "moves to acks    {acks}, {} refused", self.batches_refused)?;
        }
        if *slow_clients > 0 {
            let most = self.catch_up_messages.map_or("no".to_owned(), |most| most.to_string());
            let caught_up = self.caught_up;
            writeln!(f, "stalled clients  {caught_up} caught up, with at most {most} messages")?;
        }
        if let Some(Memory { before, after, per_client }) = self.server_memory {
            writeln!(f, "server memory    {before} to {after} bytes, {per_client} per client")?;
        }
        if self.drops.is_empty() {
            return write!(f, "drops            none");
        }
        let drops = self.drops.iter().map(|(cause, count)| format!("{count} × {cause}"));
        write!(f, "drops            {}", drops.collect::<Vec<_>>().join(", "))
    }
}
