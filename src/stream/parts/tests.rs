use firn_snow::{CELL, Grid};
use serde_json::Value;

use crate::session::{Ground, TileColumns};

use super::super::quantum::Quantum;
use super::*;

fn sampling(width: u32, depth: u32, stride: u32) -> Sampling {
    let grid = Grid { width, depth, height: 50, cell_size: 0.2 };
    let quantum = Quantum::new(0.001).unwrap();
    Sampling { grid, stride, quantum, protocol: SubProtocol::Json }
}

fn head(recovered: Option<bool>) -> Head {
    Head { snapshot: true, id: -4, stamp: Stamp { tick: 5, seq: 6 }, recovered, level: true }
}

/// Columns of heights that all differ: `first`, then one cell more for each column.
fn columns(first: u32) -> TileColumns {
    std::array::from_fn(|i| (first + i as u32) * CELL)
}

/// All parts as values, after checking that none is larger than it may be.
fn parts(parts: Parts) -> Vec<Value> {
    let largest = parts.largest;
    parts
        .map(|part| {
            let Message::Text(part) = part else { panic!("{part:?}") };
            assert!(part.len() <= largest, "{} bytes", part.len());
            serde_json::from_str(&part).unwrap()
        })
        .collect()
}

/// Nine tiles whose heights all differ.
fn nine(sampling: &Sampling) -> Vec<(u32, Bytes)> {
    (0..9).map(|tile| (tile, sampling.encode_tile(tile, &columns(tile)).into())).collect()
}

/// The ground under them: it falls by a metre from one tile to the next.
fn ground(sampling: &Sampling) -> Vec<(u32, Bytes)> {
    let elevation =
        |i: u64| -(i as f64 / 24.0 / 8.0).floor() * 3.0 - (i as f64 % 24.0 / 8.0).floor();
    let ground = Ground::new((0..sampling.grid.columns()).map(elevation).collect());
    (0..9).map(|tile| (tile, sampling.encode_ground(tile, &ground).into())).collect()
}

fn long_colliders() -> Vec<Vec<u8>> {
    (0..40).map(|i| format!(r#"{{"id":"{i:0100}"}}"#).into_bytes()).collect()
}

#[test]
fn a_long_binary_message_is_cut_and_loses_nothing() {
    let sampling = Sampling { protocol: SubProtocol::Binary, ..sampling(24, 24, 1) };
    let colliders = long_colliders();
    let below = ground(&sampling);
    let mut cut =
        Parts::new(head(Some(true)), sampling, nine(&sampling), below, Some(colliders.clone()));
    cut.largest = 500;
    let mut messages = Vec::new();
    for part in cut {
        let Message::Binary(part) = part else { panic!("{part:?}") };
        assert!(part.len() <= 500, "{} bytes", part.len());
        messages.push(heights::decode(&part).unwrap());
    }
    assert!(messages.len() > 4);
    let last = messages.len() - 1;
    for (i, message) in messages.iter().enumerate() {
        let recovered = (i == 0).then_some(true);
        let head = heights::Head {
            snapshot: true,
            id: -4,
            seq: 6,
            tick: 5,
            recovered,
            more: i < last,
            level: i == 0,
            stride: 1,
            tiles_x: 3,
        };
        assert_eq!(message.head, head);
    }
    let tiles: Vec<_> = messages.iter().flat_map(|message| message.tiles()).collect();
    let corners: Vec<u64> = tiles.iter().map(|(x, z, _)| z * 3 + x).collect();
    assert_eq!(corners, [0, 8, 16, 24, 32, 40, 48, 56, 64]);
    for ((_, _, tile), number) in tiles.iter().zip(0u32..) {
        let expected: Vec<u32> = (0..64).map(|i| (number + i) * 200).collect();
        assert_eq!(tile.heights, expected);
    }
    let ground: Vec<_> = messages.iter().flat_map(|message| message.ground()).collect();
    assert_eq!(ground.len(), 9);
    for ((x, z, tile), number) in ground.iter().zip(0i32..) {
        assert_eq!(z * 3 + x, number as u64 * 8);
        assert!(tile.elevations().all(|steps| steps == -10_000 * number), "{tile:?}");
    }
    let told: Vec<Vec<u8>> = messages
        .iter()
        .filter_map(|message| serde_json::from_str::<Vec<Value>>(message.colliders.as_ref()?).ok())
        .flatten()
        .map(|collider| collider.to_string().into_bytes())
        .collect();
    assert_eq!(told, colliders);
}

#[test]
fn a_long_message_is_cut_and_loses_nothing() {
    let colliders = long_colliders();
    let sampling = sampling(24, 24, 1);
    let below = ground(&sampling);
    let mut cut =
        Parts::new(head(Some(false)), sampling, nine(&sampling), below, Some(colliders.clone()));
    cut.largest = 1500;
    let parts = parts(cut);
    assert!(parts.len() > 4);
    let (last, others) = parts.split_last().unwrap();
    assert!(others.iter().all(|part| part["more"] == true));
    assert_eq!(last.get("more"), None);
    assert_eq!(parts[0]["recovered"], false);
    assert_eq!(parts[0]["level"], true);
    for key in ["recovered", "level"] {
        assert!(parts[1..].iter().all(|part| part.get(key).is_none()), "{key}");
    }
    for part in &parts {
        assert_eq!((&part["op"], &part["id"]), (&"snapshot".into(), &(-4).into()));
        assert_eq!((&part["tick"], &part["seq"]), (&5.into(), &6.into()));
    }
    let list = |key| parts.iter().filter_map(move |part| part.get(key)?.as_array()).flatten();
    let corner =
        |tile: &Value| tile["column_z"].as_u64().unwrap() * 3 + tile["column_x"].as_u64().unwrap();
    for key in ["tiles", "terrain"] {
        let corners: Vec<u64> = list(key).map(corner).collect();
        assert_eq!(corners, [0, 8, 16, 24, 32, 40, 48, 56, 64], "{key}");
    }
    for (tile, number) in list("terrain").zip(0i64..) {
        assert!(tile["heights"].as_array().unwrap().iter().all(|height| *height == -number));
    }
    assert_eq!(list("tiles").flat_map(|tile| tile["heights"].as_array().unwrap()).count(), 576);
    let told: Vec<Vec<u8>> = list("colliders").map(|c| c.to_string().into_bytes()).collect();
    assert_eq!(told, colliders);
}

#[test]
fn a_message_without_tiles_still_tells_the_colliders() {
    let head = Head { level: false, ..head(None) };
    let empty = Parts::new(head, sampling(8, 8, 1), Vec::new(), Vec::new(), Some(Vec::new()));
    let parts: Vec<Message> = empty.collect();
    let expected = r#"{"op":"snapshot","id":-4,"seq":6,"tick":5,"tiles":[],"colliders":[]}"#;
    assert_eq!(parts, [Message::text(expected)]);
}
