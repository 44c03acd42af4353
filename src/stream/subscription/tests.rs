mod ground;

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

/// Tells a change at a tick when that is due, but not before a time. Returns when it was told.
fn tell(paced: &mut Subscription, mirror: &mut Mirror, tick: u64, now: Instant) -> Instant {
    mirror.clock = Clock::new(60.0, 1.0);
    mirror.clock.pass(tick);
    mirror.seq += 1;
    mirror.colliders_version = mirror.seq;
    mirror.colliders = Arc::new([collider("a", (mirror.seq % 9) as f64)]);
    paced.mark(tick);
    let now = paced.due().unwrap().max(now);
    let copied = paced.copy(mirror, 0, &unsent()).expect("there is room");
    assert!(paced.message(copied, now).is_some());
    now
}

const PERIOD: Duration = Duration::from_millis(100);

fn paced(start: Instant) -> (Subscription, Mirror) {
    let wish = Subscribe { max_rate: 10.0, colliders: true, ..Subscribe::default() };
    let mut paced = begin(&wish, start).unwrap();
    let mut mirror = mirror();
    assert_eq!(tell(&mut paced, &mut mirror, 1, start), start);
    (paced, mirror)
}

#[test]
fn ticks_are_told_at_once_whenever_their_client_subscribed() {
    let start = Instant::now();
    for after_tick in [1, 50, 99] {
        let (mut paced, mut mirror) = paced(start);
        let mut at = start + Duration::from_millis(after_tick);
        for tick in 2..20 {
            assert_eq!(tell(&mut paced, &mut mirror, tick, at), at, "{after_tick} ms, {tick}");
            // Between two ticks something changes. It does not keep the next tick from being told.
            paced.mark(tick);
            assert!(paced.due().unwrap() >= at + PERIOD);
            at += PERIOD;
        }
    }
}

#[test]
fn the_rate_holds_on_average_where_ticks_come_faster() {
    let start = Instant::now();
    let (mut paced, mut mirror) = paced(start);
    let mut at = start;
    for tick in 2..40 {
        at = tell(&mut paced, &mut mirror, tick, at + PERIOD / 6);
    }
    // One message more than its share: the one that may come early.
    assert!(at >= start + PERIOD * 36, "{:?}", at - start);
    assert!(at <= start + PERIOD * 38, "{:?}", at - start);
}

