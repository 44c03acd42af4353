//! Requests of clients, each a future that is polled when a seed says so.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};
use std::time::Instant;

use firn::session::{Applied, Change, Once, SessionError, Sessions, Tokens};
use firn_protocol::{
    AirTemperature, Clearing, ColliderSpec, Part, Region, SessionSpec, SettingsPatch, Snowfall,
    StampBatch, StampSpec, StepSpec,
};
use firn_snow::{Grid, Position, Shape};

use crate::model::{Fate, Model, Operation, metres};

/// What an answer says.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// That it was done.
    Nothing,
    /// What a change did.
    Applied(Box<Applied>),
    /// The hash of the token that a session has now.
    Token(String),
}

/// The answer to a request.
pub type Told = Result<Heard, SessionError>;

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
    pub first: Option<(Heard, Instant)>,
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
    pub fn poll(&mut self, sessions: &Sessions, model: &Model) -> Option<Told> {
        let answer = self.answer.get_or_insert_with(|| {
            let (id, operation) = (self.session.clone(), self.operation.clone());
            send(sessions.clone(), id, operation, self.once.clone(), model)
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
    model: &Model,
) -> Answer {
    let spec = model.spec.clone();
    if let Operation::Create(beginning) = operation {
        let snapshot = model.snapshot(beginning);
        return Box::pin(async move {
            let created = match snapshot {
                Some(bytes) => sessions.restore(bytes, Some(id), None, once).await,
                None => sessions.create_once(spec, None, once).await,
            };
            created.map(|(_, tokens)| token(&tokens))
        });
    }
    let snapshot = match operation {
        Operation::Restore(number) => model.snapshot(number),
        _ => None,
    };
    Box::pin(async move {
        let session = sessions.get(&id)?;
        match operation {
            Operation::Delete => sessions.delete(&session).await?,
            Operation::Reset => drop(session.reset().await?),
            Operation::EndStep => session.end_step().await?,
            Operation::Restore(_) => {
                let snapshot = snapshot.map(|bytes| bytes.to_vec()).unwrap_or_default();
                session.reset_to_snapshot(snapshot).await?;
            }
            Operation::Keep(name) => drop(session.keep_checkpoint(&name.to_string()).await?),
            Operation::Forget(name) => session.delete_checkpoint(&name.to_string()).await?,
            Operation::GoBack(name) => {
                session.reset_to_checkpoint(&name.to_string()).await?;
            }
            Operation::Reissue => return Ok(token(&session.reissue_tokens().await?)),
            Operation::Step(ticks) => {
                let ticks = Some(ticks);
                session.step(StepSpec { ticks, ..StepSpec::default() }).await?;
            }
            operation => {
                let change = change(&operation, &spec);
                let applied = session.change_once(change, once).await?;
                return Ok(Heard::Applied(Box::new(applied)));
            }
        }
        Ok(Heard::Nothing)
    })
}

fn token(tokens: &Tokens) -> Heard {
    Heard::Token(tokens.hashes().token.to_hex().to_string())
}

/// An object: a disk, a turned box, a wheel, or what stands on two feet. Some hang over the edge.
fn put(object: u8, mass: u32) -> ColliderSpec {
    let number = f64::from(object);
    let foot = |x: f64| Part {
        shape: Shape::Capsule { length: 0.4, radius: 0.1 },
        offset: Position { x, z: 0.0 },
        heading: 10.0 * x,
    };
    let (shape, footprints) = match object {
        0 => (Some(Shape::Disk { radius: 0.3 }), None),
        1 => (Some(Shape::Box { width: 0.2, depth: 0.9 }), None),
        2 => (Some(Shape::Wheel { width: 0.3, radius: 0.4 }), None),
        _ => (None, Some(vec![foot(-0.2), foot(0.2)])),
    };
    ColliderSpec {
        id: Some(object.to_string()),
        mass: f64::from(mass),
        shape,
        footprints,
        position: Position { x: 0.2 * number, z: 0.8 },
        heading: 30.0 * number,
        // Now and then it is held up, lets snow fall through, or moves.
        airborne: mass.is_multiple_of(7),
        shelters: !mass.is_multiple_of(5),
        velocity: Position { x: 0.3 * f64::from(mass % 3), z: 0.0 },
        turn_rate: if mass.is_multiple_of(4) { 20.0 } else { 0.0 },
        path: mass.is_multiple_of(6).then(|| vec![[0.6, 0.2], [0.2, 1.0]]),
        over: mass.is_multiple_of(6).then_some(5.0),
    }
}

fn change(operation: &Operation, spec: &SessionSpec) -> Change {
    match *operation {
        Operation::Snowfall(depth) => Change::Snowfall(Snowfall::new(metres(depth, &spec.grid))),
        Operation::Clear(depth, columns) => {
            let Grid { depth: columns_z, cell_size, .. } = spec.grid;
            let (width, reach) = (f64::from(columns) * cell_size, f64::from(columns_z) * cell_size);
            let region = Some(Region { x: 0.0, z: 0.0, width, depth: reach });
            Change::Clearing(Clearing {
                depth: metres(depth, &spec.grid),
                region,
                ..Clearing::default()
            })
        }
        Operation::Air(celsius) => {
            Change::AirTemperature(AirTemperature { celsius: f64::from(celsius) })
        }
        Operation::Put(object, mass) => Change::PutCollider(put(object, mass)),
        Operation::Stamp(place, kilopascals) => Change::Stamps(StampBatch {
            stamps: vec![StampSpec {
                shape: Shape::Box { width: 0.3, depth: 0.5 },
                position: Position { x: 0.3 * f64::from(place), z: 0.6 },
                heading: 25.0 * f64::from(place),
                mass: None,
                pressure: Some(1000.0 * f64::from(kilopascals)),
            }],
        }),
        Operation::Remove(object) => Change::DeleteCollider { id: object.to_string() },
        Operation::Pause(paused) => {
            Change::Settings(SettingsPatch { paused: Some(paused), ..SettingsPatch::default() })
        }
        Operation::Create(_)
        | Operation::Delete
        | Operation::Reset
        | Operation::Reissue
        | Operation::Step(_)
        | Operation::EndStep
        | Operation::Restore(_)
        | Operation::Keep(_)
        | Operation::Forget(_)
        | Operation::GoBack(_) => unreachable!("these are no changes"),
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
