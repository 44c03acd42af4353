//! Whether the server lives, and whether it can take work.

use axum::Json as Answer;
use axum::extract::State;
use axum::http::StatusCode;
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::state::App;
use crate::problem::Problem;
use crate::session::StoreState;

/// Answer to `GET /livez`.
#[derive(Debug, Serialize, ToSchema)]
pub struct Alive {
    /// Always `alive`.
    status: &'static str,
}

/// Answer to `GET /readyz`.
#[derive(Debug, Serialize, ToSchema)]
pub struct Readiness {
    /// Whether requests are served.
    status: ReadyStatus,
    /// Name of the adapter that the snowpacks live on, or `cpu`.
    adapter: String,
    /// Graphics interface, or `cpu`.
    backend: String,
    /// Whether clients are asked for tokens.
    auth: Auth,
    /// How what sessions are kept in is doing.
    store: StoreStatus,
    /// Sessions there are.
    sessions: usize,
    /// Most sessions there may be.
    capacity: usize,
    /// Whether a session should be created here: there is room for one, and frames keep up with
    /// the clock.
    schedulable: bool,
}

/// Whether clients are asked for tokens.
#[derive(Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Auth {
    /// Nobody is asked.
    Open,
    /// Everybody is: the API key, or a session's token.
    Required,
}

/// How what sessions are kept in is doing.
#[derive(Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StoreStatus {
    /// Nothing is wrong with it.
    Sound,
    /// It was damaged when the server started: sessions may be missing, and those that came back are
    /// locked.
    Damaged,
    /// It can't be written to: changes are refused until it can.
    Failing,
    /// The data directory is not where it was: changes are refused.
    Gone,
}

impl From<StoreState> for StoreStatus {
    fn from(state: StoreState) -> StoreStatus {
        match state {
            StoreState::Sound => StoreStatus::Sound,
            StoreState::Damaged => StoreStatus::Damaged,
            StoreState::Failing => StoreStatus::Failing,
            StoreState::Gone => StoreStatus::Gone,
        }
    }
}

/// Whether requests are served.
#[derive(Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReadyStatus {
    /// They are.
    Ready,
    /// Sessions that outlived the last stop are being brought back.
    Recovering,
    /// The server is stopping.
    Draining,
    /// What there is can be read, and changes are refused: the data directory is gone.
    ReadOnly,
    /// The engine has failed, and is being started anew, or the server ends.
    Failed,
}

/// Is the server alive?
#[utoipa::path(
    get,
    path = "/livez",
    operation_id = "livez",
    tag = "operations",
    responses(
        (status = 200, description = "It is", body = Alive),
        (status = 503, description = "The engine has failed for good, and the server is about to end",
            body = Problem, content_type = "application/problem+json")
    )
)]
pub async fn livez(State(app): State<App>) -> Result<Answer<Alive>, Problem> {
    if app.sessions.vitals().gave_up() {
        return Err(Problem::unavailable("the engine has failed for good: only a restart helps"));
    }
    Ok(Answer(Alive { status: "alive" }))
}

/// Is the server ready?
///
/// With what it runs on, and how much it holds.
#[utoipa::path(
    get,
    path = "/readyz",
    operation_id = "readyz",
    tag = "operations",
    responses(
        (status = 200, description = "It is", body = Readiness),
        (status = 503, description = "It is bringing sessions back or stopping, its engine has failed, or \
            its data directory is gone", body = Readiness)
    )
)]
pub async fn readyz(State(app): State<App>) -> (StatusCode, Answer<Readiness>) {
    let store = StoreStatus::from(app.sessions.vitals().store.state());
    let status = if !app.sessions.vitals().is_healthy() {
        ReadyStatus::Failed
    } else if app.draining.is_cancelled() {
        ReadyStatus::Draining
    } else if !app.sessions.vitals().is_recovered() {
        ReadyStatus::Recovering
    } else if store == StoreStatus::Gone {
        ReadyStatus::ReadOnly
    } else {
        ReadyStatus::Ready
    };
    let device = app.sessions.device();
    let (sessions, capacity) = (app.sessions.count(), app.sessions.limits().sessions);
    let ready = status == ReadyStatus::Ready;
    let readiness = Readiness {
        status,
        adapter: device.adapter.clone(),
        backend: device.backend.clone(),
        store,
        auth: if app.gate.access.is_open() { Auth::Open } else { Auth::Required },
        sessions,
        capacity,
        schedulable: ready && sessions < capacity && !app.sessions.vitals().is_overloaded(),
    };
    let code = if ready { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (code, Answer(readiness))
}
