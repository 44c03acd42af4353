//! Large answers: how many are made at a time, and how much of them may wait for clients that do not
//! take them.
//!
//! The memory of an answer is counted from before it is made until its last byte is with the operating
//! system, whatever route it is for.

use std::borrow::Cow;
use std::io::{self, Read};
use std::sync::Arc;
use std::time::Duration;

use axum::Extension;
use axum::body::{Body, Bytes, HttpBody, to_bytes};
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use firn_engine::parallel;
use firn_engine::reserve::ask_for;
use futures_util::stream::{self, Stream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

use crate::budget::{Budget, Reservation};
use crate::limit::Limit;
use crate::problem::Problem;
use crate::session::{Reading, Session};
use crate::threads::Pool;

use super::state::App;

/// Longest answer that is not counted \[bytes\].
pub const SMALL: u64 = 64 * 1024;

/// Bytes that are read at a time of an answer that is made while it is taken.
const PIECE: u64 = 64 * 1024;

/// Large answers that are made at a time, for each processor.
const EACH_PROCESSOR: usize = 2;

/// What large answers take. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct Answers {
    /// Bytes of answers that are being made, or have not been taken yet.
    pub unsent: Budget,
    turns: Arc<Semaphore>,
    /// Where they are made.
    pub threads: Pool,
    patience: Duration,
}

/// Leave to make an answer.
#[derive(Debug)]
pub struct Leave {
    answers: Answers,
    /// None for a small answer.
    memory: Option<Reservation>,
    /// The only place for what a session's world finds, until it is found.
    finding: Option<OwnedSemaphorePermit>,
}

/// Says of an answer that its memory is counted, or takes none.
#[derive(Clone, Copy, Debug)]
pub struct Counted;

impl Answers {
    /// Answers that take so many bytes at the most, and wait for room no longer than `patience`.
    ///
    /// # Errors
    /// Where the operating system refuses threads.
    pub fn new(most_unsent: u64, patience: Duration) -> io::Result<Answers> {
        let at_once = EACH_PROCESSOR * parallel::processors();
        let threads = Pool::new(at_once, "answers").map_err(io::Error::other)?;
        let turns = Arc::new(Semaphore::new(at_once));
        Ok(Answers { unsent: Budget::new(most_unsent), turns, threads, patience })
    }

    /// Waits until an answer may be made that takes so many bytes meanwhile, or less.
    ///
    /// # Errors
    /// 503 where too many answers wait to be taken, for too long; 507 where there is no memory.
    pub async fn admit(&self, bytes: u64) -> Result<Leave, Problem> {
        if bytes <= SMALL {
            return Ok(Leave { answers: self.clone(), memory: None, finding: None });
        }
        let memory = timeout(self.patience, self.unsent.reserve(bytes)).await;
        let memory = memory.map_err(|_| full())?;
        ask_for(bytes).map_err(|error| {
            Problem::no_memory(format!(
                "there is no memory for the answer, which takes {bytes} bytes: {error}"
            ))
        })?;
        Ok(Leave { answers: self.clone(), memory: Some(memory), finding: None })
    }

    /// The same, for what the world has to find first. A session's are found one after another: how long that
    /// takes is its own affair, and so it takes no more memory than one of them meanwhile.
    ///
    /// # Errors
    /// As [`Answers::admit`].
    pub async fn admit_found(&self, session: &Session, bytes: u64) -> Result<Leave, Problem> {
        let finding = timeout(self.patience, session.finding()).await.map_err(|_| full())?;
        Ok(Leave { finding: Some(finding), ..self.admit(bytes).await? })
    }

    /// Finds what is to be read of the snow and makes an answer of it, off the threads that serve everybody, to the
    /// end also where its client goes away. The leave is kept until the answer has been taken.
    ///
    /// # Errors
    /// As [`Answers::admit`], those of the session and those of `make`.
    pub async fn read<T, A>(
        &self,
        reading: Reading<T>,
        make: impl FnOnce(T) -> Result<A, Problem> + Send + 'static,
    ) -> Result<(A, Leave), Problem>
    where
        T: Send + 'static,
        A: Send + 'static,
    {
        let bytes = reading.bytes();
        let mut leave = match bytes {
            ..=SMALL => self.admit(bytes).await?,
            _ => self.admit_found(reading.session(), bytes).await?,
        };
        let answers = self.clone();
        carry_on(async move {
            let found = reading.find().await?;
            leave.finding = None;
            let made = answers.threads.run(move || make(found.finish())).await;
            Ok((made.ok_or_else(failed)??, leave))
        })
        .await
    }

