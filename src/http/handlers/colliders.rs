//! Colliders: objects that stand on the snow.

use axum::Json as Answer;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::{
    BatchReply, ColliderBatch, ColliderPatch, ColliderReply, ColliderSpec, ColliderView, Stamp,
};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::docs::{
    BodyProblems, ColliderPath, ParameterProblems, SessionPath, SessionProblems,
};
use crate::http::extract::{Json, Query, Segments};
use crate::http::page::{Page, PageQuery};
use crate::http::repeat::Keyed;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::quote::quote;
use crate::session::{Applied, Change, Session, SessionError};

use super::stamp_headers;

/// A page of the colliders of a session.
#[derive(Debug, Serialize, ToSchema)]
pub struct ColliderPage {
    /// When this holds.
    #[serde(flatten)]
    stamp: Stamp,
    /// The page.
    #[serde(flatten)]
    page: Page<ColliderView>,
}

/// Create a collider
///
/// One column at least of what it stands on must be in the grid.
///
/// It stays where it is, or moves by itself: with a `velocity` (at most 100 m/s), a `turn_rate` (at most 720 °/s), or along a
/// `path` that it takes `over` a time (0.001 to 86 400 s, at most 100 m/s on average). A path is followed first, then the velocity
/// goes on. The heading does not follow the path. Objects move in simulated time: a paused session holds them still. At the edge of
/// the grid an object stops, with the last of its columns in the grid, and forgets its motion.
///
/// Snow that falls on its columns lies on it as its `burden` and adds to its weight, unless `shelters` is false.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/colliders",
    operation_id = "create_collider",
    tag = "colliders",
    params(SessionPath),
    request_body = ColliderSpec,
    responses(
        (status = 201, description = "The collider", body = ColliderReply,
            headers(("Location" = String, description = "Path of the collider"))),
        (status = 409, description = "There is a collider of that name already", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn create(
    Target(session): Target,
    Keyed(once): Keyed,
    Json(spec): Json<ColliderSpec>,
) -> Result<Response, Problem> {
    Ok(answer(&session, session.change_once(Change::CreateCollider(spec), once).await?))
}

/// List colliders
///
/// In ascending order of their names.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/colliders",
    operation_id = "list_colliders",
    tag = "colliders",
    params(SessionPath, PageQuery),
    responses(
        (status = 200, description = "A page of colliders", body = ColliderPage),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn list(
    Target(session): Target,
    Query(query): Query<PageQuery>,
) -> Result<Answer<ColliderPage>, Problem> {
    let (stamp, all) = published(&session);
    let first = query
        .cursor
        .as_deref()
        .map_or(0, |after| all.partition_point(|collider| collider.id.as_str() <= after));
    let items = all.iter().skip(first).take(query.limit() + 1).cloned().collect();
    let page = Page::new(items, query.limit(), |collider: &ColliderView| &collider.id);
    Ok(Answer(ColliderPage { stamp, page }))
}

/// Put and remove several colliders
///
/// All in one frame, or none; with `"on_error": "skip"` those that are not in error, and a result for each. Up
/// to 4096 in all. Removals come first. An entry of `put` replaces an object as `PUT` does, its motion included; its burden stays.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/colliders:batch",
    operation_id = "batch_colliders",
    tag = "colliders",
    params(SessionPath),
    request_body = ColliderBatch,
    responses(
        (status = 200, description = "When they were put and removed", body = BatchReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn batch(
    Target(session): Target,
    Keyed(once): Keyed,
    Json(batch): Json<ColliderBatch>,
) -> Result<Response, Problem> {
    Ok(super::applied(session.change_once(Change::Colliders(batch), once).await?))
}

/// Get a collider
///
/// Where it stands, how it moves, what lies on it. `velocity` and `turn_rate` are left out where they are 0, `path` and `speed` where
/// it follows no path. `path` has the points that are still ahead. `sink_depth` counts from the place where it was put or moved to last,
/// so that of a moving object counts from its last step.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/colliders/{cid}",
    operation_id = "get_collider",
    tag = "colliders",
    params(ColliderPath),
    responses((status = 200, description = "The collider", body = ColliderReply), SessionProblems)
)]
pub async fn get(
    Target(session): Target,
    Segments((_id, cid)): Segments<(String, String)>,
) -> Result<Answer<ColliderReply>, Problem> {
    let (stamp, all) = published(&session);
    let collider = all
        .iter()
        .find(|collider| collider.id == cid)
        .cloned()
        .ok_or(SessionError::NotFound { kind: "collider", id: cid })?;
    Ok(Answer(ColliderReply { stamp, collider }))
}

/// Create or replace a collider
///
/// Where the body has an `id`, it must be the one in the path. What the body leaves out has its default: an object that is replaced
/// without a `velocity` stops. The snow that lies on it stays there, except on columns that it leaves.
///
/// It stays where it is, or moves by itself: with a `velocity` (at most 100 m/s), a `turn_rate` (at most 720 °/s), or along a
/// `path` that it takes `over` a time (0.001 to 86 400 s, at most 100 m/s on average). A path is followed first, then the velocity
/// goes on. The heading does not follow the path. Objects move in simulated time: a paused session holds them still. At the edge of
/// the grid an object stops, with the last of its columns in the grid, and forgets its motion.
///
/// Snow that falls on its columns lies on it as its `burden` and adds to its weight, unless `shelters` is false.
#[utoipa::path(
    put,
    path = "/v1/sessions/{id}/colliders/{cid}",
    operation_id = "put_collider",
    tag = "colliders",
    params(ColliderPath),
    request_body = ColliderSpec,
    responses(
        (status = 200, description = "The collider, replaced", body = ColliderReply),
        (status = 201, description = "The collider, created", body = ColliderReply,
            headers(("Location" = String, description = "Path of the collider"))),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn put(
    Target(session): Target,
    Segments((_id, cid)): Segments<(String, String)>,
    Json(spec): Json<ColliderSpec>,
) -> Result<Response, Problem> {
    if let Some(named) = spec.id.as_ref().filter(|&named| *named != cid) {
        let (named, path) = (quote(named), quote(&cid));
        let detail = format!("{named} is not the {path} of the path; leave it out");
        return Err(Problem::invalid_field("/id", detail));
    }
    let spec = ColliderSpec { id: Some(cid), ..spec };
    Ok(answer(&session, session.change(Change::PutCollider(spec)).await?))
}

/// Change a collider
///
/// Fields that are left out stay as they are. Another `position` lifts the object there: it leaves no track between, a path that it
/// was following ends, and its velocity goes on. A `velocity` ends a path too. A new `path` begins where the object is, and a velocity goes on at its end only
/// if it comes along.
///
/// With `"sweep": true` the object is pushed to the `position` and turned to the `heading` instead, the shorter way round, and leaves a
/// track. It takes the next cycle for that, or several where the way is longer than 32 columns. Sweeps before a cycle has passed follow
/// each other. 422 for a sweep with neither a position nor a heading, and for a sweep with a `path`.
#[utoipa::path(
    patch,
    path = "/v1/sessions/{id}/colliders/{cid}",
    operation_id = "patch_collider",
    tag = "colliders",
    params(ColliderPath),
    request_body = ColliderPatch,
    responses(
        (status = 200, description = "The collider as it is now", body = ColliderReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn patch(
    Target(session): Target,
    Segments((_id, cid)): Segments<(String, String)>,
    Json(patch): Json<ColliderPatch>,
) -> Result<Response, Problem> {
    Ok(answer(&session, session.change(Change::PatchCollider { id: cid, patch }).await?))
}

/// Remove a collider
///
/// The snow that lies on it is laid on its columns. What finds no room there, and what is less than a quantum for each column, counts as
/// refused in the ledger.
#[utoipa::path(
    delete,
    path = "/v1/sessions/{id}/colliders/{cid}",
    operation_id = "delete_collider",
    tag = "colliders",
    params(ColliderPath),
    responses(
        (status = 204, description = "It is gone", headers(
            ("Firn-Tick" = u64, description = "Tick at which it was removed"),
            ("Firn-Seq" = u64, description = "Seq at which it was gone")
        )),
        SessionProblems
    )
)]
pub async fn delete(
    Target(session): Target,
    Segments((_id, cid)): Segments<(String, String)>,
) -> Result<Response, Problem> {
    let applied = session.change(Change::DeleteCollider { id: cid }).await?;
    let stamp = match applied {
        Applied::Stamp(stamp) => stamp,
        _ => session.mirror().stamp_at(session.frame()),
    };
    Ok((StatusCode::NO_CONTENT, stamp_headers(stamp)).into_response())
}

/// The published colliders, and when they hold.
fn published(session: &Session) -> (Stamp, std::sync::Arc<[ColliderView]>) {
    let mirror = session.mirror();
    (mirror.stamp_at(session.frame()), mirror.colliders.clone())
}

/// 201 with its location for a collider that is new, 200 for one that was there.
fn answer(session: &Session, applied: Applied) -> Response {
    match applied {
        Applied::Collider { reply, created: true } => {
            let location = format!("/v1/sessions/{}/colliders/{}", session.id, reply.collider.id);
            let headers = [(header::LOCATION, location)];
            (StatusCode::CREATED, headers, Answer(reply)).into_response()
        }
        other => super::applied(other),
    }
}
