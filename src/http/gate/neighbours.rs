//! Keeps web pages of others away: a page in somebody's browser can send requests to any address
//! that the browser can reach, and give its own name an address of this server. The browser tells
//! on it, by `Host` and `Origin`.

use std::net::IpAddr;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum_server::accept::LocalAddr;
use tower_http::cors::CorsLayer;

use crate::config::AccessConfig;
use crate::http::{App, repeat};
use crate::problem::Problem;
use crate::quote::quote;

/// The names that the server answers to, and the pages that may use it.
#[derive(Debug, Default)]
pub struct Neighbours {
    hosts: Vec<String>,
    origins: Vec<HeaderValue>,
}

impl Neighbours {
    /// What a configuration says.
    pub fn new(config: &AccessConfig) -> Neighbours {
        let (hosts, origins) = (config.allowed_host.clone(), config.allowed_origin.clone());
        Neighbours { hosts, origins }
    }

    /// What tells browsers that the allowed pages may read answers; nothing where there are none.
    pub fn cors(&self) -> Option<CorsLayer> {
        if self.origins.is_empty() {
            return None;
        }
        let methods = [Method::GET, Method::POST, Method::PUT, Method::PATCH, Method::DELETE];
        let asked =
            [header::AUTHORIZATION, header::CONTENT_TYPE, header::IF_NONE_MATCH, repeat::KEY];
        let told = [
            header::ETAG,
            header::LOCATION,
            header::RETRY_AFTER,
            HeaderName::from_static("firn-tick"),
            HeaderName::from_static("firn-seq"),
            HeaderName::from_static("firn-height-scale"),
            repeat::REPLAYED,
        ];
        let layer = CorsLayer::new().allow_origin(self.origins.clone()).allow_methods(methods);
        Some(layer.allow_headers(asked).expose_headers(told))
    }

    /// Whether a name is this server's: loopback, the address that the client connected to, or one
    /// that was allowed.
    fn knows(&self, host: &Authority, local: Option<IpAddr>) -> bool {
        let name = host.host();
        let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        match address {
            Ok(address) if address.is_loopback() || Some(address) == local => true,
            _ if name.eq_ignore_ascii_case("localhost") => true,
            _ => self.hosts.iter().any(|allowed| name.eq_ignore_ascii_case(allowed)),
        }
    }

    /// Whether all of a request's origins are this server, by the name it was called by, or allowed.
    fn trusts(&self, headers: &HeaderMap, host: &Authority) -> bool {
        headers.get_all(header::ORIGIN).iter().all(|origin| {
            let page = origin.to_str().ok().and_then(|origin| origin.split_once("://"));
            page.is_some_and(|(_, page)| page.eq_ignore_ascii_case(host.as_str()))
                || self.origins.contains(origin)
        })
    }
}

/// Lets no request through that was meant for another server.
///
/// # Errors
/// 421 where the `Host` is not one of the server's names.
pub async fn check_host(State(app): State<App>, request: Request) -> Result<Request, Problem> {
    let local = request.extensions().get::<LocalAddr>().map(|local| local.0.ip().to_canonical());
    let host = host(&request)?;
    if app.gate.neighbours.knows(&host, local) {
        return Ok(request);
    }
    Err(Problem::misdirected(format!(
        "this server does not go by the name {}; its operator can allow it by --allowed-host",
        quote(host.host())
    )))
}

/// Lets no foreign web page change anything or open a stream. What it reads, the browser keeps from
/// it.
///
/// # Errors
/// 403 where the `Origin` is neither this server nor allowed.
pub async fn check_origin(State(app): State<App>, request: Request) -> Result<Request, Problem> {
    let reads = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS)
        && !request.headers().contains_key(header::UPGRADE);
    if reads || app.gate.neighbours.trusts(request.headers(), &host(&request)?) {
        return Ok(request);
    }
    Err(Problem::forbidden(
        "web pages of another origin may not change anything here; the operator can allow one by \
         --allowed-origin",
    ))
}

/// The name that a request calls the server by.
fn host(request: &Request) -> Result<Authority, Problem> {
    let named = match request.uri().authority() {
        Some(authority) => Some(authority.clone()),
        None => {
            let mut given = request.headers().get_all(header::HOST).iter();
            let (first, second) = (given.next(), given.next());
            let only = first.filter(|_| second.is_none());
            only.and_then(|only| Authority::try_from(only.as_bytes()).ok())
        }
    };
    named.filter(|named| !named.as_str().contains('@')).ok_or_else(|| {
        Problem::malformed("the request needs one `Host` header with a name, as in snow.example")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn neighbours() -> Neighbours {
        Neighbours {
            hosts: vec!["snow.example".to_owned()],
            origins: vec![HeaderValue::from_static("https://game.example")],
        }
    }

    #[test]
    fn a_server_knows_its_names() {
        let local = Some("192.0.2.7".parse().unwrap());
        let knows = |host: &str| neighbours().knows(&host.parse().unwrap(), local);
        for own in [
            "localhost",
            "LocalHost:8080",
            "127.0.0.1:8080",
            "127.9.9.9",
            "[::1]:80",
            "192.0.2.7:80",
            "Snow.Example:443",
        ] {
            assert!(knows(own), "{own}");
        }
        for foreign in ["evil.example", "192.0.2.8", "localhost.evil.example", "0.0.0.0", "[::]"] {
            assert!(!knows(foreign), "{foreign}");
        }
    }

    #[test]
    fn a_page_is_trusted_where_it_came_from_here_or_is_allowed() {
        let host: Authority = "localhost:8080".parse().unwrap();
        let trusts = |origins: &[&'static str]| {
            let origins = origins.iter().map(|o| (header::ORIGIN, HeaderValue::from_static(o)));
            neighbours().trusts(&origins.collect(), &host)
        };
        for own in [&[][..], &["http://localhost:8080"], &["https://game.example"]] {
            assert!(trusts(own), "{own:?}");
        }
        for foreign in [
            &["null"][..],
            &["http://localhost:3000"],
            &["http://localhost"],
            &["https://game.example.evil.example"],
            &["http://localhost:8080", "http://evil.example"],
        ] {
            assert!(!trusts(foreign), "{foreign:?}");
        }
    }
}
