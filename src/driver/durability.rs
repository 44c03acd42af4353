//! How sessions outlive a failure, and the process.

use std::time::Duration;

use firn_engine::frame::{Backend, EngineError};

use crate::store::{Ephemeral, Store, StoreError};

/// Opens the device anew.
pub type OpenBackend = Box<dyn FnMut() -> Result<Box<dyn Backend + Send>, EngineError> + Send>;

/// How sessions outlive a failure, and the process.
#[derive(Debug)]
pub struct Durability {
    /// Where changes and checkpoints are kept.
    pub store: Box<dyn Store>,
    /// Time after a change until a checkpoint is due.
    pub checkpoint_interval: Duration,
    /// Whether to begin empty where a damaged store holds no session that is whole.
    pub accept_loss: bool,
}

impl Durability {
    /// Time after a change until a checkpoint is due, usually.
    pub const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);

    /// Nothing outlives the process.
    pub fn ephemeral() -> Durability {
        Durability {
            store: Box::new(Ephemeral),
            checkpoint_interval: Durability::CHECKPOINT_INTERVAL,
            accept_loss: false,
        }
    }
}

/// Why the world could not be started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The operating system refuses a thread.
    #[error("starting the engine: {0}")]
    Thread(#[from] std::io::Error),
    /// The device can't be used.
    #[error("{0}")]
    Device(#[from] EngineError),
    /// What is stored can't be read.
    #[error("reading what is stored: {0}")]
    Store(#[from] StoreError),
    /// What was stored is lost, and nobody has said that this is accepted.
    #[error(
        "{0}, and no session in it is whole; nothing was changed: put a backup in its place, or begin \
         empty with --accept-loss, which keeps the damaged file beside the new one"
    )]
    Lost(String),
}
