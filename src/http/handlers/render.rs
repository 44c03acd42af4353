//! Pictures of the snow.

mod query;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::{Reference, Stamp};
use firn_snow::ColumnRect;
use utoipa::ToSchema;

use crate::http::answers::carry_on;
use crate::http::docs::{Held, ParameterProblems, SessionPath, SessionProblems};
use crate::http::etag;
use crate::http::extract::Query;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::render::{self, Field, Picture, Snow, View};
use crate::session::{CellBox, MOST_SAMPLES, Session};

use self::query::RenderQuery;
use super::stamp_headers;

/// A PNG image of 8 bits per channel; with transparency where the background is transparent.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct PngImage(Vec<u8>);

/// Draw the snow
///
/// The fixed grid as boxes coloured by a field, the surface, or a vertical cut, with a legend in
/// units. The graphics device draws it, on a thread of its own, so that no snowpack waits for a
/// picture. Faces that lie level have the legend's very colour; sides are shaded, unless `shading`
/// is off. Objects have no height of their own: they are drawn half as high as they are wide.
/// Choose a part of the columns to look inside.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/render.png",
    operation_id = "get_render",
    tag = "snow",
    params(SessionPath, RenderQuery, Held),
    responses(
        (status = 200, description = "The picture", body = PngImage, content_type = "image/png",
            headers(
                ("Firn-Tick" = u64, description = "Tick at which it holds"),
                ("Firn-Seq" = u64, description = "Seq at which it holds"),
                ("ETag" = String, description = "Weak: names the state and what is shown of it")
            )),
        (status = 304, description = "The client holds it already",
            headers(
                ("Firn-Tick" = u64, description = "Tick at which it holds"),
                ("Firn-Seq" = u64, description = "Seq at which it holds"),
                ("ETag" = String, description = "As of the picture")
            )),
        (status = 413, description = "More than 2²⁰ cells would be shown; choose a part of them",
            body = Problem, content_type = "application/problem+json"),
        (status = 501, description = "The server has no graphics adapter, not even a software one",
            body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "The device's memory does not hold a picture of that size",
            body = Problem, content_type = "application/problem+json"),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Target(session): Target,
    Query(query): Query<RenderQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let region = query.region(&session)?;
    if headers.contains_key(header::IF_NONE_MATCH) {
        let stamp = session.mirror().stamp_at(session.frame());
        let tag = tag(&session, &query, stamp);
        if etag::is_held(&headers, &tag) {
            let headers = (stamp_headers(stamp), validators(tag));
            return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
        }
    }
    let mut leave = app.answers.admit_found(&session, bytes(&session, &query, region)?).await?;
    carry_on(async move {
        let (stamp, snow) = read(&session, &query, region).await?;
        let tag = tag(&session, &query, stamp);
        let turn = leave.turn().await?;
        let picture =
            render::draw(&app.renderer, &app.answers.threads, query.picture, snow).await?;
        drop(turn);
        let kind = [(header::CONTENT_TYPE, HeaderValue::from_static("image/png"))];
        let headers = (stamp_headers(stamp), validators(tag), kind);
        Ok(leave.take((headers, picture).into_response()).await)
    })
    .await
}

/// The weak ETag of a picture.
fn tag(session: &Session, query: &RenderQuery, stamp: Stamp) -> String {
    let asked = blake3::hash(format!("{query:?}").as_bytes()).to_hex();
    format!("W/\"{}-{}-{}\"", session.epoch, stamp.seq, &asked[..16])
}

/// Memory that a picture takes while it is drawn \[bytes\]: for each cell that is shown the sample and
/// the boxes made of it, for each pixel its colour and depth on the device, and its colour as it is read,
/// written on and encoded.
const BYTES_PER_CELL: u64 = 128;
const BYTES_PER_PIXEL: u64 = 20;

/// Memory that a picture of some columns takes while it is drawn.
///
/// # Errors
/// 413 where it would show too many cells.
fn bytes(session: &Session, query: &RenderQuery, region: ColumnRect) -> Result<u64, Problem> {
    let shows_depths = shows_depths(&query.picture);
    let height =
        if shows_depths { 1 } else { u64::from(session.sampled_height(Reference::Ground)) };
    let cells = region.columns() * height;
    check(cells)?;
    let pixels = u64::from(query.picture.width) * u64::from(query.picture.height);
    Ok(cells * BYTES_PER_CELL + pixels * BYTES_PER_PIXEL)
}

/// Whether elevations of the surface are all that a picture shows.
fn shows_depths(picture: &Picture) -> bool {
    picture.view == View::Surface && picture.field == Field::Position
}

/// What the picture is made from.
async fn read(
    session: &Session,
    query: &RenderQuery,
    region: ColumnRect,
) -> Result<(Stamp, Snow), Problem> {
    let grid = &session.spec.grid;
    // These are at hand.
    if shows_depths(&query.picture) {
        let mirror = session.mirror();
        let metres = |(x, z)| grid.metres(u64::from(mirror.height(x, z))) as f32;
        let places =
            (region.z0..region.z1).flat_map(|z| (region.x0..region.x1).map(move |x| (x, z)));
        let depths = places.map(metres).collect();
        let ground = (grid, &mirror.ground);
        let snow = Snow::from_depths(ground, region, depths, &mirror.colliders);
        return Ok((mirror.stamp_at(session.frame()), snow));
    }
    let reference = Reference::Ground;
    let height = session.sampled_height(reference);
    let wanted = CellBox { columns: region, reference, y0: 0, height };
    let sampled = session.sample_grid(wanted).await?;
    let mirror = session.mirror();
    let ground = (grid, &mirror.ground);
    Ok((sampled.stamp, Snow::from_cells(ground, region, sampled.cells, &mirror.colliders)))
}

fn check(cells: u64) -> Result<(), Problem> {
    if cells <= MOST_SAMPLES {
        return Ok(());
    }
    Err(Problem::too_large(format!(
        "the picture would show {cells} cells, more than {MOST_SAMPLES}; choose a part of them with \
         `column_x`, `column_z`, `columns_x` and `columns_z`, or `view=section`, or \
         `view=surface&field=position`, which counts columns alone"
    )))
}

/// The headers by which a client may ask for it again.
fn validators(tag: String) -> [(HeaderName, HeaderValue); 2] {
    [
        (header::ETAG, HeaderValue::try_from(tag).expect("an epoch is ASCII")),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ]
}
