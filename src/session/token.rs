//! Secrets that let a client at one session.

use std::fmt;

use crate::core::session::TokenHashes;
use crate::machine;

/// The secrets of a session, told once.
#[derive(Clone)]
pub struct Tokens {
    /// Allows everything about the session.
    pub token: String,
    /// Allows its reads and streams.
    pub viewer_token: String,
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
