//! What is written about a session.

use firn_protocol::SessionSpec;
use serde::{Deserialize, Serialize};
use ulid::Ulid;

use crate::core::record::Weight;
use crate::core::session::{Command, TokenHashes};

/// Who a session is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Identity {
    /// Names it in whatever outlives a server; fixed when it is created.
    pub sid: Ulid,
    pub id: String,
    /// RFC 3339.
    pub created_at: String,
    /// Name of the tenant it belongs to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<String>,
    /// Memory that the journal holds of the session.
    #[serde(skip)]
    pub weight: Weight,
    #[serde(flatten)]
    pub tokens: TokenHashes,
    pub spec: SessionSpec,
}

/// What happened to a session in one frame, and not by the passing of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Tick at which it happened.
    pub tick: u64,
    /// Seq that it was published with, and the tick then.
    pub seq: u64,
    pub reached: u64,
    pub commands: Vec<Command>,
}

/// How many entries were written: a damaged file may have lost the newest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Head {
    pub next: u64,
}

/// A session at some tick.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Checkpoint {
    /// Number of the first entry that is not in it.
    pub base: u64,
    /// Newest published seq.
    pub seq: u64,
    /// Seq at which each tile last changed.
    pub versions: Vec<u64>,
    /// The snapshot, encoded.
    pub snapshot: Vec<u8>,
}

impl Checkpoint {
    /// As bytes: base, seq, number of tiles, their versions, the snapshot.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(24 + self.versions.len() * 8 + self.snapshot.len());
        for number in [self.base, self.seq, self.versions.len() as u64] {
            bytes.extend(number.to_le_bytes());
        }
        self.versions.iter().for_each(|version| bytes.extend(version.to_le_bytes()));
        bytes.extend(&self.snapshot);
        bytes
    }

    /// Reads what `encode` wrote; `None` for anything else.
    pub fn decode(bytes: &[u8]) -> Option<Checkpoint> {
        let mut rest = bytes;
        let mut number = || {
            let (number, after) = rest.split_first_chunk::<8>()?;
            rest = after;
            Some(u64::from_le_bytes(*number))
        };
        let (base, seq, count) = (number()?, number()?, number()?);
        if count > bytes.len() as u64 / 8 {
            return None;
        }
        let versions = (0..count).map(|_| number()).collect::<Option<_>>()?;
        Some(Checkpoint { base, seq, versions, snapshot: rest.to_vec() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_is_read_as_it_was_written() {
        let checkpoint =
            Checkpoint { base: 3, seq: 9, versions: vec![1, 9, 4], snapshot: b"snow".to_vec() };
        let bytes = checkpoint.encode();
        assert_eq!(Checkpoint::decode(&bytes), Some(checkpoint));
        for length in 0..48 {
            assert_eq!(Checkpoint::decode(&bytes[..length]), None, "{length}");
        }
        assert_eq!(Checkpoint::decode(&[0xff; 64]), None);
    }
}
