//! The ground that the snow lies on.

use std::sync::Arc;

use axum::Json as Answer;
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::HeaderMap;
use axum::response::Response;
use firn_protocol::{Stamp, Terrain};
use firn_snow::Grid;
use utoipa::IntoParams;

use crate::http::docs::{BodyProblems, Held, ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query, media_type, read_body};
use crate::http::query::Params;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::{self, FieldError, Problem};
use crate::session::{Change, Ground};

use super::heights::decode::{self, GreyScale};
use super::heights::{
    FLOATS, Floats, GreyImage, HeightsView, JSON, MEDIA_TYPES, NPY, NumpyArray, PNG, Shown,
    WindowQuery, tell,
};

/// Read the ground
///
/// Its elevations under all columns, or under those of a region, or under every second, fourth or eighth. By
/// `Accept` as JSON, as 32-bit floats, as a grey image, or as a NumPy array. Level ground at 0 where the
/// session has no terrain.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/terrain",
    operation_id = "get_terrain",
    tag = "snow",
    params(SessionPath, WindowQuery, Held),
    responses(
        (status = 200, description = "Elevations in metres, row by row",
            content((HeightsView = "application/json"), (Floats = "application/octet-stream"),
                (GreyImage = "image/png"), (NumpyArray = "application/x-npy")),
            headers(
                ("Firn-Tick" = u64, description = "Tick at which they hold"),
                ("Firn-Seq" = u64, description = "Seq at which they hold"),
                ("Firn-Height-Scale" = f64, description = "Metres per step of grey (PNG only)"),
                ("Firn-Height-Offset" = f64, description = "Metres at grey 0 (PNG only)"),
                ("ETag" = String, description = "Weak: names the ground and the representation")
            )),
        (status = 304, description = "The client holds it already",
            headers(
                ("Firn-Tick" = u64, description = "Tick at which it holds"),
                ("Firn-Seq" = u64, description = "Seq at which it holds"),
                ("ETag" = String, description = "As of the whole answer")
            )),
        (status = 406, description = "The client accepts none of the media types", body = Problem,
            content_type = "application/problem+json"),
        (status = 413, description = "The answer would have more than 2²⁴ samples",
            body = Problem, content_type = "application/problem+json"),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Target(session): Target,
    Query(query): Query<WindowQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    tell(&app, session, &query, Shown::Ground, &headers).await
}

/// What the greys of an image mean.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct GreyQuery {
    /// Metres from one grey to the next, not 0; an image needs it, nothing else may have it.
    #[param(minimum = -1000, maximum = 1000)]
    scale: Option<f64>,
    /// Metres at grey 0 (an image only).
    #[param(minimum = -20_000, maximum = 20_000, default = 0)]
    offset: Option<f64>,
}

impl FromQuery for GreyQuery {
    fn from_query(params: &mut Params) -> GreyQuery {
        GreyQuery {
            scale: params.number("scale", -1000.0, 1000.0),
            offset: params.number("offset", -20_000.0, 20_000.0),
        }
    }
}

impl GreyQuery {
    /// What the greys of an image mean.
    fn of_image(&self) -> Result<GreyScale, Problem> {
        let scale = self.scale.filter(|scale| *scale != 0.0).ok_or_else(|| {
            wrong("scale", "an image needs the metres from one grey to the next, which are not 0")
        })?;
        Ok(GreyScale { scale, offset: self.offset.unwrap_or_default() })
    }

    /// Says that there are no greys.
    fn of_numbers(&self) -> Result<(), Problem> {
        match (self.scale, self.offset) {
            (None, None) => Ok(()),
            (Some(_), _) => Err(wrong("scale", "only an image has one")),
            (_, Some(_)) => Err(wrong("offset", "only an image has one")),
        }
    }
}

fn wrong(parameter: &str, detail: &str) -> Problem {
    let (pointer, detail) = (parameter.to_owned(), detail.to_owned());
    Problem::invalid(vec![FieldError { pointer, detail }])
}

/// Put other ground under the snow
///
/// The snow lies on it as it lay before: each column keeps its cells, and objects stand on the new surface. An
/// elevation \[m\] for each column, within ±20 000 m, and at most 65 536 cells between the lowest and the
/// highest. As JSON, as 32-bit floats (little-endian, row by row), as a NumPy array of shape (depth, width), or
/// as a grey image of 8 or 16 bits with its `scale` and `offset`.
#[utoipa::path(
    put,
    path = "/v1/sessions/{id}/terrain",
    operation_id = "put_terrain",
    tag = "snow",
    params(SessionPath, GreyQuery),
    request_body(content(
        (Terrain = "application/json"),
        (Floats = "application/octet-stream"),
        (GreyImage = "image/png"),
        (NumpyArray = "application/x-npy")
    )),
    responses(
        (status = 200, description = "When the snow came to lie on it", body = Stamp),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn put(
    State(app): State<App>,
    Target(session): Target,
    Query(query): Query<GreyQuery>,
    request: Request,
) -> Result<Answer<Stamp>, Problem> {
    let kind = media_type(request.headers());
    let bytes = read_body(request, &app).await?;
    let grid = session.spec.grid;
    let mut leave = app.answers.admit(grid.columns() * BYTES_PER_COLUMN).await?;
    let turn = leave.turn().await?;
    let read = move || (read(&kind, &bytes, &grid, &query), turn, leave);
    let (ground, ..) = app.answers.threads.run(read).await.ok_or_else(unread)?;
    let ground = ground?;
    let applied = session.change(Change::Ground(ground)).await?;
    Ok(Answer(applied.stamp()))
}

fn unread() -> Problem {
    Problem::internal("reading the ground failed")
}

/// Memory that an elevation takes while it is read \[bytes\]: as it is, and packed to be stored.
const BYTES_PER_COLUMN: u64 = 32;

/// Reads ground from a body of some media type.
fn read(kind: &str, bytes: &Bytes, grid: &Grid, query: &GreyQuery) -> Result<Ground, Problem> {
    if kind != PNG {
        query.of_numbers()?;
    }
    let heights: Arc<[f64]> = match kind {
        JSON => problem::parse::<Terrain>(bytes)?.heights,
        FLOATS => decode::floats(bytes, grid)?.into(),
        NPY => decode::npy(bytes, grid)?.into(),
        PNG => decode::png(bytes, grid, query.of_image()?)?.into(),
        _ => {
            let known = MEDIA_TYPES.join(", ");
            return Err(Problem::unsupported_media_type(format!("ground is read as {known}")));
        }
    };
    Ok(Ground::checked(heights, grid)?)
}
