//! Lets one hostile client take what it can, and measures what is left for a neighbour.
//!
//! The neighbour is a small live session whose client changes it ten times a second. It is measured alone
//! first, then beside each [`Scenario`].

mod alone;
mod clients;
mod neighbour;
mod report;
mod scenario;
mod silent;

use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio_util::sync::CancellationToken;

use crate::open_files;

use super::api::Api;
use super::{LoadError, OTHER_FILES, Plan, resident};

pub use alone::{Alone, Got};
pub use neighbour::Measured;
pub use report::{Beside, HostileReport, Rise};
pub use scenario::Scenario;

/// Time in which a hostile client takes what it can before its neighbour is measured.
const ONSET: Duration = Duration::from_secs(1);

/// Time between two looks at the server's memory: a peak between them is not seen.
const MEMORY_LOOK: Duration = Duration::from_millis(20);

/// What a hostile client does.
#[derive(Clone, Debug)]
pub struct Attack {
    /// What it does, one after another.
    pub scenarios: Vec<Scenario>,
    /// Part of the full columns, pixels, objects, requests and bytes, above 0 and up to 1.
    pub scale: f64,
}

/// What the parts of a run share.
struct Run<'a> {
    plan: &'a Plan,
    api: Arc<Api>,
    scale: f64,
    /// Begins the name of each of its sessions.
    name: String,
    stop: &'a CancellationToken,
}

impl Run<'_> {
    /// So many at full scale: fewer below it, but one at least.
    fn count(&self, full: usize) -> usize {
        ((full as f64 * self.scale).round() as usize).max(1)
    }

    /// Length of each side of what has two of them at full scale, and `least` below it.
    fn side(&self, full: u32, least: u32) -> u32 {
        ((f64::from(full) * self.scale.sqrt()).round() as u32).max(least)
    }
}

/// Measures the neighbour alone and beside each scenario, for the plan's duration each. `observe` is told
/// what is measured; cancelling `stop` ends the run early.
///
/// # Errors
/// Where the server is not on this machine, or a session can't be made or read; the sessions are deleted all
/// the same.
pub async fn run_hostile(
    plan: &Plan,
    attack: &Attack,
    observe: impl Fn(&'static str),
    stop: &CancellationToken,
) -> Result<HostileReport, LoadError> {
    check_is_here(plan)?;
    open_files::allow(clients::MOST as u64 + neighbour::most_requests(plan) + OTHER_FILES)
        .map_err(LoadError)?;
    let name = format!("load-{}", ulid::Ulid::generate().to_string().to_lowercase());
    let run = Run { plan, api: Arc::new(Api::new(plan)?), scale: attack.scale, name, stop };
    observe("nobody");
    let id = format!("{}-nobody", run.name);
    let measured = measure_alone(&run, &id).await;
    let deleted = run.api.delete(&id).await;
    let baseline = measured.and_then(|measured| deleted.map(|()| measured))?;
    let mut beside = Vec::new();
    for &scenario in &attack.scenarios {
        if stop.is_cancelled() {
            break;
        }
        observe(scenario.name());
        beside.push(measure_and_clean_up(&run, scenario).await?);
    }
    Ok(HostileReport {
        seconds: plan.duration.as_secs_f64(),
        scale: attack.scale,
        interrupted: stop.is_cancelled(),
        baseline,
        beside,
    })
}

/// The neighbour with nobody beside it.
async fn measure_alone(run: &Run<'_>, id: &str) -> Result<Measured, LoadError> {
    neighbour::create(run, id).await?;
    neighbour::measure(run, id).await
}

/// A scenario, after which none of its sessions are left.
async fn measure_and_clean_up(run: &Run<'_>, scenario: Scenario) -> Result<Beside, LoadError> {
    let hostile = format!("{}-{}", run.name, scenario.name());
    let neighbour = format!("{hostile}-neighbour");
    let measured = measure_beside(run, scenario, &hostile, &neighbour).await;
    for id in [&hostile, &neighbour] {
        let deleted = run.api.delete(id).await;
        if measured.is_ok() {
            deleted?;
        }
    }
    measured
}

async fn measure_beside(
    run: &Run<'_>,
    scenario: Scenario,
    hostile: &str,
    neighbour: &str,
) -> Result<Beside, LoadError> {
    let alone = match scenario {
        Scenario::Ticks => Some(alone::measure(run, hostile).await?),
        _ => None,
    };
    scenario::prepare(run, scenario, hostile).await?;
    neighbour::create(run, neighbour).await?;
    let before = run.plan.server_pid.map(resident).transpose()?;
    let end = CancellationToken::new();
    // However this ends, so do the clients.
    let _ends = end.clone().drop_guard();
    let peak = run.plan.server_pid.map(|pid| tokio::spawn(peak(pid, end.clone())));
    let clients = clients::start(run, scenario, hostile, &end).await?;
    tokio::select! {
        () = run.stop.cancelled() => {}
        () = tokio::time::sleep(ONSET) => {}
    }
    let measured = neighbour::measure(run, neighbour).await?;
    end.cancel();
    let outcomes = clients::outcomes(clients).await;
    let failed = |_| LoadError("looking at the server's memory failed".to_owned());
    let memory = match before.zip(peak) {
        Some((before, peak)) => Some(Rise { before, peak: peak.await.map_err(failed)?? }),
        None => None,
    };
    Ok(Beside { scenario, neighbour: measured, outcomes, memory, alone })
}

/// The most memory that a process has until the end \[bytes\].
async fn peak(pid: u32, end: CancellationToken) -> Result<u64, LoadError> {
    let mut most = resident(pid)?;
    while !end.is_cancelled() {
        tokio::time::sleep(MEMORY_LOOK).await;
        most = most.max(resident(pid)?);
    }
    Ok(most)
}

/// Refuses servers of other machines: this is no tool to harm them with.
fn check_is_here(plan: &Plan) -> Result<(), LoadError> {
    let client = plan.client()?;
    let host = client.host();
    let ip = host.trim_matches(['[', ']']).parse::<IpAddr>();
    if host == "localhost" || ip.is_ok_and(|ip| ip.is_loopback()) {
        return Ok(());
    }
    Err(LoadError(format!(
        "'{}' is no server on this machine: --hostile is for --url http://127.0.0.1:PORT alone",
        plan.url
    )))
}
