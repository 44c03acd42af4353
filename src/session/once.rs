//! Requests that carry a key of their client's are carried out once, whatever happens to the
//! server meanwhile: what came of one is made durable together with what it changed.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use firn_protocol::{ClearingReply, ColliderReply, SnowfallReply, Stamp};
use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, Nonce, UnboundKey};
use serde::{Deserialize, Serialize};

use crate::machine;
use crate::store::StoreClock;

use super::change::Applied;
use super::idempotency::{Idempotency, RequestKey};
use super::token::Tokens;

/// What tokens are sealed for: keys for other purposes are others.
const PURPOSE: &str = "firn 2026 tokens in the answer to a request that is sent again";

/// A request that carries a key.
#[derive(Clone)]
pub struct Once {
    /// Names it.
    pub key: RequestKey,
    /// Hash of all that it says.
    pub request: [u8; 32],
    /// Hash of what only its client knows: the key and the token it was sent with. It is never
    /// written down.
    pub secret: [u8; 32],
}

impl fmt::Debug for Once {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Once(…)")
    }
}

/// What came of a request that carried a key.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Done {
    pub key: RequestKey,
    pub request: [u8; 32],
    /// When it was done, by the store's clock \[ms\]. Earlier versions noted the wall clock's time in
    /// another field: those requests are as old as the store's clock is.
    #[serde(default)]
    pub at_ms: u64,
    pub result: DoneResult,
}

/// The answer, or what it can be made of again.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum DoneResult {
    Snowfall(SnowfallReply),
    Clearing(ClearingReply),
    Collider { reply: ColliderReply, created: bool },
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
                DoneResult::Collider { reply: reply.clone(), created: *created }
            }
            Applied::AirTemperature(reply) => DoneResult::Stamp(reply.stamp),
            Applied::Stamp(stamp) => DoneResult::Stamp(*stamp),
        };
        Done { key: once.key, request: once.request, at_ms: milliseconds(at), result }
    }

    /// A session that was created.
    ///
    /// # Errors
    /// Where the operating system has no random numbers.
    pub fn created(
        once: &Once,
        id: &str,
        tokens: &Tokens,
        at: Duration,
    ) -> Result<Done, getrandom::Error> {
        let tokens = Sealed::seal(&once.secret, tokens)?;
        let result = DoneResult::Created { id: id.to_owned(), tokens };
        Ok(Done { key: once.key, request: once.request, at_ms: milliseconds(at), result })
    }

    /// Number of the row that holds it.
    pub fn number(&self) -> u64 {
        let (first, _) = self.key.split_first_chunk().expect("32 bytes");
        u64::from_be_bytes(*first)
    }

    /// Whether nobody may ask for it any more at some time.
    fn is_old(&self, now: Duration) -> bool {
        now.saturating_sub(Duration::from_millis(self.at_ms)) >= Idempotency::LIFETIME
    }

    /// The answer to the change that it was.
    fn answer(&self) -> Option<Applied> {
        Some(match &self.result {
            DoneResult::Snowfall(reply) => Applied::Snowfall(*reply),
            DoneResult::Clearing(reply) => Applied::Clearing(*reply),
            DoneResult::Collider { reply, created } => {
                Applied::Collider { reply: reply.clone(), created: *created }
            }
            DoneResult::Stamp(stamp) => Applied::Stamp(*stamp),
            DoneResult::Created { .. } => return None,
        })
    }
}

fn milliseconds(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

/// Tokens that only somebody with the request's secret can read.
#[derive(Serialize, Deserialize)]
pub(super) struct Sealed {
    salt: [u8; 32],
    bytes: Vec<u8>,
}

impl Sealed {
    fn seal(secret: &[u8; 32], tokens: &Tokens) -> Result<Sealed, getrandom::Error> {
        let mut salt = [0; 32];
        machine::fill(&mut salt)?;
        let mut bytes = format!("{} {}", tokens.token, tokens.viewer_token).into_bytes();
        let tag = cipher(secret, &salt).seal_in_place_append_tag(nonce(), Aad::empty(), &mut bytes);
        tag.expect("two tokens are not too long");
        Ok(Sealed { salt, bytes })
    }

    /// The tokens, where the secret is theirs.
    pub fn open(&self, secret: &[u8; 32]) -> Option<Tokens> {
        let mut bytes = self.bytes.clone();
        let opened =
            cipher(secret, &self.salt).open_in_place(nonce(), Aad::empty(), &mut bytes).ok()?;
        let (token, viewer_token) = std::str::from_utf8(opened).ok()?.split_once(' ')?;
        Some(Tokens { token: token.to_owned(), viewer_token: viewer_token.to_owned() })
    }
}

impl fmt::Debug for Sealed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Sealed(…)")
    }
}

/// The salt makes every key one of its own, which is used once.
fn cipher(secret: &[u8; 32], salt: &[u8; 32]) -> LessSafeKey {
    let key = blake3::Hasher::new_derive_key(PURPOSE).update(secret).update(salt).finalize();
    let key = UnboundKey::new(&CHACHA20_POLY1305, key.as_bytes());
    LessSafeKey::new(key.expect("the key has the cipher's length"))
}

fn nonce() -> Nonce {
    Nonce::assume_unique_for_key([0; 12])
}

/// What came of the requests that carried a key lately, by the store's clock.
#[derive(Debug, Default)]
pub(super) struct Answered {
    clock: StoreClock,
    done: Mutex<HashMap<RequestKey, Arc<Done>>>,
}

