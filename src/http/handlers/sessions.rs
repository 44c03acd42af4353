//! Sessions: creating, listing, changing, stepping and deleting them.

use axum::Extension;
use axum::Json as Answer;
use axum::extract::{FromRequest, Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::{
    CreatedSession, ResetSpec, SessionBody, SessionSpec, SessionView, SettingsPatch, StepSpec,
};
use utoipa::IntoParams;

use crate::config::Scope;
use crate::http::docs::{BodyProblems, ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Json, OptionalJson, Query, media_type, read_body};
use crate::http::gate::Caller;
use crate::http::handlers::snapshots::SnapshotBytes;
use crate::http::handlers::tokens::SECRET;
use crate::http::page::{Page, PageQuery};
use crate::http::query::Params;
use crate::http::repeat::Keyed;
use crate::http::state::App;
use crate::http::target::{Target, Unvisited};
use crate::problem::{FieldError, Problem};
use crate::session::{Change, SNAPSHOT_MEDIA_TYPE, SessionError};

/// Create a session
///
/// A session owns one snowpack. Every field has a default; an empty body will do. `preset` chooses a kind of
/// snow; the answer tells the material, `pressing` and the air that hold. A body that is a
/// snapshot makes the session what was saved, bit for bit; its name is `?id=` then, or a new one.
/// It belongs to the tenant whose API key makes it, and counts for its quotas; names are those of all
/// tenants. The tokens are told here and never again.
#[utoipa::path(
    post,
    path = "/v1/sessions",
    operation_id = "create_session",
    tag = "sessions",
    params(CreateQuery),
    request_body(content(
        (SessionBody = "application/json"),
        (SnapshotBytes = "application/vnd.firn.snapshot")
    )),
    responses(
        (status = 201, description = "The session, and its tokens", body = CreatedSession,
            headers(("Location" = String, description = "Path of the session"))),
        (status = 409, description = "There is a session of that name already", body = Problem,
            content_type = "application/problem+json"),
        (status = 429, description = "The server, or the tenant, holds as much as it may", body = Problem,
            content_type = "application/problem+json",
            headers(("Retry-After" = u32, description = "Seconds until another try makes sense"))),
        (status = 500, description = "Handling the request failed inside the server",
            body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The server is bringing sessions back or stopping, or its engine has failed",
            body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "Device memory is full, or nothing can be stored", body = Problem,
            content_type = "application/problem+json"),
        BodyProblems
    )
)]
pub async fn create(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Query(query): Query<CreateQuery>,
    Keyed(once): Keyed,
    request: Request,
) -> Result<Response, Problem> {
    let tenant = caller.tenant().map(str::to_owned);
    let making = if media_type(request.headers()) == SNAPSHOT_MEDIA_TYPE {
        let bytes = read_body(request, &app).await?;
        // A task of its own: where the client goes away, the session is whole or not there.
        tokio::spawn(async move {
            app.sessions.restore(bytes.to_vec().into(), query.id, tenant.as_deref(), once).await
        })
    } else {
        let OptionalJson(spec) = OptionalJson::<SessionSpec>::from_request(request, &app).await?;
        if query.id.is_some() {
            return Err(Problem::invalid(vec![FieldError {
                pointer: "id".to_owned(),
                detail: "names a restored session only; a new one is named in the body".to_owned(),
            }]));
        }
        tokio::spawn(async move { app.sessions.create_once(spec, tenant.as_deref(), once).await })
    };
    let made = making.await.map_err(|_| SessionError::Internal("the creation failed".into()))?;
    let (session, tokens) = made?;
    let location = format!("/v1/sessions/{}", session.id);
    let created = CreatedSession {
        session: session.view(),
        token: tokens.token,
        viewer_token: tokens.viewer_token,
    };
    let location = [(header::LOCATION, location)];
    Ok((StatusCode::CREATED, location, [SECRET], Answer(created)).into_response())
}

/// How a restored session is to be called.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct CreateQuery {
    /// Name of a session that is restored from a snapshot.
    id: Option<String>,
}

impl FromQuery for CreateQuery {
    fn from_query(params: &mut Params) -> CreateQuery {
        CreateQuery { id: params.text("id") }
    }
}

/// Memory that a session takes in a list, about \[bytes\].
const BYTES_PER_SESSION: u64 = 2048;

/// List sessions
///
/// In ascending order of their names: a tenant's own to its keys, all of them to the operator.
#[utoipa::path(
    get,
    path = "/v1/sessions",
    operation_id = "list_sessions",
    tag = "sessions",
    params(PageQuery),
    responses(
        (status = 200, description = "A page of sessions", body = Page<SessionView>),
        ParameterProblems
    )
)]
pub async fn list(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Query(query): Query<PageQuery>,
) -> Result<Response, Problem> {
    let (after, limit) = (query.cursor.as_deref(), query.limit() + 1);
    let found = app.sessions.list(caller.confined_to(), after, limit);
    let views = found.iter().map(|session| session.view()).collect();
    let page = Page::new(views, query.limit(), |view: &SessionView| &view.id);
    let leave = app.answers.admit(page.items.len() as u64 * BYTES_PER_SESSION).await?;
    leave.make(move || Ok(Answer(page).into_response())).await
}

