//! Who may do what: the API key everything, a session's token everything about it, its viewer's
//! token only reads. Without an API key nobody is asked.
//!
//! Tokens are compared by their hashes, in a time that does not depend on where they differ. A
//! stranger gets the same answer for a session that exists as for one that doesn't.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::extract::rejection::RawPathParamsRejection;
use axum::extract::{MatchedPath, RawPathParams, Request, State};
use axum::http::{HeaderMap, Method, header};
use blake3::Hash;
use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};

use crate::config::AccessConfig;
use crate::http::App;
use crate::problem::Problem;
use crate::session::{Grant, Session, TokenHashes};

/// Everything that is asked for a token lies under this path.
const GUARDED: &str = "/v1/";

/// Calls that only read although they are a POST.
const READS_BY_POST: [&str; 1] = ["/v1/sessions/{id}/probes"];

/// Requests between two looks for tokens whose rate needs no remembering any more.
const SWEEP: u64 = 10_000;

/// What decides who may do what.
#[derive(Debug)]
pub struct Access {
    /// Hash of the API key; the server is open where there is none.
    key: Option<Hash>,
    rates: DefaultKeyedRateLimiter<[u8; 32]>,
    checked: AtomicU64,
}

/// Who sent a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caller {
    /// Anybody: the server is open.
    Anyone,
    /// Who has the API key.
    Operator,
    /// Who has one of the session's tokens, by its hash.
    Holder(Hash, Grant),
}

impl Caller {
    /// Whether it may change what it can read.
    pub fn may_change(self) -> bool {
        !matches!(self, Caller::Holder(_, Grant::Reads))
    }

    /// Whether it may stay where a session's tokens are now these.
    pub fn is_known_to(self, tokens: &TokenHashes) -> bool {
        match self {
            Caller::Anyone | Caller::Operator => true,
            Caller::Holder(token, grant) => tokens.grant(&token) == Some(grant),
        }
    }
}

impl Default for Access {
    /// An open server.
    fn default() -> Self {
        Access::new(&AccessConfig::default()).expect("no key is no wrong key")
    }
}

impl Access {
    /// What a configuration says.
    ///
    /// # Errors
    /// Those of [`AccessConfig::key`].
    pub fn new(config: &AccessConfig) -> Result<Access, String> {
        Ok(Access {
            key: config.key()?.map(|key| key.hash()),
            rates: RateLimiter::keyed(Quota::per_second(config.requests_per_second)),
            checked: AtomicU64::new(0),
        })
    }

    /// Whether nobody is asked for a token.
    pub fn is_open(&self) -> bool {
        self.key.is_none()
    }

    /// Who presents a token for a session, or for the server where there is none; one request is
    /// counted for it.
    ///
    /// # Errors
    /// 401 where the token is missing or unknown, 429 where it is used too often.
    pub fn admit(&self, token: Option<&str>, session: Option<&Session>) -> Result<Caller, Problem> {
        let Some(key) = &self.key else { return Ok(Caller::Anyone) };
        let Some(token) = token else {
            return Err(Problem::unauthorized(
                "this takes a token, as in `Authorization: Bearer …`: the API key, or one of the \
                 session's own",
            ));
        };
        let token = blake3::hash(token.as_bytes());
        let caller = if token == *key {
            Some(Caller::Operator)
        } else {
            let grant = session.and_then(|session| session.tokens().grant(&token));
            grant.map(|grant| Caller::Holder(token, grant))
        };
        let caller = caller.ok_or_else(|| {
            Problem::unauthorized(
                "the token is neither the API key nor one of this session's; creating and listing \
                 sessions takes the API key",
            )
        })?;
        self.count(token).map(|()| caller)
    }

    fn count(&self, token: Hash) -> Result<(), Problem> {
        if self.checked.fetch_add(1, Ordering::Relaxed) % SWEEP == SWEEP - 1 {
            self.rates.retain_recent();
        }
        self.rates.check_key(token.as_bytes()).map_err(|early| {
            let wait = early.wait_time_from(DefaultClock::default().now());
            let detail = "this token is used for more requests than the server takes per second; \
                          the operator can raise --requests-per-second";
            Problem::too_many_requests(detail, whole_seconds(wait))
        })
    }
}

/// Lets requests under `/v1/` through to their handlers where the caller may do what they ask for,
/// and notes the [`Caller`] on them.
///
/// # Errors
/// Those of [`Access::admit`]; 403 where the token is good, but only for reading.
pub async fn authorize(
    State(app): State<App>,
    path: MatchedPath,
    params: Result<RawPathParams, RawPathParamsRejection>,
    mut request: Request,
) -> Result<Request, Problem> {
    if !path.as_str().starts_with(GUARDED) {
        return Ok(request);
    }
    // A path that is no text names no session.
    let named = params.iter().flatten().find(|(name, _)| *name == "id");
    let session = named.map(|(_, id)| app.sessions.find(id)).transpose()?.flatten();
    let caller = app.gate.access.admit(bearer(request.headers()), session.as_deref())?;
    if changes(request.method(), path.as_str()) && !caller.may_change() {
        return Err(Problem::forbidden("a viewer's token only allows reading and streaming"));
    }
    request.extensions_mut().insert(caller);
    Ok(request)
}

fn changes(method: &Method, path: &str) -> bool {
    !matches!(*method, Method::GET | Method::HEAD) && !READS_BY_POST.contains(&path)
}

/// The token in an `Authorization` header; none where there are several such headers.
pub fn bearer(headers: &HeaderMap) -> Option<&str> {
    let mut given = headers.get_all(header::AUTHORIZATION).iter();
    let (Some(only), None) = (given.next(), given.next()) else { return None };
    let (scheme, token) = only.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim_start())
}

/// A time as `Retry-After` tells it: rounded up, and never 0.
fn whole_seconds(time: Duration) -> u32 {
    (time.as_secs_f64().ceil() as u32).max(1)
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
        assert!(!changes(&Method::GET, "/v1/sessions/{id}/heights"));
        assert!(!changes(&Method::HEAD, "/v1/sessions/{id}"));
        assert!(!changes(&Method::POST, "/v1/sessions/{id}/probes"));
        for method in [Method::POST, Method::PUT, Method::PATCH, Method::DELETE] {
            assert!(changes(&method, "/v1/sessions/{id}"), "{method}");
        }
    }
}
