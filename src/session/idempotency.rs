//! Answers to requests that carry a key of their client's, kept for a while: who did not get the
//! answer asks again, gets the first one, and nothing happens twice.
//!
//! Sessions share the memory for it. None may have more than a part of what the others leave free, so that
//! there is always some for one that has had none.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::OnceCell;
use tokio::time::Instant;

/// Most bytes of all answers together.
const MOST_BYTES: u64 = 256 << 20;

/// What of the free memory a session may have is one part of so many.
const PARTS: u64 = 8;

/// What a request takes beside its answer \[bytes\]: its place here, and what is noted of it for the time
/// after a restart (`Done`), in this process's maps and queues.
const OVERHEAD: u64 = 832;

/// Longest answer that is kept \[bytes\]. A longer one, as of a session on a large terrain, is made anew
/// from what is noted of the request.
const LONGEST_ANSWER: u64 = 64 * 1024;

/// Times that a request may wait for its answer at once.
const MOST_AT_ONCE: usize = 64;

/// Names a request: a hash of the session's `sid`, the call, and its client's key.
pub type RequestKey = [u8; 32];

/// Whose memory an answer takes: that of a session, or of who creates sessions.
pub type Share = [u8; 32];

/// An answer as it was sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// HTTP status.
    pub status: u16,
    /// A line for each of its headers.
    head: Box<[u8]>,
    /// Its body. It holds tokens where the request made a session.
    pub body: Box<[u8]>,
}

impl Answer {
    /// A status, names and values of headers, and a body.
    pub fn new<'a>(
        status: u16,
        headers: impl Iterator<Item = (&'a [u8], &'a [u8])>,
        body: &[u8],
    ) -> Answer {
        let lines: Vec<u8> =
            headers.flat_map(|(name, value)| [name, b":", value, b"\n"].concat()).collect();
        Answer { status, head: lines.into(), body: body.into() }
    }

    /// Names and values of its headers.
    pub fn headers(&self) -> impl Iterator<Item = (&[u8], &[u8])> {
        // No name has a colon, and no value a line feed.
        self.head.split(|&byte| byte == b'\n').filter_map(|line| {
            let colon = line.iter().position(|&byte| byte == b':')?;
            Some((&line[..colon], &line[colon + 1..]))
        })
    }

    fn bytes(&self) -> u64 {
        (self.head.len() + self.body.len()) as u64
    }

    /// Whether it may be kept.
    pub fn is_short(&self) -> bool {
        self.bytes() <= LONGEST_ANSWER
    }
}

/// The place for the answer to one key. Whoever finds it empty carries the request out, and all
/// others wait meanwhile.
#[derive(Debug)]
pub struct Place {
    /// Hash of all that the request says.
    request: [u8; 32],
    /// The answer, once there is one that is kept.
    pub answer: OnceCell<Answer>,
    share: Share,
    age: Age,
    bytes: AtomicU64,
}

/// When a request arrived first; numbers tell those of one instant apart.
type Age = (Instant, u64);

/// Why a request gets no place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPlace {
    /// Its key belongs to a request that says something else.
    OtherRequest,
    /// As many answers are kept as may be; the oldest is forgotten after this time.
    Full(Duration),
}

/// All answers that are kept.
#[derive(Debug)]
pub struct Idempotency {
    most_bytes: u64,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    places: HashMap<RequestKey, Arc<Place>>,
    ages: BTreeMap<Age, RequestKey>,
    numbers: u64,
    /// Bytes of each share, and of all of them.
    shares: HashMap<Share, u64>,
    bytes: u64,
}

impl Default for Idempotency {
    fn default() -> Self {
        Idempotency::new(MOST_BYTES)
    }
}

impl Idempotency {
    /// Time for which an answer is kept, from the first request on.
    pub const LIFETIME: Duration = Duration::from_secs(600);

    /// Keeps answers of a number of bytes in all, one more at most for each request under way.
    pub fn new(most_bytes: u64) -> Idempotency {
        Idempotency { most_bytes, kept: Mutex::default() }
    }

    /// Bytes that all answers and requests take.
    pub fn bytes(&self) -> u64 {
        self.kept().bytes
    }

