//! Tokens in what was done for a request: only its client can read them.

use std::time::Duration;

use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, Nonce, UnboundKey};

use crate::core::record::{Done, DoneResult, Once, Sealed};
use crate::machine;
use crate::session::token::Tokens;

/// What tokens are sealed for: keys for other purposes are others.
const PURPOSE: &str = "firn 2026 tokens in the answer to a request that is sent again";

impl Done {
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
    use firn_protocol::{SnowfallReply, Stamp};

    use super::*;
    use crate::core::session::Applied;
    use crate::journal::keyed::KeyedRequests;
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
        let collider = r#"{"tick":3,"seq":9,"id":"a","mass":80.0,"shape":{"type":"disk","radius":0.3},"position":{"x":1.0,"z":0.7},"heading":0.0,"airborne":false,"shelters":false,"bottom":0.5,"sink_depth":0.25,"contact_area":0.125,"pressure":100.0,"burden":0.0,"resting":true}"#;
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
            // Version 0.1 knew no headings, and nothing of snow on objects.
            let older = text
                .replace(r#""heading":0.0,"airborne":false,"shelters":false,"#, "")
                .replace(r#""burden":0.0,"#, "");
            let done: Done = serde_json::from_str(&older).unwrap();
            assert_eq!(serde_json::to_string(&done).unwrap(), text);
        }
    }
}
