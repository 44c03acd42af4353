//! Answers that requests wait for, and how many of one session may wait.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

use crate::core::session::SessionError;

/// A place among the requests that wait for a session; clones share it.
pub(crate) type Place = Arc<OwnedSemaphorePermit>;

/// Where the answer to a request goes. The request waits until this is used or dropped, also where nobody is
/// left to be told.
#[derive(Debug)]
pub(crate) struct Answer<T> {
    sender: oneshot::Sender<Result<T, SessionError>>,
    _place: Option<Place>,
}

impl<T> Answer<T> {
    /// For a request that takes a place among those that wait, and where its answer arrives.
    pub fn new(place: Option<Place>) -> (Answer<T>, oneshot::Receiver<Result<T, SessionError>>) {
        let (sender, receiver) = oneshot::channel();
        (Answer { sender, _place: place }, receiver)
    }

    /// Answers. A client that has gone away gets nothing.
    pub fn give(self, result: Result<T, SessionError>) {
        drop(self.sender.send(result));
    }

    /// Answers with an error.
    pub fn refuse(self, why: &SessionError) {
        self.give(Err(why.clone()));
    }
}

/// Memory that a request takes while it waits, at the least \[bytes\].
const LEAST: usize = 4 << 10;

/// Memory that the requests of one session may take while they wait \[bytes\].
const MOST: usize = 16 << 20;

/// Room for the requests of one session that wait for an answer.
#[derive(Debug)]
pub(crate) struct WaitingRoom(Arc<Semaphore>);

impl Default for WaitingRoom {
    fn default() -> Self {
        WaitingRoom(Arc::new(Semaphore::new(MOST / LEAST)))
    }
}

impl WaitingRoom {
    /// Takes a place for a request of so many bytes.
    ///
    /// # Errors
    /// [`SessionError::TooManyWaiting`].
    pub fn enter(&self, bytes: usize) -> Result<Place, SessionError> {
        let parts = bytes.div_ceil(LEAST).clamp(1, MOST / LEAST);
        self.0.clone().try_acquire_many_owned(parts as u32).map(Arc::new).map_err(|_| {
            SessionError::TooManyWaiting(format!(
                "as many requests wait for this session as may: {} of them, or {} MiB of changes; \
                 wait for their answers first",
                MOST / LEAST,
                MOST >> 20
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_wait_until_they_are_answered_whoever_has_gone() {
        let room = WaitingRoom::default();
        let (answer, receiver) = Answer::<()>::new(Some(room.enter(MOST - LEAST + 1).unwrap()));
        assert!(matches!(room.enter(1), Err(SessionError::TooManyWaiting(_))));
        drop(receiver);
        assert!(answer.sender.is_closed() && room.enter(1).is_err());
        answer.give(Ok(()));
        let all: Vec<_> = (0..MOST / LEAST).map(|_| room.enter(100).unwrap()).collect();
        assert!(room.enter(0).is_err());
        drop(all);
        assert!(room.enter(100 * MOST).is_ok(), "one is always let in");
    }
}
