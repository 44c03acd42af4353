//! Lets requests in: finds out who sent one and whether that caller may do what it asks for, before
//! anything else of it is looked at.
//!
//! A stranger gets the same answer for a session that exists as for one that doesn't, and so does a
//! tenant for a session of somebody else.

use std::convert::Infallible;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;

use axum::extract::rejection::RawPathParamsRejection;
use axum::extract::{ConnectInfo, FromRequestParts, MatchedPath, RawPathParams, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;

use crate::config::Scope;
use crate::http::App;
use crate::limit::Limit;
use crate::metrics::AuthFailure;
use crate::problem::Problem;
use crate::session::Session;

use super::access::{Caller, Stranger};
use super::audit::{self, Call};
use super::rates::whole_seconds;

/// Everything that is asked for a token lies under this path.
const GUARDED: &str = "/v1/";

/// Calls that only read although they are a POST.
const READS_BY_POST: [&str; 2] = ["/v1/sessions/{id}/probes", "/v1/sessions/{id}/samples"];

/// Calls that are an administrator's.
const ADMINISTERS: [&str; 4] =
    ["/v1/sessions/{id}/unlock", "/v1/store/backup", "/v1/store/verify", "/v1/store/compact"];

/// Somebody who wants something.
#[derive(Clone, Copy, Debug)]
pub struct Visitor<'a> {
    /// Where it comes from.
    pub address: IpAddr,
    /// What it presents.
    pub token: Option<&'a str>,
    /// Name of the session that it is about; none where that is the server.
    pub session: Option<&'a str>,
    /// What it wants to do there.
    pub scope: Scope,
}

/// Somebody who was let in.
#[derive(Clone, Debug)]
pub struct Admitted {
    /// Who it is.
    pub caller: Caller,
    /// The session that it is about.
    pub session: Option<Arc<Session>>,
}

/// Lets a visitor in; one request is counted for it.
///
/// # Errors
/// 401 where the token is missing or unknown, and 429 where that address has had too many of the
/// latter; 403 where the token is good, but not for this; 404 where there is no such session for the
/// caller, 503 where it may still be brought back; 429 where the token is used too often.
pub fn admit(app: &App, visitor: &Visitor<'_>) -> Result<Admitted, Problem> {
    let access = &app.gate.access;
    let session = visitor.session.and_then(|id| app.sessions.peek(id));
    let caller = access.identify(visitor.token, session.as_deref()).map_err(|stranger| {
        // Its token may be one of a session that is still to come.
        let may_come = stranger == Stranger::Unknown && visitor.session.is_some();
        match app.sessions.recovering().filter(|_| may_come) {
            Some(why) => why.into(),
            None => turn_away(app, visitor, stranger),
        }
    })?;
    access.count(&caller, session.as_deref())?;
    if !caller.may(visitor.scope) {
        return Err(forbid(app, visitor, &caller));
    }
    match (visitor.session, session) {
        (None, _) => Ok(Admitted { caller, session: None }),
        (Some(_), Some(session)) if caller.reaches(&session) => {
            Ok(Admitted { caller, session: Some(session) })
        }
        (Some(id), _) => Err(app.sessions.absence(id).into()),
    }
}

/// What a visitor is told whom nobody knows.
fn turn_away(app: &App, visitor: &Visitor<'_>, stranger: Stranger) -> Problem {
    let problem = match stranger {
        Stranger::Missing => Problem::unauthorized(
            "this takes a token, as in `Authorization: Bearer …`: an API key, or one of the \
             session's own",
        ),
        Stranger::Unknown => match app.gate.access.failures.count(visitor.address) {
            Ok(()) => Problem::unauthorized(
                "the token is neither an API key nor one of this session's; creating and listing \
                 sessions takes an API key",
            ),
            Err(wait) => Problem::too_many_requests(
                "this address has sent too many tokens that are not good; those that are still work",
                whole_seconds(wait),
            )
            .from_limit(Limit::AuthFailuresPerMinute),
        },
    };
    let failure = match stranger {
        Stranger::Missing => AuthFailure::Missing,
        Stranger::Unknown => AuthFailure::Unknown,
    };
    note(app, visitor, "stranger", failure, &problem);
    problem
}

/// What a visitor is told who may not do what it wants.
fn forbid(app: &App, visitor: &Visitor<'_>, caller: &Caller) -> Problem {
    let problem = match caller {
        Caller::Tenant(_) => Problem::forbidden(format!(
            "this API key is not for that: the scope `{}` is not among its own",
            visitor.scope.name()
        )),
        _ if visitor.scope == Scope::Admin => Problem::forbidden(
            "a session's token is not for that: it takes an API key with the scope `admin`",
        ),
        _ => Problem::forbidden("a viewer's token only allows reading and streaming"),
    };
    note(app, visitor, &caller.name(), AuthFailure::Forbidden, &problem);
    problem
}