#[test]
fn changes_between_ticks_keep_their_distance_and_are_not_made_up_for() {
    let start = Instant::now();
    let (mut paced, mut mirror) = paced(start);
    let first = tell(&mut paced, &mut mirror, 1, start);
    assert_eq!(first, start + PERIOD);
    let second = tell(&mut paced, &mut mirror, 1, first);
    assert_eq!(second, first + PERIOD);
    // Very late: nothing is made up for.
    let later = start + 9 * PERIOD;
    assert_eq!(tell(&mut paced, &mut mirror, 1, later), later);
    assert_eq!(tell(&mut paced, &mut mirror, 1, later), later + PERIOD);
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

fn falls(x0: u32, z0: u32) -> Happening {
    let stamp = Stamp { tick: 0, seq: 2 };
    let event = Event::Snowfall { stamp, fallen_mass: 1.0, refused_mass: 0.0 };
    Happening { event, columns: Some(ColumnRect { x0, z0, x1: x0 + 1, z1: z0 + 1 }) }
}

#[test]
fn events_are_of_the_kinds_and_the_tiles_that_are_wanted() {
    let region = region(9, 0, 1, 1);
    let all = subscription(&Subscribe { region, ..Subscribe::default() });
    for (x, z, wanted) in
        [(8, 0, true), (15, 7, true), (7, 0, false), (16, 0, false), (9, 8, false)]
    {
        assert_eq!(all.wants(&falls(x, z)), wanted, "{x}/{z}");
    }
    let settled = Happening::from(Event::Settled { stamp: Stamp { tick: 0, seq: 2 } });
    assert!(all.wants(&settled));
    let events = Some(Events::from_iter([EventKind::Settled]));
    let mut some = subscription(&Subscribe { region, events, ..Subscribe::default() });
    assert!(some.wants(&settled) && !some.wants(&falls(8, 0)));
    some.update(to(region)).unwrap();
    assert!(some.wants(&settled) && !some.wants(&falls(8, 0)), "it stays");
    let update = Update { region, events: Some(Events::none()), watch: None };
    some.update(update).unwrap();
    assert!(!some.wants(&settled));
}

/// How watches stand of which that is news.
fn crossings(subscription: &mut Subscription, mirror: &Mirror) -> Vec<(String, bool, f64)> {
    let mut copied = subscription.copy(mirror, 0, &unsent()).expect("there is room");
    let crossings = std::mem::take(&mut copied.crossings);
    let told = |event| match event {
        Event::Watch { stamp, subscription: 1, id, holds, mean_depth } => {
            assert_eq!(stamp.seq, mirror.seq);
            (id, holds, mean_depth)
        }
        other => panic!("{other:?}"),
    };
    crossings.into_iter().map(told).collect()
}

fn watch(id: &str, region: Option<ColumnRegion>) -> DepthWatch {
    DepthWatch { id: id.to_owned(), region, ..DepthWatch::default() }
}

#[test]
fn a_watch_tells_how_it_stands_and_each_crossing() {
    // A change raises all columns of a tile by one quantum.
    let quantum = 0.5 / f64::from(firn_snow::CELL);
    let mut mirror = mirror();
    let above = DepthWatch { above: Some(1.5 * quantum), ..watch("part", region(6, 0, 4, 1)) };
    let below = DepthWatch { below: Some(quantum), ..watch("tile", region(8, 0, 8, 8)) };
    let wish =
        Subscribe { watch: vec![above, below], region: region(0, 8, 1, 1), ..Subscribe::default() };
    let mut both = subscription(&wish);
    let tell = |id: &str, holds, mean_depth| (id.to_owned(), holds, mean_depth);
    assert_eq!(crossings(&mut both, &mirror), [tell("part", false, 0.0), tell("tile", true, 0.0)]);
    assert_eq!(crossings(&mut both, &mirror), []);
    mirror.change(1, 2);
    // Exactly at its depth it is not below it.
    assert_eq!(crossings(&mut both, &mirror), [tell("tile", false, quantum)]);
    mirror.change(0, 3);
    assert_eq!(crossings(&mut both, &mirror), [], "1 is not above 1.5");
    mirror.change(0, 4);
    assert_eq!(crossings(&mut both, &mirror), [], "nor is (2 + 1) / 2");
    mirror.change(0, 5);
    assert_eq!(crossings(&mut both, &mirror), [tell("part", true, 2.0 * quantum)]);
    mirror.change(2, 6);
    assert_eq!(crossings(&mut both, &mirror), []);

    let watch = Some(vec![DepthWatch { above: Some(0.0), ..watch("all", None) }]);
    both.update(Update { watch, ..Update::default() }).unwrap();
    let mean = quantum * f64::from(3 * 64 + 64 + 4 * 8) / 240.0;
    assert_eq!(crossings(&mut both, &mirror), [tell("all", true, mean)]);
    assert_eq!(mirror.summary().mean_height, mean);
}

#[test]
fn watches_that_can_not_be_are_refused() {
    let good = || DepthWatch { above: Some(1.0), ..watch("a", None) };
    let cases = [
        (vec![DepthWatch { id: "a b".to_owned(), ..good() }], "/watch/0/id"),
        (vec![good(), good()], "/watch/1/id"),
        (vec![watch("a", None)], "/watch/0"),
        (vec![DepthWatch { below: Some(1.0), ..good() }], "/watch/0"),
        (vec![DepthWatch { above: Some(2.5), ..good() }], "/watch/0/above"),
        (vec![DepthWatch { above: None, below: Some(-0.5), ..good() }], "/watch/0/below"),
        (vec![DepthWatch { region: region(20, 0, 1, 1), ..good() }], "/watch/0/region"),
        (vec![DepthWatch { region: region(0, 0, 0, 1), ..good() }], "/watch/0/region/width"),
    ];
    for (watch, pointer) in cases {
        let refused = begin(&Subscribe { watch, ..Subscribe::default() }, Instant::now());
        let Err(SessionError::Invalid(fields)) = refused else { panic!("{pointer} was accepted") };
        let pointers: Vec<_> = fields.iter().map(|field| &*field.pointer).collect();
        assert_eq!(pointers, [pointer]);
    }
}
