//! Secrets that let a client at one session.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::machine;

/// The secrets of a session, told once.
#[derive(Clone)]
pub struct Tokens {
    /// Allows everything about the session.
    pub token: String,
    /// Allows its reads and streams.
    pub viewer_token: String,
}

/// What the server keeps of a session's secrets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TokenHashes {
    /// Hash of the token that allows everything.
    #[serde(with = "hex")]
    pub token: blake3::Hash,
    /// Hash of the token that allows reads and streams.
    #[serde(with = "hex")]
    pub viewer_token: blake3::Hash,
}

/// What a token allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grant {
    /// Everything about its session.
    Everything,
    /// Its session's reads and streams.
    Reads,
}

impl TokenHashes {
    /// What the token of a hash allows; nothing where it is neither of the two.
    pub fn grant(&self, token: &blake3::Hash) -> Option<Grant> {
        // These comparisons take the same time wherever two hashes differ.
        match (*token == self.token, *token == self.viewer_token) {
            (true, _) => Some(Grant::Everything),
            (_, true) => Some(Grant::Reads),
            _ => None,
        }
    }
}

/// A secret of 256 random bits, as hexadecimal text.
///
/// # Errors
/// Where the operating system has no random numbers.
pub fn random_secret() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 32];
    machine::fill(&mut bytes)?;
    Ok(blake3::Hash::from_bytes(bytes).to_hex().to_string())
}

impl fmt::Debug for Tokens {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Tokens(…)")
    }
}

impl Tokens {
    /// New secrets of 256 random bits each.
    ///
    /// # Errors
    /// Where the operating system has no random numbers.
    pub fn generate() -> Result<Tokens, getrandom::Error> {
        Ok(Tokens { token: random_secret()?, viewer_token: random_secret()? })
    }

    /// Their hashes.
    pub fn hashes(&self) -> TokenHashes {
        TokenHashes {
            token: blake3::hash(self.token.as_bytes()),
            viewer_token: blake3::hash(self.viewer_token.as_bytes()),
        }
    }
}

/// A hash as hexadecimal text.
mod hex {
    use serde::{Deserialize, Deserializer, Serializer, de};

    pub fn serialize<S: Serializer>(hash: &blake3::Hash, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(hash.to_hex().as_str())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<blake3::Hash, D::Error> {
        let text = String::deserialize(from)?;
        blake3::Hash::from_hex(text).map_err(de::Error::custom)
    }
}
