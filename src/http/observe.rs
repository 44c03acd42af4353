//! What a request leaves behind: a figure in the metrics, a line in the log, a span in the traces.

use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;
use opentelemetry::global;
use opentelemetry_http::HeaderExtractor;
use tracing::field::Empty;
use tracing::{Instrument, Span, debug, debug_span, error};
use tracing_opentelemetry::OpenTelemetrySpanExt;

use crate::limit::Limit;
use crate::metrics;

use super::state::App;

/// What the path of every session begins with, and its route.
const SESSIONS: &str = "/v1/sessions/";
const SESSION_ROUTE: &str = "/v1/sessions/{id}";

/// Counts a request and times its answer, and tells the log and the traces of it.
pub async fn observe(State(app): State<App>, request: Request, next: Next) -> Response {
    let begun = Instant::now();
    let route = request.extensions().get::<MatchedPath>();
    let route = route.map_or(String::new(), |path| path.as_str().to_owned());
    let method = method_name(request.method());
    let span = span(&request, method, &route);
    let response = next.run(request).instrument(span.clone()).await;
    let (status, took) = (response.status(), begun.elapsed());
    finish(&span, status, response.headers());
    span.in_scope(|| match status {
        StatusCode::INTERNAL_SERVER_ERROR => error!(status = 500, ?took, "a request failed"),
        _ => debug!(status = status.as_u16(), ?took, "answered"),
    });
    if let Some(&limit) = response.extensions().get::<Limit>() {
        app.metrics.limits.reached(limit);
    }
    let status = status.as_u16();
    app.metrics.requests.answered(&metrics::Request { method, route, status }, took);
    response
}

/// A request's span, with the attributes that OpenTelemetry has for one. It is made only where the
/// log or the traces tell of requests at all. The query is left out: it may hold a token.
fn span(request: &Request, method: &'static str, route: &str) -> Span {
    let path = request.uri().path();
    let span = debug_span!(
        "request",
        otel.name = format!("{method} {route}").trim_end(),
        otel.kind = "server",
        otel.status_code = Empty,
        http.request.method = method,
        http.route = route,
        http.response.status_code = Empty,
        url.path = path,
        firn.session = Empty,
    );
    if span.is_disabled() {
        return span;
    }
    if route.starts_with(SESSION_ROUTE) {
        record_session(&span, path);
    }
    let caller = global::get_text_map_propagator(|propagator| {
        propagator.extract(&HeaderExtractor(request.headers()))
    });
    // Fails where there are no traces.
    let _ = span.set_parent(caller);
    span
}

/// Adds to a request's span what its answer tells: a new session's name is in its `Location`.
fn finish(span: &Span, status: StatusCode, headers: &HeaderMap) {
    span.record("http.response.status_code", status.as_u16());
    if status.is_server_error() {
        span.record("otel.status_code", "ERROR");
    }
    if status == StatusCode::CREATED {
        let location = headers.get(header::LOCATION).and_then(|place| place.to_str().ok());
        location.into_iter().for_each(|path| record_session(span, path));
    }
}

fn record_session(span: &Span, path: &str) {
    let name = path.strip_prefix(SESSIONS).and_then(|rest| rest.split('/').next());
    span.record("firn.session", name);
}

/// Methods that clients make up are one, so that they can't fill the memory.
fn method_name(method: &Method) -> &'static str {
    const KNOWN: [Method; 7] = [
        Method::GET,
        Method::POST,
        Method::PUT,
        Method::PATCH,
        Method::DELETE,
        Method::HEAD,
        Method::OPTIONS,
    ];
    const NAMES: [&str; 7] = ["GET", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS"];
    KNOWN.iter().position(|known| known == method).map_or("other", |place| NAMES[place])
}
