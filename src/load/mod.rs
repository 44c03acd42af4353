//! Puts load on a server as many viewers of moving snow do, and measures what they get.
//!
//! It talks to the server by its public interface alone. See [`Report`] for what is measured.

mod api;
mod durable;
mod hostile;
mod message;
mod mover;
mod plan;
mod report;
mod samples;
mod tally;
mod viewer;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use firn_client::Client;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::open_files;

use api::Api;
use tally::{Moves, Tally};

pub use durable::{DurableReport, run_durable};
pub use hostile::{
    Alone, Attack, Beside, Got, HostileReport, Measured, Rise, Scenario, run_hostile,
};
pub use plan::{Extent, Plan};
pub use report::{Memory, Percentiles, Report};
pub use samples::{SamplesReport, run_samples};

/// Side of a column \[m\].
const CELL_SIZE: f64 = 0.2;

/// Clients that connect at a time.
const CONNECTING: usize = 64;

/// Time after which clients that are not connected are no longer waited for.
const PATIENCE: Duration = Duration::from_secs(60);

/// Time between two looks at a run.
const LOOK: Duration = Duration::from_millis(250);

/// Open files that are needed beside one per client.
const OTHER_FILES: u64 = 64;

/// Why a run could not be carried out.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LoadError(String);

/// How far a run is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// Clients that see the snow.
    pub connected: usize,
    /// Time since the run began; zero before.
    pub elapsed: Duration,
    /// Messages of heights so far.
    pub messages: u64,
    /// Their payload \[bytes\].
    pub bytes: u64,
}

/// What all clients of a run share.
struct Shared {
    client: Client,
    zero: Instant,
    /// Cancelled when the run begins, once every client is connected.
    begin: CancellationToken,
    /// Cancelled when the run ends.
    end: CancellationToken,
    counting: AtomicBool,
    connecting: Semaphore,
    connected: AtomicUsize,
    /// Clients that are connected or have given up.
    arrived: AtomicUsize,
    messages: AtomicU64,
    bytes: AtomicU64,
    /// Newest seq that a client has got, by session.
    newest: Vec<AtomicU64>,
}

