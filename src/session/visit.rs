//! Who is with a session: a request under way, or a stream.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use crate::session::handle::Session;

/// Somebody who is with a session. As long as there is anybody, it is not idle; nor is it before its
/// timeouts have passed since the last one left.
#[derive(Debug)]
pub struct Visit(Arc<Session>);

impl Visit {
    pub(crate) fn begin(session: Arc<Session>) -> Visit {
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