/// Get a session
///
/// Its configuration, clock and summary.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}",
    operation_id = "get_session",
    tag = "sessions",
    params(SessionPath),
    responses((status = 200, description = "The session", body = SessionView), SessionProblems)
)]
pub async fn get(Target(session): Target) -> Answer<SessionView> {
    Answer(session.view())
}

/// Change a session's settings
///
/// Fields that are left out stay as they are.
#[utoipa::path(
    patch,
    path = "/v1/sessions/{id}",
    operation_id = "patch_session",
    tag = "sessions",
    params(SessionPath),
    request_body = SettingsPatch,
    responses(
        (status = 200, description = "The session with its new settings", body = SessionView),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn patch(
    Target(session): Target,
    Json(patch): Json<SettingsPatch>,
) -> Result<Answer<SessionView>, Problem> {
    session.change(Change::Settings(patch)).await?;
    Ok(Answer(session.view()))
}

/// Delete a session
///
/// Its device memory is free afterwards. One that is `locked` is deleted with an API key of the scope
/// `admin` only.
#[utoipa::path(
    delete,
    path = "/v1/sessions/{id}",
    operation_id = "delete_session",
    tag = "sessions",
    params(SessionPath),
    responses((status = 204, description = "It is gone"), SessionProblems)
)]
pub async fn delete(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Unvisited(session): Unvisited,
) -> Result<StatusCode, Problem> {
    if !caller.may(Scope::Admin) {
        session.check_unlocked()?;
    }
    app.sessions.delete(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Step a paused session
///
/// By a number of ticks, a simulated time, or until the snow has settled; as fast as the machine
/// can. Not subject to the time limit of requests. Meanwhile the session is `stepping`, and `progress` tells
/// how far it has come. Where somebody ends the step, or the client goes away, it ends early, at the tick it has
/// reached: the answer's `tick` and `settled` tell what was done.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/step",
    operation_id = "step_session",
    tag = "sessions",
    params(SessionPath),
    request_body = StepSpec,
    responses(
        (status = 200, description = "The session after the step", body = SessionView),
        (status = 409, description = "The session is running, or is being stepped already",
            body = Problem, content_type = "application/problem+json"),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn step(
    State(app): State<App>,
    Target(session): Target,
    Json(step): Json<StepSpec>,
) -> Result<Answer<SessionView>, Problem> {
    tokio::select! {
        stepped = session.step(step) => Ok(Answer(stepped?)),
        () = app.draining.cancelled() => {
            Err(Problem::unavailable("the server is stopping; the step has ended early"))
        }
    }
}

/// End a step
///
/// The step under way ends at the tick it has reached, and its call answers with the session as it is then.
/// Ticks that are taken at once come to their end before this returns.
#[utoipa::path(
    delete,
    path = "/v1/sessions/{id}/step",
    operation_id = "end_step",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 204, description = "It has ended"),
        (status = 409, description = "No step of the session is under way", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems
    )
)]
pub async fn end_step(Target(session): Target) -> Result<StatusCode, Problem> {
    session.end_step().await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Reset a session
///
/// Back to the state it was created in: snow, settings, clock and ledger, without colliders. Where the body
/// names a restore point, back to that; where it is a snapshot of the same grid, the session becomes
/// what that holds. Its name, its tokens and what it was created with stay, and seqs go on.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/reset",
    operation_id = "reset_session",
    tag = "sessions",
    params(SessionPath),
    request_body(content(
        (ResetSpec = "application/json"),
        (SnapshotBytes = "application/vnd.firn.snapshot")
    )),
    responses(
        (status = 200, description = "The session as it is now", body = SessionView),
        (status = 409, description = "The session is being stepped, or reset", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn reset(
    State(app): State<App>,
    Target(session): Target,
    request: Request,
) -> Result<Answer<SessionView>, Problem> {
    let view = if media_type(request.headers()) == SNAPSHOT_MEDIA_TYPE {
        let snapshot = read_body(request, &app).await?.to_vec();
        session.reset_to_snapshot(snapshot).await?
    } else {
        let OptionalJson(to) = OptionalJson::<ResetSpec>::from_request(request, &app).await?;
        match to.checkpoint {
            Some(name) => session.reset_to_checkpoint(&name).await?,
            None => session.reset().await?,
        }
    };
    Ok(Answer(view))
}
