//! Signals that ask the server to stop, or to read its files again.

use std::io;

#[cfg(unix)]
use tokio::signal::unix::{Signal, SignalKind, signal};
#[cfg(windows)]
use tokio::signal::windows::{CtrlC, ctrl_c};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::http::{self, App};

/// The signals to stop that arrive from when it was made; none of them ends the process any more.
#[derive(Debug)]
pub struct Signals {
    #[cfg(unix)]
    terminate: Signal,
    #[cfg(unix)]
    interrupt: Signal,
    #[cfg(windows)]
    interrupt: CtrlC,
}

impl Signals {
    /// Begins to take signals in; inside of a runtime.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn new() -> io::Result<Signals> {
        Ok(Signals {
            #[cfg(unix)]
            terminate: signal(SignalKind::terminate())?,
            #[cfg(unix)]
            interrupt: signal(SignalKind::interrupt())?,
            #[cfg(windows)]
            interrupt: ctrl_c()?,
        })
    }

    /// Waits for the next one.
    pub async fn next(&mut self) {
        #[cfg(unix)]
        tokio::select! {
            _ = self.terminate.recv() => {}
            _ = self.interrupt.recv() => {}
        }
        #[cfg(windows)]
        self.interrupt.recv().await;
    }
}

/// The signals to read files again that arrive from when it was made; none of them ends the process
/// any more.
#[cfg(unix)]
#[derive(Debug)]
pub struct Hangups(Signal);

#[cfg(unix)]
impl Hangups {
    /// Begins to take signals in; inside of a runtime.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn new() -> io::Result<Hangups> {
        signal(SignalKind::hangup()).map(Hangups)
    }

    /// Waits for the next one.
    pub async fn next(&mut self) {
        self.0.recv().await;
    }
}

/// Other systems have no such signal.
#[cfg(not(unix))]
#[derive(Debug)]
pub struct Hangups;

#[cfg(not(unix))]
impl Hangups {
    /// Nothing to take in.
    ///
    /// # Errors
    /// None.
    pub fn new() -> io::Result<Hangups> {
        Ok(Hangups)
    }

    /// Waits for ever.
    pub async fn next(&mut self) {
        std::future::pending().await
    }
}

/// Reads keys and certificates again on each signal.
pub async fn reload_on_signal(hangups: Option<Hangups>, app: App) {
    let Some(mut hangups) = hangups else { return };
    loop {
        hangups.next().await;
        let app = app.clone();
        let reloaded = tokio::task::spawn_blocking(move || http::reload(&app)).await;
        if let Err(failure) = reloaded {
            warn!("reading files again failed: {failure}");
        }
    }
}

/// Begins to stop on the first signal, and ends the process on the second.
pub async fn stop_on_signal(mut signals: Signals, shutdown: CancellationToken) {
    signals.next().await;
    info!("stopping: finishing what is under way");
    shutdown.cancel();
    signals.next().await;
    warn!("stopped at once by a second signal");
    std::process::exit(1);
}
