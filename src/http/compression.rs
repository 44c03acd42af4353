//! Answers in fewer bytes, for clients that ask for it (RFC 9110, section 12.5.3).
//!
//! What handlers answer is kept, compared and counted as it is. Only on its way out it is coded, a large answer
//! piece by piece as its client takes it, on the threads that make large answers.

use std::io::{self, Cursor, Read};

use axum::body::{Body, Bytes, HttpBody, to_bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use flate2::Compression;
use flate2::bufread::GzEncoder;
use futures_util::TryStreamExt;

use crate::problem::Problem;

use super::accept::choose_coding;
use super::answers::{Answers, SMALL, holding};
use super::etag;
use super::state::App;

const GZIP: &str = "gzip";
const ZSTD: &str = "zstd";

/// The codings, best first: zstd takes half the time of gzip.
const CODINGS: [&str; 2] = [ZSTD, GZIP];

/// Longest answer that is never compressed \[bytes\]: it fits a packet or little more.
const SHORT: u64 = 1024;

/// Level 1 leaves half as many bytes again of heights; higher ones take longer for hardly fewer.
const GZIP_LEVEL: u32 = 2;

/// Higher levels take more time and memory for hardly fewer bytes.
const ZSTD_LEVEL: i32 = 1;

/// Memory that coding a large answer takes \[bytes\]: what zstd says of its level, and a piece.
const CODER: u64 = 1536 * 1024;

/// Media types that get shorter; those of `text` do as well. Pictures and snapshots are compressed already.
const COMPRESSIBLE: [&str; 5] = [
    "application/json",
    "application/octet-stream",
    "application/problem+json",
    "application/x-npy",
    "image/svg+xml",
];

/// Compresses answers that gain by it.
pub async fn compress(State(app): State<App>, request: Request, next: Next) -> Response {
    let coding = choose_coding(request.headers(), &CODINGS);
    let mut response = next.run(request).await;
    if !is_compressible(&response) {
        return response;
    }
    vary(response.headers_mut());
    match coding {
        Some(coding) => encode(&app.answers, response, coding).await,
        None => response,
    }
}

/// Whether an answer gets shorter. One of unknown length is a backup, which is compressed already.
fn is_compressible(response: &Response) -> bool {
    let headers = response.headers();
    let media_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let media_type = media_type.unwrap_or_default().split(';').next().unwrap_or_default().trim();
    response.body().size_hint().exact().is_some_and(|length| length > SHORT)
        && (media_type.starts_with("text/") || COMPRESSIBLE.contains(&media_type))
        && !headers.contains_key(header::CONTENT_ENCODING)
}

/// Says that the answer depends on the codings that the client takes.
fn vary(headers: &mut HeaderMap) {
    let name = header::ACCEPT_ENCODING;
    let told = headers.get_all(header::VARY).iter().filter_map(|value| value.to_str().ok());
    if !told.flat_map(|value| value.split(',')).any(|told| told.trim() == name) {
        headers.append(header::VARY, name.into());
    }
}

/// Codes an answer. Where that can't be done, for want of memory, it goes as it is.
async fn encode(answers: &Answers, response: Response, coding: &'static str) -> Response {
    let (mut parts, body) = response.into_parts();
    // Handlers make their bodies whole: it is there at once.
    let Ok(answer) = to_bytes(body, usize::MAX).await else {
        return Problem::internal("the answer could not be made").into_response();
    };
    let Ok(coded) = code(answers, &answer, coding) else {
        return Response::from_parts(parts, Body::from(answer));
    };
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static(coding));
    etag::weaken(&mut parts.headers);
    Response::from_parts(parts, coded)
}

/// A small answer is coded at once.
fn code(answers: &Answers, answer: &Bytes, coding: &str) -> io::Result<Body> {
    if answer.len() as u64 <= SMALL {
        let mut coded = Vec::new();
        coder(answer.clone(), coding)?.read_to_end(&mut coded)?;
        return Ok(Body::from(coded));
    }
    let memory = answers.unsent.try_reserve(CODER).ok_or(io::ErrorKind::OutOfMemory)?;
    // Each piece holds the answer and the coder's memory: they count until the last one is sent.
    let answer = holding(answer.clone(), memory);
    let pieces = answers.pieces(coder(answer.clone(), coding)?);
    let pieces = pieces.map_ok(move |piece| holding(Bytes::from(piece), answer.clone()));
    Ok(Body::from_stream(pieces))
}

/// Reads an answer coded.
fn coder(answer: Bytes, coding: &str) -> io::Result<Box<dyn Read + Send>> {
    let answer = Cursor::new(answer);
    Ok(match coding {
        ZSTD => Box::new(zstd::stream::read::Encoder::with_buffer(answer, ZSTD_LEVEL)?),
        _ => Box::new(GzEncoder::new(answer, Compression::new(GZIP_LEVEL))),
    })
}
