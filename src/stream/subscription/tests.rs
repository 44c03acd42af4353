mod events;
mod ground;
mod pace;

use std::time::Duration;

use firn_protocol::{ColumnRegion, DepthWatch, EventKind, SessionSpec};
use firn_snow::{Body, Position, Shape};
use serde_json::{Value, json};

use crate::session::Clock;
use crate::session::Ground;

use super::*;

/// 20 × 12 columns: 3 × 2 tiles, those at the far edges clipped.
fn mirror() -> Mirror {
    let spec = SessionSpec {
        grid: Grid { width: 20, depth: 12, height: 4, cell_size: 0.5 },
        ..SessionSpec::default()
    };
    let clock = Clock::new(spec.tick_rate, spec.time_scale);
    Mirror::new(&spec, Ground::level(), clock).unwrap()
}

fn collider(id: &str, x: f64) -> ColliderView {
    ColliderView {
        id: id.to_owned(),
        body: Body {
            mass: 1.0,
            shape: Some(Shape::Disk { radius: 0.5 }),
            position: Position { x, z: 1.0 },
            ..Body::default()
        },
        bottom: 0.0,
        sink_depth: 0.0,
        contact_area: 0.0,
        pressure: 0.0,
        burden: 0.0,
        resting: true,
    }
}

fn region(column_x: i64, column_z: i64, width: u64, depth: u64) -> Option<ColumnRegion> {
    Some(ColumnRegion { column_x, column_z, width, depth })
}

fn to(region: Option<ColumnRegion>) -> Update {
    Update { region, ..Update::default() }
}

fn subscription(wish: &Subscribe) -> Subscription {
    begin(wish, Instant::now()).unwrap()
}

fn begin(wish: &Subscribe, now: Instant) -> Result<Subscription, SessionError> {
    let encoded = EncodedTiles::default();
    let source = Source {
        grid: mirror().grid,
        recovers: &|resume| resume.epoch == "e" && (1..=5).contains(&resume.seq),
        protocol: SubProtocol::Json,
        encoded: &encoded,
    };
    Subscription::new(1, wish, source, now)
}

fn unsent() -> Budget {
    Budget::new(1 << 20)
}

/// The next message, as one JSON value.
fn message(subscription: &mut Subscription, mirror: &Mirror) -> Option<Value> {
    let copied = subscription.copy(mirror, 0, &unsent()).expect("there is room");
    let parts: Vec<_> = subscription.message(copied, Instant::now())?.collect();
    assert_eq!(parts.len(), 1);
    Some(serde_json::from_str(parts[0].to_text().unwrap()).unwrap())
}

/// Corners of a message's tiles.
fn tiles(message: &Value) -> Vec<(u64, u64)> {
    let corner =
        |tile: &Value| (tile["column_x"].as_u64().unwrap(), tile["column_z"].as_u64().unwrap());
    message["tiles"].as_array().unwrap().iter().map(corner).collect()
}

#[test]
fn a_large_message_waits_for_memory_and_gives_it_back() {
    let grid = Grid { width: 256, depth: 256, height: 4, cell_size: 0.5 };
    let spec = SessionSpec { grid, ..SessionSpec::default() };
    let clock = Clock::new(spec.tick_rate, spec.time_scale);
    let mirror = Mirror::new(&spec, Ground::level(), clock).unwrap();
    let encoded = EncodedTiles::default();
    let source = Source {
        grid,
        recovers: &|resume| resume.epoch == "e" && (1..=5).contains(&resume.seq),
        protocol: SubProtocol::Json,
        encoded: &encoded,
    };
    let mut all = Subscription::new(1, &Subscribe::default(), source, Instant::now()).unwrap();
    let unsent = Budget::new(2 << 20);
    let other = unsent.try_reserve(1 << 20).unwrap();
    assert!(all.copy(&mirror, 0, &unsent).is_none());
    let later = Instant::now() + Duration::from_secs(1);
    all.put_off(later);
    assert_eq!(all.due(), Some(later), "it is still due");
    drop(other);
    let copied = all.copy(&mirror, 0, &unsent).expect("there is room");
    let parts = all.message(copied, Instant::now()).unwrap();
    let held = unsent.held();
    assert!(held > 700_000, "{held}");
    let written: usize = parts.map(|part| part.to_text().unwrap().len()).sum();
    assert!(written as u64 <= held, "{written} bytes of {held}");
    assert_eq!(unsent.held(), 0);
}

