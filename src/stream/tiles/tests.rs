use firn_snow::{CELL, Object, Position, Shape, TILE_COLUMNS};
use proptest::prelude::*;
use serde_json::Value;

use super::*;

fn written(quantum: f64, steps: u64) -> String {
    let mut out = Vec::new();
    Quantum::new(quantum).unwrap().write(steps, &mut out);
    String::from_utf8(out).unwrap()
}

fn sampling(width: u32, depth: u32, stride: u32) -> Sampling {
    let grid = Grid { width, depth, height: 50, cell_size: 0.2 };
    let quantum = Quantum::new(0.001).unwrap();
    Sampling { grid, stride, quantum, protocol: SubProtocol::Json }
}

fn head(recovered: Option<bool>) -> Head {
    Head { snapshot: true, id: -4, stamp: Stamp { tick: 5, seq: 6 }, recovered }
}

/// Columns of heights that all differ: `first`, then one cell more for each column.
fn columns(first: u32) -> TileColumns {
    std::array::from_fn(|i| (first + i as u32) * CELL)
}

#[test]
fn steps_are_written_as_short_decimals() {
    assert_eq!(written(0.001, 4685), "4.685");
    assert_eq!(written(0.001, 4680), "4.68");
    assert_eq!(written(0.001, 5000), "5");
    assert_eq!(written(0.001, 7), "0.007");
    assert_eq!(written(0.001, 0), "0");
    assert_eq!(written(0.25, 3), "0.75");
    assert_eq!(written(1.0, 12), "12");
    assert_eq!(written(0.0001, 5_100_000), "510");
    assert_eq!(written(0.0003, 3), "0.0009");
    assert_eq!(written(0.1234567890123, 4_000_000_000), "493827156.0492");
}

#[test]
fn halves_are_rounded_up() {
    let quantum = Quantum::new(0.25).unwrap();
    assert_eq!(quantum.steps(0.125), 1);
    assert_eq!(quantum.steps(0.1249), 0);
    assert_eq!(quantum.steps(0.375), 2);
}

#[test]
fn only_quanta_of_a_tenth_of_a_millimetre_to_a_metre_are_taken() {
    for wrong in [0.0, -0.001, 0.00009, 1.001, f64::NAN, f64::INFINITY] {
        assert!(Quantum::new(wrong).is_err(), "{wrong}");
    }
}

proptest! {
    /// Whatever a client makes of it, it is the number nearest to the multiple.
    #[test]
    fn what_is_written_reads_as_the_multiple(quantum in 1e-4..1.0f64, height in 0.0..510.0f64) {
        let steps = Quantum::new(quantum).unwrap().steps(height);
        let read: f64 = written(quantum, steps).parse().unwrap();
        prop_assert!((read - steps as f64 * quantum).abs() <= 1e-12 * read.max(1e-3));
        prop_assert!((read - height).abs() <= quantum * 0.500_001);
    }

    /// Two ways to the same number: a height that REST tells, rounded to millimetres.
    #[test]
    fn millimetres_equal_a_rounded_height(quanta in 0u32..u32::MAX) {
        let grid = Grid::default();
        let metres = grid.metres(u64::from(quanta));
        let steps = (metres / 0.001 + 0.5).floor();
        let read: f64 = written(0.001, Quantum::new(0.001).unwrap().steps(metres)).parse().unwrap();
        prop_assert_eq!(read, steps / 1000.0);
    }
}

#[test]
fn a_tile_is_written_row_by_row_and_clipped() {
    let mut out = Vec::new();
    sampling(10, 9, 1).write_tile(3, &columns(0), &mut out);
    assert_eq!(
        String::from_utf8(out).unwrap(),
        r#"{"column_x":8,"column_z":8,"width":2,"depth":1,"heights":[0,0.2]}"#
    );
}

#[test]
fn a_stride_takes_the_columns_that_are_multiples_of_it() {
    let mut out = Vec::new();
    sampling(8, 5, 4).write_tile(0, &columns(0), &mut out);
    assert_eq!(
        String::from_utf8(out).unwrap(),
        r#"{"column_x":0,"column_z":0,"width":2,"depth":2,"heights":[0,0.8,6.4,7.2]}"#
    );
}

