//! Who is with a session: a request under way, or a stream.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::clock::FRAME_RATE;
use super::handle::Session;

/// Somebody who is with a session. As long as there is anybody, it is not idle; nor is it before its
/// timeouts have passed since the last one left.
#[derive(Debug)]
pub struct Visit(Arc<Session>);

impl Visit {
    pub(super) fn begin(session: Arc<Session>) -> Visit {
        // Either the world sees this visit before the session hibernates, or the visitor sees that it does.
        session.visitors.fetch_add(1, Ordering::SeqCst);
        session.touch();
        Visit(session)
    }
}

impl Deref for Visit {
    type Target = Arc<Session>;

    fn deref(&self) -> &Arc<Session> {
        &self.0
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        self.0.touch();
        self.0.visitors.fetch_sub(1, Ordering::Release);
    }
}

impl Session {
    /// Notes that somebody wants the session now.
    fn touch(&self) {
        self.last_used.store(self.frame(), Ordering::Relaxed);
    }

    /// Seconds since anybody was with it: 0 while somebody is.
    pub(super) fn idle_for(&self) -> f64 {
        // Whoever has left has noted when.
        if self.visitors.load(Ordering::SeqCst) > 0 {
            return 0.0;
        }
        let frames = self.frame().saturating_sub(self.last_used.load(Ordering::Relaxed));
        frames as f64 / FRAME_RATE
    }
}