impl Answered {
    /// Nothing yet.
    pub fn by(clock: StoreClock) -> Answered {
        Answered { clock, done: Mutex::default() }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<RequestKey, Arc<Done>>> {
        self.done.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Goes on from the newest request that is stored, where the clock is behind it: nothing that is
    /// newer by the clock would be forgotten before it.
    pub fn go_on_from(&self, newest: &Done) {
        self.clock.begin_no_earlier_than(Duration::from_millis(newest.at_ms));
    }

    /// The time that requests are done at.
    pub fn now(&self) -> Duration {
        self.clock.now()
    }

    /// Whether nobody may ask for what came of a request any more.
    pub fn is_over(&self, done: &Done) -> bool {
        done.is_old(self.now())
    }

    /// Notes what came of a request, once that is durable.
    pub fn note(&self, done: Arc<Done>) {
        self.lock().insert(done.key, done);
    }

    /// Forgets a request.
    pub fn forget(&self, key: &RequestKey) {
        self.lock().remove(key);
    }

    /// What came of a request, if it has been made.
    pub fn find(&self, key: &RequestKey) -> Option<Arc<Done>> {
        self.lock().get(key).filter(|done| !self.is_over(done)).cloned()
    }

    /// The answer to a change, if it has been made.
    pub fn answer(&self, once: Option<&Once>) -> Option<Applied> {
        self.find(&once?.key)?.answer()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: Duration = Duration::from_secs(1000);

    fn once() -> Once {
        Once { key: [1; 32], request: [2; 32], secret: [3; 32] }
    }

    #[test]
    fn tokens_are_read_with_their_secret_alone() {
        let tokens = Tokens::generate().unwrap();
        let done = Done::created(&once(), "a", &tokens, AT).unwrap();
        let text = serde_json::to_string(&done).unwrap();
        assert!(!text.contains(&tokens.token) && !text.contains(&tokens.viewer_token), "{text}");
        let done: Done = serde_json::from_str(&text).unwrap();
        let DoneResult::Created { tokens: sealed, .. } = done.result else { panic!("{done:?}") };
        let opened = sealed.open(&once().secret).unwrap();
        assert_eq!((opened.token, opened.viewer_token), (tokens.token, tokens.viewer_token));
        assert!(sealed.open(&[4; 32]).is_none());
        let again = Done::created(&once(), "a", &opened_tokens(), AT).unwrap();
        let DoneResult::Created { tokens: other, .. } = again.result else { panic!() };
        assert_ne!(sealed.salt, other.salt, "no key is used twice");
    }

    fn opened_tokens() -> Tokens {
        Tokens { token: "a".to_owned(), viewer_token: "b".to_owned() }
    }

    #[test]
    fn an_answer_is_over_when_the_stores_clock_says_so() {
        let stamp = Applied::Stamp(Stamp { tick: 3, seq: 9 });
        let done = Done::applied(&once(), &stamp, AT);
        let second = Duration::from_secs(1);
        assert!(!done.is_old(AT + Idempotency::LIFETIME - second));
        assert!(done.is_old(AT + Idempotency::LIFETIME));
        assert!(!done.is_old(AT - second), "a backup's clock may be behind");
        // One of an earlier version counts from the store's beginning.
        let mut text = serde_json::to_value(&done).unwrap();
        text.as_object_mut().unwrap().remove("at_ms");
        text["at"] = 1_790_000_000_u64.into();
        let old: Done = serde_json::from_value(text).unwrap();
        assert!(!old.is_old(Duration::ZERO) && old.is_old(Idempotency::LIFETIME));
    }

    #[test]
    fn an_answer_is_the_same_after_it_was_stored() {
        let stamp = Stamp { tick: 3, seq: 9 };
        let reply = SnowfallReply { stamp, fallen_mass: 0.1 + 0.2, refused_mass: 1e-9 };
        let applied = Applied::Snowfall(reply);
        let text = serde_json::to_string(&Done::applied(&once(), &applied, AT)).unwrap();
        let answered = Answered::default();
        answered.note(serde_json::from_str::<Done>(&text).unwrap().into());
        assert_eq!(answered.answer(Some(&once())), Some(applied));
        assert_eq!(answered.answer(None), None);
        answered.forget(&[1; 32]);
        assert_eq!(answered.answer(Some(&once())), None);
    }

    /// What stands on disk is read by later versions.
    #[test]
    fn what_is_stored_keeps_its_form() {
        let stamp = r#"{"tick":3,"seq":9}"#;
        let collider = r#"{"tick":3,"seq":9,"id":"a","mass":80.0,"shape":{"type":"disk","radius":0.3},"position":{"x":1.0,"z":0.7},"bottom":0.5,"sink_depth":0.25,"contact_area":0.125,"pressure":100.0,"resting":true}"#;
        let numbers = |byte: u8| serde_json::to_string(&[byte; 32]).unwrap();
        let sealed = format!(r#"{{"salt":{},"bytes":[1,2]}}"#, numbers(5));
        for result in [
            r#"{"snowfall":{"tick":3,"seq":9,"fallen_mass":1.5,"refused_mass":0.0}}"#.to_owned(),
            r#"{"clearing":{"tick":3,"seq":9,"cleared_mass":1.5}}"#.to_owned(),
            format!(r#"{{"collider":{{"reply":{collider},"created":true}}}}"#),
            format!(r#"{{"stamp":{stamp}}}"#),
            format!(r#"{{"created":{{"id":"a","tokens":{sealed}}}}}"#),
        ] {
            let (key, request) = (numbers(1), numbers(2));
            let text =
                format!(r#"{{"key":{key},"request":{request},"at_ms":1000,"result":{result}}}"#);
            let done: Done = serde_json::from_str(&text).unwrap();
            assert_eq!(serde_json::to_string(&done).unwrap(), text);
        }
    }
}
