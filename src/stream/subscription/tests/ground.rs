//! When a subscription is told its ground.

use super::*;

/// A subscription that wants the ground.
fn grounded(wish: Subscribe) -> Subscription {
    subscription(&Subscribe { terrain: true, ..wish })
}

/// [`mirror`] on a slope, as it is at a seq.
fn slope(seq: u64) -> Mirror {
    let mut mirror = mirror();
    let columns = mirror.grid.columns();
    mirror.lie_on(&Ground::new((0..columns).map(|i| i as f64 * 0.25).collect()), seq);
    mirror.seq = seq;
    mirror
}

/// Corners of the tiles of ground in a message; `None` where it tells that all is level.
fn told(message: &Value) -> Option<Vec<(u64, u64)>> {
    if message.get("level").is_some() {
        assert_eq!((&message["level"], message.get("terrain")), (&json!(true), None));
        return None;
    }
    let list = message.get("terrain").cloned().unwrap_or_else(|| json!([]));
    Some(tiles(&json!({"tiles": list})))
}

const ALL: [(u64, u64); 6] = [(0, 0), (8, 0), (16, 0), (0, 8), (8, 8), (16, 8)];

#[test]
fn ground_is_told_with_the_first_heights_and_never_again() {
    let mut all = grounded(Subscribe::default());
    let mut mirror = slope(2);
    let snapshot = message(&mut all, &mirror).unwrap();
    assert_eq!(told(&snapshot), Some(ALL.to_vec()));
    let last = &snapshot["terrain"][5];
    assert_eq!((&last["width"], &last["depth"]), (&json!(4), &json!(4)));
    assert_eq!(last["heights"][0], (8.0 * 20.0 + 16.0) / 4.0);
    mirror.change(4, 3);
    let delta = message(&mut all, &mirror).unwrap();
    assert_eq!((tiles(&delta), told(&delta)), (vec![(8, 8)], Some(Vec::new())));
    assert_eq!(message(&mut all, &mirror), None);
}

#[test]
fn ground_that_is_not_wanted_is_not_told() {
    let mut all = subscription(&Subscribe::default());
    assert_eq!(told(&message(&mut all, &slope(2)).unwrap()), Some(Vec::new()));
    assert_eq!(message(&mut all, &slope(3)), None);
    let mut flat = subscription(&Subscribe::default());
    assert_eq!(message(&mut flat, &mirror()).unwrap().get("level"), None);
}

#[test]
fn level_ground_is_told_as_such() {
    let mut all = grounded(Subscribe::default());
    let mut mirror = mirror();
    assert_eq!(told(&message(&mut all, &mirror).unwrap()), None);
    mirror.change(4, 3);
    assert_eq!(told(&message(&mut all, &mirror).unwrap()), Some(Vec::new()));
    // It was laid, but it is as level.
    mirror.lie_on(&Ground::new(vec![0.0; 240].into()), 4);
    mirror.seq = 4;
    let delta = message(&mut all, &mirror).unwrap();
    assert_eq!((tiles(&delta), told(&delta)), (Vec::new(), None));
    mirror.lie_on(&Ground::new(vec![1.0; 240].into()), 5);
    mirror.seq = 5;
    assert_eq!(told(&message(&mut all, &mirror).unwrap()), Some(ALL.to_vec()));
}

#[test]
fn a_moved_view_is_told_the_ground_that_came_into_it() {
    let mut moving = grounded(Subscribe { region: region(0, 0, 16, 8), ..Subscribe::default() });
    let mirror = slope(2);
    assert_eq!(told(&message(&mut moving, &mirror).unwrap()), Some(vec![(0, 0), (8, 0)]));
    moving.update(to(region(8, 0, 16, 12))).unwrap();
    let delta = message(&mut moving, &mirror).unwrap();
    assert_eq!(told(&delta), Some(vec![(16, 0), (8, 8), (16, 8)]));
    assert_eq!(told(&delta), Some(tiles(&delta)));
}

#[test]
fn who_resumes_is_told_other_ground_only() {
    let resumed = |seq| {
        let resume = Some(Resume { epoch: "e".to_owned(), seq });
        grounded(Subscribe { resume, ..Subscribe::default() })
    };
    for (laid, seen, expected) in [(2, 2, Vec::new()), (2, 4, Vec::new()), (3, 2, ALL.to_vec())] {
        let delta = message(&mut resumed(seen), &slope(laid)).unwrap();
        assert_eq!((&delta["recovered"], told(&delta)), (&json!(true), Some(expected)), "{seen}");
    }
    let snapshot = message(&mut resumed(99), &slope(2)).unwrap();
    assert_eq!((&snapshot["recovered"], told(&snapshot)), (&json!(false), Some(ALL.to_vec())));
}

#[test]
fn memory_for_the_ground_is_asked_for_and_given_back() {
    let grid = Grid { width: 256, depth: 256, height: 4, cell_size: 0.5 };
    let spec = SessionSpec { grid, ..SessionSpec::default() };
    let clock = Clock::new(spec.tick_rate, spec.time_scale);
    let heights = (0..grid.columns()).map(|i| -19_999.999_9 + (i * i % 977) as f64 / 7.0);
    let mirror = Mirror::new(&spec, Ground::new(heights.collect()), clock).unwrap();
    let encoded = EncodedTiles::default();
    for (protocol, terrain) in [SubProtocol::Json, SubProtocol::Binary]
        .into_iter()
        .flat_map(|way| [(way, true), (way, false)])
    {
        let source = Source { grid, recovers: &|_| false, protocol, encoded: &encoded };
        let wish = Subscribe { terrain, ..Subscribe::default() };
        let mut all = Subscription::new(1, &wish, source, Instant::now()).unwrap();
        let unsent = Budget::new(4 << 20);
        let copied = all.copy(&mirror, 0, &unsent).expect("there is room");
        let parts = all.message(copied, Instant::now()).unwrap();
        let held = unsent.held();
        let written: usize = parts.map(|part| part.into_data().len()).sum();
        assert!(written as u64 <= held, "{written} bytes of {held}");
        assert_eq!(unsent.held(), 0);
    }
}
