use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

fn head() -> Head {
    Head {
        snapshot: false,
        id: 1,
        seq: 300,
        tick: 128,
        recovered: None,
        more: false,
        level: false,
        stride: 1,
        tiles_x: 16,
    }
}

/// A tile's heights after a message with it alone was read again.
fn again(width: u32, depth: u32, heights: &[u32]) -> Tile {
    let bytes = encode_tile(width, depth, 1, heights);
    let message = decode(&encode(&head(), &[(5, bytes)], &[], None)).unwrap();
    assert_eq!((message.runs.len(), message.runs[0].first, message.runs[0].count), (1, 5, 1));
    message.runs[0].tile.clone()
}

#[test]
fn level_snow_costs_a_few_bytes() {
    for (height, bytes) in [(0, 2), (5338, 3), (65_535, 4), (u32::MAX, 6)] {
        assert_eq!(encode_tile(8, 8, 1, &[height; 64]).len(), bytes);
    }
    // 4 × 4 tiles out of 16 × 16, all alike.
    let tile = encode_tile(8, 8, 1, &[5338; 64]);
    let tiles: Vec<_> = (0..16).map(|i| (i / 4 * 16 + i % 4, tile.as_slice())).collect();
    let message = encode(&Head { seq: 1 << 27, tick: 1 << 27, ..head() }, &tiles, &[], None);
    assert!(message.len() * 10 <= 16 * 64, "{} bytes", message.len());
    let decoded = decode(&message).unwrap();
    assert_eq!(decoded.tiles().count(), 16);
    let corners: Vec<_> = decoded.tiles().map(|(x, z, _)| (x, z)).collect();
    assert_eq!(corners[..5], [(0, 0), (8, 0), (16, 0), (24, 0), (0, 8)]);
}

#[test]
fn a_track_costs_a_fraction_of_its_columns() {
    // A trench of three columns across settled snow, along x and along z.
    let along_z: Vec<u32> =
        (0..64).map(|i| if (2..5).contains(&(i % 8)) { 4880 } else { 5230 }).collect();
    let along_x: Vec<u32> =
        (0..64).map(|i| if (2..5).contains(&(i / 8)) { 4880 } else { 5230 }).collect();
    for heights in [along_z, along_x] {
        let bytes = encode_tile(8, 8, 1, &heights);
        assert!(bytes.len() <= 14, "{} bytes", bytes.len());
        assert_eq!(again(8, 8, &heights).heights, heights);
    }
}

#[test]
fn equal_neighbours_share_their_bytes() {
    let [a, b] = [7, 9].map(|height| encode_tile(8, 8, 1, &[height; 64]));
    let places = [(2, &a), (3, &b), (4, &b), (5, &b), (6, &a), (7, &b), (9, &b)];
    let message = decode(&encode(&head(), &places, &[], None)).unwrap();
    let runs: Vec<_> =
        message.runs.iter().map(|run| (run.first, run.count, run.tile.heights[0])).collect();
    assert_eq!(runs, [(2, 1, 7), (3, 3, 9), (6, 1, 7), (7, 1, 9), (9, 1, 9)]);
}

#[test]
fn level_ground_costs_nothing_and_hills_cost_their_tiles() {
    let snow = [(0, encode_tile(8, 8, 1, &[5338; 64]))];
    let bare = encode(&head(), &snow, &[], None);
    let level = encode(&Head { level: true, ..head() }, &snow, &[], None);
    assert_eq!((level.len(), level[1]), (bare.len(), bare[1] | 0x80));

    // Two metres below 0 at the corner, a slope of 10 cm from one column to the next.
    let elevations: Vec<i32> = (0..64).map(|i| -20_000 + i % 8 * 1000).collect();
    let samples: Vec<u32> = elevations.iter().map(|step| step.cast_unsigned()).collect();
    let ground = [(3, encode_tile(8, 8, 1, &samples))];
    let told = encode(&head(), &snow, &ground, None);
    assert!(told.len() <= bare.len() + 24, "{} bytes", told.len() - bare.len());
    let message = decode(&told).unwrap();
    let (x, z, tile) = message.ground().next().unwrap();
    assert_eq!((x, z, tile.elevations().collect::<Vec<_>>()), (24, 0, elevations));
    assert_eq!(message.tiles().count(), 1);
}

#[test]
fn a_run_that_claims_four_thousand_million_tiles_costs_nothing() {
    let mut bytes = encode(&head(), &[(0, encode_tile(8, 8, 1, &[1; 64]))], &[], None);
    let run = bytes.len() - 3;
    bytes.splice(run..=run, [0xff, 0xff, 0xff, 0xff, 0x1f]);
    let message = decode(&bytes).unwrap();
    assert_eq!(message.runs.len(), 1);
    assert_eq!(message.runs[0].count, u32::MAX);
}

