//! Rows that objects take in the device's tables. They are written anew for every frame in which an
//! object presses on snow that moves, so those of all sessions together must fit a buffer.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::core::session::{Invalid, SessionError};

/// Words of four bytes that the objects of one session may take: thousands of vehicles, or fifteen
/// objects as large as 2048 × 2048 columns.
const MOST: u64 = 1 << 20;

/// Words that the objects of all sessions may take: twice as many, for the two evaluations that a
/// frame may begin with, fit the smallest buffer that a device has to bind.
const MOST_IN_ALL: u64 = 1 << 23;

/// What the objects of one session take of the words that there are for all.
#[derive(Debug)]
pub(crate) struct ObjectRows {
    all: Arc<AtomicU64>,
    own: u64,
}

impl ObjectRows {
    /// None yet; `all` counts those of all sessions.
    pub fn new(all: Arc<AtomicU64>) -> ObjectRows {
        ObjectRows { all, own: 0 }
    }

    /// Words that are taken.
    pub fn taken(&self) -> u64 {
        self.own
    }

    /// Takes as many words as it says, in place of those before.
    pub fn take(&mut self, words: u64) {
        self.all.fetch_add(words, Ordering::Relaxed);
        self.all.fetch_sub(self.own, Ordering::Relaxed);
        self.own = words;
    }

    /// As [`ObjectRows::take`], where there is room for them.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] and [`SessionError::ServerFull`]; nothing has changed then.
    pub fn try_take(&mut self, words: u64) -> Result<(), SessionError> {
        if words > MOST && words > self.own {
            let detail = "the objects of this session would cover too many columns together; \
                          remove some, or make them smaller";
            return Err(SessionError::Invalid(vec![Invalid::new("", detail)]));
        }
        let room = |all: u64| {
            let after = all + words - self.own;
            (words <= self.own || after <= MOST_IN_ALL).then_some(after)
        };
        if self.all.try_update(Ordering::Relaxed, Ordering::Relaxed, room).is_err() {
            return Err(SessionError::ServerFull(
                "the objects of all sessions cover as many columns as the device has room for; \
                 remove some first"
                    .to_owned(),
            ));
        }
        self.own = words;
        Ok(())
    }
}

impl Drop for ObjectRows {
    fn drop(&mut self) {
        self.take(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_session_gives_back_another_may_take() {
        let all = Arc::new(AtomicU64::new(0));
        let mut sessions: Vec<_> = (0..9).map(|_| ObjectRows::new(all.clone())).collect();
        assert!(matches!(sessions[0].try_take(MOST + 1), Err(SessionError::Invalid(_))));
        for rows in &mut sessions[..8] {
            rows.try_take(MOST).unwrap();
        }
        let full = sessions[8].try_take(1).unwrap_err();
        assert!(matches!(full, SessionError::ServerFull(_)), "{full}");
        assert_eq!(sessions[8].taken(), 0);
        sessions[0].try_take(MOST - 5).unwrap();
        sessions[8].try_take(5).unwrap();
        // What is brought back was allowed once.
        sessions[1].take(2 * MOST);
        sessions[1].try_take(2 * MOST - 1).unwrap();
        assert!(sessions[2].try_take(MOST + 1).is_err());
        drop(sessions);
        assert_eq!(all.load(Ordering::Relaxed), 0);
    }
}
