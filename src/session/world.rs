//! The thread that owns the device and every snowpack on it.
//!
//! Requests reach it through a bounded channel, each with a channel for its answer. It works in
//! frames: it takes in what has arrived, submits one frame for all sessions that have something to
//! do, waits for its outcome, publishes and answers. Ticks fall on a beat of 60 frames a second;
//! frames between beats carry out requests at once.

mod engine;
mod requests;
mod simulations;
mod slots;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Instant;

use tokio::sync::mpsc;
use tracing::error;

use crate::engine::frame::Backend;

use super::message::Message;
use super::pace::Pace;
use super::registry::{Names, Sessions};
use super::spec::Limits;
use super::vitals::Vitals;
use engine::Engine;
use simulations::Simulations;
use slots::Slots;

/// Requests that may wait for the next frame before senders have to.
const INBOX: usize = 4096;

/// How the world works.
#[derive(Clone, Copy, Debug)]
pub struct WorldConfig {
    /// Limits of what the server holds.
    pub limits: Limits,
    /// Publications per second \[Hz\], beside those that requests ask for; at most 60.
    pub publish_rate: f64,
    /// Whether snow at rest is left alone. It makes no difference to any result.
    pub sleep: bool,
}

/// The running world. Dropping it leaves the thread running; [`World::stop`] ends it.
#[derive(Debug)]
pub struct World {
    inbox: mpsc::Sender<Message>,
    thread: JoinHandle<()>,
}

impl World {
    /// Starts the world's thread on a backend.
    ///
    /// # Errors
    /// Where the operating system refuses a thread.
    pub fn start(
        backend: Box<dyn Backend + Send>,
        config: WorldConfig,
    ) -> std::io::Result<(Sessions, World)> {
        let (send, inbox) = mpsc::channel(INBOX);
        let names = Arc::new(Names::default());
        let frames = Arc::new(AtomicU64::new(0));
        let vitals = Arc::new(Vitals::new(backend.device().clone(), backend.memory()));
        let sessions = Sessions::new(
            names.clone(),
            send.clone(),
            vitals.clone(),
            frames.clone(),
            config.limits,
        );
        // The runtime only waits: for a request or for the next beat, whatever comes first.
        let clock = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
        let mut engine = Engine {
            backend,
            config,
            inbox,
            clock,
            names,
            vitals: vitals.clone(),
            frames,
            frame: 0,
            full: false,
            next_inspection: 0,
            next_beat: Instant::now(),
            pace: Pace::default(),
            simulations: Simulations::default(),
            busy: false,
            slots: Slots::default(),
        };
        let thread = std::thread::Builder::new().name("world".to_owned()).spawn(move || {
            let end = catch_unwind(AssertUnwindSafe(|| engine.run()));
            vitals.healthy.store(false, Ordering::Relaxed);
            match end {
                Ok(Ok(())) => {}
                Ok(Err(failure)) => error!("{failure}; all sessions are lost"),
                Err(_) => error!("the engine panicked; all sessions are lost"),
            }
        })?;
        Ok((sessions, World { inbox: send, thread }))
    }

    /// Ends the thread after the frame under way.
    pub fn stop(self) {
        // It may have ended by itself.
        let _ = self.inbox.blocking_send(Message::Stop);
        let _ = self.thread.join();
    }
}