/// Counts a failure, and tells the audit log of it, though of no more than one a second and address.
fn note(app: &App, visitor: &Visitor<'_>, who: &str, failure: AuthFailure, problem: &Problem) {
    app.metrics.gate.auth_failed(failure);
    if app.gate.access.failures.is_told(visitor.address) {
        let status = StatusCode::from_u16(problem.status).unwrap_or_default();
        audit::refused(who, visitor.address, failure.label(), visitor.session, status);
    }
}

/// Lets requests under `/v1/` through to their handlers where [`admit`] does, and notes on them the
/// [`Caller`] and the session.
///
/// # Errors
/// Those of [`admit`].
pub async fn guard(
    State(app): State<App>,
    path: MatchedPath,
    Peer(address): Peer,
    params: Result<RawPathParams, RawPathParamsRejection>,
    mut request: Request,
    next: Next,
) -> Result<Response, Problem> {
    let route = path.as_str();
    if !route.starts_with(GUARDED) {
        return Ok(next.run(request).await);
    }
    // A path that is no text names no session.
    let named = params.iter().flatten().find(|(name, _)| *name == "id").map(|(_, id)| id);
    let visitor = Visitor {
        address,
        token: bearer(request.headers()),
        session: named,
        scope: scope(request.method(), route),
    };
    let Admitted { caller, session } = admit(&app, &visitor)?;
    let call = Call::begin(&caller, address, &request, route, named);
    let extensions = request.extensions_mut();
    extensions.insert(caller);
    if let Some(session) = session {
        extensions.insert(session);
    }
    let response = next.run(request).await;
    if let Some(call) = call {
        call.end(&response);
    }
    Ok(response)
}

/// What a call does.
fn scope(method: &Method, route: &str) -> Scope {
    if ADMINISTERS.contains(&route) {
        return Scope::Admin;
    }
    let reads = matches!(*method, Method::GET | Method::HEAD) || READS_BY_POST.contains(&route);
    if reads { Scope::Read } else { Scope::Write }
}

/// The address that a request comes from; 0.0.0.0 where it comes through no connection.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub IpAddr);

impl<S: Sync> FromRequestParts<S> for Peer {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Peer, Infallible> {
        let connected = parts.extensions.get::<ConnectInfo<SocketAddr>>();
        let address = connected.map(|ConnectInfo(address)| address.ip().to_canonical());
        Ok(Peer(address.unwrap_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED))))
    }
}

/// The token in an `Authorization` header; none where there are several such headers.
pub fn bearer(headers: &HeaderMap) -> Option<&str> {
    let mut given = headers.get_all(header::AUTHORIZATION).iter();
    let (Some(only), None) = (given.next(), given.next()) else { return None };
    let (scheme, token) = only.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim_start())
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    fn headers(values: &[&str]) -> HeaderMap {
        let name = header::AUTHORIZATION;
        values.iter().map(|v| (name.clone(), HeaderValue::from_str(v).unwrap())).collect()
    }

    #[test]
    fn a_token_stands_behind_its_scheme() {
        assert_eq!(bearer(&headers(&["Bearer abc"])), Some("abc"));
        assert_eq!(bearer(&headers(&["bearer  abc"])), Some("abc"));
        for wrong in [&[][..], &["abc"], &["Basic abc"], &["Bearer"], &["Bearer a", "Bearer b"]] {
            assert_eq!(bearer(&headers(wrong)), None, "{wrong:?}");
        }
    }

    #[test]
    fn only_reads_change_nothing() {
        for (method, route) in [
            (Method::GET, "/v1/sessions/{id}/heights"),
            (Method::HEAD, "/v1/sessions/{id}"),
            (Method::POST, "/v1/sessions/{id}/probes"),
        ] {
            assert_eq!(scope(&method, route), Scope::Read, "{method} {route}");
        }
        for method in [Method::POST, Method::PUT, Method::PATCH, Method::DELETE] {
            assert_eq!(scope(&method, "/v1/sessions/{id}"), Scope::Write, "{method}");
        }
        assert_eq!(scope(&Method::POST, "/v1/sessions/{id}/unlock"), Scope::Admin);
        assert_eq!(scope(&Method::GET, "/v1/store/backup"), Scope::Admin);
    }
}
