//! What clients send: JSON text, read into requests. No I/O.

use std::sync::Arc;

use firn_protocol::{
    AirTemperature, Clearing, ColliderBatch, ColliderPatch, ColliderSpec, DepthWatch, MOST_WATCHES,
    ProbeBatch, SampleBatch, SettingsPatch, Snowfall, StampBatch, Subscribe, Update, WeatherInput,
};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::problem::{self, Problem};
use crate::quote::quote;
use crate::session::Change;

/// Every `op` that a client can send.
const OPS: &str = "subscribe, update, unsubscribe, ping, snowfall, clearing, air_temperature, weather, set, \
                   collider.put, collider.patch, collider.delete, colliders.batch, stamps, probes, samples";

/// What a client asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// To be answered by the stream itself.
    Control(Control),
    /// A change of the session.
    Change {
        /// The client's number for it.
        id: i64,
        /// The change.
        change: Change,
        /// JSON pointer to the part of the message that holds the change.
        at: &'static str,
    },
    /// Something to be read of the snow.
    Read {
        /// The client's number for it.
        id: i64,
        /// What.
        read: Read,
    },
}

/// Something to be read of the snow.
#[derive(Clone, Debug, PartialEq)]
pub enum Read {
    /// How deep loads would sink.
    Probes(ProbeBatch),
    /// The snow at some points.
    Samples(SampleBatch),
}

/// A request about the stream itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// Begins a subscription, or replaces the one of the same id.
    Subscribe(i64, Subscribe),
    /// Changes a subscription.
    Update(i64, Update),
    /// Ends a subscription.
    Unsubscribe(i64),
    /// Asks for a sign of life.
    Ping(Option<i64>),
}

/// A message that can't be accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// The client's number for it, where it could be read.
    pub id: Option<i64>,
    /// What is wrong with it.
    pub problem: Box<Problem>,
}

/// Body of an operation that has no fields.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// Body of `collider.put`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PutCollider {
    collider: ColliderSpec,
}

/// Body of `collider.patch`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PatchCollider {
    collider: String,
    patch: ColliderPatch,
}

/// Body of `collider.delete`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DeleteCollider {
    collider: String,
}

impl Request {
    /// Reads a message.
    ///
    /// # Errors
    /// Says what is wrong with it: 400 where it is not JSON, 422 where a field is.
    pub fn parse(text: &str) -> Result<Request, Refusal> {
        let refuse = |id| move |problem| Refusal { id, problem: Box::new(problem) };
        let mut fields: Map<String, Value> =
            problem::parse(text.as_bytes()).map_err(refuse(None))?;
        let id = take_id(&mut fields).map_err(refuse(None))?;
        let op = take_op(&mut fields).map_err(refuse(id))?;
        read(&op, id, fields).map_err(refuse(id))
    }
}

fn take_id(fields: &mut Map<String, Value>) -> Result<Option<i64>, Problem> {
    match fields.remove("id") {
        None => Ok(None),
        Some(id) => id.as_i64().map(Some).ok_or_else(|| {
            Problem::invalid_field("/id", "expected a whole number of at most 64 bits")
        }),
    }
}

fn take_op(fields: &mut Map<String, Value>) -> Result<String, Problem> {
    match fields.remove("op") {
        Some(Value::String(op)) => Ok(op),
        None => Err(Problem::invalid_field("/op", format!("is missing; known are {OPS}"))),
        Some(_) => Err(Problem::invalid_field("/op", "expected a string")),
    }
}

fn read(op: &str, id: Option<i64>, fields: Map<String, Value>) -> Result<Request, Problem> {
    if op == "ping" {
        let Nothing {} = body(fields)?;
        return Ok(Request::Control(Control::Ping(id)));
    }
    let numbered = || {
        id.ok_or_else(|| {
            Problem::invalid_field("/id", "is missing; the answer repeats it to say what it is to")
        })
    };
    let change = |change, at| Ok(Request::Change { id: numbered()?, change, at });
    let reading = |read| Ok(Request::Read { id: numbered()?, read });
    let control = match op {
        "subscribe" => {
            let wish: Subscribe = body(fields)?;
            few_enough(&wish.watch)?;
            Control::Subscribe(numbered()?, wish)
        }
        "update" => {
            let update: Update = body(fields)?;
            few_enough(update.watch.as_deref().unwrap_or_default())?;
            Control::Update(numbered()?, update)
        }
        "unsubscribe" => {
            let Nothing {} = body(fields)?;
            Control::Unsubscribe(numbered()?)
        }
        "snowfall" => return change(Change::Snowfall(body::<Snowfall>(fields)?), ""),
        "clearing" => return change(Change::Clearing(body::<Clearing>(fields)?), ""),
        "air_temperature" => {
            return change(Change::AirTemperature(body::<AirTemperature>(fields)?), "");
        }
        "weather" => {
            return change(Change::Weather(Arc::new(body::<WeatherInput>(fields)?)), "");
        }
        "set" => return change(Change::Settings(body::<SettingsPatch>(fields)?), ""),
        "collider.put" => {
            let put: PutCollider = body(fields)?;
            return change(Change::PutCollider(put.collider), "/collider");
        }
        "collider.patch" => {
            let PatchCollider { collider: id, patch } = body(fields)?;
            return change(Change::PatchCollider { id, patch }, "/patch");
        }
        "collider.delete" => {
            let delete: DeleteCollider = body(fields)?;
            return change(Change::DeleteCollider { id: delete.collider }, "/collider");
        }
        "probes" => return reading(Read::Probes(body(fields)?)),
        "samples" => return reading(Read::Samples(body(fields)?)),
        "stamps" => return change(Change::Stamps(body::<StampBatch>(fields)?), ""),
        "colliders.batch" => return change(Change::Colliders(body::<ColliderBatch>(fields)?), ""),
        other => {
            let detail = format!("{} is no op; known are {OPS}", quote(other));
            return Err(Problem::invalid_field("/op", detail));
        }
    };
    Ok(Request::Control(control))
}

/// Requests wait until the client has taken what it was sent before: with all that they name.
fn few_enough(watches: &[DepthWatch]) -> Result<(), Problem> {
    if watches.len() <= MOST_WATCHES {
        return Ok(());
    }
    let detail = format!("{} watches are more than {MOST_WATCHES}", watches.len());
    Err(Problem::invalid_field("/watch", detail))
}

/// Reads what is left of a message beside `op` and `id`.
fn body<T: DeserializeOwned>(fields: Map<String, Value>) -> Result<T, Problem> {
    let bytes = serde_json::to_vec(&fields)
        .map_err(|error| Problem::internal(format!("the message can't be repeated: {error}")))?;
    problem::parse(&bytes)
}

#[cfg(test)]
mod tests;
