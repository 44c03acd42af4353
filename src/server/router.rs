//! Every route, and the layers around them.

use std::any::Any;

use axum::Router;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{Method, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::sensitive_headers::SetSensitiveRequestHeadersLayer;
use tracing::error;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::http::App;
use crate::http::answers;
use crate::http::bodies::read_whole;
use crate::http::compression::compress;
use crate::http::gate::{check_host, check_origin, guard};
use crate::http::handlers::{
    self, air_temperature, cells, checkpoints, clearings, colliders, columns, health, height,
    heights, mass, probes, profile, render, samples, sessions, snapshots, snowfalls, stamps, store,
    terrain, tokens, unlock, usage, weather,
};
use crate::http::observe::observe;
use crate::http::repeat::answer_once;
use crate::http::{reference, viewer};
use crate::problem::Problem;
use crate::quote::quote;
use crate::stream;

use super::document::{self, Document};

/// The whole server.
pub fn router(app: App) -> Router {
    let (timed, _) = timed_routes().split_for_parts();
    let (repeatable, _) = repeatable_routes().split_for_parts();
    let (untimed, _) = untimed_routes().split_for_parts();
    let (streams, _) = stream_routes().split_for_parts();
    let limit = middleware::from_fn_with_state(app.clone(), limit_time);
    let guard = middleware::from_fn_with_state(app.clone(), guard);
    // A request that is out of time is still carried out, and its repeat finds the answer.
    let once = middleware::from_fn_with_state(app.clone(), answer_once);
    let timed = timed.merge(repeatable.route_layer(once)).layer(limit);
    let whole = middleware::from_fn_with_state(app.clone(), read_whole);
    let guarded = timed.merge(untimed).route_layer(whole).route_layer(guard);
    let pages = reference::routes().merge(viewer::routes());
    let routes = guarded.merge(streams).merge(pages);
    dress(routes, &app).with_state(app)
}

/// Every documented route.
pub fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(Document::openapi())
        .merge(repeatable_routes())
        .merge(timed_routes())
        .merge(untimed_routes())
        .merge(stream_routes())
}

/// Routes with a POST that takes an `Idempotency-Key`. They have to answer in time, too.
fn repeatable_routes() -> OpenApiRouter<App> {
    let mut routes = OpenApiRouter::default()
        .routes(routes!(sessions::create, sessions::list))
        .routes(routes!(snowfalls::create))
        .routes(routes!(clearings::create))
        .routes(routes!(stamps::create))
        .routes(routes!(colliders::create, colliders::list))
        .routes(routes!(colliders::batch));
    document::tell_of_keys(routes.get_openapi_mut());
    routes
}

/// Routes that have to answer within the time limit of requests.
fn timed_routes() -> OpenApiRouter<App> {
    OpenApiRouter::default()
        .routes(routes!(sessions::get, sessions::patch, sessions::delete))
        .routes(routes!(sessions::reset))
        .routes(routes!(usage::get))
        .routes(routes!(tokens::create))
        .routes(routes!(unlock::create))
        .routes(routes!(air_temperature::put))
        .routes(routes!(weather::get, weather::put))
        .routes(routes!(colliders::get, colliders::put, colliders::patch, colliders::delete))
        .routes(routes!(heights::get))
        .routes(routes!(terrain::get, terrain::put))
        .routes(routes!(height::get))
        .routes(routes!(columns::get))
        .routes(routes!(cells::get))
        .routes(routes!(mass::get))
        .routes(routes!(render::get))
        .routes(routes!(profile::get))
        .routes(routes!(snapshots::get))
        .routes(routes!(snapshots::digest))
        .routes(routes!(checkpoints::list))
        .routes(routes!(checkpoints::get, checkpoints::put, checkpoints::delete))
        .routes(routes!(probes::create))
        .routes(routes!(samples::create))
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(handlers::metrics::get))
        .routes(routes!(document::get))
}

/// Routes that may take as long as they need.
fn untimed_routes() -> OpenApiRouter<App> {
    OpenApiRouter::default()
        .routes(routes!(sessions::step, sessions::end_step))
        .routes(routes!(store::backup))
        .routes(routes!(store::verify))
        .routes(routes!(store::compact))
}

