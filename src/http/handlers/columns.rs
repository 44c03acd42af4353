//! Single columns, cell by cell.

use axum::Json as Answer;
use firn_protocol::ColumnView;

use crate::http::docs::{ParameterProblems, SessionProblems};
use crate::http::extract::Segments;
use crate::http::target::Target;
use crate::problem::{FieldError, Problem};
use crate::quote::quote;

/// Read a column
///
/// Its material cells from the ground up, and its weak layers.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/columns/{column_x}/{column_z}",
    operation_id = "get_column",
    tag = "snow",
    params(
        ("id" = String, Path, description = "Name of the session"),
        ("column_x" = u32, Path, description = "Column along x, from 0"),
        ("column_z" = u32, Path, description = "Column along z, from 0")
    ),
    responses(
        (status = 200, description = "The column", body = ColumnView),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    Target(session): Target,
    Segments((_id, x, z)): Segments<(String, String, String)>,
) -> Result<Answer<ColumnView>, Problem> {
    let mut errors = Vec::new();
    let x = index("column_x", &x, &mut errors);
    let z = index("column_z", &z, &mut errors);
    if !errors.is_empty() {
        return Err(Problem::invalid(errors));
    }
    Ok(Answer(session.column(x, z).await?))
}

fn index(name: &str, text: &str, errors: &mut Vec<FieldError>) -> u32 {
    text.parse().unwrap_or_else(|_| {
        let detail = format!("expected a whole number, not negative, found {}", quote(text));
        errors.push(FieldError { pointer: name.to_owned(), detail });
        0
    })
}
