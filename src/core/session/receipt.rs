//! Receipts: an answer is held back until what it says is durable.
//!
//! Everything that a frame hands to the journal of one session has a position, counted up for as long as the
//! process lives. The answer to a change carries the position; the request returns when everything up to there
//! is durable, or with the reason why it never will be.

use std::collections::VecDeque;

use tokio::sync::watch;

use crate::core::session::SessionError;

/// An answer, and the position of what has to be durable before it counts.
#[derive(Clone, Debug)]
pub(crate) struct Receipted<T> {
    pub answer: T,
    pub position: u64,
}

/// Ranges of refused positions that are remembered. A waiting request looks at them long before there are so
/// many.
const REMEMBERED: usize = 16;

/// How far a session is durable.
#[derive(Debug, Default)]
struct Durable {
    /// All up to here is, but for what was refused.
    position: u64,
    /// First and last positions that are taken back, and why, once that may be told.
    refused: VecDeque<(u64, u64, Option<SessionError>)>,
    /// The last position of what was refused and is not remembered.
    forgotten: u64,
    /// Why nothing more comes.
    ended: Option<SessionError>,
}

impl Durable {
    /// What is known of a position.
    fn verdict(&self, position: u64) -> Option<Result<(), SessionError>> {
        let holds = |range: &&(u64, u64, _)| (range.0..=range.1).contains(&position);
        if let Some((.., why)) = self.refused.iter().find(holds) {
            return why.clone().or_else(|| self.ended.clone()).map(Err);
        }
        if position <= self.forgotten {
            let why = "nobody knows any more whether the change was stored: read the session first";
            return Some(Err(SessionError::Internal(why.to_owned())));
        }
        if position <= self.position {
            return Some(Ok(()));
        }
        self.ended.clone().map(Err)
    }
}

/// Where requests wait for their session to be durable.
#[derive(Debug, Default)]
pub(crate) struct Receipts(watch::Sender<Durable>);

impl Receipts {
    /// All up to a position is durable, but for what was refused.
    pub fn confirm(&self, position: u64) {
        self.0.send_if_modified(|durable| {
            let more = position > durable.position;
            durable.position = durable.position.max(position);
            more
        });
    }

    /// Some positions, first and last, never will be durable. The reason follows with [`Receipts::refuse`].
    pub fn take_back(&self, (first, last): (u64, u64)) {
        self.0.send_modify(|durable| {
            durable.refused.push_back((first, last, None));
            if durable.refused.len() > REMEMBERED
                && let Some((_, last, _)) = durable.refused.pop_front()
            {
                durable.forgotten = durable.forgotten.max(last);
            }
        });
    }

    /// Tells why some positions never will be durable.
    pub fn refuse(&self, range: (u64, u64), why: &SessionError) {
        if !self.0.borrow().refused.iter().any(|known| (known.0, known.1) == range) {
            self.take_back(range);
        }
        self.0.send_modify(|durable| {
            let mut known = durable.refused.iter_mut();
            if let Some(known) = known.find(|known| (known.0, known.1) == range) {
                known.2 = Some(why.clone());
            }
        });
    }

    /// Nothing more will be.
    pub fn end(&self, why: &SessionError) {
        self.0.send_modify(|durable| {
            durable.ended = durable.ended.take().or_else(|| Some(why.clone()))
        });
    }

    /// Waits until all up to a position is durable.
    ///
    /// # Errors
    /// Why it never will be.
    pub async fn wait(&self, position: u64) -> Result<(), SessionError> {
        let mut known = self.0.subscribe();
        loop {
            if let Some(verdict) = known.borrow_and_update().verdict(position) {
                return verdict;
            }
            if known.changed().await.is_err() {
                return Err(SessionError::Internal("nothing is stored any more".to_owned()));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn why(text: &str) -> SessionError {
        SessionError::StorageFailed(text.to_owned())
    }

    fn told(durable: &Receipts, position: u64) -> Option<Result<(), String>> {
        let verdict = durable.0.borrow().verdict(position)?;
        Some(verdict.map_err(|why| why.to_string()))
    }

    #[test]
    fn a_position_is_durable_or_refused_and_stays_so() {
        let receipts = Receipts::default();
        assert_eq!(told(&receipts, 1), None);
        receipts.confirm(2);
        receipts.take_back((3, 5));
        receipts.confirm(6);
        assert_eq!(told(&receipts, 4), None, "it is not told yet");
        receipts.refuse((3, 5), &why("full"));
        receipts.confirm(1);
        for (position, verdict) in
            [(1, Some(Ok(()))), (2, Some(Ok(()))), (4, Some(Err("full".to_owned()))), (7, None)]
        {
            assert_eq!(told(&receipts, position), verdict, "{position}");
        }
        receipts.confirm(7);
        assert_eq!(told(&receipts, 5), Some(Err("full".to_owned())));
        assert_eq!(told(&receipts, 6), Some(Ok(())));
        receipts.end(&why("gone"));
        assert_eq!(told(&receipts, 7), Some(Ok(())));
        assert_eq!(told(&receipts, 8), Some(Err("gone".to_owned())));
    }

    #[test]
    fn what_is_forgotten_is_never_taken_for_durable() {
        let receipts = Receipts::default();
        for position in 1..=REMEMBERED as u64 + 2 {
            receipts.refuse((position, position), &why("full"));
        }
        receipts.confirm(100);
        assert!(told(&receipts, 1).unwrap().unwrap_err().contains("nobody knows"));
        assert_eq!(told(&receipts, 3), Some(Err("full".to_owned())));
        assert_eq!(told(&receipts, 50), Some(Ok(())));
    }
}
