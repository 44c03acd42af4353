//! Snow depths of many columns.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use crate::http::accept;
use crate::http::docs::{ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query, Segments};
use crate::http::query::Params;
use crate::http::state::App;
use crate::problem::{FieldError, Problem};
use crate::session::{Mirror, Session, Stamp};
use crate::snow::{Grid, TILE_SIDE};

use super::{off_thread, stamp_headers};

const JSON: &str = "application/json";
const BINARY: &str = "application/octet-stream";

/// Most samples of one answer.
const MOST_SAMPLES: u64 = 1 << 24;

/// Samples beyond which an answer is made off the threads that serve requests.
const MANY_SAMPLES: u64 = 1 << 14;

/// Which columns are asked for.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct HeightsQuery {
    /// First column along x.
    #[param(default = 0)]
    column_x: Option<u32>,
    /// First column along z.
    #[param(default = 0)]
    column_z: Option<u32>,
    /// Samples along x; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    width: Option<u32>,
    /// Samples along z; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    depth: Option<u32>,
    /// Columns from one sample to the next: 1, 2, 4 or 8.
    #[param(default = 1)]
    stride: Option<u32>,
    /// Adds the elevation of the ground.
    #[param(default = false)]
    surface: Option<bool>,
}

impl FromQuery for HeightsQuery {
    fn from_query(params: &mut Params) -> HeightsQuery {
        let query = HeightsQuery {
            column_x: params.whole("column_x", 0, u32::MAX),
            column_z: params.whole("column_z", 0, u32::MAX),
            width: params.whole("width", 1, u32::MAX),
            depth: params.whole("depth", 1, u32::MAX),
            stride: params.whole("stride", 1, 8),
            surface: params.flag("surface"),
        };
        if let Some(stride) = query.stride.filter(|stride| !stride.is_power_of_two()) {
            params.reject("stride", format!("expected 1, 2, 4 or 8, found {stride}"));
        }
        query
    }
}

/// Snow depths of a region.
#[derive(Debug, Serialize, ToSchema)]
pub struct HeightsView {
    /// When this holds.
    #[serde(flatten)]
    stamp: Stamp,
    /// First column.
    origin: Origin,
    /// Samples along x.
    width: u32,
    /// Samples along z.
    depth: u32,
    /// Columns from one sample to the next.
    stride: u32,
    /// Side of a column \[m\].
    cell_size: f64,
    /// Snow depths \[m\], row by row: index = z · width + x.
    heights: Vec<f64>,
}

/// A column.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct Origin {
    /// Along x.
    column_x: u32,
    /// Along z.
    column_z: u32,
}

/// Snow depths as 32-bit floats, little-endian, row by row.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct Floats(Vec<u8>);

/// Read snow depths
///
/// Of all columns, or of a region, or of every second, fourth or eighth column. By `Accept` as JSON
/// or as 32-bit floats, little-endian.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/heights",
    operation_id = "get_heights",
    tag = "snow",
    params(SessionPath, HeightsQuery),
    responses(
        (status = 200, description = "Snow depths in metres, row by row",
            content((HeightsView = "application/json"), (Floats = "application/octet-stream")),
            headers(
                ("Firn-Tick" = u64, description = "Tick at which they hold"),
                ("Firn-Seq" = u64, description = "Seq at which they hold")
            )),
        (status = 406, description = "The client accepts neither media type", body = Problem,
            content_type = "application/problem+json"),
        (status = 413, description = "The answer would have more than 2²⁴ samples",
            body = Problem, content_type = "application/problem+json"),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Segments(id): Segments<String>,
    Query(query): Query<HeightsQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id)?;
    let media_type = accept::choose(&headers, &[JSON, BINARY])
        .ok_or_else(|| Problem::not_acceptable(format!("heights exist as {JSON} and {BINARY}")))?;
    let window = Window::new(&query, &session.spec.grid)?;
    let surface = query.surface.unwrap_or(false);
    if window.samples() <= MANY_SAMPLES {
        return Ok(answer(&session, &window, surface, media_type));
    }
    off_thread(move || answer(&session, &window, surface, media_type)).await
}

/// The columns to be read, inside the grid.
#[derive(Debug, PartialEq)]
struct Window {
    origin: Origin,
    width: u32,
    depth: u32,
    stride: u32,
}

