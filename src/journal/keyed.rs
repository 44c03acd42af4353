//! Requests that carry a key of their client's. Each is carried out once, whatever happens to the server
//! meanwhile: a client that did not get the answer asks again, gets the first one, and changes nothing.
//!
//! There is one entry for each key. HTTP begins it, has repeats wait in its place, and keeps the answer there
//! as it was sent. The journal notes what was done, as soon as that is durable together with what it changed:
//! after a restart, and where an answer was too long to be kept, the answer is made anew from that.
//!
//! Sessions share the memory for it. None may have more than a part of what the others leave free, so that
//! there is always some for one that has had none.

#[cfg(test)]
mod tests;

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::mem::size_of;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::OnceCell;

use crate::core::record::{Done, Hash, LIFETIME, OVERHEAD, Once, is_over};
use crate::journal::rows::row_of;
use crate::store::{Row, StoreClock};

/// Most bytes of all that HTTP has begun.
const MOST_BYTES: u64 = 256 << 20;

/// What of the free memory a session may have is one part of so many.
const PARTS: u64 = 8;

/// Times that a request may wait for its answer at once.
const MOST_AT_ONCE: usize = 64;

/// Counters of an `Arc`.
const SHARED: usize = 2 * size_of::<usize>();

// What the core counts is its place, what was done, and what both are found by: the table, the tree of ages and
// its session's record, of which about half is in use.
const _: () = assert!(
    OVERHEAD
        >= 2 * SHARED
            + size_of::<OnceCell<Box<[u8]>>>()
            + size_of::<Done>()
            + (size_of::<(Hash, Entry)>() + size_of::<(Duration, Hash)>() + size_of::<Arc<Done>>())
                * 2
);

/// The place for the answer to a request, as it was sent. The first to ask carries the request out; all others
/// wait meanwhile.
pub type Place = Arc<OnceCell<Box<[u8]>>>;

/// Why a request gets no place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPlace {
    /// Its key belongs to a request that says something else.
    OtherRequest,
    /// As many requests are known as may be; the oldest is forgotten after this time.
    Full(Duration),
}

/// All requests that are known.
#[derive(Debug)]
pub struct KeyedRequests {
    clock: StoreClock,
    most_bytes: u64,
    table: Mutex<Table>,
}

#[derive(Debug, Default)]
struct Table {
    entries: HashMap<Hash, Entry>,
    /// The keys, the oldest first.
    ages: BTreeSet<(Duration, Hash)>,
    /// Bytes of each share, and of all of them.
    shares: HashMap<Hash, u64>,
    bytes: u64,
    /// Rows of forgotten requests, which are still stored.
    over: Vec<Row>,
}

/// A request.
#[derive(Debug)]
struct Entry {
    /// Hash of all that it says.
    request: Hash,
    /// When its time began.
    since: Duration,
    place: Place,
    /// Whose memory it takes, and how much \[bytes\]: none where HTTP has not begun it in this process.
    share: Hash,
    bytes: u64,
    /// What was done, in the session of a key.
    done: Option<(u64, Arc<Done>)>,
}

impl KeyedRequests {
    /// Time for which a request is known: since it was done, or since it arrived first while it is not. The
    /// store's clock counts it.
    pub const LIFETIME: Duration = LIFETIME;

    /// Longest answer that is kept \[bytes\]. A longer one is made anew.
    pub const LONGEST_ANSWER: usize = 64 * 1024;

    /// None yet.
    pub(crate) fn by(clock: StoreClock) -> KeyedRequests {
        KeyedRequests { clock, most_bytes: MOST_BYTES, table: Mutex::default() }
    }

    /// The place for the answer to a request, of which the memory counts for a session, or for who creates
    /// sessions.
    ///
    /// # Errors
    /// [`NoPlace`].
    pub fn begin(&self, once: &Once, share: Hash) -> Result<Place, NoPlace> {
        let (now, table) = (self.now(), &mut *self.lock());
        table.forget_old(now);
        if let Some(Entry { request, place, bytes, .. }) = table.entries.get(&once.key) {
            if *request != once.request {
                return Err(NoPlace::OtherRequest);
            }
            if place.get().is_none() && Arc::strong_count(place) > MOST_AT_ONCE {
                return Err(NoPlace::Full(Duration::from_secs(1)));
            }
            if *bytes > 0 {
                return Ok(place.clone());
            }
        }
        let free = self.most_bytes.saturating_sub(table.bytes);
        let own = table.shares.get(&share).copied().unwrap_or(0);
        if own + OVERHEAD as u64 > free / PARTS {
            let oldest = table.ages.first().map_or(now, |(since, _)| *since);
            return Err(NoPlace::Full((oldest + KeyedRequests::LIFETIME).saturating_sub(now)));
        }
        let entry = table.enter(once.key, once.request, now);
        entry.share = share;
        let place = entry.place.clone();
        table.charge(&once.key, OVERHEAD as u64);
        Ok(place)
    }

