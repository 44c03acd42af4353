//! Requests that carry a key of their client's: what was done for one is stored together with what it changed.

use std::fmt;
use std::time::Duration;

use firn_protocol::{BatchReply, ClearingReply, ColliderReply, SnowfallReply, Stamp, StampReply};
use serde::{Deserialize, Serialize};

use crate::core::session::Applied;

/// Time for which a request is known, by the store's clock.
pub(crate) const LIFETIME: Duration = Duration::from_secs(600);

/// Memory that a request takes beside its answer as it was sent \[bytes\].
pub(crate) const OVERHEAD: usize = 672;

/// A hash.
pub type Hash = [u8; 32];

/// A request that carries a key.
#[derive(Clone)]
pub struct Once {
    /// Names it: a hash of the session's `sid`, the call, and its client's key.
    pub key: Hash,
    /// Hash of all that it says.
    pub request: Hash,
    /// Hash of what only its client knows: the key and the token it was sent with. It is never
    /// written down.
    pub secret: Hash,
}

impl fmt::Debug for Once {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Once(…)")
    }
}

/// What was done for a request.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Done {
    pub key: Hash,
    pub request: Hash,
    /// When it was done, by the store's clock \[ms\]. Earlier versions noted the wall clock's time in
    /// another field: those requests are as old as the store's clock is.
    #[serde(default)]
    at_ms: u64,
    pub result: DoneResult,
}

/// The answer, or what it can be made of again.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum DoneResult {
    Snowfall(SnowfallReply),
    Clearing(ClearingReply),
    Collider { reply: Box<ColliderReply>, created: bool },
    Stamps(StampReply),
    Batch(BatchReply),
    Stamp(Stamp),
    Created { id: String, tokens: Sealed },
}

impl Done {
    /// A change that was applied.
    pub fn applied(once: &Once, applied: &Applied, at: Duration) -> Done {
        let result = match applied {
            Applied::Snowfall(reply) => DoneResult::Snowfall(*reply),
            Applied::Clearing(reply) => DoneResult::Clearing(*reply),
            Applied::Collider { reply, created } => {
                DoneResult::Collider { reply: Box::new(reply.clone()), created: *created }
            }
            Applied::Stamps(reply) => DoneResult::Stamps(reply.clone()),
            Applied::Batch(reply) => DoneResult::Batch(reply.clone()),
            Applied::AirTemperature(reply) => DoneResult::Stamp(reply.stamp),
            Applied::Stamp(stamp) => DoneResult::Stamp(*stamp),
        };
        Done::new(once, result, at)
    }

    pub fn new(once: &Once, result: DoneResult, at: Duration) -> Done {
        let at_ms = u64::try_from(at.as_millis()).unwrap_or(u64::MAX);
        Done { key: once.key, request: once.request, at_ms, result }
    }

    /// When it was done, by the store's clock.
    pub fn at(&self) -> Duration {
        Duration::from_millis(self.at_ms)
    }

    /// Whether nobody may ask for it any more at some time.
    pub fn is_over(&self, now: Duration) -> bool {
        is_over(self.at(), now)
    }

    /// The answer to the change that it was.
    pub fn answer(&self) -> Option<Applied> {
        Some(match &self.result {
            DoneResult::Snowfall(reply) => Applied::Snowfall(*reply),
            DoneResult::Clearing(reply) => Applied::Clearing(*reply),
            DoneResult::Collider { reply, created } => {
                Applied::Collider { reply: (**reply).clone(), created: *created }
            }
            DoneResult::Stamps(reply) => Applied::Stamps(reply.clone()),
            DoneResult::Batch(reply) => Applied::Batch(reply.clone()),
            DoneResult::Stamp(stamp) => Applied::Stamp(*stamp),
            DoneResult::Created { .. } => return None,
        })
    }
}

/// Tokens that only somebody with the request's secret can read.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Sealed {
    pub salt: [u8; 32],
    pub bytes: Vec<u8>,
}

/// Whether what began at some time is too old.
pub(crate) fn is_over(since: Duration, now: Duration) -> bool {
    now.saturating_sub(since) >= LIFETIME
}