    /// The place for the answer to a request; a new one where its key is new.
    ///
    /// # Errors
    /// [`NoPlace`].
    pub fn lookup(
        &self,
        key: RequestKey,
        request: [u8; 32],
        share: Share,
    ) -> Result<Arc<Place>, NoPlace> {
        let now = Instant::now();
        let mut kept = self.kept();
        kept.forget_old(now);
        if let Some(place) = kept.places.get(&key) {
            return match place {
                _ if place.request != request => Err(NoPlace::OtherRequest),
                _ if place.answer.get().is_none() && Arc::strong_count(place) > MOST_AT_ONCE => {
                    Err(NoPlace::Full(Duration::from_secs(1)))
                }
                _ => Ok(place.clone()),
            };
        }
        let free = self.most_bytes.saturating_sub(kept.bytes);
        let own = kept.shares.get(&share).copied().unwrap_or(0);
        if own + OVERHEAD > free / PARTS {
            let oldest = kept.ages.first_key_value().map_or(now, |((began, _), _)| *began);
            let wait = (oldest + Idempotency::LIFETIME).saturating_duration_since(now);
            return Err(NoPlace::Full(wait));
        }
        kept.numbers += 1;
        let age = (now, kept.numbers);
        let place =
            Place { request, answer: OnceCell::new(), share, age, bytes: AtomicU64::new(0) };
        let place = Arc::new(place);
        kept.places.insert(key, place.clone());
        kept.ages.insert(age, key);
        kept.add(&place, OVERHEAD);
        Ok(place)
    }

    /// Notes an answer that is about to be put in its place and sent.
    pub fn record(&self, key: &RequestKey, place: &Arc<Place>, answer: &Answer) {
        let mut kept = self.kept();
        // It may have been forgotten meanwhile.
        if kept.holds(key, place) {
            kept.add(place, answer.bytes());
        }
    }