#[test]
fn the_first_message_is_a_snapshot_of_whole_tiles_inside_the_grid() {
    let mut all = subscription(&Subscribe::default());
    let snapshot = message(&mut all, &mirror()).unwrap();
    assert_eq!(snapshot["op"], "snapshot");
    assert_eq!((&snapshot["id"], &snapshot["seq"]), (&json!(1), &json!(1)));
    assert_eq!(tiles(&snapshot), [(0, 0), (8, 0), (16, 0), (0, 8), (8, 8), (16, 8)]);
    let last = &snapshot["tiles"][5];
    assert_eq!((&last["width"], &last["depth"]), (&json!(4), &json!(4)));
    assert_eq!(last["heights"].as_array().unwrap().len(), 16);
    assert_eq!(snapshot.get("colliders"), None);
    assert_eq!(snapshot.get("recovered"), None);
    assert_eq!(snapshot.get("more"), None);
    assert_eq!(message(&mut all, &mirror()), None);
    assert_eq!(all.due(), None);
}

#[test]
fn a_region_is_widened_to_tiles_and_clipped_to_the_grid() {
    let wish = Subscribe { region: region(7, -100, 2, 101), ..Subscribe::default() };
    let snapshot = message(&mut subscription(&wish), &mirror()).unwrap();
    assert_eq!(tiles(&snapshot), [(0, 0), (8, 0)]);
}

#[test]
fn only_tiles_with_a_higher_version_are_missing() {
    let mut all = subscription(&Subscribe::default());
    assert_eq!(all.missing(|_| 1), [0, 1, 2, 3, 4, 5]);
    let mut mirror = mirror();
    mirror.seq = 7;
    message(&mut all, &mirror).unwrap();
    assert_eq!(all.missing(|tile| if tile == 4 { 8 } else { 7 }), [4]);
    assert!(all.missing(|_| 7).is_empty());
}

#[test]
fn a_moved_view_misses_only_what_came_into_it() {
    let wish = Subscribe { region: region(0, 0, 16, 8), ..Subscribe::default() };
    let mut moving = subscription(&wish);
    message(&mut moving, &mirror()).unwrap();
    moving.update(to(region(8, 0, 16, 12))).unwrap();
    let delta = message(&mut moving, &mirror()).unwrap();
    assert_eq!(delta["op"], "delta");
    assert_eq!(tiles(&delta), [(16, 0), (8, 8), (16, 8)]);
    moving.update(to(region(8, 0, 4, 4))).unwrap();
    assert_eq!(message(&mut moving, &mirror()), None);
}

#[test]
fn what_went_out_of_view_and_came_back_is_sent_again() {
    let mut moving =
        subscription(&Subscribe { region: region(0, 0, 8, 8), ..Subscribe::default() });
    message(&mut moving, &mirror()).unwrap();
    moving.update(to(region(8, 0, 8, 8))).unwrap();
    moving.update(to(region(0, 0, 8, 8))).unwrap();
    assert_eq!(tiles(&message(&mut moving, &mirror()).unwrap()), [(0, 0)]);
}

#[test]
fn colliders_are_told_whole_and_only_when_those_in_view_changed() {
    let wish = Subscribe { region: region(0, 0, 8, 8), colliders: true, ..Subscribe::default() };
    let mut near = subscription(&wish);
    let mut mirror = mirror();
    assert_eq!(message(&mut near, &mirror).unwrap()["colliders"], json!([]));

    let place = |mirror: &mut Mirror, colliders: &[ColliderView]| {
        mirror.seq += 1;
        mirror.colliders_version = mirror.seq;
        mirror.colliders = Arc::from(colliders);
    };
    place(&mut mirror, &[collider("far", 8.0)]);
    assert_eq!(message(&mut near, &mirror), None);

    // Its centre is beyond the view, its edge is not.
    place(&mut mirror, &[collider("far", 8.0), collider("near", 4.25)]);
    let delta = message(&mut near, &mirror).unwrap();
    assert_eq!(tiles(&delta), []);
    assert_eq!(delta["colliders"].as_array().unwrap().len(), 1);
    assert_eq!(delta["colliders"][0]["id"], "near");

    near.update(to(region(8, 0, 8, 8))).unwrap();
    let delta = message(&mut near, &mirror).unwrap();
    assert_eq!(delta["colliders"].as_array().unwrap().len(), 2);

    place(&mut mirror, &[]);
    assert_eq!(message(&mut near, &mirror).unwrap()["colliders"], json!([]));
    assert_eq!(message(&mut near, &mirror), None);
}

