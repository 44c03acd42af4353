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
    let as_json = |column_x: u64, column_z: u64, tile: &Tile, heights: Value| {
        json!({"column_x": column_x, "column_z": column_z, "width": tile.width,
               "depth": tile.depth, "heights": heights})
    };
    let tiles: Vec<_> =
        message.tiles().map(|(x, z, tile)| as_json(x, z, tile, json!(tile.heights))).collect();
    let elevations = |tile: &Tile| tile.elevations().collect::<Vec<_>>();
    let ground: Vec<_> =
        message.ground().map(|(x, z, tile)| as_json(x, z, tile, json!(elevations(tile)))).collect();
    json!({
        "op": if head.snapshot { "snapshot" } else { "delta" },
        "id": head.id, "seq": head.seq, "tick": head.tick, "recovered": head.recovered,
        "more": head.more, "level": head.level, "stride": head.stride, "tiles": tiles,
        "terrain": ground,
        "colliders": message.colliders.as_deref().map(|text| {
            serde_json::from_str::<Value>(text).unwrap()
        }),
    })
}

#[test]
fn messages_read_as_published() {
    let vectors: Value = serde_json::from_str(VECTORS).unwrap();
    let messages = vectors["messages"].as_array().unwrap();
    assert!(messages.len() >= 14);
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
        let HeightMessage { head, runs, terrain, colliders } = decode(&expected).unwrap();
        let tile = |tile: &Tile| encode_tile(tile.width, tile.depth, head.stride, &tile.heights);
        let each = |run: &Run| {
            let bytes = tile(&run.tile);
            (run.first..run.first + run.count).map(move |place| (place, bytes.clone()))
        };
        let tiles: Vec<_> = runs.iter().flat_map(each).collect();
        let ground: Vec<_> = terrain.iter().flat_map(each).collect();
        let head: Head = head;
        let written = encode(&head, &tiles, &ground, colliders.as_deref().map(str::as_bytes));
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
