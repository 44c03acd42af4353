//! Sessions that came back from a damaged file take no changes until an administrator unlocks them:
//! nobody knows whether they had been deleted.

use std::sync::Arc;

use firn_protocol::SessionView;

use crate::core::Control;
use crate::core::session::SessionError;
use crate::session::handle::Session;

impl Session {
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
