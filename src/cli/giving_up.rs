//! A server whose engine has failed for good ends, for a supervisor to start it again.

use tokio_util::sync::CancellationToken;

use crate::session::Sessions;

/// Why it ends.
pub const GAVE_UP: &str = "the engine has failed, and so has every attempt to start it anew: the lines above \
                           say why; what was acknowledged is stored: start the server again";

/// Begins to stop when the engine has failed for good.
pub async fn stop_on_giving_up(sessions: Sessions, shutdown: CancellationToken) {
    sessions.vitals().until_it_gives_up().await;
    shutdown.cancel();
}
