//! Requests of clients, each a future that is polled when a seed says so.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};
use std::time::Instant;

use firn::session::{Applied, Change, Once, SessionError, Sessions};
use firn_protocol::{AirTemperature, ColliderSpec, SessionSpec, SettingsPatch, Snowfall, StepSpec};
use firn_snow::{Position, Shape};

use crate::model::{Fate, Operation, metres};

/// The answer to a request. Only changes have one that says something.
pub type Told = Result<Option<Applied>, SessionError>;

type Answer = Pin<Box<dyn Future<Output = Told>>>;

/// A request that has no answer yet.
pub struct Request {
    /// The session that it is for.
    pub session: String,
    /// What it asks.
    pub operation: Operation,
    /// Its key, where it may be repeated.
    pub once: Option<Once>,
    /// Its place in the model, once it was sent.
    pub place: Option<usize>,
    /// Whether it may have been carried out although nobody was told.
    pub doubtful: bool,
    /// Its first answer, and when it came, where it is asked again nevertheless.
    pub first: Option<(Option<Applied>, Instant)>,
    answer: Option<Answer>,
}

impl Request {
    /// A request that is still to be sent.
    pub fn new(session: &str, operation: Operation, once: Option<Once>) -> Request {
        Request {
            session: session.to_owned(),
            operation,
            once,
            place: None,
            doubtful: false,
            first: None,
            answer: None,
        }
    }

    /// Sends it, or looks for its answer.
    pub fn poll(&mut self, sessions: &Sessions, spec: &SessionSpec) -> Option<Told> {
        let answer = self.answer.get_or_insert_with(|| {
            let id = self.session.clone();
            send(sessions.clone(), id, self.operation.clone(), self.once.clone(), spec.clone())
        });
        match answer.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Pending => None,
            Poll::Ready(answer) => Some(answer),
        }
    }

    /// It has its answer.
    pub fn forget(&mut self) {
        self.answer = None;
    }

    /// Has its answer lost: the client has gone, or the server is dead.
    pub fn lose(&mut self) {
        self.doubtful |= self.answer.take().is_some();
    }
}

/// What an answer says of what was asked.
pub fn fate(answer: &Told) -> Fate {
    match answer {
        Ok(_) => Fate::Done,
        Err(SessionError::Internal(_)) => Fate::Unknown,
        Err(SessionError::Unavailable(why)) if why.contains("has stopped") => Fate::Unknown,
        Err(_) => Fate::Refused,
    }
}

/// Sends a request.
pub fn send(
    sessions: Sessions,
    id: String,
    operation: Operation,
    once: Option<Once>,
    spec: SessionSpec,
) -> Answer {
    Box::pin(async move {
        if operation == Operation::Create {
            return sessions.create_once(spec, None, once).await.map(|_| None);
        }
        let session = sessions.get(&id)?;
        match operation {
            Operation::Delete => sessions.delete(&session).await.map(|()| None),
            Operation::Reset => session.reset().await.map(|_| None),
            Operation::Step(ticks) => {
                let ticks = Some(ticks);
                session.step(StepSpec { ticks, ..StepSpec::default() }).await.map(|_| None)
            }
            operation => session.change_once(change(&operation, &spec), once).await.map(Some),
        }
    })
}

fn change(operation: &Operation, spec: &SessionSpec) -> Change {
    match *operation {
        Operation::Snowfall(depth) => Change::Snowfall(Snowfall::new(metres(depth, &spec.grid))),
        Operation::Air(celsius) => {
            Change::AirTemperature(AirTemperature { celsius: f64::from(celsius) })
        }
        Operation::Put(object, mass) => Change::PutCollider(ColliderSpec {
            id: Some(object.to_string()),
            mass: f64::from(mass),
            shape: Shape::Disk { radius: 0.3 },
            position: Position { x: 0.2 * f64::from(object), z: 0.8 },
        }),
        Operation::Remove(object) => Change::DeleteCollider { id: object.to_string() },
        Operation::Pause(paused) => {
            Change::Settings(SettingsPatch { paused: Some(paused), ..SettingsPatch::default() })
        }
        Operation::Create | Operation::Delete | Operation::Reset | Operation::Step(_) => {
            unreachable!("these are no changes")
        }
    }
}

/// Polls something until it is done, doing `meanwhile` in between.
///
/// # Errors
/// Where it is not done in so many rounds.
pub fn wait_for<T>(
    what: &str,
    future: impl Future<Output = T>,
    mut meanwhile: impl FnMut(),
) -> Result<T, String> {
    let mut future = std::pin::pin!(future);
    for _ in 0..4000 {
        if let Poll::Ready(done) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return Ok(done);
        }
        meanwhile();
    }
    Err(format!("nobody answers: {what}"))
}

/// Lets everybody else do something first.
pub async fn later() {
    let mut waited = false;
    std::future::poll_fn(|_| match std::mem::replace(&mut waited, true) {
        true => Poll::Ready(()),
        false => Poll::Pending,
    })
    .await;
}

/// Names of keys, of which none is used twice.
pub fn key(number: u64) -> Once {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&number.to_le_bytes());
    Once { key, request: key, secret: key }
}