    /// Pieces of an answer that is read while its client takes it, off the threads that serve everybody.
    pub fn pieces<R: Read + Send + 'static>(
        &self,
        source: R,
    ) -> impl Stream<Item = io::Result<Vec<u8>>> + use<R> {
        let threads = self.threads.clone();
        stream::try_unfold(source, move |mut source| {
            let threads = threads.clone();
            async move {
                let reading = threads.run(move || {
                    let mut piece = Vec::new();
                    source.by_ref().take(PIECE).read_to_end(&mut piece)?;
                    Ok((piece, source))
                });
                let failed = || Err(io::Error::other("making the answer failed"));
                let (piece, source) = reading.await.unwrap_or_else(failed)?;
                Ok((!piece.is_empty()).then_some((piece, source)))
            }
        })
    }

    /// Counts the memory of an answer that was made without leave.
    async fn count(&self, response: Response) -> Response {
        let bytes = response.body().size_hint().lower();
        if bytes <= SMALL || response.extensions().get::<Counted>().is_some() {
            return response;
        }
        match timeout(self.patience, self.unsent.reserve(bytes)).await {
            Ok(memory) => hold(response, Some(memory)).await,
            Err(_) => full().into_response(),
        }
    }
}

/// Finds and makes an answer, also where its client goes away: its memory is taken until then.
///
/// # Errors
/// Those of `work`; 500 where it panics.
pub async fn carry_on<T: Send + 'static>(
    work: impl Future<Output = Result<T, Problem>> + Send + 'static,
) -> Result<T, Problem> {
    tokio::spawn(work).await.unwrap_or_else(|_| Err(failed()))
}

fn failed() -> Problem {
    Problem::internal("making the answer failed")
}

impl Leave {
    /// Waits for a turn to make the answer: everything that it is made of is there.
    ///
    /// # Errors
    /// 503 where that takes too long.
    pub async fn turn(&mut self) -> Result<OwnedSemaphorePermit, Problem> {
        self.finding = None;
        let turn = timeout(self.answers.patience, self.answers.turns.clone().acquire_owned()).await;
        Ok(turn.map_err(|_| full())?.expect("the semaphore of turns is never closed"))
    }

    /// Makes the answer, off the threads that serve everybody where it is a large one.
    ///
    /// # Errors
    /// Those of `work`; 500 where it panics; 503 where there is no turn for it.
    pub async fn make(
        mut self,
        work: impl FnOnce() -> Result<Response, Problem> + Send + 'static,
    ) -> Result<Response, Problem> {
        if self.memory.is_none() {
            return work();
        }
        let turn = self.turn().await?;
        let memory = self.memory;
        // They stay with the work, which goes on where the client goes away.
        let made = self.answers.threads.run(move || (work(), turn, memory)).await;
        let (response, turn, memory) = made.ok_or_else(failed)?;
        drop(turn);
        Ok(hold(response?, memory).await)
    }

    /// Takes an answer that was made elsewhere.
    pub async fn take(self, response: Response) -> Response {
        hold(response, self.memory).await
    }
}

/// Counts the memory of every answer.
pub async fn count(State(app): State<App>, request: Request, next: Next) -> Response {
    app.answers.count(next.run(request).await).await
}

/// Keeps memory reserved until the last byte of an answer has been taken.
async fn hold(response: Response, memory: Option<Reservation>) -> Response {
    let Some(mut memory) = memory else { return response };
    let (mut parts, body) = response.into_parts();
    // Handlers make their bodies whole: it is there at once.
    let Ok(bytes) = to_bytes(body, usize::MAX).await else {
        return Problem::internal("the answer could not be made").into_response();
    };
    memory.resize(bytes.len() as u64);
    parts.extensions.insert(Counted);
    Response::from_parts(parts, Body::from(holding(bytes, memory)))
}

/// A body that is a file: where it is part of the program it takes no memory of its own, however many
/// clients take their time.
pub fn file(bytes: Cow<'static, [u8]>) -> Response {
    match bytes {
        Cow::Borrowed(bytes) => (Extension(Counted), Bytes::from_static(bytes)).into_response(),
        Cow::Owned(bytes) => bytes.into_response(),
    }
}

/// The same bytes, which hold something until they are gone.
pub fn holding(bytes: Bytes, held: impl Send + 'static) -> Bytes {
    Bytes::from_owner(Held { bytes, _held: held })
}

struct Held<T> {
    bytes: Bytes,
    _held: T,
}

impl<T> AsRef<[u8]> for Held<T> {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

fn full() -> Problem {
    let detail = "as many large answers are being made, or wait for clients that do not take them, as \
                  the server holds; try again, or ask for less at a time";
    Problem::unavailable(detail).from_limit(Limit::MaxUnsent)
}
