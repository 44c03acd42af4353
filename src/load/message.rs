//! Reads what a stream tells, as far as it is counted.

use std::borrow::Cow;

use firn_client::Raw;
use firn_protocol::heights;
use serde::Deserialize;
use serde::de::IgnoredAny;

/// A message of heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Told {
    /// Whether it is a snapshot.
    pub snapshot: bool,
    /// State that is told.
    pub seq: u64,
    /// Ticks until then.
    pub tick: u64,
    /// Columns in its tiles.
    pub columns: u64,
    /// Whether further parts follow.
    pub more: bool,
}

/// What a message is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Content {
    /// Heights.
    Heights(Told),
    /// A change was applied.
    Ack,
    /// Something was refused, with a status.
    Refused(u16),
    /// Something that is not counted.
    Other,
}

#[derive(Deserialize)]
struct Json<'a> {
    #[serde(borrow)]
    op: Cow<'a, str>,
    #[serde(default)]
    seq: u64,
    #[serde(default)]
    tick: u64,
    #[serde(default)]
    tiles: Vec<JsonTile>,
    #[serde(default)]
    more: bool,
    problem: Option<JsonProblem>,
}

#[derive(Deserialize)]
struct JsonTile {
    width: u64,
    depth: u64,
    #[serde(rename = "heights")]
    _heights: IgnoredAny,
}

#[derive(Deserialize)]
struct JsonProblem {
    status: u16,
}

/// Reads a message; `None` where it can't be read.
pub fn read(message: &Raw) -> Option<Content> {
    let text = match message {
        Raw::Text(text) => text,
        Raw::Binary(bytes) => return read_binary(bytes).map(Content::Heights),
    };
    let json: Json = serde_json::from_str(text).ok()?;
    Some(match &*json.op {
        "snapshot" | "delta" => Content::Heights(Told {
            snapshot: json.op == "snapshot",
            seq: json.seq,
            tick: json.tick,
            columns: json.tiles.iter().map(|tile| tile.width * tile.depth).sum(),
            more: json.more,
        }),
        "ack" => Content::Ack,
        "error" => Content::Refused(json.problem.map_or(0, |problem| problem.status)),
        _ => Content::Other,
    })
}

fn read_binary(bytes: &[u8]) -> Option<Told> {
    let message = heights::decode(bytes).ok()?;
    let columns = |run: &heights::Run| {
        u64::from(run.count) * u64::from(run.tile.width) * u64::from(run.tile.depth)
    };
    Some(Told {
        snapshot: message.head.snapshot,
        seq: message.head.seq,
        tick: message.head.tick,
        columns: message.runs.iter().map(columns).sum(),
        more: message.head.more,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn binary_messages_count_the_same() {
        let head = heights::Head {
            snapshot: true,
            id: 1,
            seq: 7,
            tick: 3,
            recovered: None,
            more: false,
            level: false,
            stride: 1,
            tiles_x: 4,
        };
        // Two tiles that are alike, and one that is clipped.
        let (whole, clipped) =
            (heights::encode_tile(8, 8, 1, &[5; 64]), heights::encode_tile(3, 2, 1, &[1; 6]));
        let bytes = heights::encode(&head, &[(1, &whole), (2, &whole), (3, &clipped)], &[], None);
        let told = Told { snapshot: true, seq: 7, tick: 3, columns: 134, more: false };
        assert_eq!(read(&Raw::Binary(bytes.clone().into())), Some(Content::Heights(told)));
        assert_eq!(read(&Raw::Binary(bytes[..bytes.len() - 1].to_vec().into())), None);
    }

    #[test]
    fn messages_are_told_apart() {
        let of = |text: &str| read(&Raw::Text(text.into()));
        let delta = r#"{"op":"delta","id":1,"seq":7,"tick":3,"tiles":[
            {"column_x":0,"column_z":8,"width":8,"depth":2,"heights":[1,2.5]},
            {"column_x":8,"column_z":8,"width":1,"depth":2,"heights":[1,2]}],"more":true}"#;
        let told = Told { snapshot: false, seq: 7, tick: 3, columns: 18, more: true };
        assert_eq!(of(delta), Some(Content::Heights(told)));
        assert_eq!(of(r#"{"op":"ack","id":3,"seq":7,"tick":3}"#), Some(Content::Ack));
        let refusal = r#"{"op":"error","id":null,"problem":{"status":422,"title":"x"}}"#;
        assert_eq!(of(refusal), Some(Content::Refused(422)));
        assert_eq!(of(r#"{"op":"event","event":"settled","seq":1}"#), Some(Content::Other));
        assert_eq!(of("not JSON"), None);
    }
}
