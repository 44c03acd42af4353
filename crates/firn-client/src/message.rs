//! What a stream tells.

use firn_protocol::heights::{self, GROUND_STEPS_PER_METRE, HeightMessage, Tile};
use firn_protocol::{ColliderView, Event, Problem, Settings, Stamp};
use firn_snow::Grid;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::error::Error;
use crate::stream::Raw;

/// A message of the server.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Message {
    /// The first one.
    Welcome(Welcome),
    /// Heights of a subscription.
    Heights(Heights),
    /// A change was applied.
    Ack(Ack),
    /// A message was refused; nothing has changed.
    Refused {
        /// Number that the client gave it; `None` where it could not be read.
        id: Option<i64>,
        /// What was wrong.
        problem: Problem,
    },
    /// Something happened in the session.
    Event(Event),
    /// A sign of life.
    Pong {
        /// Number that the client gave its ping.
        id: Option<i64>,
    },
    /// Something that a newer server tells; it may be passed over.
    Unknown,
}

/// The first message of a stream.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Welcome {
    /// Name of the session.
    pub session: String,
    /// Opaque; (epoch, seq) names one state.
    pub epoch: String,
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Columns along one side of a tile.
    pub tile_size: u32,
    /// Size of the grid.
    pub grid: Grid,
    /// Settings, as they are now.
    pub settings: Settings,
}

/// Heights of a subscription's region: all of them, or what has changed.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Heights {
    /// Whether everything in the region is told.
    #[serde(skip)]
    pub snapshot: bool,
    /// The subscription.
    pub id: i64,
    /// Number of the state that is told.
    pub seq: u64,
    /// Ticks until that state.
    pub tick: u64,
    /// Whether exactly what was missed is told; in the first answer to a subscribe that asked to resume.
    #[serde(default)]
    pub recovered: Option<bool>,
    /// Whether further parts of the message follow.
    #[serde(default)]
    pub more: bool,
    /// The tiles.
    #[serde(default)]
    pub tiles: Vec<HeightTile>,
    /// Whether all ground is level at 0, but what the message tells.
    #[serde(default)]
    pub level: bool,
    /// Tiles of the ground, where it is wanted and was told with this: their heights are its elevations \[m\].
    #[serde(default)]
    pub terrain: Vec<HeightTile>,
    /// The objects, where they are wanted and were told with this.
    #[serde(default)]
    pub colliders: Option<Vec<ColliderView>>,
}

/// Heights of a tile, or elevations of its ground.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct HeightTile {
    /// Column of the first sample along x.
    pub column_x: u64,
    /// Column of the first sample along z.
    pub column_z: u64,
    /// Samples along x.
    pub width: u32,
    /// Samples along z.
    pub depth: u32,
    /// Metres, row by row: index = z · width + x.
    pub heights: Vec<f64>,
}

/// A change was applied.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Ack {
    /// Number that the client gave the change.
    pub id: i64,
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// The rest of the answer that REST gives.
    #[serde(flatten)]
    pub reply: Map<String, Value>,
}

/// A message as it is written in JSON.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "snake_case")]
enum Text {
    Welcome(Welcome),
    Snapshot(Heights),
    Delta(Heights),
    Ack(Ack),
    Error {
        id: Option<i64>,
        problem: Problem,
    },
    Event(Value),
    Pong {
        id: Option<i64>,
    },
    #[serde(other)]
    Unknown,
}

/// Reads a message; `quantum` knows the step that heights of a subscription are rounded to \[m\].
///
/// # Errors
/// [`Error::Unreadable`].
pub fn read(raw: &Raw, quantum: impl Fn(i64) -> Option<f64>) -> Result<Message, Error> {
    let unreadable = |why: String| Error::Unreadable { what: "the stream".to_owned(), why };
    match raw {
        Raw::Text(text) => {
            let text = serde_json::from_str(text).map_err(|error| unreadable(error.to_string()))?;
            Ok(match text {
                Text::Welcome(welcome) => Message::Welcome(welcome),
                Text::Snapshot(heights) => Message::Heights(Heights { snapshot: true, ..heights }),
                Text::Delta(heights) => Message::Heights(heights),
                Text::Ack(ack) => Message::Ack(ack),
                Text::Error { id, problem } => Message::Refused { id, problem },
                Text::Event(event) => {
                    serde_json::from_value(event).map_or(Message::Unknown, Message::Event)
                }
                Text::Pong { id } => Message::Pong { id },
                Text::Unknown => Message::Unknown,
            })
        }
        Raw::Binary(bytes) => {
            let message = heights::decode(bytes).map_err(|error| unreadable(error.to_string()))?;
            let id = message.head.id;
            let quantum =
                quantum(id).ok_or_else(|| unreadable(format!("there is no subscription {id}")))?;
            unpacked(&message, quantum).map(Message::Heights).map_err(unreadable)
        }
    }
}

/// A binary message in metres.
fn unpacked(message: &HeightMessage, quantum: f64) -> Result<Heights, String> {
    let tile = |column_x, column_z, tile: &Tile, heights| {
        let (width, depth) = (tile.width, tile.depth);
        HeightTile { column_x, column_z, width, depth, heights }
    };
    let tiles = message.tiles().map(|(x, z, snow)| {
        let depths = snow.heights.iter().map(|&steps| f64::from(steps) * quantum);
        tile(x, z, snow, depths.collect())
    });
    let terrain = message.ground().map(|(x, z, ground)| {
        let elevations = ground.elevations().map(|steps| f64::from(steps) / GROUND_STEPS_PER_METRE);
        tile(x, z, ground, elevations.collect())
    });
    let colliders = message.colliders.as_deref().map(serde_json::from_str).transpose();
    let head = &message.head;
    Ok(Heights {
        snapshot: head.snapshot,
        id: head.id,
        seq: head.seq,
        tick: head.tick,
        recovered: head.recovered,
        more: head.more,
        tiles: tiles.collect(),
        level: head.level,
        terrain: terrain.collect(),
        colliders: colliders.map_err(|error| error.to_string())?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Message {
        read(&Raw::Text(text.into()), |_| None).unwrap()
    }

    #[test]
    fn what_a_newer_server_tells_is_passed_over() {
        assert_eq!(text(r#"{"op":"avalanche","size":3}"#), Message::Unknown);
        assert_eq!(text(r#"{"op":"event","event":"thaw","tick":1,"seq":2}"#), Message::Unknown);
        let settled = Event::Settled { stamp: Stamp { tick: 1, seq: 2 } };
        let told = r#"{"op":"event","event":"settled","tick":1,"seq":2,"since":3}"#;
        assert_eq!(text(told), Message::Event(settled));
    }

    #[test]
    fn heights_of_an_unknown_subscription_are_not_guessed() {
        let head = heights::Head {
            snapshot: true,
            id: 9,
            seq: 1,
            tick: 1,
            recovered: None,
            more: false,
            level: true,
            stride: 1,
            tiles_x: 1,
        };
        let tile = heights::encode_tile(1, 1, 1, &[150]);
        let hole = heights::encode_tile(1, 1, 1, &[(-12_345i32).cast_unsigned()]);
        let raw = Raw::Binary(heights::encode(&head, &[(0, &tile)], &[(0, &hole)], None).into());
        assert!(matches!(read(&raw, |_| None), Err(Error::Unreadable { .. })));
        match read(&raw, |id| (id == 9).then_some(0.01)).unwrap() {
            Message::Heights(heights) => {
                assert_eq!(heights.tiles[0].heights, [1.5]);
                assert!(heights.level && heights.terrain[0].heights == [-1.2345]);
            }
            other => panic!("{other:?}"),
        }
    }
}
