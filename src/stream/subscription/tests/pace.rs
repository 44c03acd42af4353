//! When messages are sent.

use super::*;

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
