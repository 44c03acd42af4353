//! The viewer: a web page, built from `viewer/` and part of the binary.
//!
//! Optimised builds hold the files as they were at build time; others read them from `viewer/dist` at
//! each request. A server that was built without them says how to build them.

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use rust_embed::{EmbeddedFile, RustEmbed};

use crate::problem::Problem;
use crate::quote::quote;

use super::accept::choose_coding;
use super::answers;
use super::etag::is_held;
use super::state::App;

/// The built files. Beside each that gains by it lies the same compressed, with `.gz` at its end.
#[derive(RustEmbed)]
#[folder = "viewer/dist/"]
#[allow_missing = true]
struct Files;

/// What the page may do: run its own scripts, and talk to this server. Nothing inline, nothing from elsewhere.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'; require-trusted-types-for 'script'";

/// The names of these files change with their content.
const FOR_EVER: &str = "public, max-age=31536000, immutable";

/// Clients ask each time whether what they have is the newest.
const ASK_AGAIN: &str = "no-cache";

/// Shown where the viewer was not built.
const UNBUILT: &str = include_str!("viewer/unbuilt.html");

/// The viewer's page, and the scripts, styles and images that it loads. They need no token.
pub fn routes() -> Router<App> {
    Router::new().route("/", get(page)).route("/assets/{file}", get(asset))
}

async fn page(headers: HeaderMap) -> Response {
    let page = send("index.html", ASK_AGAIN, &headers);
    page.unwrap_or_else(|| {
        let headers = [
            (header::CACHE_CONTROL, ASK_AGAIN),
            (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
        ];
        (headers, Html(UNBUILT)).into_response()
    })
}

async fn asset(Path(file): Path<String>, headers: HeaderMap) -> Result<Response, Problem> {
    send(&format!("assets/{file}"), FOR_EVER, &headers)
        .ok_or_else(|| Problem::not_found(format!("the viewer has no file {}", quote(&file))))
}

/// Answers with a file, compressed for those who understand it; `None` where there is no such file.
fn send(path: &str, caching: &str, request: &HeaderMap) -> Option<Response> {
    let plain = Files::get(path)?;
    let media_type = plain.metadata.mimetype().to_owned();
    let takes_gzip = choose_coding(request, &["gzip"]).is_some();
    let packed = Files::get(&format!("{path}.gz")).filter(|_| takes_gzip);
    let encoding = packed.is_some().then_some([(header::CONTENT_ENCODING, "gzip")]);
    let file = packed.unwrap_or(plain);
    let tag = tag(&file);
    let unchanged = is_held(request, &tag);
    let headers = [
        (header::CACHE_CONTROL, caching),
        (header::ETAG, tag.as_str()),
        (header::VARY, "accept-encoding"),
        (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    if unchanged {
        return Some((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    let media_type = [(header::CONTENT_TYPE, media_type)];
    Some((headers, media_type, encoding, answers::file(file.data)).into_response())
}

/// A strong ETag: the hash of the bytes that are sent.
fn tag(file: &EmbeddedFile) -> String {
    let hash = file.metadata.sha256_hash();
    let hex: String = hash[..16].iter().map(|byte| format!("{byte:02x}")).collect();
    format!("\"{hex}\"")
}
