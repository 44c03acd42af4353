//! The OpenAPI document, made from the handlers' annotations.

use std::sync::OnceLock;

use axum::http::header;
use axum::response::IntoResponse;
use utoipa::OpenApi;
use utoipa::openapi::header::Header;
use utoipa::openapi::path::{Operation, Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Content, PathItem, Ref, RefOr, Required, Response};

use crate::problem::Problem;

use super::router;

/// Name of the way to say who one is.
const BEARER: &str = "bearer";

/// The OpenAPI document of the REST interface.
pub fn document() -> utoipa::openapi::OpenApi {
    let mut document = router::routes().into_openapi();
    // Bodies that may be left out; the annotations can't say so.
    for path in ["/v1/sessions", "/v1/sessions/{id}/reset"] {
        let post = document.paths.paths.get_mut(path).and_then(|path| path.post.as_mut());
        if let Some(RefOr::T(body)) = post.and_then(|post| post.request_body.as_mut()) {
            body.required = Some(Required::False);
        }
    }
    for (path, item) in &mut document.paths.paths {
        if path.starts_with("/v1/") {
            operations(item).for_each(guarded);
        } else {
            // Said, rather than left open: these take no token.
            operations(item).for_each(|operation| operation.security = Some(Vec::new()));
        }
    }
    let bearer = "An API key, or one of the session's tokens; an open server asks for none.";
    let mut scheme = Http::new(HttpAuthScheme::Bearer);
    scheme.description = Some(bearer.to_owned());
    let components = document.components.get_or_insert_default();
    components.add_security_scheme(BEARER, SecurityScheme::Http(scheme));
    document
}

/// Read this document
#[utoipa::path(
    get,
    path = "/openapi.json",
    operation_id = "get_openapi",
    tag = "operations",
    responses((status = 200, description = "The OpenAPI document of this server", body = Object,
        content_type = "application/json"))
)]
pub async fn get() -> impl IntoResponse {
    static DOCUMENT: OnceLock<String> = OnceLock::new();
    let document = DOCUMENT
        .get_or_init(|| serde_json::to_string(&document()).expect("the document is plain data"));
    ([(header::CONTENT_TYPE, "application/json")], document.as_str())
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    let PathItem { get, put, post, delete, patch, .. } = item;
    [get, put, post, delete, patch].into_iter().flatten()
}

/// Adds what the gate answers in front of every call under `/v1/`.
fn guarded(operation: &mut Operation) {
    operation.security = Some(vec![SecurityRequirement::new(BEARER, [] as [&str; 0])]);
    let string = || ObjectBuilder::new().schema_type(Type::String).build();
    let seconds = ObjectBuilder::new().schema_type(Type::Integer).build();
    let problems = [
        ("401", "No token, or an unknown one", Some(("WWW-Authenticate", Header::new(string())))),
        ("403", "A token or an API key that is not for this, or a foreign `Origin`", None),
        ("421", "A `Host` that is none of the server's names", None),
        (
            "429",
            "Too many requests with this token, or too many wrong ones from this address",
            Some(("Retry-After", Header::new(seconds))),
        ),
    ];
    for (status, description, header) in problems {
        let content = Content::new(Some(Ref::from_schema_name("Problem")));
        let mut response = Response::new(description);
        response.content.insert("application/problem+json".to_owned(), RefOr::T(content));
        response.headers.extend(header.map(|(name, header)| (name.to_owned(), RefOr::T(header))));
        operation.responses.responses.entry(status.to_owned()).or_insert(RefOr::T(response));
    }
}

/// Says of every POST that it takes an `Idempotency-Key`.
pub(super) fn tell_of_keys(document: &mut utoipa::openapi::OpenApi) {
    for post in document.paths.paths.values_mut().filter_map(|item| item.post.as_mut()) {
        post.parameters.get_or_insert_default().push(RefOr::T(idempotency_key()));
    }
}

fn idempotency_key() -> Parameter {
    let key = ObjectBuilder::new().schema_type(Type::String);
    ParameterBuilder::new()
        .name("Idempotency-Key")
        .parameter_in(ParameterIn::Header)
        .required(Required::False)
        .description(Some(
            "The client's own name for this request. Sent again with it within 10 minutes, the \
             request gets the first answer that was a success, with `Idempotent-Replayed: true`, and \
             changes nothing. What was refused leaves the key free. After a restart of the server too: the session that a request made is told then as it \
             is by then, with its first tokens.",
        ))
        .schema(Some(key.min_length(Some(1)).max_length(Some(255)).build()))
        .build()
}

/// What the document says beside the calls.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Firn",
        description = "Simulates snowpacks on the GPU: create a session, let snow fall, put \
            objects on it, and read how it settles.\n\nSI units and °C throughout; positions are \
            metres unless they are called `column`. A change is applied in the next frame, between \
            two ticks, and is acknowledged once it is on disk and visible to the next read. Every error is an \
            `application/problem+json` document (RFC 9457) that names the fields that were wrong.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    servers((url = "/", description = "The server this document comes from")),
    tags(
        (name = "sessions", description = "Snowpacks: their configuration, clock and summary"),
        (name = "weather", description = "Snowfalls, clearings and the air"),
        (name = "colliders", description = "Objects that stand on the snow"),
        (name = "snow", description = "Reading the snow"),
        (name = "operations", description = "The server itself")
    ),
    components(schemas(Problem))
)]
pub struct Document;
