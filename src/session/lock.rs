//! Sessions that came back from a damaged file take no changes until an administrator unlocks them:
//! nobody knows whether they had been deleted.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use firn_protocol::SessionView;

use super::error::SessionError;
use super::handle::Session;
use super::world::Control;

impl Session {
    /// Whether it takes no changes.
    pub fn is_locked(&self) -> bool {
        self.locked.load(Ordering::Relaxed)
    }

    /// Whether it takes changes.
    ///
    /// # Errors
    /// [`SessionError::Locked`].
    pub fn check_unlocked(&self) -> Result<(), SessionError> {
        if !self.is_locked() {
            return Ok(());
        }
        Err(SessionError::Locked(format!(
            "the session '{id}' may have been deleted, as the store was damaged or a deletion was cut \
             off: it takes no changes until an administrator says that it is as it should be, by \
             POST /v1/sessions/{id}/unlock, or deletes it",
            id = self.id
        )))
    }

    pub(super) fn set_locked(&self, locked: bool) {
        self.locked.store(locked, Ordering::Relaxed);
    }

    /// Has it take changes again. When this returns that is durable.
    ///
    /// # Errors
    /// [`SessionError::StorageFailed`]; it stays locked then.
    pub async fn unlock(self: &Arc<Self>) -> Result<SessionView, SessionError> {
        if self.is_locked() {
            self.control(Control::Unlock).await?;
        }
        Ok(self.view())
    }
}
