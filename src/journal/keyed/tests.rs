use std::sync::atomic::{AtomicU64, Ordering};

use firn_protocol::Stamp;

use super::*;
use crate::session::Applied;

const OVERHEAD: u64 = super::OVERHEAD as u64;
const SAYS: Hash = [7; 32];
const LIFETIME: Duration = KeyedRequests::LIFETIME;
const SECOND: Duration = Duration::from_secs(1);

/// Requests whose clock the test drives.
struct Driven {
    keyed: KeyedRequests,
    milliseconds: Arc<AtomicU64>,
}

impl Driven {
    fn new() -> Driven {
        Driven::with(MOST_BYTES)
    }

    fn with(most_bytes: u64) -> Driven {
        let milliseconds = Arc::new(AtomicU64::new(0));
        let time = milliseconds.clone();
        let source = Arc::new(move || Duration::from_millis(time.load(Ordering::Relaxed)));
        let clock = StoreClock::driven_by(Duration::ZERO, source);
        Driven { keyed: KeyedRequests { most_bytes, ..KeyedRequests::by(clock) }, milliseconds }
    }

    fn advance(&self, by: Duration) {
        self.milliseconds.fetch_add(by.as_millis() as u64, Ordering::Relaxed);
    }

    fn begin(&self, number: u8) -> Result<Place, NoPlace> {
        self.keyed.begin(&once(number, SAYS), share(0))
    }

    /// Begins the request of the same key that says something else.
    fn begin_other(&self, number: u8) -> Result<Place, NoPlace> {
        self.keyed.begin(&once(number, [8; 32]), share(0))
    }

    /// Answers a request as HTTP does.
    fn answer(&self, number: u8, answer: &[u8]) {
        let place = self.begin(number).unwrap();
        self.keyed.keep(&key(number), &place, answer);
        place.set(answer.into()).unwrap();
    }

    /// Notes what was done now in a session, as the journal does.
    fn done(&self, number: u8, session: u64) {
        let done = Done::applied(&once(number, SAYS), &applied(), self.keyed.now());
        self.keyed.note(session, Arc::new(done));
    }

    fn told(&self, number: u8) -> Option<Applied> {
        self.keyed.find(&key(number))?.answer()
    }
}

fn key(number: u8) -> Hash {
    [number; 32]
}

fn share(number: u8) -> Hash {
    [number; 32]
}

fn once(number: u8, request: Hash) -> Once {
    Once { key: key(number), request, secret: [0; 32] }
}

fn applied() -> Applied {
    Applied::Stamp(Stamp { tick: 3, seq: 9 })
}

#[test]
fn an_answer_is_found_until_it_is_too_old() {
    let kept = Driven::new();
    kept.answer(1, b"five.");
    kept.advance(LIFETIME - SECOND);
    assert_eq!(kept.begin(1).unwrap().get().unwrap()[..], b"five."[..]);
    assert_eq!(kept.begin_other(1).unwrap_err(), NoPlace::OtherRequest);
    kept.advance(SECOND);
    assert_eq!(kept.begin_other(1).unwrap().get(), None);
}

#[test]
fn what_came_to_nothing_is_forgotten_once_nobody_waits() {
    let kept = Driven::new();
    let (first, second) = (kept.begin(1).unwrap(), kept.begin(1).unwrap());
    kept.keyed.give_up(&key(1), first);
    assert_eq!(kept.begin_other(1).unwrap_err(), NoPlace::OtherRequest);
    kept.keyed.give_up(&key(1), second);
    assert_eq!(kept.keyed.bytes(), 0);
    let other = kept.begin_other(1).unwrap();
    other.set((*b"1").into()).unwrap();
    kept.keyed.give_up(&key(1), other);
    assert_eq!(kept.keyed.bytes(), OVERHEAD, "an answer stays");
    let refused = kept.begin(2).unwrap();
    kept.done(2, 5);
    kept.keyed.give_up(&key(2), refused);
    assert_eq!(kept.told(2), Some(applied()), "what is durable stays");
}

#[test]
fn a_request_that_is_under_way_is_repeated_a_few_times_at_once() {
    let kept = Driven::new();
    let mut places: Vec<_> = (0..MOST_AT_ONCE).map(|_| kept.begin(1).unwrap()).collect();
    assert_eq!(kept.begin(1).unwrap_err(), NoPlace::Full(SECOND));
    places.pop();
    let place = kept.begin(1).unwrap();
    place.set((*b"1").into()).unwrap();
    places.extend((0..20).map(|_| kept.begin(1).unwrap()));
}

