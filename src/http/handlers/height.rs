//! The snow depth at a point.

use axum::Json as Answer;
use firn_protocol::Stamp;
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use crate::http::docs::{ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query};
use crate::http::query::Params;
use crate::http::target::Target;
use crate::problem::{FieldError, Problem};
use crate::session::Surface;

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
    let surface = Surface::new(&mirror);
    Ok(Answer(HeightView { stamp, height: surface.depth(point.x, point.z) }))
}
