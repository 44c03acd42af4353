use firn_snow::CELL;
use proptest::prelude::*;
use serde_json::Value;

use super::super::parts::most_bytes;
use super::*;

fn written(quantum: f64, steps: i64) -> String {
    let mut out = Vec::new();
    Quantum::new(quantum).unwrap().write(steps, &mut out);
    String::from_utf8(out).unwrap()
}

fn sampling(width: u32, depth: u32, stride: u32) -> Sampling {
    let grid = Grid { width, depth, height: 50, cell_size: 0.2 };
    let quantum = Quantum::new(0.001).unwrap();
    Sampling { grid, stride, quantum, protocol: SubProtocol::Json }
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
    let tile = sampling(10, 9, 1).encode_tile(3, &columns(0));
    assert_eq!(
        String::from_utf8(tile).unwrap(),
        r#"{"column_x":8,"column_z":8,"width":2,"depth":1,"heights":[0,0.2]}"#
    );
}

#[test]
fn a_stride_takes_the_columns_that_are_multiples_of_it() {
    let tile = sampling(8, 5, 4).encode_tile(0, &columns(0));
    assert_eq!(
        String::from_utf8(tile).unwrap(),
        r#"{"column_x":0,"column_z":0,"width":2,"depth":2,"heights":[0,0.8,6.4,7.2]}"#
    );
}

/// Ground of a grid from −20 000 to 20 000 m, the farthest that ground may lie.
fn ground(grid: &Grid) -> Ground {
    let last = grid.columns() - 1;
    let height = |i: u64| -20_000.0 + 40_000.0 * (i as f64 / last as f64).powi(3);
    Ground::new((0..=last).map(height).collect())
}

/// Whether a tile as text and one out of a message are of the same samples, of which so many are a metre.
fn says_the_same(
    text: &Value,
    (x, z, tile): (u64, u64, &heights::Tile),
    samples: impl Iterator<Item = i64>,
    per_metre: f64,
) {
    assert_eq!((text["column_x"].as_u64(), text["column_z"].as_u64()), (Some(x), Some(z)));
    assert_eq!((&text["width"], &text["depth"]), (&tile.width.into(), &tile.depth.into()));
    let told = text["heights"].as_array().unwrap().iter().map(|height| height.as_f64().unwrap());
    assert!(told.eq(samples.map(|steps| steps as f64 / per_metre)), "{text}");
}

#[test]
fn a_binary_tile_is_clipped_and_thinned_as_a_text_one_is() {
    for (width, depth, stride, tile) in [(10, 9, 1, 3), (8, 5, 4, 0), (20, 20, 8, 8), (9, 9, 2, 0)]
    {
        let text = sampling(width, depth, stride);
        let binary = Sampling { protocol: SubProtocol::Binary, ..text };
        let ground = ground(&text.grid);
        let head = heights::Head {
            snapshot: true,
            id: 1,
            seq: 1,
            tick: 1,
            recovered: None,
            more: false,
            level: false,
            stride,
            tiles_x: text.grid.tiles_x(),
        };
        let snow = [(tile, binary.encode_tile(tile, &columns(0)))];
        let below = [(tile, binary.encode_ground(tile, &ground))];
        let message = heights::decode(&heights::encode(&head, &snow, &below, None)).unwrap();
        let of = |bytes: Vec<u8>| -> Value { serde_json::from_slice(&bytes).unwrap() };
        let told = message.tiles().next().unwrap();
        let samples = told.2.heights.iter().map(|&steps| steps.into());
        says_the_same(&of(text.encode_tile(tile, &columns(0))), told, samples, 1000.0);
        let told = message.ground().next().unwrap();
        let samples = told.2.elevations().map(i64::from);
        let per_metre = heights::GROUND_STEPS_PER_METRE;
        says_the_same(&of(text.encode_ground(tile, &ground)), told, samples, per_metre);
    }
}

#[test]
fn ground_is_told_to_a_tenth_of_a_millimetre() {
    let elevations = [-20_000.0, -0.00006, -0.00004, 0.00005, 1_234.567_84, 20_000.0];
    let sampling = sampling(6, 1, 1);
    let tile = sampling.encode_ground(0, &Ground::new(elevations.into()));
    let tile: Value = serde_json::from_slice(&tile).unwrap();
    let told = serde_json::json!([-20_000, -0.0001, 0, 0.0001, 1234.5678, 20_000]);
    assert_eq!(tile["heights"], told);
}

#[test]
fn a_tile_always_fits_what_is_counted_for_it() {
    let quantum = Quantum::new(0.123_456_789_012_345_67).unwrap();
    let sampling = Sampling { quantum, ..sampling(8, 8, 1) };
    assert!(sampling.encode_tile(0, &[u32::MAX; TILE_COLUMNS as usize]).len() < 4096);

    let rough = (0..64).map(|i| if i % 3 == 0 { -19_999.999_9 } else { 19_999.999_9 });
    let ground = Ground::new(rough.collect());
    for protocol in SubProtocol::ALL {
        let one = Sampling { protocol, ..sampling }.encode_ground(0, &ground);
        let counted = most_bytes(protocol, 0, 1, 0) / 2;
        assert!(one.len() as u64 + 64 <= counted, "{} of {counted} bytes", one.len());
    }
}
