//! Diagrams of single columns.

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use utoipa::{IntoParams, ToSchema};

use crate::diagram;
use crate::http::answers::carry_on;
use crate::http::docs::{ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query};
use crate::http::query::Params;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::{FieldError, Problem};

use super::stamp_headers;

/// Memory that the diagrams of a column of 255 cells take while they are drawn \[bytes\].
const DRAWING: u64 = 1 << 20;

/// Which column is drawn.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ProfileQuery {
    /// Column along x, from 0.
    #[param(value_type = u32, example = 25)]
    column_x: Option<u32>,
    /// Column along z, from 0.
    #[param(value_type = u32, example = 25)]
    column_z: Option<u32>,
}

impl FromQuery for ProfileQuery {
    fn from_query(params: &mut Params) -> ProfileQuery {
        ProfileQuery {
            column_x: params.required_whole("column_x", 0, u32::MAX),
            column_z: params.required_whole("column_z", 0, u32::MAX),
        }
    }
}

/// An SVG document.
#[derive(ToSchema)]
#[schema(value_type = String)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct Svg(String);

/// Draw a column
///
/// Two diagrams: density over depth, with weak layers marked, and hardness over density beside the
/// hardness law and the stress on each cell. Snow rests where its hardness has grown to the stress.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/profile.svg",
    operation_id = "get_profile",
    tag = "snow",
    params(SessionPath, ProfileQuery),
    responses(
        (status = 200, description = "The diagrams", body = Svg, content_type = "image/svg+xml",
            headers(
                ("Firn-Tick" = u64, description = "Tick at which they hold"),
                ("Firn-Seq" = u64, description = "Seq at which they hold")
            )),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Target(session): Target,
    Query(query): Query<ProfileQuery>,
) -> Result<Response, Problem> {
    let grid = session.spec.grid;
    let mut errors = Vec::new();
    let mut within = |name: &str, column: Option<u32>, columns: u32| {
        let column = column.unwrap_or(0);
        if column >= columns {
            let detail = format!("{column} is outside the grid's columns 0 to {}", columns - 1);
            errors.push(FieldError { pointer: name.to_owned(), detail });
        }
        column
    };
    let x = within("column_x", query.column_x, grid.width);
    let z = within("column_z", query.column_z, grid.depth);
    if !errors.is_empty() {
        return Err(Problem::invalid(errors));
    }
    let leave = app.answers.admit_found(&session, DRAWING).await?;
    carry_on(async move {
        let column = session.column(x, z).await?;
        let material = session.mirror().material;
        let stamp = column.stamp;
        let title = format!("Column {x}/{z} of '{}' at tick {}", session.id, stamp.tick);
        let answer = move || {
            let svg = diagram::draw(&diagram::profile(&title, &column, &material))?;
            let headers = (stamp_headers(stamp), [(header::CONTENT_TYPE, "image/svg+xml")]);
            Ok((headers, svg).into_response())
        };
        leave.make(answer).await
    })
    .await
}
