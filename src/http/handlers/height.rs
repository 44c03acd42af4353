//! The snow depth at a point.

use axum::Json as Answer;
use firn_protocol::Stamp;
use firn_snow::Grid;
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use crate::http::docs::{ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query};
use crate::http::query::Params;
use crate::http::target::Target;
use crate::problem::{FieldError, Problem};
use crate::session::Mirror;

/// A point in metres.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PointQuery {
    /// Along x \[m\], from 0 to the grid's edge.
    x: f64,
    /// Along z \[m\], from 0 to the grid's edge.
    z: f64,
}

impl FromQuery for PointQuery {
    fn from_query(params: &mut Params) -> PointQuery {
        // What is missing is reported; the value is not used then.
        PointQuery {
            x: params.required_number("x").unwrap_or_default(),
            z: params.required_number("z").unwrap_or_default(),
        }
    }
}

/// The snow depth at a point.
#[derive(Debug, Serialize, ToSchema)]
pub struct HeightView {
    /// When this holds.
    #[serde(flatten)]
    stamp: Stamp,
    /// Snow depth \[m\].
    height: f64,
}

/// Read the snow depth at a point
///
/// Bilinear between the centres of columns; beyond the outermost centres, that of the nearest.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/height",
    operation_id = "get_height",
    tag = "snow",
    params(SessionPath, PointQuery),
    responses(
        (status = 200, description = "The snow depth", body = HeightView),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    Target(session): Target,
    Query(point): Query<PointQuery>,
) -> Result<Answer<HeightView>, Problem> {
    let grid = session.spec.grid;
    let mut errors = Vec::new();
    for (name, at, columns) in [("x", point.x, grid.width), ("z", point.z, grid.depth)] {
        let edge = f64::from(columns) * grid.cell_size;
        if !(0.0..=edge).contains(&at) {
            let detail = format!("{at} is outside the grid, which is from 0 to {edge} m");
            errors.push(FieldError { pointer: name.to_owned(), detail });
        }
    }
    if !errors.is_empty() {
        return Err(Problem::invalid(errors));
    }
    let mirror = session.mirror();
    let stamp = mirror.stamp_at(session.frame());
    Ok(Answer(HeightView { stamp, height: interpolate(&mirror, &grid, &point) }))
}

fn interpolate(mirror: &Mirror, grid: &Grid, point: &PointQuery) -> f64 {
    let neighbours = |metres: f64, columns: u32| {
        let last = columns - 1;
        let at = (metres / grid.cell_size - 0.5).clamp(0.0, f64::from(last));
        let low = at.floor() as u32;
        (low, (low + 1).min(last), at - at.floor())
    };
    let (x0, x1, along_x) = neighbours(point.x, grid.width);
    let (z0, z1, along_z) = neighbours(point.z, grid.depth);
    let height = |x, z| grid.metres(u64::from(mirror.height(x, z)));
    let between = |a: f64, b: f64, part: f64| a + (b - a) * part;
    let near = between(height(x0, z0), height(x1, z0), along_x);
    let far = between(height(x0, z1), height(x1, z1), along_x);
    between(near, far, along_z)
}
