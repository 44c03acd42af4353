//! What the server sends beside heights. No I/O.

use firn_protocol::{ColliderReply, ColliderView, Event, Settings, Stamp};
use firn_snow::{Grid, TILE_SIDE};
use serde::Serialize;

use crate::problem::Problem;
use crate::session::{Applied, Session, SessionError};

/// What the server sends beside heights.
#[derive(Debug, Serialize)]
#[serde(tag = "op", rename_all = "snake_case")]
pub enum Answer<'a> {
    /// The first message of every stream.
    Welcome {
        /// Name of the session.
        session: &'a str,
        /// Opaque; (epoch, seq) names one state.
        epoch: &'a str,
        /// When this holds.
        #[serde(flatten)]
        stamp: Stamp,
        /// Columns along one side of a tile.
        tile_size: u32,
        /// Size of the grid.
        grid: Grid,
        /// Settings, as they are now.
        settings: Settings,
    },
    /// A change was applied.
    Ack {
        /// The client's number for it.
        id: i64,
        /// The answer that REST gives.
        #[serde(flatten)]
        applied: &'a Applied,
    },
    /// A collider was put. It has an id of its own, so it stands apart.
    #[serde(rename = "ack")]
    PutCollider {
        /// The client's number for it.
        id: i64,
        /// When it was applied.
        #[serde(flatten)]
        stamp: Stamp,
        /// The collider, as it stands now.
        collider: &'a ColliderView,
    },
    /// A message was refused; nothing has changed.
    Error {
        /// The client's number for it; `null` where it could not be read.
        id: Option<i64>,
        /// What was wrong.
        problem: &'a Problem,
    },
    /// Something happened in the session.
    Event(&'a Event),
    /// A sign of life.
    Pong {
        /// The client's number for it.
        #[serde(skip_serializing_if = "Option::is_none")]
        id: Option<i64>,
    },
}

impl Answer<'_> {
    /// The message's text.
    pub fn encode(&self) -> String {
        serde_json::to_string(self).expect("answers have string keys")
    }
}

/// The message that greets a new client.
pub fn welcome(session: &Session, stamp: Stamp, settings: Settings) -> String {
    Answer::Welcome {
        session: &session.id,
        epoch: &session.epoch,
        stamp,
        tile_size: TILE_SIDE,
        grid: session.spec.grid,
        settings,
    }
    .encode()
}

/// The message that answers a change whose body stands at a JSON pointer of the client's message.
pub fn outcome(id: i64, at: &str, result: Result<Applied, SessionError>) -> String {
    match result {
        Ok(Applied::Collider { reply: ColliderReply { stamp, collider }, .. }) => {
            Answer::PutCollider { id, stamp, collider: &collider }.encode()
        }
        Ok(applied) => Answer::Ack { id, applied: &applied }.encode(),
        Err(SessionError::Invalid(mut fields)) => {
            for field in &mut fields {
                field.pointer.insert_str(0, at);
            }
            refusal(Some(id), SessionError::Invalid(fields))
        }
        Err(error) => refusal(Some(id), error),
    }
}

/// The message that answers a request which reads the snow, with the reply that REST gives.
///
/// # Errors
/// Where it can't be written; none is known.
pub fn found(id: i64, reply: &impl Serialize) -> Result<String, Problem> {
    #[derive(Serialize)]
    struct Found<'a, T> {
        op: &'static str,
        id: i64,
        #[serde(flatten)]
        reply: &'a T,
    }
    serde_json::to_string(&Found { op: "ack", id, reply })
        .map_err(|error| Problem::internal(format!("the answer can't be written: {error}")))
}

/// The message that answers a refused request.
pub fn refusal(id: Option<i64>, error: impl Into<Problem>) -> String {
    Answer::Error { id, problem: &error.into() }.encode()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::session::Invalid;
    use firn_protocol::SnowfallReply;
    use firn_snow::{Body, Position, Shape};

    fn value(text: &str) -> Value {
        serde_json::from_str(text).expect("answers are JSON")
    }

    #[test]
    fn an_ack_repeats_the_id_and_carries_the_rest_reply() {
        let stamp = Stamp { tick: 7, seq: 9 };
        let reply = SnowfallReply { stamp, fallen_mass: 20.0, refused_mass: 0.5 };
        assert_eq!(
            value(&outcome(3, "", Ok(Applied::Snowfall(reply)))),
            json!({"op": "ack", "id": 3, "tick": 7, "seq": 9, "fallen_mass": 20.0,
                   "refused_mass": 0.5})
        );
        assert_eq!(
            value(&outcome(4, "", Ok(Applied::Stamp(stamp)))),
            json!({"op": "ack", "id": 4, "tick": 7, "seq": 9})
        );
    }

    #[test]
    fn a_collider_keeps_its_own_id_apart_from_that_of_the_request() {
        let collider = ColliderView {
            id: "sledge".to_owned(),
            body: Body {
                mass: 1.0,
                shape: Some(Shape::Disk { radius: 0.5 }),
                position: Position { x: 1.0, z: 2.0 },
                ..Body::default()
            },
            bottom: 3.0,
            sink_depth: 0.25,
            contact_area: 0.5,
            pressure: 9.0,
            burden: 0.0,
            resting: false,
        };
        let reply = ColliderReply { stamp: Stamp { tick: 7, seq: 9 }, collider };
        let ack = outcome(3, "", Ok(Applied::Collider { reply, created: true }));
        assert_eq!(ack.matches(r#""id""#).count(), 2);
        let ack = value(&ack);
        assert_eq!((&ack["op"], &ack["id"], &ack["seq"]), (&json!("ack"), &json!(3), &json!(9)));
        assert_eq!(ack["collider"]["id"], "sledge");
        assert_eq!(ack["collider"]["sink_depth"], 0.25);
    }

    #[test]
    fn an_error_points_into_the_clients_message() {
        let invalid = Invalid::new("/mass", "is 0");
        let error = SessionError::Invalid(vec![invalid]);
        let error = value(&outcome(5, "/collider", Err(error)));
        assert_eq!((&error["op"], &error["id"]), (&json!("error"), &json!(5)));
        assert_eq!(error["problem"]["status"], 422);
        assert_eq!(
            error["problem"]["errors"],
            json!([{"pointer": "/collider/mass", "detail": "is 0"}])
        );
        assert_eq!(error["problem"]["detail"], "/collider/mass: is 0");
    }

    #[test]
    fn what_could_not_be_read_has_no_id() {
        let error = value(&refusal(None, Problem::malformed("not JSON")));
        assert_eq!((&error["id"], &error["problem"]["status"]), (&Value::Null, &json!(400)));
    }

    #[test]
    fn events_say_what_happened_and_when() {
        let event = Event::Settled { stamp: Stamp { tick: 1, seq: 2 } };
        assert_eq!(
            value(&Answer::Event(&event).encode()),
            json!({"op": "event", "event": "settled", "tick": 1, "seq": 2})
        );
    }

    #[test]
    fn a_pong_repeats_an_id_only_where_there_was_one() {
        assert_eq!(value(&Answer::Pong { id: None }.encode()), json!({"op": "pong"}));
        assert_eq!(value(&Answer::Pong { id: Some(2) }.encode()), json!({"op": "pong", "id": 2}));
    }
}