fn resuming(epoch: &str, seq: u64) -> Subscription {
    let resume = Some(Resume { epoch: epoch.to_owned(), seq });
    subscription(&Subscribe { resume, colliders: true, ..Subscribe::default() })
}

#[test]
fn a_state_that_was_not_published_is_not_recovered() {
    for (epoch, seq) in [("e", 6), ("e", 0), ("e", u64::MAX), ("f", 3), ("", 1)] {
        let snapshot = message(&mut resuming(epoch, seq), &mirror()).unwrap();
        assert_eq!((&snapshot["op"], &snapshot["recovered"]), (&json!("snapshot"), &json!(false)));
        assert_eq!(tiles(&snapshot).len(), 6, "{epoch} {seq}");
        assert_eq!(snapshot["colliders"], json!([]));
    }
}

#[test]
fn who_resumes_gets_exactly_what_has_changed_since() {
    let mut mirror = mirror();
    for (tile, seq) in [(2, 2), (4, 4), (1, 5)] {
        mirror.change(tile, seq);
    }
    for (seen, missed) in [
        (1, vec![(8, 0), (16, 0), (8, 8)]),
        (2, vec![(8, 0), (8, 8)]),
        (4, vec![(8, 0)]),
        (5, vec![]),
    ] {
        let mut resumed = resuming("e", seen);
        let delta = message(&mut resumed, &mirror).unwrap();
        assert_eq!((&delta["op"], &delta["recovered"]), (&json!("delta"), &json!(true)));
        assert_eq!((tiles(&delta), &delta["seq"]), (missed, &json!(5)), "from {seen}");
        assert_eq!(delta["colliders"], json!([]));
        assert_eq!(message(&mut resumed, &mirror), None);
    }
}

#[test]
fn a_view_that_moves_before_it_has_resumed_is_sent_what_came_into_it() {
    let mut mirror = mirror();
    mirror.change(0, 3);
    let resume = Some(Resume { epoch: "e".to_owned(), seq: 2 });
    let wish = Subscribe { region: region(0, 0, 16, 8), resume, ..Subscribe::default() };
    let mut moved = subscription(&wish);
    moved.update(to(region(0, 0, 20, 8))).unwrap();
    let delta = message(&mut moved, &mirror).unwrap();
    assert_eq!((tiles(&delta), &delta["recovered"]), (vec![(0, 0), (16, 0)], &json!(true)));
}

#[test]
fn invalid_wishes_name_every_field() {
    let wish = Subscribe {
        region: region(0, 0, 0, 1),
        stride: 3,
        max_rate: 61.0,
        quantum: 0.0,
        ..Subscribe::default()
    };
    let Err(SessionError::Invalid(wrong)) = begin(&wish, Instant::now()) else {
        panic!("accepted");
    };
    let pointers: Vec<&str> = wrong.iter().map(|error| error.pointer.as_str()).collect();
    assert_eq!(pointers, ["/stride", "/max_rate", "/quantum", "/region/width"]);
    for beyond in [region(20, 0, 1, 1), region(-5, 0, 5, 1), region(0, i64::MAX, 1, u64::MAX)] {
        let wish = Subscribe { region: beyond, ..Subscribe::default() };
        let result = begin(&wish, Instant::now());
        assert!(matches!(result, Err(SessionError::Invalid(_))), "{beyond:?}");
    }
}

#[test]
fn a_refused_move_leaves_the_view() {
    let mut view = subscription(&Subscribe::default());
    message(&mut view, &mirror()).unwrap();
    assert!(view.update(to(region(40, 0, 1, 1))).is_err());
    assert_eq!(view.due(), None);
    assert!(view.missing(|_| 1).is_empty());
}