impl Window {
    fn new(query: &HeightsQuery, grid: &Grid) -> Result<Window, Problem> {
        let stride = query.stride.unwrap_or(1);
        let mut errors = Vec::new();
        let mut span = |first: (&str, Option<u32>), count: (&str, Option<u32>), columns: u32| {
            let start = first.1.unwrap_or(0);
            if start >= columns {
                let detail = format!("{start} is outside the grid's columns 0 to {}", columns - 1);
                errors.push(FieldError { pointer: first.0.to_owned(), detail });
                return (start, 0);
            }
            let most = (columns - start).div_ceil(stride);
            let samples = count.1.unwrap_or(most);
            if samples > most {
                let detail = format!(
                    "{samples} samples from column {start} on reach beyond the grid; \
                     at most {most} fit"
                );
                errors.push(FieldError { pointer: count.0.to_owned(), detail });
            }
            (start, samples)
        };
        let (x, width) = span(("column_x", query.column_x), ("width", query.width), grid.width);
        let (z, depth) = span(("column_z", query.column_z), ("depth", query.depth), grid.depth);
        if !errors.is_empty() {
            return Err(Problem::invalid(errors));
        }
        let window = Window { origin: Origin { column_x: x, column_z: z }, width, depth, stride };
        if window.samples() > MOST_SAMPLES {
            return Err(Problem::too_large(format!(
                "the answer would have {} samples, more than {MOST_SAMPLES}; \
                 ask for a part of them, or for a greater stride",
                window.samples()
            )));
        }
        Ok(window)
    }

    fn samples(&self) -> u64 {
        u64::from(self.width) * u64::from(self.depth)
    }

    /// The sampled columns of each row, row by row.
    fn rows(&self) -> impl Iterator<Item = u32> + use<> {
        let first = self.origin.column_z;
        let stride = self.stride;
        (0..self.depth).map(move |row| first + row * stride)
    }

    /// Copies the sampled heights, in thickness quanta.
    fn copy(&self, mirror: &Mirror) -> Vec<u32> {
        let mut heights = Vec::with_capacity(self.samples() as usize);
        let first = self.origin.column_x;
        let end = first + (self.width - 1) * self.stride + 1;
        for z in self.rows() {
            let mut x = first;
            // Columns of one row lie side by side as far as their tile reaches.
            while x < end {
                let (tile, column) = mirror.grid.locate(x, z);
                let stop = (x / TILE_SIDE + 1).saturating_mul(TILE_SIDE).min(end);
                let run = &mirror.tile(tile).0[column as usize..(column + stop - x) as usize];
                heights.extend(run.iter().step_by(self.stride as usize));
                x += (stop - x).next_multiple_of(self.stride);
            }
        }
        heights
    }

    /// Elevations of the ground under the samples, as they were given \[m\].
    fn ground<'a>(&self, terrain: &'a [f64], grid: &Grid) -> impl Iterator<Item = f64> + use<'a> {
        let (first, stride, width) = (self.origin.column_x, self.stride, self.width);
        let columns = u64::from(grid.width);
        self.rows().flat_map(move |z| {
            (0..width).map(move |i| {
                let index = u64::from(z) * columns + u64::from(first + i * stride);
                terrain[index as usize]
            })
        })
    }
}

fn answer(session: &Arc<Session>, window: &Window, surface: bool, media_type: &str) -> Response {
    let grid = session.spec.grid;
    let (stamp, quanta) = {
        let mirror = session.mirror();
        (mirror.stamp_at(session.frame()), window.copy(&mirror))
    };
    let mut heights: Vec<f64> = quanta.iter().map(|&q| grid.metres(u64::from(q))).collect();
    if let Some(terrain) = session.spec.terrain.as_ref().filter(|_| surface) {
        let ground = window.ground(&terrain.heights, &grid);
        heights.iter_mut().zip(ground).for_each(|(height, ground)| *height += ground);
    }
    let headers = stamp_headers(stamp);
    let vary = [(header::VARY, HeaderValue::from_static("accept"))];
    if media_type == BINARY {
        let bytes: Vec<u8> = heights.iter().flat_map(|&h| (h as f32).to_le_bytes()).collect();
        return (headers, vary, [(header::CONTENT_TYPE, BINARY)], bytes).into_response();
    }
    let view = HeightsView {
        stamp,
        origin: window.origin,
        width: window.width,
        depth: window.depth,
        stride: window.stride,
        cell_size: grid.cell_size,
        heights,
    };
    (headers, vary, axum::Json(view)).into_response()
}