impl Shared {
    fn new(client: Client, sessions: usize) -> Shared {
        Shared {
            client,
            zero: Instant::now(),
            begin: CancellationToken::new(),
            end: CancellationToken::new(),
            counting: AtomicBool::new(false),
            connecting: Semaphore::new(CONNECTING),
            connected: AtomicUsize::new(0),
            arrived: AtomicUsize::new(0),
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            newest: (0..sessions).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    fn progress(&self, elapsed: Duration) -> Progress {
        Progress {
            connected: self.connected.load(Ordering::Relaxed),
            elapsed,
            messages: self.messages.load(Ordering::Relaxed),
            bytes: self.bytes.load(Ordering::Relaxed),
        }
    }
}

/// Carries a plan out: creates its sessions, runs, and deletes them again. `observe` is told how
/// far it is; cancelling `stop` ends the run early.
///
/// # Errors
/// Where the plan can't be carried out; the sessions are deleted all the same.
pub async fn run(
    plan: &Plan,
    observe: impl Fn(Progress),
    stop: &CancellationToken,
) -> Result<Report, LoadError> {
    plan.check()?;
    let files = plan.clients as u64 + plan.sessions as u64 + OTHER_FILES;
    open_files::allow(files).map_err(LoadError)?;
    let api = Api::new(plan)?;
    let run = ulid::Ulid::generate().to_string().to_lowercase();
    let ids: Vec<String> = (0..plan.sessions).map(|i| format!("load-{run}-{i}")).collect();
    let result = tokio::select! {
        biased;
        () = stop.cancelled() => Err(LoadError("interrupted before the run began".to_owned())),
        prepared = prepare(plan, &api, &ids) => prepared,
    };
    let result = match result {
        Ok(()) => measure(plan, &api, &ids, observe, stop).await,
        Err(error) => Err(error),
    };
    // Those that were not created are not there, which is what is wanted.
    for id in &ids {
        let deleted = api.delete(id).await;
        if result.is_ok() {
            deleted?;
        }
    }
    result
}

/// Creates the sessions, with snow that has settled where that is wanted, and sets them running.
async fn prepare(plan: &Plan, api: &Api, ids: &[String]) -> Result<(), LoadError> {
    for id in ids {
        api.create(id, plan).await?;
        if plan.settled {
            api.settle(id).await?;
        }
        api.snow_at(id, plan.snowfall_rate).await?;
        api.unpause(id).await?;
    }
    Ok(())
}

async fn measure(
    plan: &Plan,
    api: &Api,
    ids: &[String],
    observe: impl Fn(Progress),
    stop: &CancellationToken,
) -> Result<Report, LoadError> {
    let memory_before = plan.server_pid.map(resident).transpose()?;
    let shared = Arc::new(Shared::new(plan.client()?, ids.len()));
    let mut viewers = JoinSet::new();
    for number in 0..plan.clients {
        viewers.spawn(viewer::watch(plan.clone(), number, ids.to_vec(), shared.clone()));
    }
    let mut movers = JoinSet::new();
    for id in ids.iter().filter(|_| plan.colliders > 0) {
        movers.spawn(mover::drive(plan.clone(), id.clone(), shared.clone()));
    }
    let waited = Instant::now();
    while shared.arrived.load(Ordering::Relaxed) < plan.clients
        && waited.elapsed() < PATIENCE
        && !stop.is_cancelled()
    {
        tokio::time::sleep(LOOK / 10).await;
        observe(shared.progress(Duration::ZERO));
    }
    let ticks_before = ticks(api, ids).await?;
    let began = Instant::now();
    shared.counting.store(true, Ordering::Relaxed);
    shared.begin.cancel();
    while began.elapsed() < plan.duration && !stop.is_cancelled() {
        let left = plan.duration.saturating_sub(began.elapsed());
        tokio::time::sleep(left.min(LOOK)).await;
        observe(shared.progress(began.elapsed()));
    }
    shared.counting.store(false, Ordering::Relaxed);
    let seconds = began.elapsed().as_secs_f64();
    let ticks_after = ticks(api, ids).await?;
    let memory_after = plan.server_pid.map(resident).transpose()?;
    shared.end.cancel();
    let tallies: Vec<Tally> = viewers.join_all().await;
    let moves: Vec<Moves> = movers.join_all().await;
    let rates = ticks_before.iter().zip(&ticks_after).map(|((at, tick), (until, last))| {
        last.saturating_sub(*tick) as f64 / (*until - *at).as_secs_f64()
    });
    Ok(Report::new(plan, &tallies, &moves)
        .over(seconds, rates.fold(f64::INFINITY, f64::min))
        .interrupted(stop.is_cancelled())
        .with_memory(memory_before.zip(memory_after)))
}

/// Each session's tick and when it was read.
async fn ticks(api: &Api, ids: &[String]) -> Result<Vec<(Instant, u64)>, LoadError> {
    let mut ticks = Vec::with_capacity(ids.len());
    for id in ids {
        let tick = api.tick(id).await?;
        ticks.push((Instant::now(), tick));
    }
    Ok(ticks)
}

/// Memory of a process that is in use \[bytes\].
fn resident(pid: u32) -> Result<u64, LoadError> {
    let path = format!("/proc/{pid}/status");
    let unknown = || LoadError(format!("{path} does not say how much memory the process uses"));
    let status = std::fs::read_to_string(&path).map_err(|_| unknown())?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).ok_or_else(unknown)?;
    let kibibytes: u64 =
        line.trim().trim_end_matches("kB").trim().parse().map_err(|_| unknown())?;
    Ok(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_is_read_of_processes_that_are_there() {
        assert!(resident(std::process::id()).unwrap() > 1 << 20);
        assert!(resident(u32::MAX).is_err());
    }
}
