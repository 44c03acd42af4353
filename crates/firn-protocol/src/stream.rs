//! Sub-protocols of a stream, its close codes, and the client's commands.

use firn_snow::weather::WeatherInput;
use serde::Serialize;

use crate::{
    AirTemperature, Clearing, ColliderBatch, ColliderPatch, ColliderSpec, ProbeBatch, SampleBatch,
    SettingsPatch, Snowfall, StampBatch, Subscribe, Update,
};

/// A sub-protocol: how heights are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SubProtocol {
    /// `firn.v1.json`.
    Json,
    /// `firn.v1.bin`.
    Binary,
}

impl SubProtocol {
    /// Every sub-protocol, the most compact first: a client that offers several is given that one.
    pub const ALL: [SubProtocol; 2] = [SubProtocol::Binary, SubProtocol::Json];

    /// The name that is offered and chosen at the upgrade.
    pub const fn name(self) -> &'static str {
        match self {
            SubProtocol::Json => "firn.v1.json",
            SubProtocol::Binary => "firn.v1.bin",
        }
    }
}

/// Why a stream ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// The client closed it.
    Done,
    /// The connection broke.
    Broken,
    /// The client did not keep to the WebSocket protocol.
    Malformed,
    /// A message of the client was too big.
    TooBig,
    /// Nothing was heard from the client for too long.
    Silent,
    /// A message could not be written for too long.
    TooSlow,
    /// The client sent more commands than it may.
    TooManyCommands,
    /// There was no memory for its messages, which did not end.
    NoRoom,
    /// The server is stopping.
    Draining,
    /// The client's token is not good for the session, or no longer.
    BadToken,
    /// There is no such session.
    UnknownSession,
    /// The session was deleted.
    Deleted,
}

impl Cause {
    /// Every cause.
    pub const ALL: [Cause; 12] = [
        Cause::Done,
        Cause::Broken,
        Cause::Malformed,
        Cause::TooBig,
        Cause::Silent,
        Cause::TooSlow,
        Cause::TooManyCommands,
        Cause::NoRoom,
        Cause::Draining,
        Cause::BadToken,
        Cause::UnknownSession,
        Cause::Deleted,
    ];

    /// A label for logs and counters.
    pub fn label(self) -> &'static str {
        match self {
            Cause::Done => "done",
            Cause::Broken => "broken",
            Cause::Malformed => "malformed",
            Cause::TooBig => "too_big",
            Cause::Silent => "silent",
            Cause::TooSlow => "too_slow",
            Cause::TooManyCommands => "too_many_commands",
            Cause::NoRoom => "no_room",
            Cause::Draining => "draining",
            Cause::BadToken => "bad_token",
            Cause::UnknownSession => "unknown_session",
            Cause::Deleted => "deleted",
        }
    }

    /// Code and reason of the closing frame that the client is sent; `None` where there is nobody to tell.
    pub fn close(self) -> Option<(u16, &'static str)> {
        match self {
            Cause::Broken | Cause::Silent => None,
            Cause::Done => Some((1000, "done")),
            Cause::Draining => Some((1001, "the server is stopping; connect again")),
            Cause::NoRoom => {
                Some((1013, "the server has no memory for this message; try again later"))
            }
            Cause::Malformed => Some((1002, "not a WebSocket message")),
            Cause::TooBig => Some((1009, "a message may have at most 1 MiB")),
            Cause::TooSlow => Some((3008, "a message could not be delivered for too long")),
            Cause::TooManyCommands => Some((3013, "more commands per second than are taken")),
            Cause::BadToken => Some((3500, "the token is missing, or not good for this session")),
            Cause::UnknownSession => Some((3501, "there is no such session")),
            Cause::Deleted => Some((3502, "the session was deleted")),
        }
    }
}

/// What a client sends: about the stream itself, or changes of the session. The answer repeats the `id`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "op", rename_all = "snake_case")]
pub enum Command {
    /// Begins a subscription, or replaces the one of the same id.
    Subscribe {
        /// The subscription.
        id: i64,
        /// What is wanted.
        #[serde(flatten)]
        wish: Subscribe,
    },
    /// Moves a subscription.
    Update {
        /// The subscription.
        id: i64,
        /// Where to.
        #[serde(flatten)]
        update: Update,
    },
    /// Ends a subscription.
    Unsubscribe {
        /// The subscription.
        id: i64,
    },
    /// Asks for a sign of life.
    Ping {
        /// A number for the answer.
        #[serde(skip_serializing_if = "Option::is_none")]
        id: Option<i64>,
    },
    /// Lets snow fall.
    Snowfall {
        /// A number for the answer.
        id: i64,
        /// How much, and where.
        #[serde(flatten)]
        snowfall: Snowfall,
    },
    /// Clears snow to a depth.
    Clearing {
        /// A number for the answer.
        id: i64,
        /// To what depth, and where.
        #[serde(flatten)]
        clearing: Clearing,
    },
    /// Gives the air another temperature.
    AirTemperature {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        air: AirTemperature,
    },
    /// Gives alpine snow another weather.
    Weather {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        weather: WeatherInput,
    },
    /// Changes some settings.
    Set {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        settings: SettingsPatch,
    },
    /// Creates or replaces an object.
    #[serde(rename = "collider.put")]
    PutCollider {
        /// A number for the answer.
        id: i64,
        /// The object, with an id of its own.
        collider: ColliderSpec,
    },
    /// Changes parts of an object.
    #[serde(rename = "collider.patch")]
    PatchCollider {
        /// A number for the answer.
        id: i64,
        /// The object's id.
        collider: String,
        /// The parts that change.
        patch: ColliderPatch,
    },
    /// Takes an object away.
    #[serde(rename = "collider.delete")]
    DeleteCollider {
        /// A number for the answer.
        id: i64,
        /// The object's id.
        collider: String,
    },
    /// Presses prints into the snow.
    Stamps {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        batch: StampBatch,
    },
    /// Puts and removes objects in one frame: all or none, or those without error.
    #[serde(rename = "colliders.batch")]
    Colliders {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        batch: ColliderBatch,
    },
    /// Asks how deep loads would sink.
    Probes {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        batch: ProbeBatch,
    },
    /// Reads the snow at some points.
    Samples {
        /// A number for the answer.
        id: i64,
        /// Which.
        #[serde(flatten)]
        batch: SampleBatch,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_codes_are_those_of_the_contract() {
        let codes = [
            (Cause::Done, Some(1000)),
            (Cause::Draining, Some(1001)),
            (Cause::TooBig, Some(1009)),
            (Cause::TooSlow, Some(3008)),
            (Cause::TooManyCommands, Some(3013)),
            (Cause::NoRoom, Some(1013)),
            (Cause::BadToken, Some(3500)),
            (Cause::UnknownSession, Some(3501)),
            (Cause::Deleted, Some(3502)),
            (Cause::Silent, None),
        ];
        for (cause, code) in codes {
            assert_eq!(cause.close().map(|(code, _)| code), code, "{}", cause.label());
        }
    }
}