#[test]
fn no_session_takes_what_others_need() {
    let kept = Driven::with(64 * OVERHEAD);
    let requests = |share: Hash, from: u8| {
        let fits = |&number: &u8| kept.keyed.begin(&once(number, SAYS), share).is_ok();
        (from..from + 60).take_while(fits).count()
    };
    // Seven, of which one more would be an eighth of what is left; then less and less.
    assert_eq!([requests(share(1), 1), requests(share(2), 70), requests(share(3), 140)], [7, 6, 5]);
    let full = kept.keyed.begin(&once(250, SAYS), share(1)).unwrap_err();
    assert_eq!(full, NoPlace::Full(LIFETIME));
    // What is known is still found.
    assert!(kept.keyed.begin(&once(1, SAYS), share(1)).is_ok());
    kept.advance(LIFETIME);
    assert_eq!(requests(share(1), 1), 7);
    assert_eq!(kept.keyed.bytes(), 7 * OVERHEAD);
}

#[test]
fn an_answer_that_comes_when_its_place_is_forgotten_is_not_counted() {
    let kept = Driven::new();
    let late = kept.begin(2).unwrap();
    kept.answer(1, b"five.");
    assert_eq!(kept.keyed.bytes(), 2 * OVERHEAD + 5);
    kept.advance(LIFETIME);
    kept.begin(3).unwrap();
    kept.keyed.keep(&key(2), &late, &[0; 10]);
    kept.keyed.give_up(&key(2), late);
    assert_eq!((kept.keyed.bytes(), kept.keyed.lock().shares.len()), (OVERHEAD, 1));
}

#[test]
fn what_was_done_is_found_for_its_time_and_its_row_is_removed_once() {
    let kept = Driven::new();
    kept.begin(1).unwrap();
    kept.begin(2).unwrap();
    kept.advance(SECOND);
    kept.done(1, 5);
    kept.advance(LIFETIME - SECOND);
    // Of what was not done no row is stored.
    assert_eq!(kept.keyed.forget_old(), []);
    assert!(kept.keyed.is_done(&key(1)) && !kept.keyed.is_done(&key(2)));
    assert_eq!(kept.keyed.bytes(), OVERHEAD, "its time began when it was done");
    kept.advance(SECOND);
    assert_eq!(kept.told(1), None);
    // HTTP may forget it before the journal asks.
    kept.begin(3).unwrap();
    let number = u64::from_be_bytes([1; 8]);
    let row = Row { session: 5, kind: crate::store::Kind::Answer, number };
    assert_eq!(kept.keyed.forget_old(), [row]);
    assert_eq!(kept.keyed.forget_old(), []);
}

#[test]
fn what_was_done_before_a_start_has_a_place_like_all_others() {
    let kept = Driven::with(9 * OVERHEAD);
    let stored = Done::applied(&once(1, SAYS), &applied(), Duration::from_secs(50));
    kept.keyed.bring_back(5, &VecDeque::from([Arc::new(stored)]));
    assert_eq!(kept.keyed.now(), Duration::from_secs(50), "the clock goes on from there");
    assert_eq!((kept.told(1), kept.keyed.bytes()), (Some(applied()), 0));
    assert_eq!(kept.begin_other(1).unwrap_err(), NoPlace::OtherRequest);
    assert_eq!(kept.begin(1).unwrap().get(), None);
    assert_eq!(kept.keyed.bytes(), OVERHEAD);
    assert_eq!(kept.begin(2).unwrap_err(), NoPlace::Full(LIFETIME));
}

#[test]
fn an_answer_outlives_the_session_and_what_was_done_does_not() {
    let kept = Driven::new();
    kept.answer(1, b"five.");
    for number in [1, 2] {
        kept.done(number, 5);
        kept.keyed.forget(&key(number));
        assert_eq!(kept.told(number), None);
    }
    assert_eq!(kept.begin(1).unwrap().get().unwrap()[..], b"five."[..]);
    kept.advance(LIFETIME);
    assert_eq!(kept.keyed.forget_old(), []);
    assert_eq!((kept.keyed.bytes(), kept.keyed.lock().entries.len()), (0, 0));
}
