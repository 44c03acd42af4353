//! What was done for a request that carries a key. It is stored together with what it changed.

use std::time::Duration;

use firn_protocol::{ClearingReply, ColliderReply, SnowfallReply, Stamp};
use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, Nonce, UnboundKey};
use serde::{Deserialize, Serialize};

use crate::machine;
use crate::session::change::Applied;
use crate::session::token::Tokens;
use crate::store::{Kind, Row};

use super::{Hash, Once, is_over};

/// What tokens are sealed for: keys for other purposes are others.
const PURPOSE: &str = "firn 2026 tokens in the answer to a request that is sent again";

/// What was done for a request.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::session) struct Done {
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
pub(in crate::session) enum DoneResult {
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
        Done::new(once, result, at)
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
        Ok(Done::new(once, DoneResult::Created { id: id.to_owned(), tokens }, at))
    }

    fn new(once: &Once, result: DoneResult, at: Duration) -> Done {
        let at_ms = u64::try_from(at.as_millis()).unwrap_or(u64::MAX);
        Done { key: once.key, request: once.request, at_ms, result }
    }

    /// The row that holds it, in the session of a key.
    pub fn row(&self, session: u64) -> Row {
        let (first, _) = self.key.split_first_chunk().expect("32 bytes");
        Row { session, kind: Kind::Answer, number: u64::from_be_bytes(*first) }
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
                Applied::Collider { reply: reply.clone(), created: *created }
            }
            DoneResult::Stamp(stamp) => Applied::Stamp(*stamp),
            DoneResult::Created { .. } => return None,
        })
    }
}

/// Tokens that only somebody with the request's secret can read.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::session) struct Sealed {
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

/// The salt makes every key one of its own, which is used once.
fn cipher(secret: &[u8; 32], salt: &[u8; 32]) -> LessSafeKey {
    let key = blake3::Hasher::new_derive_key(PURPOSE).update(secret).update(salt).finalize();
    let key = UnboundKey::new(&CHACHA20_POLY1305, key.as_bytes());
    LessSafeKey::new(key.expect("the key has the cipher's length"))
}

fn nonce() -> Nonce {
    Nonce::assume_unique_for_key([0; 12])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::keyed::KeyedRequests;
    use crate::store::StoreClock;

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
        assert!(!done.is_over(AT + KeyedRequests::LIFETIME - second));
        assert!(done.is_over(AT + KeyedRequests::LIFETIME));
        assert!(!done.is_over(AT - second), "a backup's clock may be behind");
        // One of an earlier version counts from the store's beginning.
        let mut text = serde_json::to_value(&done).unwrap();
        text.as_object_mut().unwrap().remove("at_ms");
        text["at"] = 1_790_000_000_u64.into();
        let old: Done = serde_json::from_value(text).unwrap();
        assert!(!old.is_over(Duration::ZERO) && old.is_over(KeyedRequests::LIFETIME));
    }

    #[test]
    fn an_answer_is_the_same_after_it_was_stored() {
        let stamp = Stamp { tick: 3, seq: 9 };
        let reply = SnowfallReply { stamp, fallen_mass: 0.1 + 0.2, refused_mass: 1e-9 };
        let applied = Applied::Snowfall(reply);
        let text = serde_json::to_string(&Done::applied(&once(), &applied, AT)).unwrap();
        let keyed = KeyedRequests::by(StoreClock::default());
        keyed.note(7, serde_json::from_str::<Done>(&text).unwrap().into());
        assert_eq!(keyed.find(&once().key).unwrap().answer(), Some(applied));
        keyed.forget(&[1; 32]);
        assert!(keyed.find(&once().key).is_none());
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
