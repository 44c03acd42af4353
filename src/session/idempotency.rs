//! Answers to requests that carry a key of their client's, kept for a while: who did not get the
//! answer asks again, gets the first one, and nothing happens twice.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::OnceCell;
use tokio::time::Instant;

/// Most bytes of all answers together.
const MOST_BYTES: usize = 256 << 20;

/// What a request costs beside its answer \[bytes\], rounded up.
const OVERHEAD: usize = 256;

/// Names a request: a hash of the session's epoch, the call, and its client's key.
pub type RequestKey = [u8; 32];

/// An answer as it was sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// HTTP status.
    pub status: u16,
    /// Names and values of its headers.
    pub headers: Vec<(String, Vec<u8>)>,
    /// Its body. It holds tokens where the request made a session.
    pub body: Vec<u8>,
}

impl Answer {
    fn bytes(&self) -> usize {
        let header = |(name, value): &(String, Vec<u8>)| name.len() + value.len();
        self.body.len() + self.headers.iter().map(header).sum::<usize>()
    }
}

/// The place for the answer to one key. Whoever finds it empty carries the request out, and all
/// others wait meanwhile.
#[derive(Debug)]
pub struct Place {
    /// Hash of all that the request says.
    request: [u8; 32],
    /// The answer, once there is one.
    pub answer: OnceCell<Answer>,
    bytes: AtomicUsize,
}

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
    most_bytes: usize,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    places: HashMap<RequestKey, Arc<Place>>,
    /// By age, the oldest first.
    ages: VecDeque<(Instant, RequestKey)>,
    bytes: usize,
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
    pub fn new(most_bytes: usize) -> Idempotency {
        Idempotency { most_bytes, kept: Mutex::default() }
    }

    /// The place for the answer to a request; a new one where its key is new.
    ///
    /// # Errors
    /// [`NoPlace`].
    pub fn lookup(&self, key: RequestKey, request: [u8; 32]) -> Result<Arc<Place>, NoPlace> {
        let now = Instant::now();
        let mut kept = self.kept();
        kept.forget(now);
        if let Some(place) = kept.places.get(&key) {
            let same = place.request == request;
            return if same { Ok(place.clone()) } else { Err(NoPlace::OtherRequest) };
        }
        if kept.bytes + OVERHEAD > self.most_bytes {
            let oldest = kept.ages.front().map_or(now, |(began, _)| *began);
            return Err(NoPlace::Full(
                (oldest + Idempotency::LIFETIME).saturating_duration_since(now),
            ));
        }
        let bytes = AtomicUsize::new(OVERHEAD);
        let place = Arc::new(Place { request, answer: OnceCell::new(), bytes });
        kept.bytes += OVERHEAD;
        kept.places.insert(key, place.clone());
        kept.ages.push_back((now, key));
        Ok(place)
    }

    /// Notes an answer that is about to be put in its place and sent.
    pub fn record(&self, key: &RequestKey, place: &Arc<Place>, answer: &Answer) {
        let mut kept = self.kept();
        // It may have been forgotten meanwhile.
        if kept.places.get(key).is_some_and(|kept| Arc::ptr_eq(kept, place)) {
            place.bytes.fetch_add(answer.bytes(), Ordering::Relaxed);
            kept.bytes += answer.bytes();
        }
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    /// Forgets what is too old.
    fn forget(&mut self, now: Instant) {
        while let Some((began, key)) = self.ages.front()
            && now.saturating_duration_since(*began) >= Idempotency::LIFETIME
        {
            if let Some(place) = self.places.remove(key) {
                self.bytes -= place.bytes.load(Ordering::Relaxed);
            }
            self.ages.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REQUEST: [u8; 32] = [7; 32];
    const LIFETIME: Duration = Idempotency::LIFETIME;

    fn answer(body: usize) -> Answer {
        Answer { status: 200, headers: Vec::new(), body: vec![0; body] }
    }

    fn key(number: u8) -> RequestKey {
        [number; 32]
    }

    async fn answered(kept: &Idempotency, number: u8, body: usize) -> Arc<Place> {
        let place = kept.lookup(key(number), REQUEST).unwrap();
        kept.record(&key(number), &place, &answer(body));
        place.answer.set(answer(body)).unwrap();
        place
    }

    #[tokio::test(start_paused = true)]
    async fn an_answer_is_found_until_it_is_too_old() {
        let kept = Idempotency::default();
        answered(&kept, 1, 5).await;
        tokio::time::advance(LIFETIME - Duration::from_secs(1)).await;
        let found = kept.lookup(key(1), REQUEST).unwrap();
        assert_eq!(found.answer.get(), Some(&answer(5)));
        assert_eq!(kept.lookup(key(1), [8; 32]).unwrap_err(), NoPlace::OtherRequest);
        tokio::time::advance(Duration::from_secs(1)).await;
        assert_eq!(kept.lookup(key(1), [8; 32]).unwrap().answer.get(), None);
    }

    #[tokio::test(start_paused = true)]
    async fn no_more_is_kept_than_may_be() {
        let kept = Idempotency::new(3 * OVERHEAD);
        answered(&kept, 1, OVERHEAD).await;
        tokio::time::advance(Duration::from_secs(100)).await;
        let late = kept.lookup(key(2), REQUEST).unwrap();
        let full = NoPlace::Full(LIFETIME - Duration::from_secs(100));
        assert_eq!(kept.lookup(key(3), REQUEST).unwrap_err(), full);
        // What is known is still found.
        assert!(kept.lookup(key(1), REQUEST).unwrap().answer.get().is_some());
        tokio::time::advance(LIFETIME).await;
        assert!(kept.lookup(key(3), REQUEST).is_ok());
        // An answer that comes when its place is forgotten is not counted.
        kept.record(&key(2), &late, &answer(10 * OVERHEAD));
        assert_eq!(kept.kept().bytes, OVERHEAD);
    }
}