#[test]
fn errors_say_where() {
    let bytes = encode(&head(), &[(0, encode_tile(8, 8, 1, &[1; 64]))], &[], None);
    for cut in 0..bytes.len() {
        let error = decode(&bytes[..cut]).unwrap_err();
        assert_eq!(error, DecodeError { at: cut, what: "the message ends too early" });
    }
    for (at, byte) in [(0, 3), (1, 4), (7, 0), (10, 0), (11, 4)] {
        let mut wrong = bytes.clone();
        wrong[at] = byte;
        assert_eq!(decode(&wrong).unwrap_err().at, at, "{byte} at {at} of {bytes:?}");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(decode(&longer).is_err());
}

fn any_height() -> impl Strategy<Value = u32> {
    prop_oneof![Just(5000u32), 4990..5010u32, 0..70_000u32, any::<u32>()]
}

prop_compose! {
    fn any_tile()(width in 1..=8u32, depth in 1..=8u32)(
        heights in vec(any_height(), (width * depth) as usize),
        width in Just(width), depth in Just(depth),
    ) -> Tile {
        Tile { width, depth, heights }
    }
}

prop_compose! {
    fn any_message()(
        snapshot: bool, id: i64, seq: u64, tick: u64, recovered: Option<bool>, more: bool,
        level: bool,
        log_stride in 0..4u32, tiles_x in 1..100u32,
        tiles in any_tiles(), ground in any_tiles(),
        colliders in proptest::option::of("\\PC{0,40}"),
    ) -> Told {
        let stride = 1 << log_stride;
        let head = Head { snapshot, id, seq, tick, recovered, more, level, stride, tiles_x };
        Told { head, tiles, ground, colliders }
    }
}

prop_compose! {
    /// Tiles at ascending places.
    fn any_tiles()(tiles in vec((0..3u32, any_tile()), 0..12)) -> Vec<(u32, Tile)> {
        let place = |next: &mut u32, skip| { *next += skip + 1; Some(*next - 1) };
        let places: Vec<u32> =
            tiles.iter().scan(0, |next, &(skip, _)| place(next, skip)).collect();
        places.into_iter().zip(tiles.into_iter().map(|(_, tile)| tile)).collect()
    }
}

/// What a message says.
#[derive(Clone, Debug)]
struct Told {
    head: Head,
    tiles: Vec<(u32, Tile)>,
    ground: Vec<(u32, Tile)>,
    colliders: Option<String>,
}

fn bytes_of(Told { head, tiles, ground, colliders }: &Told) -> Vec<u8> {
    let encoded = |tiles: &[(u32, Tile)]| -> Vec<_> {
        let encode = |t: &Tile| encode_tile(t.width, t.depth, head.stride, &t.heights);
        tiles.iter().map(|(place, tile)| (*place, encode(tile))).collect()
    };
    encode(head, &encoded(tiles), &encoded(ground), colliders.as_deref().map(str::as_bytes))
}

/// Each tile of some runs with its place.
fn placed(runs: &[Run]) -> Vec<(u32, Tile)> {
    let tiles = |run: &Run| {
        let tile = run.tile.clone();
        (run.first..run.first + run.count).map(move |place| (place, tile.clone()))
    };
    runs.iter().flat_map(tiles).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn what_was_encoded_is_read_again(message in any_message()) {
        let decoded = decode(&bytes_of(&message)).unwrap();
        prop_assert_eq!(decoded.head, message.head);
        prop_assert_eq!(placed(&decoded.runs), message.tiles);
        prop_assert_eq!(placed(&decoded.terrain), message.ground);
        prop_assert_eq!(&decoded.colliders, &message.colliders);
    }

    #[test]
    fn any_bytes_are_taken(bytes in vec(any::<u8>(), 0..200)) {
        let _ = decode(&bytes);
        // With a head that is right, more of the reader is reached.
        let begun = [&[2, 0, 2, 1, 1, 4][..], &bytes].concat();
        let _ = decode(&begun);
    }

    #[test]
    fn damaged_messages_are_taken(
        message in any_message(),
        damage in vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut: prop::sample::Index,
    ) {
        let mut bytes = bytes_of(&message);
        for (at, byte) in damage {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = decode(&bytes);
        let _ = decode(&bytes[..cut.index(bytes.len())]);
    }
}
