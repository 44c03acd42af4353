//! Single columns, cell by cell.

use std::time::{SystemTime, UNIX_EPOCH};

use axum::Json as Answer;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use firn_protocol::ColumnView;
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use crate::caaml::{self, Profile};
use crate::http::answers::carry_on;
use crate::http::docs::{AlpineProblems, ParameterProblems, SessionProblems};
use crate::http::extract::{FromQuery, Query, Segments};
use crate::http::query::Params;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::{FieldError, Problem};
use crate::quote::quote;
use crate::session::Visit;

use super::stamp_headers;

/// As what the column is told.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ColumnQuery {
    /// As what it is told: JSON, or a snow profile after CAAML 6.0.3, which alpine snow only has.
    #[param(inline, required = false)]
    format: Format,
}

/// What columns exist as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Format {
    /// JSON.
    #[default]
    Json,
    /// A snow profile as XML.
    Caaml,
}

impl FromQuery for ColumnQuery {
    fn from_query(params: &mut Params) -> ColumnQuery {
        let known = [("json", Format::Json), ("caaml", Format::Caaml)];
        ColumnQuery { format: params.choice("format", &known).unwrap_or_default() }
    }
}

/// A snow profile after CAAML 6.0.3, from the surface down.
#[derive(ToSchema)]
#[schema(value_type = String)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct SnowProfile(String);

/// Read a column
///
/// Its material cells from the ground up, and its weak layers. Of alpine snow also as a snow profile after CAAML 6.0.3,
/// the format of snow pits.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/columns/{column_x}/{column_z}",
    operation_id = "get_column",
    tag = "snow",
    params(
        ("id" = String, Path, description = "Name of the session"),
        ("column_x" = u32, Path, description = "Column along x, from 0"),
        ("column_z" = u32, Path, description = "Column along z, from 0"),
        ColumnQuery
    ),
    responses(
        (status = 200, description = "The column",
            content((ColumnView = "application/json"), (SnowProfile = "application/xml"))),
        AlpineProblems,
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Target(session): Target,
    Segments((_id, x, z)): Segments<(String, String, String)>,
    Query(ColumnQuery { format }): Query<ColumnQuery>,
) -> Result<Response, Problem> {
    let mut errors = Vec::new();
    let x = index("column_x", &x, &mut errors);
    let z = index("column_z", &z, &mut errors);
    if !errors.is_empty() {
        return Err(Problem::invalid(errors));
    }
    match format {
        Format::Json => Ok(Answer(session.column(x, z).await?).into_response()),
        Format::Caaml => profile(&app, session, [x, z]).await,
    }
}

/// A column of alpine snow as a snow profile.
async fn profile(app: &App, session: Visit, place: [u32; 2]) -> Result<Response, Problem> {
    // Refused where the snow is not alpine.
    session.weather()?;
    let leave = app.answers.admit_found(&session, caaml::MOST_BYTES).await?;
    carry_on(async move {
        let [x, z] = place;
        let column = session.column(x, z).await?;
        let stamp = column.stamp;
        let (time, site) = session.time_and_site(stamp.tick)?;
        let answer = move || {
            let alpine =
                column.alpine.ok_or_else(|| Problem::internal("a column has no totals"))?;
            let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            let asked = since.as_secs_f64();
            let (session, column, site) = (&*session.id, &column, &*site);
            let xml = Profile { session, place, column, alpine, site, time, asked }.write();
            let kind = [(header::CONTENT_TYPE, caaml::MEDIA_TYPE)];
            Ok((stamp_headers(stamp), kind, xml).into_response())
        };
        leave.make(answer).await
    })
    .await
}

fn index(name: &str, text: &str, errors: &mut Vec<FieldError>) -> u32 {
    text.parse().unwrap_or_else(|_| {
        let detail = format!("expected a whole number, not negative, found {}", quote(text));
        errors.push(FieldError { pointer: name.to_owned(), detail });
        0
    })
}
