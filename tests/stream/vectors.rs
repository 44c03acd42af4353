//! The published test vectors of the binary messages, which decoders in other languages are checked
//! against too.

use firn_protocol::heights::{Head, HeightMessage, Run, Tile, decode, encode, encode_tile};
use serde_json::{Value, json};

const VECTORS: &str = include_str!("../../api/height-stream-vectors.json");

fn bytes(hex: &Value) -> Vec<u8> {
    let digits: String = hex.as_str().unwrap().split_whitespace().collect();
    assert_eq!(digits.len() % 2, 0);
    let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
    (0..digits.len()).step_by(2).map(byte).collect()
}

fn as_json(message: &HeightMessage) -> Value {
    let head = &message.head;
    let tiles: Vec<_> = message
        .tiles()
        .map(|(column_x, column_z, tile)| {
            json!({"column_x": column_x, "column_z": column_z, "width": tile.width,
                   "depth": tile.depth, "heights": tile.heights})
        })
        .collect();
    json!({
        "op": if head.snapshot { "snapshot" } else { "delta" },
        "id": head.id, "seq": head.seq, "tick": head.tick, "recovered": head.recovered,
        "more": head.more, "stride": head.stride, "tiles": tiles,
        "colliders": message.colliders.as_deref().map(|text| {
            serde_json::from_str::<Value>(text).unwrap()
        }),
    })
}

#[test]
fn messages_read_as_published() {
    let vectors: Value = serde_json::from_str(VECTORS).unwrap();
    let messages = vectors["messages"].as_array().unwrap();
    assert!(messages.len() >= 6);
    for vector in messages {
        let message = decode(&bytes(&vector["hex"])).unwrap();
        assert_eq!(as_json(&message), vector["message"], "{}", vector["name"]);
    }
}

#[test]
fn messages_are_written_as_published() {
    let vectors: Value = serde_json::from_str(VECTORS).unwrap();
    for vector in vectors["messages"].as_array().unwrap() {
        let expected = bytes(&vector["hex"]);
        let HeightMessage { head, runs, colliders } = decode(&expected).unwrap();
        let tile = |tile: &Tile| encode_tile(tile.width, tile.depth, head.stride, &tile.heights);
        let tiles: Vec<_> = runs
            .iter()
            .flat_map(|run: &Run| (run.first..run.first + run.count).map(|i| (i, tile(&run.tile))))
            .collect();
        let head: Head = head;
        let written = encode(&head, &tiles, colliders.as_deref().map(str::as_bytes));
        assert_eq!(written, expected, "{}", vector["name"]);
    }
}

#[test]
fn what_is_published_as_wrong_is_refused() {
    let vectors: Value = serde_json::from_str(VECTORS).unwrap();
    let wrong = vectors["wrong"].as_array().unwrap();
    assert!(wrong.len() >= 4);
    for vector in wrong {
        assert!(decode(&bytes(&vector["hex"])).is_err(), "{}", vector["name"]);
    }
}