    /// Forgets a request of which nothing came, where nobody else waits for it: it may be sent again, and
    /// say something else.
    pub fn give_up(&self, key: &RequestKey, place: Arc<Place>) {
        let mut kept = self.kept();
        // One is kept here, and one is the caller's.
        if kept.holds(key, &place) && place.answer.get().is_none() && Arc::strong_count(&place) == 2
        {
            kept.forget(key);
        }
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn holds(&self, key: &RequestKey, place: &Arc<Place>) -> bool {
        self.places.get(key).is_some_and(|kept| Arc::ptr_eq(kept, place))
    }

    fn add(&mut self, place: &Place, bytes: u64) {
        place.bytes.fetch_add(bytes, Ordering::Relaxed);
        *self.shares.entry(place.share).or_default() += bytes;
        self.bytes += bytes;
    }

    fn forget(&mut self, key: &RequestKey) {
        let Some(place) = self.places.remove(key) else { return };
        self.ages.remove(&place.age);
        let bytes = place.bytes.load(Ordering::Relaxed);
        self.bytes -= bytes;
        if let Some(share) = self.shares.get_mut(&place.share) {
            *share -= bytes;
            if *share == 0 {
                self.shares.remove(&place.share);
            }
        }
    }

    /// Forgets what is too old.
    fn forget_old(&mut self, now: Instant) {
        while let Some((&(began, _), &key)) = self.ages.first_key_value()
            && now.saturating_duration_since(began) >= Idempotency::LIFETIME
        {
            self.forget(&key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REQUEST: [u8; 32] = [7; 32];
    const LIFETIME: Duration = Idempotency::LIFETIME;

    fn answer(body: usize) -> Answer {
        let headers = [(&b"etag"[..], &b"a:b"[..]), (b"date", b"")];
        Answer::new(200, headers.into_iter(), &vec![0; body])
    }

    fn key(number: u8) -> RequestKey {
        [number; 32]
    }

    fn share(number: u8) -> Share {
        [number; 32]
    }

    async fn answered(kept: &Idempotency, number: u8, body: usize) -> Arc<Place> {
        let place = kept.lookup(key(number), REQUEST, share(0)).unwrap();
        kept.record(&key(number), &place, &answer(body));
        place.answer.set(answer(body)).unwrap();
        place
    }

    #[test]
    fn an_answer_has_its_headers() {
        let answer = answer(3);
        let headers: Vec<_> = answer.headers().collect();
        assert_eq!(headers, [(&b"etag"[..], &b"a:b"[..]), (b"date", b"")]);
        assert!(answer.is_short() && !self::answer(LONGEST_ANSWER as usize).is_short());
    }

    #[tokio::test(start_paused = true)]
    async fn an_answer_is_found_until_it_is_too_old() {
        let kept = Idempotency::default();
        answered(&kept, 1, 5).await;
        tokio::time::advance(LIFETIME - Duration::from_secs(1)).await;
        let found = kept.lookup(key(1), REQUEST, share(0)).unwrap();
        assert_eq!(found.answer.get(), Some(&answer(5)));
        assert_eq!(kept.lookup(key(1), [8; 32], share(0)).unwrap_err(), NoPlace::OtherRequest);
        tokio::time::advance(Duration::from_secs(1)).await;
        assert_eq!(kept.lookup(key(1), [8; 32], share(0)).unwrap().answer.get(), None);
    }

    #[tokio::test(start_paused = true)]
    async fn what_came_to_nothing_is_forgotten_once_nobody_waits() {
        let kept = Idempotency::default();
        let first = kept.lookup(key(1), REQUEST, share(0)).unwrap();
        let second = kept.lookup(key(1), REQUEST, share(0)).unwrap();
        kept.give_up(&key(1), first);
        assert_eq!(kept.lookup(key(1), [8; 32], share(0)).unwrap_err(), NoPlace::OtherRequest);
        kept.give_up(&key(1), second);
        assert_eq!(kept.bytes(), 0);
        let other = kept.lookup(key(1), [8; 32], share(0)).unwrap();
        other.answer.set(answer(1)).unwrap();
        kept.give_up(&key(1), other);
        assert_eq!(kept.bytes(), OVERHEAD, "an answer stays");
    }

    #[tokio::test(start_paused = true)]
    async fn a_request_that_is_under_way_is_repeated_a_few_times_at_once() {
        let kept = Idempotency::default();
        let lookup = || kept.lookup(key(1), REQUEST, share(0));
        let mut places: Vec<_> = (0..MOST_AT_ONCE).map(|_| lookup().unwrap()).collect();
        assert_eq!(lookup().unwrap_err(), NoPlace::Full(Duration::from_secs(1)));
        places.pop();
        let place = lookup().unwrap();
        place.answer.set(answer(1)).unwrap();
        places.extend((0..20).map(|_| lookup().unwrap()));
    }

    #[tokio::test(start_paused = true)]
    async fn no_session_takes_what_others_need() {
        let kept = Idempotency::new(64 * OVERHEAD);
        let requests = |share: Share, from: u8| {
            let fits = |number: &u8| kept.lookup(key(*number), REQUEST, share).is_ok();
            (from..from + 60).take_while(fits).count()
        };
        // Seven, of which one more would be an eighth of what is left; then less and less.
        assert_eq!(
            [requests(share(1), 1), requests(share(2), 70), requests(share(3), 140)],
            [7, 6, 5]
        );
        let full = kept.lookup(key(250), REQUEST, share(1)).unwrap_err();
        assert_eq!(full, NoPlace::Full(LIFETIME));
        // What is known is still found.
        assert!(kept.lookup(key(1), REQUEST, share(1)).is_ok());
        tokio::time::advance(LIFETIME).await;
        assert_eq!(requests(share(1), 1), 7);
        assert_eq!(kept.bytes(), 7 * OVERHEAD);
    }

    #[tokio::test(start_paused = true)]
    async fn an_answer_that_comes_when_its_place_is_forgotten_is_not_counted() {
        let kept = Idempotency::default();
        let late = kept.lookup(key(2), REQUEST, share(0)).unwrap();
        answered(&kept, 1, 5).await;
        assert_eq!(kept.bytes(), 2 * OVERHEAD + answer(5).bytes());
        tokio::time::advance(LIFETIME).await;
        kept.lookup(key(3), REQUEST, share(0)).unwrap();
        kept.record(&key(2), &late, &answer(10));
        kept.give_up(&key(2), late);
        assert_eq!((kept.bytes(), kept.kept().shares.len()), (OVERHEAD, 1));
    }
}