    /// Counts an answer that is about to be put in its place and sent.
    pub fn keep(&self, key: &Hash, place: &Place, answer: &[u8]) {
        let table = &mut *self.lock();
        // It may have been forgotten meanwhile.
        if table.find(key, place).is_some() {
            table.charge(key, answer.len() as u64);
        }
    }

    /// Forgets a request that was refused, where nobody else waits for it: it may be sent again, and say
    /// something else.
    pub fn give_up(&self, key: &Hash, place: Place) {
        let table = &mut *self.lock();
        // One is kept here, and one is the caller's.
        let alone = place.get().is_none() && Arc::strong_count(&place) == 2;
        if alone && table.find(key, &place).is_some_and(|entry| entry.done.is_none()) {
            table.remove(key);
        }
    }

    /// Whether a request was carried out, in this process or before.
    pub fn is_done(&self, key: &Hash) -> bool {
        self.find(key).is_some()
    }

    /// Bytes that all requests take that HTTP has begun, and their answers.
    pub fn bytes(&self) -> u64 {
        self.lock().bytes
    }

    /// The time that requests are done at.
    pub(crate) fn now(&self) -> Duration {
        self.clock.now()
    }

    /// Notes what is stored of a session at the start. The clock goes on from there, where it is behind: nothing
    /// that is newer by the clock would be forgotten before it.
    pub(crate) fn bring_back(&self, session: u64, stored: &VecDeque<Arc<Done>>) {
        for done in stored {
            self.clock.begin_no_earlier_than(done.at());
            self.note(session, done.clone());
        }
    }

    /// Notes what was done in a session, once that is durable. Its time begins.
    pub(crate) fn note(&self, session: u64, done: Arc<Done>) {
        let (table, key, at) = (&mut *self.lock(), done.key, done.at());
        let entry = table.enter(key, done.request, at);
        let since = std::mem::replace(&mut entry.since, at);
        entry.done = Some((session, done));
        table.ages.remove(&(since, key));
        table.ages.insert((at, key));
    }

    /// Forgets what was done, whose session is deleted. The answer as it was sent stays.
    pub(crate) fn forget(&self, key: &Hash) {
        let table = &mut *self.lock();
        if let Some(entry) = table.entries.get_mut(key) {
            entry.done = None;
            if entry.bytes == 0 {
                table.remove(key);
            }
        }
    }

    /// Forgets what is too old. Returns the rows that are to be removed from the store.
    pub(crate) fn forget_old(&self) -> Vec<Row> {
        let (now, table) = (self.now(), &mut *self.lock());
        table.forget_old(now);
        std::mem::take(&mut table.over)
    }

    /// Notes that rows are still to be removed.
    pub(crate) fn put_back(&self, rows: Vec<Row>) {
        self.lock().over.extend(rows);
    }

    /// What was done, if it was.
    pub(crate) fn find(&self, key: &Hash) -> Option<Arc<Done>> {
        let (now, table) = (self.now(), self.lock());
        let entry = table.entries.get(key).filter(|entry| !is_over(entry.since, now))?;
        entry.done.as_ref().map(|(_, done)| done.clone())
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Table {
    /// The entry of a key; a new one where there is none.
    fn enter(&mut self, key: Hash, request: Hash, since: Duration) -> &mut Entry {
        self.entries.entry(key).or_insert_with(|| {
            self.ages.insert((since, key));
            let (place, share) = Default::default();
            Entry { request, since, place, share, bytes: 0, done: None }
        })
    }

    /// The entry of a key, where a place is still its own.
    fn find(&self, key: &Hash, place: &Place) -> Option<&Entry> {
        self.entries.get(key).filter(|entry| Arc::ptr_eq(&entry.place, place))
    }

    fn charge(&mut self, key: &Hash, bytes: u64) {
        if let Some(entry) = self.entries.get_mut(key) {
            entry.bytes += bytes;
            *self.shares.entry(entry.share).or_default() += bytes;
            self.bytes += bytes;
        }
    }

    fn remove(&mut self, key: &Hash) -> Option<Entry> {
        let entry = self.entries.remove(key)?;
        self.ages.remove(&(entry.since, *key));
        self.bytes -= entry.bytes;
        let left = self.shares.remove(&entry.share).unwrap_or(0) - entry.bytes;
        if left > 0 {
            self.shares.insert(entry.share, left);
        }
        Some(entry)
    }

    /// Forgets what is too old.
    fn forget_old(&mut self, now: Duration) {
        while let Some(&(since, key)) = self.ages.first()
            && is_over(since, now)
        {
            let done = self.remove(&key).and_then(|entry| entry.done);
            self.over.extend(done.map(|(session, done)| row_of(session, &done)));
        }
    }
}
