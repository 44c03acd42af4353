//! Extractors whose rejections are problems.

use axum::body::Bytes;
use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use serde::de::DeserializeOwned;

use crate::problem::{self, Problem};
use crate::quote::quote;

use super::query::Params;
use super::state::App;

/// A JSON body.
pub struct Json<T>(pub T);

/// A JSON body that may be left out; an empty one stands for `{}`.
pub struct OptionalJson<T>(pub T);

/// Path parameters.
///
/// Not called `Path`: the OpenAPI macros would describe parameters of that name a second time.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Path), rejection(Problem))]
pub struct Segments<T>(pub T);

/// Query parameters.
pub struct Query<T>(pub T);

/// Query parameters that a handler understands.
pub trait FromQuery: Sized {
    /// Takes the known parameters; those that are left over are reported as unknown.
    fn from_query(params: &mut Params) -> Self;
}

impl<A: FromQuery, B: FromQuery> FromQuery for (A, B) {
    fn from_query(params: &mut Params) -> (A, B) {
        (A::from_query(params), B::from_query(params))
    }
}

impl<T: DeserializeOwned> FromRequest<App> for Json<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        expect_json(request.headers())?;
        problem::parse(&read_body(request, app).await?).map(Json)
    }
}

impl<T: DeserializeOwned> FromRequest<App> for OptionalJson<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        let media_type = expect_json(request.headers());
        let body = read_body(request, app).await?;
        if body.is_empty() {
            return problem::parse(b"{}").map(OptionalJson);
        }
        media_type?;
        problem::parse(&body).map(OptionalJson)
    }
}

impl<T: FromQuery, S: Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Problem> {
        let mut params = Params::new(&parts.uri)?;
        let query = T::from_query(&mut params);
        params.finish().map(|()| Query(query))
    }
}

impl From<PathRejection> for Problem {
    fn from(rejection: PathRejection) -> Problem {
        match rejection.status() {
            status if status.is_server_error() => Problem::internal(rejection.body_text()),
            _ => Problem::not_found("the path is not valid UTF-8 text once decoded"),
        }
    }
}

/// The media type of a body, without its parameters and in lower case; empty where there is none.
pub fn media_type(headers: &HeaderMap) -> String {
    let found = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    found.and_then(|f| f.split(';').next()).unwrap_or("").trim().to_ascii_lowercase()
}

fn expect_json(headers: &HeaderMap) -> Result<(), Problem> {
    let found = media_type(headers);
    if found == "application/json" || is_json_like(&found) {
        return Ok(());
    }
    let found = if found.is_empty() { "none".to_owned() } else { quote(&found).to_string() };
    Err(Problem::unsupported_media_type(format!(
        "the body must be sent with `Content-Type: application/json`, found {found}"
    )))
}

fn is_json_like(essence: &str) -> bool {
    essence.starts_with("application/") && essence.ends_with("+json")
}

/// The body of a request, which was read whole before.
///
/// # Errors
/// None is known.
pub async fn read_body(request: Request, app: &App) -> Result<Bytes, Problem> {
    let body = Bytes::from_request(request, app).await;
    body.map_err(|_| Problem::malformed("the body could not be read to its end"))
}
