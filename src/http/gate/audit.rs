//! The audit log: a line for each administrative call, and for authentications that failed.
//! `docs/operations.md` describes the fields.

use std::net::IpAddr;

use axum::http::{Method, StatusCode, header};
use axum::response::Response;
use firn_protocol::is_valid_id;
use tracing::info;

use crate::http::extract::media_type;
use crate::http::repeat::REPLAYED;
use crate::session::SNAPSHOT_MEDIA_TYPE;

use super::access::Caller;

/// Tells of something that happened: who did it from where, to which session, and what came of it.
fn tell(who: &str, address: Option<IpAddr>, what: &str, session: Option<&str>, result: &str) {
    let address = address.map(tracing::field::display);
    info!(target: "firn::audit", who, address, what, session, result, "audit");
}

/// An administrative call that is under way. Where its client goes away before it is answered, what
/// it asked for may happen all the same, and the log tells of it too.
#[derive(Debug)]
pub struct Call {
    who: String,
    address: IpAddr,
    what: &'static str,
    session: Option<String>,
    answered: bool,
}

impl Call {
    /// A call to a route, where that is an administrative one.
    pub fn begin(
        caller: &Caller,
        address: IpAddr,
        request: &axum::extract::Request,
        route: &str,
        session: Option<&str>,
    ) -> Option<Call> {
        let restores = || media_type(request.headers()) == SNAPSHOT_MEDIA_TYPE;
        let what = match (request.method(), route) {
            (&Method::POST, "/v1/sessions") if restores() => "restore session",
            (&Method::POST, "/v1/sessions") => "create session",
            (&Method::DELETE, "/v1/sessions/{id}") => "delete session",
            (&Method::POST, "/v1/sessions/{id}/tokens") => "reissue tokens",
            (&Method::POST, "/v1/sessions/{id}/unlock") => "unlock session",
            (_, "/v1/store/backup") => "back up store",
            (&Method::POST, "/v1/store/verify") => "verify store",
            (&Method::POST, "/v1/store/compact") => "compact store",
            _ => return None,
        };
        let session = session.map(str::to_owned);
        Some(Call { who: caller.name(), address, what, session, answered: false })
    }

    /// Tells of the call with its answer. A new session's name is in its `Location`.
    pub fn end(mut self, response: &Response) {
        self.answered = true;
        let headers = response.headers();
        let place = headers.get(header::LOCATION).and_then(|place| place.to_str().ok());
        let made = place.and_then(|place| place.rsplit('/').next());
        let status = response.status();
        let again = headers.contains_key(REPLAYED);
        let result = if again { "replayed".to_owned() } else { status.as_u16().to_string() };
        tell(&self.who, Some(self.address), self.what, self.session.as_deref().or(made), &result);
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        if !self.answered {
            let session = self.session.as_deref();
            tell(&self.who, Some(self.address), self.what, session, "unanswered");
        }
    }
}

/// Tells of a caller who was not let in.
pub fn refused(
    who: &str,
    address: IpAddr,
    reason: &str,
    session: Option<&str>,
    status: StatusCode,
) {
    // A stranger may send any text as a name.
    let session = session.filter(|id| is_valid_id(id));
    let what = format!("authenticate: {reason}");
    tell(who, Some(address), &what, session, &status.as_u16().to_string());
}

/// Tells that something was read again.
pub fn reloaded(what: &str, done: bool) {
    tell("signal", None, &format!("reload {what}"), None, if done { "ok" } else { "failed" });
}
