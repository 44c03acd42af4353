//! Lets many clients change sessions, each waiting for its answer before it asks again, and
//! measures how many changes are durable in a second and how long each takes.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::open_files;

use super::api::Api;
use super::report::Percentiles;
use super::tally::Times;
use super::{LOOK, LoadError, OTHER_FILES, Plan, Progress};

/// What came of a run: a change counts once it is acknowledged, which is when it is on disk.
#[derive(Clone, Debug, Serialize)]
pub struct DurableReport {
    /// Sessions, each paused.
    pub sessions: usize,
    /// Clients, each with one connection and one request under way.
    pub clients: usize,
    /// Length of the run \[s\].
    pub seconds: f64,
    /// Snowfalls that were acknowledged.
    pub acknowledged: u64,
    /// Of them in a second.
    pub per_second: f64,
    /// From a request to its answer \[ms\].
    pub answer_ms: Option<Percentiles>,
    /// Snowfalls that were not acknowledged.
    pub refused: u64,
}

/// Creates the plan's sessions, lets snow fall on them for the plan's duration or until each
/// session has had `changes`, and deletes them again unless they are to be kept.
///
/// # Errors
/// Where the plan can't be carried out.
pub async fn run_durable(
    plan: &Plan,
    changes: Option<u64>,
    keep: bool,
    observe: impl Fn(Progress),
    stop: &CancellationToken,
) -> Result<DurableReport, LoadError> {
    if plan.sessions == 0 || plan.clients == 0 {
        let wrong = "there must be at least one session and one client".to_owned();
        return Err(LoadError(wrong));
    }
    open_files::allow(plan.clients as u64 + OTHER_FILES).map_err(LoadError)?;
    let api = Api::new(plan)?;
    let run = ulid::Ulid::generate().to_string().to_lowercase();
    let ids: Vec<String> = (0..plan.sessions).map(|i| format!("load-{run}-{i}")).collect();
    for id in &ids {
        api.create(id, plan).await?;
    }
    let report = measure(plan, &ids, changes, observe, stop).await;
    if !keep {
        for id in &ids {
            api.delete(id).await?;
        }
    }
    report
}

/// What the clients of a run share.
struct Shared {
    /// Snowfalls that are still to be asked for, of each session.
    left: Vec<AtomicU64>,
    acknowledged: AtomicU64,
    end: CancellationToken,
}

impl Shared {
    /// Takes the next snowfall of a client that begins at some session; its session.
    fn next(&self, first: usize) -> Option<usize> {
        let sessions = self.left.len();
        (first..first + sessions).map(|i| i % sessions).find(|&session| {
            let left = &self.left[session];
            let taken = |left: u64| left.checked_sub(1);
            left.try_update(Ordering::Relaxed, Ordering::Relaxed, taken).is_ok()
        })
    }
}

async fn measure(
    plan: &Plan,
    ids: &[String],
    changes: Option<u64>,
    observe: impl Fn(Progress),
    stop: &CancellationToken,
) -> Result<DurableReport, LoadError> {
    let shared = Arc::new(Shared {
        left: ids.iter().map(|_| AtomicU64::new(changes.unwrap_or(u64::MAX))).collect(),
        acknowledged: AtomicU64::new(0),
        end: stop.child_token(),
    });
    let mut clients = JoinSet::new();
    let began = Instant::now();
    for client in 0..plan.clients {
        let (shared, own, ids) = (shared.clone(), Api::new(plan)?, ids.to_vec());
        clients.spawn(async move { fall(&shared, &own, &ids, client).await });
    }
    let over = changes.is_none().then_some(began + plan.duration);
    let (mut times, mut refused) = (Times::default(), 0);
    loop {
        let wait = over.map_or(LOOK, |over| over.saturating_duration_since(Instant::now()));
        match tokio::time::timeout(wait.min(LOOK), clients.join_next()).await {
            Ok(None) => break,
            Ok(Some(ended)) => {
                let ended = ended.map_err(|_| LoadError("a client failed".to_owned()))?;
                times.add(&ended.0, 0);
                refused += ended.1;
            }
            Err(_) => {
                observe(progress(plan, &shared, began.elapsed()));
                if over.is_some_and(|over| Instant::now() >= over) {
                    shared.end.cancel();
                }
            }
        }
    }
    let (seconds, acknowledged) = (began.elapsed().as_secs_f64(), times.count());
    Ok(DurableReport {
        sessions: plan.sessions,
        clients: plan.clients,
        seconds,
        acknowledged,
        per_second: acknowledged as f64 / seconds,
        answer_ms: Percentiles::of(&times),
        refused,
    })
}

fn progress(plan: &Plan, shared: &Shared, elapsed: Duration) -> Progress {
    let messages = shared.acknowledged.load(Ordering::Relaxed);
    Progress { connected: plan.clients, elapsed, messages, bytes: 0 }
}

/// One client: asks for snow, waits for the answer, and asks again. Returns how long the answers
/// took, and how many requests were refused.
async fn fall(shared: &Shared, api: &Api, ids: &[String], client: usize) -> (Times, u64) {
    let (mut times, mut refused) = (Times::default(), 0);
    while !shared.end.is_cancelled()
        && let Some(session) = shared.next(client % ids.len())
    {
        let asked = Instant::now();
        match api.snow(&ids[session]).await {
            Ok(()) => {
                times.note(asked.elapsed().as_secs_f64());
                shared.acknowledged.fetch_add(1, Ordering::Relaxed);
            }
            Err(_) => refused += 1,
        }
    }
    (times, refused)
}

impl fmt::Display for DurableReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let DurableReport { sessions, clients, seconds, acknowledged, per_second, .. } = self;
        writeln!(f, "{sessions} paused sessions, {clients} clients, {seconds:.1} s")?;
        writeln!(f, "durable snowfalls  {acknowledged}, {per_second:.0} per second")?;
        match &self.answer_ms {
            Some(times) => writeln!(f, "request to answer  {times}")?,
            None => writeln!(f, "request to answer  none was answered")?,
        }
        write!(f, "refused            {}", self.refused)
    }
}
