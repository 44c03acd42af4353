//! Sessions: creating, listing, changing, stepping and deleting them.

use axum::Json as Answer;
use axum::extract::{FromRequest, Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::http::docs::{BodyProblems, ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Json, OptionalJson, Query, Segments, media_type, read_body};
use crate::http::handlers::snapshots::SnapshotBytes;
use crate::http::handlers::tokens::SECRET;
use crate::http::page::{Page, PageQuery};
use crate::http::query::Params;
use crate::http::repeat::Keyed;
use crate::http::state::App;
use crate::problem::{FieldError, Problem};
use crate::session::{
    Change, CreatedSession, SNAPSHOT_MEDIA_TYPE, SessionError, SessionSpec, SessionView,
    SettingsPatch, StepSpec,
};
use utoipa::IntoParams;

/// Create a session
///
/// A session owns one snowpack. Every field has a default; an empty body will do. A body that is a
/// snapshot makes the session what was saved, bit for bit; its name is `?id=` then, or a new one.
/// The tokens are told here and never again.
#[utoipa::path(
    post,
    path = "/v1/sessions",
    operation_id = "create_session",
    tag = "sessions",
    params(CreateQuery),
    request_body(content(
        (SessionSpec = "application/json"),
        (SnapshotBytes = "application/vnd.firn.snapshot")
    )),
    responses(
        (status = 201, description = "The session, and its tokens", body = CreatedSession,
            headers(("Location" = String, description = "Path of the session"))),
        (status = 409, description = "There is a session of that name already", body = Problem,
            content_type = "application/problem+json"),
        (status = 429, description = "The server holds as much as it may", body = Problem,
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
    Query(query): Query<CreateQuery>,
    Keyed(once): Keyed,
    request: Request,
) -> Result<Response, Problem> {
    let making = if media_type(request.headers()) == SNAPSHOT_MEDIA_TYPE {
        let bytes = read_body(request, &app).await?;
        // A task of its own: where the client goes away, the session is whole or not there.
        tokio::spawn(
            async move { app.sessions.restore(bytes.to_vec().into(), query.id, once).await },
        )
    } else {
        let OptionalJson(spec) = OptionalJson::<SessionSpec>::from_request(request, &app).await?;
        if query.id.is_some() {
            return Err(Problem::invalid(vec![FieldError {
                pointer: "id".to_owned(),
                detail: "names a restored session only; a new one is named in the body".to_owned(),
            }]));
        }
        tokio::spawn(async move { app.sessions.create_once(spec, once).await })
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

/// List sessions
///
/// In ascending order of their names.
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
    Query(query): Query<PageQuery>,
) -> Answer<Page<SessionView>> {
    let found = app.sessions.list(query.cursor.as_deref(), query.limit() + 1);
    let views = found.iter().map(|session| session.view()).collect();
    Answer(Page::new(views, query.limit(), |view| &view.id))
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
pub async fn get(
    State(app): State<App>,
    Segments(id): Segments<String>,
) -> Result<Answer<SessionView>, Problem> {
    Ok(Answer(app.sessions.get(&id)?.view()))
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
    State(app): State<App>,
    Segments(id): Segments<String>,
    Json(patch): Json<SettingsPatch>,
) -> Result<Answer<SessionView>, Problem> {
    let session = app.sessions.get(&id)?;
    session.change(Change::Settings(patch)).await?;
    Ok(Answer(session.view()))
}

/// Delete a session
///
/// Its device memory is free afterwards.
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
    Segments(id): Segments<String>,
) -> Result<StatusCode, Problem> {
    app.sessions.delete(&id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Step a paused session
///
/// By a number of ticks, a simulated time, or until the snow has settled; as fast as the machine
/// can. Not subject to the time limit of requests. Where the client goes away the step ends early,
/// at the tick it has reached.
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
    Segments(id): Segments<String>,
    Json(step): Json<StepSpec>,
) -> Result<Answer<SessionView>, Problem> {
    let session = app.sessions.get(&id)?;
    tokio::select! {
        stepped = session.step(step) => Ok(Answer(stepped?)),
        () = app.draining.cancelled() => {
            Err(Problem::unavailable("the server is stopping; the step has ended early"))
        }
    }
}

/// Reset a session
///
/// Back to the state it was created in: snow, settings, clock and ledger, without colliders. Seqs
/// go on.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/reset",
    operation_id = "reset_session",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 200, description = "The session as it was created", body = SessionView),
        (status = 409, description = "The session is being stepped", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems
    )
)]
pub async fn reset(
    State(app): State<App>,
    Segments(id): Segments<String>,
) -> Result<Answer<SessionView>, Problem> {
    Ok(Answer(app.sessions.get(&id)?.reset().await?))
}