#[test]
fn a_collider_is_in_view_where_its_box_overlaps() {
    let grid = Grid::default();
    let columns = ColumnRect { x0: 8, z0: 0, x1: 16, z1: 8 };
    let collider = |x: f64| ColliderView {
        id: "a".to_owned(),
        object: Object {
            mass: 1.0,
            shape: Some(Shape::Box { width: 0.5, depth: 0.5 }),
            position: Position { x, z: 1.0 },
            ..Object::default()
        },
        bottom: 0.0,
        sink_depth: 0.0,
        contact_area: 0.0,
        pressure: 0.0,
        resting: false,
    };
    assert!(!meets(&collider(1.3), &columns, &grid));
    assert!(meets(&collider(1.4), &columns, &grid));
    assert!(meets(&collider(3.4), &columns, &grid));
    assert!(!meets(&collider(3.5), &columns, &grid));
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

fn long_colliders() -> Vec<Vec<u8>> {
    (0..40).map(|i| format!(r#"{{"id":"{i:0100}"}}"#).into_bytes()).collect()
}

#[test]
fn a_long_binary_message_is_cut_and_loses_nothing() {
    let sampling = Sampling { protocol: SubProtocol::Binary, ..sampling(24, 24, 1) };
    let colliders = long_colliders();
    let mut cut = Parts::new(head(Some(true)), sampling, nine(&sampling), Some(colliders.clone()));
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
    let told: Vec<Vec<u8>> = messages
        .iter()
        .filter_map(|message| serde_json::from_str::<Vec<Value>>(message.colliders.as_ref()?).ok())
        .flatten()
        .map(|collider| collider.to_string().into_bytes())
        .collect();
    assert_eq!(told, colliders);
}

#[test]
fn a_binary_tile_is_clipped_and_thinned_as_a_text_one_is() {
    for (width, depth, stride, tile) in [(10, 9, 1, 3), (8, 5, 4, 0), (20, 20, 8, 8)] {
        let text = sampling(width, depth, stride);
        let text: Value = serde_json::from_slice(&text.encode_tile(tile, &columns(0))).unwrap();
        let binary = Sampling { protocol: SubProtocol::Binary, ..sampling(width, depth, stride) };
        let tiles = vec![(tile, binary.encode_tile(tile, &columns(0)).into())];
        let mut parts = Parts::new(head(None), binary, tiles, None);
        let Some(Message::Binary(part)) = parts.next() else { panic!("no part") };
        let message = heights::decode(&part).unwrap();
        let (x, z, tile) = message.tiles().next().unwrap();
        assert_eq!((text["column_x"].as_u64(), text["column_z"].as_u64()), (Some(x), Some(z)));
        assert_eq!(text["width"], tile.width);
        assert_eq!(text["depth"], tile.depth);
        let heights: Vec<f64> = tile.heights.iter().map(|&h| f64::from(h) / 1000.0).collect();
        assert_eq!(
            text["heights"],
            serde_json::json!(
                heights
                    .iter()
                    .map(|&h| {
                        if h.fract() == 0.0 {
                            serde_json::json!(h as u64)
                        } else {
                            serde_json::json!(h)
                        }
                    })
                    .collect::<Vec<_>>()
            )
        );
    }
}

#[test]
fn a_long_message_is_cut_and_loses_nothing() {
    let colliders = long_colliders();
    let sampling = sampling(24, 24, 1);
    let mut cut = Parts::new(head(Some(false)), sampling, nine(&sampling), Some(colliders.clone()));
    cut.largest = 1500;
    let parts = parts(cut);
    assert!(parts.len() > 4);
    let (last, others) = parts.split_last().unwrap();
    assert!(others.iter().all(|part| part["more"] == true));
    assert_eq!(last.get("more"), None);
    assert_eq!(parts[0]["recovered"], false);
    assert!(parts[1..].iter().all(|part| part.get("recovered").is_none()));
    for part in &parts {
        assert_eq!((&part["op"], &part["id"]), (&"snapshot".into(), &(-4).into()));
        assert_eq!((&part["tick"], &part["seq"]), (&5.into(), &6.into()));
    }
    let list = |key| parts.iter().filter_map(move |part| part.get(key)?.as_array()).flatten();
    let corners: Vec<u64> = list("tiles")
        .map(|tile| tile["column_z"].as_u64().unwrap() * 3 + tile["column_x"].as_u64().unwrap())
        .collect();
    assert_eq!(corners, [0, 8, 16, 24, 32, 40, 48, 56, 64]);
    assert_eq!(list("tiles").flat_map(|tile| tile["heights"].as_array().unwrap()).count(), 576);
    let told: Vec<Vec<u8>> = list("colliders").map(|c| c.to_string().into_bytes()).collect();
    assert_eq!(told, colliders);
}

#[test]
fn a_message_without_tiles_still_tells_the_colliders() {
    let empty = Parts::new(head(None), sampling(8, 8, 1), Vec::new(), Some(Vec::new()));
    let parts: Vec<Message> = empty.collect();
    let expected = r#"{"op":"snapshot","id":-4,"seq":6,"tick":5,"tiles":[],"colliders":[]}"#;
    assert_eq!(parts, [Message::text(expected)]);
}

#[test]
fn a_tile_always_fits_a_part() {
    let quantum = Quantum::new(0.123_456_789_012_345_67).unwrap();
    let sampling = Sampling { quantum, ..sampling(8, 8, 1) };
    let mut out = Vec::new();
    sampling.write_tile(0, &[u32::MAX; TILE_COLUMNS as usize], &mut out);
    assert!(out.len() < 4096);
}
