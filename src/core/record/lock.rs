//! Sessions that came back from a damaged file: they stand still and take no changes until an
//! administrator says that they are as they should be.

use std::sync::Arc;

use firn_protocol::SettingsPatch;
use serde::{Deserialize, Serialize};

use crate::core::record::fold::Fold;
use crate::core::record::{Entry, Part, Stored};
use crate::core::session::{Change, SessionError};

/// That a session is locked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Lock {
    /// Whether that it was paused stands in its journal already.
    pub paused: bool,
}

impl Lock {
    /// The lock of a row; where the store wrote it, it says nothing yet.
    pub fn read(bytes: &[u8]) -> Lock {
        serde_json::from_slice(bytes).unwrap_or_default()
    }
}

impl Stored {
    /// Has a locked session come back paused, as if somebody had paused it last. Returns what has to
    /// be written for that, together and before anything else.
    ///
    /// # Errors
    /// Where what is stored can't be read.
    pub fn pause(&mut self) -> Result<Vec<Part>, SessionError> {
        if self.lock.is_none_or(|lock| lock.paused) {
            return Ok(Vec::new());
        }
        let patch = SettingsPatch { paused: Some(true), ..SettingsPatch::default() };
        let command = Fold::of(self)?.decide(&Change::Settings(patch))?;
        let (tick, seq) = (self.anchor.tick, self.newest_seq());
        let entry = Arc::new(Entry { tick, seq, reached: tick, commands: vec![command] });
        let lock = Some(Lock { paused: true });
        let parts = vec![Part::Entry(self.next(), entry), Part::Lock(lock)];
        parts.iter().for_each(|part| self.enter(part));
        Ok(parts)
    }
}