/// The stream asks for the token by itself: a browser has to be told in another way.
fn stream_routes() -> OpenApiRouter<App> {
    OpenApiRouter::default().routes(routes!(stream::stream))
}

/// Puts what holds for every request around some routes.
fn dress(routes: Router<App>, app: &App) -> Router<App> {
    // One stack rather than layers one by one: the router puts each of those into a box of its own.
    let layers = ServiceBuilder::new()
        .layer(SetSensitiveRequestHeadersLayer::new([header::AUTHORIZATION]))
        .layer(middleware::from_fn_with_state(app.clone(), observe))
        .layer(middleware::from_fn_with_state(app.clone(), compress))
        .layer(middleware::from_fn_with_state(app.clone(), answers::count))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(middleware::map_request_with_state(app.clone(), check_host))
        .option_layer(app.gate.neighbours.cors())
        .layer(middleware::map_request_with_state(app.clone(), check_origin))
        // Bodies are limited where they are read.
        .layer(DefaultBodyLimit::disable());
    routes.fallback(unknown_path).method_not_allowed_fallback(unknown_method).layer(layers)
}

async fn limit_time(State(app): State<App>, request: Request, next: Next) -> Response {
    let limit = app.requests.request_timeout;
    match tokio::time::timeout(limit, next.run(request)).await {
        Ok(response) => response,
        Err(_) => Problem::unavailable(format!(
            "the request was not done within {} s; what it asked for may still happen",
            limit.as_secs_f64()
        ))
        .into_response(),
    }
}

async fn unknown_path(uri: Uri) -> Problem {
    Problem::not_found(format!("there is nothing at {}; see /openapi.json", quote(uri.path())))
}

async fn unknown_method(method: Method, uri: Uri) -> Problem {
    Problem::method_not_allowed(format!(
        "{} knows no {}; the `Allow` header lists what it knows",
        quote(uri.path()),
        quote(method.as_str())
    ))
}

fn panicked(cause: Box<dyn Any + Send>) -> Response {
    let message = cause
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| cause.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    error!("handling a request panicked: {message}");
    Problem::internal("handling this request failed; the log says more").into_response()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use axum::body::Body;
    use axum::http::StatusCode;
    use axum::routing;
    use tower::ServiceExt;

    use super::*;
    use crate::config::{RequestConfig, StreamConfig};
    use crate::driver::{Driver, WorldConfig};
    use crate::http::Gate;
    use crate::session::Limits;
    use firn_engine::cpu::CpuBackend;

    fn app() -> App {
        let limits = Limits {
            sessions: 1,
            columns_per_session: 64,
            columns: 64,
            cells_per_session: 64,
            cells: 64,
            colliders_per_session: 1,
        };
        let config = WorldConfig { limits, publish_rate: 20.0, sleep: true };
        let (sessions, _world) =
            Driver::start(Box::new(CpuBackend::new(None, false)), config).unwrap();
        let request_timeout = Duration::from_millis(20);
        let requests = RequestConfig { request_timeout, ..RequestConfig::default() };
        App::new(sessions, requests, StreamConfig::default(), Gate::default()).unwrap()
    }

    async fn status(routes: Router<App>, app: &App) -> StatusCode {
        let request =
            Request::get("/x").header(header::HOST, "localhost").body(Body::empty()).unwrap();
        let router = dress(routes, app).with_state(app.clone());
        let response = router.oneshot(request).await.unwrap();
        assert_eq!(response.headers()["content-type"], "application/problem+json");
        response.status()
    }

    async fn panics() {
        panic!("in a handler");
    }

    #[tokio::test]
    async fn a_panic_in_a_handler_is_an_internal_error() {
        let routes = Router::new().route("/x", routing::get(panics));
        assert_eq!(status(routes, &app()).await, StatusCode::INTERNAL_SERVER_ERROR);
    }

    #[tokio::test]
    async fn a_handler_that_never_ends_runs_into_the_time_limit() {
        let app = app();
        let routes = Router::new()
            .route("/x", routing::get(std::future::pending::<()>))
            .layer(middleware::from_fn_with_state(app.clone(), limit_time));
        assert_eq!(status(routes, &app).await, StatusCode::SERVICE_UNAVAILABLE);
    }
}
