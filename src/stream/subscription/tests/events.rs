//! Events of a subscription's region, and its watches.

use super::*;

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
