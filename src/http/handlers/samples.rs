//! Samples: the snow at many points.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::{SampleBatch, SampleField, SampleFields, SampleReply};
use utoipa::ToSchema;

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::state::App;
use crate::http::target::Target;
use crate::http::{accept, npy};
use crate::problem::Problem;
use crate::session::sample_columns;

use super::{json, reserved, respond, stamp_headers};

const JSON: &str = "application/json";

/// Every representation, the default first.
const MEDIA_TYPES: [&str; 2] = [JSON, npy::MEDIA_TYPE];

/// A NumPy array file (version 1.0): 32-bit floats, little-endian, C order, a row for each point. Its columns are the
/// fields in the order asked for; `normal` takes three. NaN where there is no snow.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the answer")]
pub struct NumpyTable(Vec<u8>);

/// Read the snow at points
///
/// `depth`, `ground`, `elevation` and `normal` are known without asking the device. The first three are bilinear
/// between the centres of columns; beyond the outermost centres they are those of the nearest. `normal` is
/// (−∂e/∂x, 1, −∂e/∂z), made a unit vector: the slopes of the elevation e at a column's centre are those
/// between its neighbours, and bilinear between the centres. `density`, `hardness` and `sink` are those of the column
/// that the point is on, read in one frame; `sink` is what a probe with the `load` tells, `duration` included.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/samples",
    operation_id = "sample",
    tag = "snow",
    params(SessionPath),
    request_body = SampleBatch,
    responses(
        (status = 200, description = "The fields at each point",
            content((SampleReply = "application/json"), (NumpyTable = "application/x-npy")),
            headers(
                ("Firn-Tick" = u64, description = "Tick at which they hold"),
                ("Firn-Seq" = u64, description = "Seq at which they hold")
            )),
        (status = 406, description = "The client accepts none of the media types", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn create(
    State(app): State<App>,
    Target(session): Target,
    headers: HeaderMap,
    Json(batch): Json<SampleBatch>,
) -> Result<Response, Problem> {
    let media_type = accept::choose(&headers, &MEDIA_TYPES).ok_or_else(|| {
        Problem::not_acceptable(format!("samples exist as {}", MEDIA_TYPES.join(", ")))
    })?;
    let (fields, points) = (batch.fields.clone(), batch.points.len());
    let reading = session.sample(batch)?;
    let bytes = reading.answer_bytes();
    respond(&app, reading, move |reply: SampleReply| {
        let headers = stamp_headers(reply.stamp);
        if media_type == JSON {
            return Ok((headers, json(&reply, bytes)?).into_response());
        }
        let kind = [(header::CONTENT_TYPE, HeaderValue::from_static(npy::MEDIA_TYPE))];
        Ok((headers, kind, table(&reply.fields, &fields, points)?).into_response())
    })
    .await
}

/// Fields of so many points as a NumPy file.
fn table(found: &SampleFields, fields: &[SampleField], points: usize) -> Result<Vec<u8>, Problem> {
    let columns = sample_columns(fields);
    let header = npy::header(points, columns);
    let mut file = reserved(header.len() + 4 * points * columns)?;
    file.extend(header);
    for point in 0..points {
        for &field in fields {
            let values = values(found, field, point);
            file.extend(values.iter().flatten().flat_map(|value| (*value as f32).to_le_bytes()));
        }
    }
    Ok(file)
}

/// What a field says of a point: up to three numbers, NaN where there is no snow.
fn values(found: &SampleFields, field: SampleField, point: usize) -> [Option<f64>; 3] {
    fn of<T: Copy>(values: &Option<Vec<T>>, point: usize) -> T {
        values.as_ref().expect("what was asked for is there")[point]
    }
    let one = |value: f64| [Some(value), None, None];
    match field {
        SampleField::Depth => one(of(&found.depth, point)),
        SampleField::Ground => one(of(&found.ground, point)),
        SampleField::Elevation => one(of(&found.elevation, point)),
        SampleField::Normal => of(&found.normal, point).map(Some),
        SampleField::Density => one(of(&found.density, point).unwrap_or(f64::NAN)),
        SampleField::Hardness => one(of(&found.hardness, point).unwrap_or(f64::NAN)),
        SampleField::Sink => one(of(&found.sink, point)),
    }
}
