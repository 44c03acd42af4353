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
use crate::session::{KeyedRequests, NoPlace, Once, Session};

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
    let secret = hash(&[given.as_bytes(), token.as_bytes()]);
    let share = hash(&[if owner.is_empty() { token } else { &owner }.as_bytes()]);
    let (mut request, content) = read(request, &app).await?;
    let once = Once { key, request: content, secret };
    let place = app.sessions.keyed().begin(&once, share).map_err(refuse)?;
    request.extensions_mut().insert(once);

    // A task of its own: where the client goes away, what it began is still done, and noted.
    let answering = tokio::spawn(async move {
        let keyed = app.sessions.keyed();
        let mut replayed = true;
        let carry_out = async || {
            // Before the last start, or by a request whose answer was not kept.
            replayed = keyed.is_done(&key);
            let answer = write_down(next.run(request).await).await;
            answer.inspect(|answer| keyed.keep(&key, &place, answer))
        };
        let answered = place.get_or_try_init(carry_out).await;
        let mut response = match answered {
            Ok(answer) => restore(answer),
            Err(response) => *response,
        };
        if !response.status().is_success() {
            keyed.give_up(&key, place);
        } else if replayed {
            response.headers_mut().insert(REPLAYED, HeaderValue::from_static("true"));
        }
        response
    });
    answering.await.map_err(|failure| match failure.try_into_panic() {
        Ok(cause) => std::panic::resume_unwind(cause),
        Err(_) => Problem::unavailable("the server is stopping"),
    })
}

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
async fn read(request: Request, app: &App) -> Result<(Request, [u8; 32]), Problem> {
    let (parts, body) = request.into_parts();
    let body = read_body(Request::from_parts(parts.clone(), body), app).await?;
    let query = parts.uri.query().unwrap_or("");
    let media_type = parts.headers.get(header::CONTENT_TYPE).map_or(&[][..], |m| m.as_bytes());
    let content = hash(&[query.as_bytes(), media_type, &body]);
    Ok((Request::from_parts(parts, Body::from(body)), content))
}

fn hash(parts: &[&[u8]]) -> [u8; 32] {
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
                KeyedRequests::LIFETIME.as_secs() / 60
            ),
        ),
        NoPlace::Full(wait) => Problem::too_many_requests(
            "the server keeps as many answers of this session for repeats as it may; send fewer keys",
            u32::try_from(wait.as_secs()).unwrap_or(u32::MAX).max(1),
        )
        .from_limit(Limit::KeptAnswers),
    }
}

/// An answer as it is kept: its status, names and values of its headers, and an empty line, then its body.
///
/// # Errors
/// One that is not kept: nothing came of the request, and trying again makes sense; or it is so long that it
/// is made anew.
async fn write_down(response: Response) -> Result<Box<[u8]>, Box<Response>> {
    if !response.status().is_success() {
        return Err(response.into());
    }
    let (parts, body) = response.into_parts();
    // Handlers make their bodies whole, so that this can't fail.
    let failed = |_| Problem::internal("the answer could not be made").into_response();
    let body = to_bytes(body, usize::MAX).await.map_err(failed)?;
    let mut answer = [parts.status.as_str().as_bytes(), b"\n"].concat();
    for (name, value) in &parts.headers {
        // Neither has a line feed.
        answer.extend([name.as_str().as_bytes(), b"\n", value.as_bytes(), b"\n"].concat());
    }
    answer.extend([b"\n", &body[..]].concat());
    if answer.len() > KeyedRequests::LONGEST_ANSWER {
        return Err(Response::from_parts(parts, Body::from(body)).into());
    }
    Ok(answer.into())
}

/// Puts an answer together again.
fn restore(answer: &[u8]) -> Response {
    let mut rest = answer;
    let mut line = || {
        let end = rest.iter().position(|&byte| byte == b'\n')?;
        let line = &rest[..end];
        rest = &rest[end + 1..];
        Some(line)
    };
    let status = line().and_then(|line| StatusCode::from_bytes(line).ok());
    let mut headers = HeaderMap::new();
    while let Some(name) = line()
        && let Ok(name) = HeaderName::from_bytes(name)
        && let Some(Ok(value)) = line().map(HeaderValue::from_bytes)
    {
        headers.append(name, value);
    }
    (status.unwrap_or_default(), headers, Body::from(rest.to_vec())).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADERS: [(&str, &str); 4] =
        [("etag", "a:b"), ("date", ""), ("firn-seq", "1"), ("firn-seq", "2")];

    fn answer(status: StatusCode, body: usize) -> Response {
        let mut response = Response::new(Body::from(vec![b'\n'; body]));
        *response.status_mut() = status;
        for (name, value) in HEADERS {
            response.headers_mut().append(name, HeaderValue::from_static(value));
        }
        response
    }

    #[tokio::test]
    async fn an_answer_is_put_together_as_it_was() {
        for body in [0, 3] {
            let answer = write_down(answer(StatusCode::CREATED, body)).await.ok().unwrap();
            let restored = restore(&answer);
            assert_eq!(restored.status(), StatusCode::CREATED);
            let headers = restored.headers().iter();
            let headers: Vec<_> = headers.map(|(n, v)| (n.as_str(), v.to_str().unwrap())).collect();
            assert_eq!(headers, HEADERS);
            assert_eq!(to_bytes(restored.into_body(), 9).await.unwrap(), vec![b'\n'; body]);
        }
    }

    #[tokio::test]
    async fn what_is_refused_or_too_long_is_not_kept() {
        let longest = KeyedRequests::LONGEST_ANSWER;
        for (status, body) in [(StatusCode::OK, longest), (StatusCode::CONFLICT, 3)] {
            let Err(unkept) = write_down(answer(status, body)).await else { panic!() };
            assert_eq!((unkept.status(), unkept.headers().len()), (status, HEADERS.len()));
            assert_eq!(to_bytes(unkept.into_body(), longest).await.unwrap().len(), body);
        }
    }
}
