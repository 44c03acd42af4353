//! The clients of a scenario, and how they fared.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use firn_client::Method;
use reqwest::StatusCode;
use serde_json::json;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::load::LoadError;
use crate::load::api::Api;

use super::silent::{self, Request};
use super::{Run, Scenario};

/// Most connections of a scenario.
pub(super) const MOST: usize = 200;

const PICTURES: usize = 16;
const BODIES: usize = 60;

/// Bytes of a body.
const BODY: usize = 15_000_000;

/// Pixels of a picture along each side, at full scale and at the least.
const WIDTH: (u32, u32) = (4096, 16);
const HEIGHT: (u32, u32) = (2048, 16);

/// Time until a client asks again that was refused.
const REST: Duration = Duration::from_millis(100);

/// How often something came of a request: a status, or why there was none.
pub(super) type Outcomes = BTreeMap<String, u64>;

/// Clients that are at work.
pub(super) type Clients = JoinSet<Outcomes>;

/// Sends the clients of a scenario to its session. They end when `end` says so.
pub(super) async fn start(
    run: &Run<'_>,
    scenario: Scenario,
    id: &str,
    end: &CancellationToken,
) -> Result<Clients, LoadError> {
    let mut clients = JoinSet::new();
    match scenario {
        Scenario::Ticks | Scenario::Objects => run.api.unpause(id).await?,
        Scenario::Settling => {
            let (api, id) = (run.api.clone(), id.to_owned());
            clients.spawn(until(end.clone(), move || settle(api.clone(), id.clone())));
        }
        Scenario::Pictures => {
            let (width, height) = (run.side(WIDTH.0, WIDTH.1), run.side(HEIGHT.0, HEIGHT.1));
            let path = format!("/{id}/render.png?width={width}&height={height}");
            read(&mut clients, run, run.count(PICTURES), &path, end);
        }
        Scenario::Snapshots => {
            read(&mut clients, run, run.count(MOST), &format!("/{id}/snapshot"), end);
        }
        Scenario::Unread => {
            let path = format!("/v1/sessions/{id}/heights");
            let request = Request { method: "GET", path, body: 0 };
            be_silent(&mut clients, run, run.count(MOST), &request, end)?;
        }
        Scenario::Bodies => {
            let path = format!("/v1/sessions/{id}/snowfalls");
            let request = Request { method: "POST", path, body: run.count(BODY) };
            be_silent(&mut clients, run, run.count(BODIES), &request, end)?;
        }
    }
    Ok(clients)
}

/// How all clients fared, once they have ended.
pub(super) async fn outcomes(mut clients: Clients) -> Outcomes {
    let mut all = Outcomes::new();
    while let Some(ended) = clients.join_next().await {
        let ended = ended.unwrap_or_else(|_| [("client failed".to_owned(), 1)].into());
        ended.into_iter().for_each(|(what, count)| *all.entry(what).or_default() += count);
    }
    all
}

/// So many clients that each read something, over and over.
fn read(clients: &mut Clients, run: &Run<'_>, count: usize, path: &str, end: &CancellationToken) {
    for _ in 0..count {
        let (api, path) = (run.api.clone(), path.to_owned());
        clients.spawn(until(end.clone(), move || fetch(api.clone(), path.clone())));
    }
}

/// So many clients that leave their request or its answer unfinished.
fn be_silent(
    clients: &mut Clients,
    run: &Run<'_>,
    count: usize,
    request: &Request,
    end: &CancellationToken,
) -> Result<(), LoadError> {
    let client = run.plan.client()?;
    for _ in 0..count {
        let (client, plan) = (client.clone(), run.plan.clone());
        let (request, end) = (request.clone(), end.clone());
        clients
            .spawn(async move { [(silent::send(&client, &plan, &request, &end).await, 1)].into() });
    }
    Ok(())
}

async fn fetch(api: Arc<Api>, path: String) -> Result<StatusCode, LoadError> {
    api.ask(Method::GET, &path, None).await
}

/// Steps a session until it has settled, and lets a little snow fall, so that it has not any more.
async fn settle(api: Arc<Api>, id: String) -> Result<StatusCode, LoadError> {
    let step = json!({"until_settled": true, "max_seconds": 3600});
    let status = api.ask(Method::POST, &format!("/{id}/step"), Some(step)).await?;
    api.snow(&id).await.map(|()| status)
}

/// Asks over and over until the end.
async fn until<F: Future<Output = Result<StatusCode, LoadError>>>(
    end: CancellationToken,
    ask: impl Fn() -> F,
) -> Outcomes {
    let mut outcomes = Outcomes::new();
    loop {
        let status = tokio::select! {
            biased;
            () = end.cancelled() => {
                *outcomes.entry("under way".to_owned()).or_default() += 1;
                return outcomes;
            }
            status = ask() => status,
        };
        let what = status.as_ref().map_or("failed".to_owned(), |s| s.as_u16().to_string());
        *outcomes.entry(what).or_default() += 1;
        if !status.is_ok_and(|status| status.is_success()) {
            tokio::time::sleep(REST).await;
        }
    }
}
