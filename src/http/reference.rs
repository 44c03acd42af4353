//! The OpenAPI document as pages to browse: Swagger UI, out of the binary.

use std::sync::{Arc, LazyLock};

use axum::Router;
use axum::extract::{Path, Request};
use axum::http::header;
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing;
use utoipa_swagger_ui::Config;

use crate::problem::Problem;
use crate::quote::quote;

use super::answers;
use super::state::App;

/// Nothing is loaded from another host, no script stands in a page, and no other page frames it.
/// Swagger UI styles some elements itself, and holds its icons as `data:`.
const SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; \
    style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

static CONFIG: LazyLock<Arc<Config<'static>>> = LazyLock::new(|| {
    let config = Config::new(["/openapi.json"])
        .deep_linking(true)
        .doc_expansion("none")
        .display_request_duration(true)
        .default_models_expand_depth(0)
        .try_it_out_enabled(true)
        // Otherwise it asks a server of its own what it thinks of the document.
        .validator_url("none");
    Arc::new(config)
});

/// The pages, below `/docs/`.
pub fn routes() -> Router<App> {
    Router::new()
        // Relative paths of the page lead to its files only behind a slash.
        .route("/docs", routing::get(|| async { Redirect::permanent("/docs/") }))
        .route("/docs/", routing::get(|request: Request| file(String::new(), request)))
        .route("/docs/{*file}", routing::get(named))
}

async fn named(Path(name): Path<String>, request: Request) -> Result<Response, Problem> {
    file(name, request).await
}

async fn file(name: String, request: Request) -> Result<Response, Problem> {
    let found = utoipa_swagger_ui::serve(&name, CONFIG.clone())
        .map_err(|error| Problem::internal(format!("the reference can't be shown: {error}")))?;
    let Some(file) = found else {
        let path = quote(request.uri().path());
        return Err(Problem::not_found(format!("there is nothing at {path}; see /docs/")));
    };
    let headers = [
        (header::CONTENT_TYPE, file.content_type),
        (header::CONTENT_SECURITY_POLICY, SECURITY_POLICY.to_owned()),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff".to_owned()),
        (header::CACHE_CONTROL, "no-cache".to_owned()),
    ];
    Ok((headers, answers::file(file.bytes)).into_response())
}
