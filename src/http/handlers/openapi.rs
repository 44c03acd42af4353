//! The OpenAPI document.

use std::sync::OnceLock;

use axum::http::header;
use axum::response::IntoResponse;

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
    let document = DOCUMENT.get_or_init(|| {
        serde_json::to_string(&crate::http::document()).expect("the document is plain data")
    });
    ([(header::CONTENT_TYPE, "application/json")], document.as_str())
}
