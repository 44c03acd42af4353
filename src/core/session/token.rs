//! What the server keeps of the secrets that let a client at one session.

use serde::{Deserialize, Serialize};

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
