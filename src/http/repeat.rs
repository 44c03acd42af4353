//! `Idempotency-Key`: a request that is sent again gets the first answer that was a success, and changes
//! nothing.

use std::convert::Infallible;
use std::sync::Arc;

use axum::body::{Body, to_bytes};
use axum::extract::{FromRequestParts, MatchedPath, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::limit::Limit;
use crate::problem::Problem;
use crate::session::{Answer, Idempotency, NoPlace, Once, RequestKey, Session};

use super::extract::read_body;
use super::gate::{Caller, bearer};
use super::state::App;

/// The header that names a request.
pub const KEY: HeaderName = HeaderName::from_static("idempotency-key");

/// Tells an answer that was sent before.
pub const REPLAYED: HeaderName = HeaderName::from_static("idempotent-replayed");

/// Longest key \[bytes\].
const LONGEST_KEY: usize = 255;

/// What tells a request from all others, where it carries a key.
pub struct Keyed(pub Option<Once>);

impl<S: Sync> FromRequestParts<S> for Keyed {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Keyed, Infallible> {
        Ok(Keyed(parts.extensions.get().cloned()))
    }
}

/// Answers a POST that was answered before as it was then; carries out all others.
///
/// # Errors
/// 422 where the key can't be used, or was used for another request; 429 where too many answers are
/// kept; those of reading the body.
pub async fn answer_once(
    State(app): State<App>,
    path: MatchedPath,
    request: Request,
    next: Next,
) -> Result<Response, Problem> {
    let given = match *request.method() {
        Method::POST => given_key(request.headers())?,
        _ => None,
    };
    let Some(given) = given else { return Ok(next.run(request).await) };
    // Another session may get the name later: its requests are others.
    let owner = match request.extensions().get::<Arc<Session>>() {
        Some(session) => session.sid.to_string(),
        // What one tenant creates is nobody else's.
        None => {
            let caller = request.extensions().get::<Caller>();
            caller.and_then(Caller::tenant).unwrap_or_default().to_owned()
        }
    };
    let key = hash(&[owner.as_bytes(), path.as_str().as_bytes(), given.as_bytes()]);
    let token = bearer(request.headers()).unwrap_or_default();
    let (secret, creator) =
        (hash(&[given.as_bytes(), token.as_bytes()]), hash(&[token.as_bytes()]));
    let share = if owner.is_empty() { creator } else { hash(&[owner.as_bytes()]) };
    let (mut request, content) = read(request, &app).await?;
    let place = app.repeats.lookup(key, content, share).map_err(refuse)?;
    // Before the last start, or by a request whose answer was not kept.
    let before = app.sessions.asked_before(&key);
    if before.is_some_and(|before| before != content) {
        return Err(refuse(NoPlace::OtherRequest));
    }
    request.extensions_mut().insert(Once { key, request: content, secret });

    // A task of its own: where the client goes away, what it began is still done, and noted.
    let answering = tokio::spawn(async move {
        let mut carried_out = false;
        let carry_out = async || {
            carried_out = true;
            let answer = keep(next.run(request).await).await?;
            app.repeats.record(&key, &place, &answer);
            Ok(answer)
        };
        let answered = place.answer.get_or_try_init(carry_out).await;
        match answered {
            Ok(answer) => restore(answer, !carried_out || before.is_some()),
            Err(Unkept(response)) => {
                if !response.status().is_success() {
                    app.repeats.give_up(&key, place);
                }
                *response
            }
        }
    });
    answering.await.map_err(|failure| match failure.try_into_panic() {
        Ok(cause) => std::panic::resume_unwind(cause),
        Err(_) => Problem::unavailable("the server is stopping"),
    })
}

/// An answer that is not kept: nothing came of the request, and trying again makes sense; or it is so long
/// that it is made anew.
struct Unkept(Box<Response>);

fn given_key(headers: &HeaderMap) -> Result<Option<HeaderValue>, Problem> {
    let mut given = headers.get_all(KEY).iter();
    let Some(key) = given.next() else { return Ok(None) };
    if given.next().is_some() || key.is_empty() || key.len() > LONGEST_KEY {
        let detail = format!("expected one key of 1 to {LONGEST_KEY} characters");
        return Err(Problem::invalid_field("Idempotency-Key", detail));
    }
    Ok(Some(key.clone()))
}

/// Reads a request whole; returns it with a hash of what it says.
async fn read(request: Request, app: &App) -> Result<(Request, RequestKey), Problem> {
    let (parts, body) = request.into_parts();
    let body = read_body(Request::from_parts(parts.clone(), body), app).await?;
    let query = parts.uri.query().unwrap_or("");
    let media_type = parts.headers.get(header::CONTENT_TYPE).map_or(&[][..], |m| m.as_bytes());
    let content = hash(&[query.as_bytes(), media_type, &body]);
    Ok((Request::from_parts(parts, Body::from(body)), content))
}

fn hash(parts: &[&[u8]]) -> RequestKey {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    *hasher.finalize().as_bytes()
}

fn refuse(why: NoPlace) -> Problem {
    match why {
        NoPlace::OtherRequest => Problem::invalid_field(
            "Idempotency-Key",
            format!(
                "was used for another request within the last {} minutes; a key belongs to one \
                 request and its repeats",
                Idempotency::LIFETIME.as_secs() / 60
            ),
        ),
        NoPlace::Full(wait) => Problem::too_many_requests(
            "the server keeps as many answers of this session for repeats as it may; send fewer keys",
            u32::try_from(wait.as_secs()).unwrap_or(u32::MAX).max(1),
        )
        .from_limit(Limit::KeptAnswers),
    }
}

/// Takes an answer apart to keep it.
async fn keep(response: Response) -> Result<Answer, Unkept> {
    if !response.status().is_success() {
        return Err(Unkept(Box::new(response)));
    }
    let (parts, body) = response.into_parts();
    // Handlers make their bodies whole, so that this can't fail.
    let body = to_bytes(body, usize::MAX).await.map_err(|_| {
        let problem = Problem::internal("the answer could not be made");
        Unkept(Box::new(problem.into_response()))
    })?;
    let headers = parts.headers.iter();
    let headers = headers.map(|(name, value)| (name.as_str().as_bytes(), value.as_bytes()));
    let answer = Answer::new(parts.status.as_u16(), headers, &body);
    if answer.is_short() {
        return Ok(answer);
    }
    Err(Unkept(Box::new(Response::from_parts(parts, Body::from(body)))))
}

/// Puts an answer together again.
fn restore(answer: &Answer, replayed: bool) -> Response {
    let mut response = Response::new(Body::from(answer.body.to_vec()));
    *response.status_mut() = StatusCode::from_u16(answer.status).unwrap_or_default();
    for (name, value) in answer.headers() {
        let header = (HeaderName::from_bytes(name), HeaderValue::from_bytes(value));
        if let (Ok(name), Ok(value)) = header {
            response.headers_mut().append(name, value);
        }
    }
    if replayed {
        response.headers_mut().insert(REPLAYED, HeaderValue::from_static("true"));
    }
    response
}
