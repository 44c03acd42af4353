//! What is asked of the store beside commits: what an administrator asks of it as a whole, and restore points, which
//! are read when somebody wants them.
//!
//! The thread that commits takes a moment of the store, which takes no time, and another thread reads it. Only
//! compaction needs the file for itself, and changes wait for it.

use std::fs::File;
use std::io::{self, Read};
use std::sync::{Arc, Weak, mpsc};

use firn_protocol::{CompactReply, VerifyReply};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

use super::check::verify;
use super::handle::Task;
use super::rows::point_row;
use crate::core::session::SessionError;
use crate::store::{Compacted, Moment, Row, Store, StoreError};
use crate::threads::{self, Priority};

type Reply<T> = oneshot::Sender<Result<T, StoreError>>;

/// What the thread that commits does between two commits.
pub(super) enum Errand {
    Moment(Reply<Moment>),
    Compact(Reply<Compacted>),
    Read(Row, Reply<Option<Vec<u8>>>),
}

impl Errand {
    /// Does it. Nobody may wait for it any more.
    pub fn run(self, store: &mut dyn Store) {
        match self {
            Errand::Moment(reply) => drop(reply.send(store.moment())),
            Errand::Read(row, reply) => drop(reply.send(store.read(row))),
            Errand::Compact(reply) => drop(reply.send(store.compact())),
        }
    }
}

/// Asks for what concerns the store as a whole, one thing at a time. Clones are handles to the same.
#[derive(Clone, Debug, Default)]
pub struct StoreKeeper(Option<Kept>);

#[derive(Clone, Debug)]
struct Kept {
    /// Weak, so that the thread that commits ends with the journal.
    tasks: Weak<mpsc::Sender<Task>>,
    turn: Arc<Semaphore>,
}

/// A copy of the store, to be sent: a file that is gone when this is dropped.
#[derive(Debug)]
pub struct Backup {
    file: File,
    /// Its length.
    pub bytes: u64,
    _turn: OwnedSemaphorePermit,
}

impl Read for Backup {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.file.read(buffer)
    }
}

impl StoreKeeper {
    /// What asks through a journal; of a server that keeps nothing where there is none.
    pub(super) fn of(tasks: Option<&Arc<mpsc::Sender<Task>>>) -> StoreKeeper {
        StoreKeeper(
            tasks.map(|tasks| Kept {
                tasks: Arc::downgrade(tasks),
                turn: Arc::new(Semaphore::new(1)),
            }),
        )
    }

    /// Copies the store as it is at one moment.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] where nothing is kept, and while something else is done to the store,
    /// [`SessionError::Unavailable`] while the server stops, and [`SessionError::Internal`] where the
    /// store can't be read or the copy can't be written.
    pub async fn backup(&self) -> Result<Backup, SessionError> {
        let (tasks, turn) = self.begin()?;
        let moment = ask(tasks, Errand::Moment).await?;
        beside("backup", turn, move |turn| {
            let file = moment.copy();
            drop(moment);
            let file = file?;
            let length = file.metadata().map_err(|error| StoreError::Failed(error.to_string()))?;
            Ok(Backup { file, bytes: length.len(), _turn: turn })
        })
        .await
    }

    /// Reads all of the store as it is at one moment, and says what is wrong.
    ///
    /// # Errors
    /// As [`StoreKeeper::backup`].
    pub async fn verify(&self) -> Result<VerifyReply, SessionError> {
        let (tasks, turn) = self.begin()?;
        let moment = ask(tasks, Errand::Moment).await?;
        beside("verify", turn, move |_turn| {
            let verified = moment.check_memory().and_then(|()| verify(&moment));
            drop(moment);
            verified
        })
        .await
    }

    /// Gives unused pages of the file back. Changes wait until that is done.
    ///
    /// # Errors
    /// As [`StoreKeeper::backup`].
    pub async fn compact(&self) -> Result<CompactReply, SessionError> {
        let (tasks, turn) = self.begin()?;
        // It goes on where the client goes away.
        let compacted = tokio::spawn(async move {
            let compacted = ask(tasks, Errand::Compact).await;
            drop(turn);
            compacted
        });
        let Compacted { before, after } = compacted.await.map_err(|_| ended())??;
        Ok(CompactReply { bytes_before: before, bytes_after: after })
    }

    /// The snapshot of a session's restore point; `None` where it is no more.
    ///
    /// # Errors
    /// [`SessionError::Unavailable`] while the server stops, and [`SessionError::Internal`] where the store
    /// can't be read.
    pub(crate) async fn restore_point(
        &self,
        session: u64,
        number: u64,
    ) -> Result<Option<Vec<u8>>, SessionError> {
        let tasks = self.0.as_ref().and_then(|kept| kept.tasks.upgrade()).ok_or_else(ended)?;
        ask(tasks, |reply| Errand::Read(point_row(session, number), reply)).await
    }

    fn begin(&self) -> Result<(Arc<mpsc::Sender<Task>>, OwnedSemaphorePermit), SessionError> {
        let nothing = || {
            let why =
                "there is no store: this server was started with --ephemeral, and keeps nothing";
            SessionError::Conflict(why.to_owned())
        };
        let Kept { tasks, turn } = self.0.as_ref().ok_or_else(nothing)?;
        let busy = |_| {
            let why = "the store is being backed up, verified or compacted already; these are done one at a \
                       time: try again when that has ended";
            SessionError::Conflict(why.to_owned())
        };
        let turn = turn.clone().try_acquire_owned().map_err(busy)?;
        Ok((tasks.upgrade().ok_or_else(ended)?, turn))
    }
}

/// Has the thread that commits do something.
async fn ask<T>(
    tasks: Arc<mpsc::Sender<Task>>,
    errand: impl FnOnce(Reply<T>) -> Errand,
) -> Result<T, SessionError> {
    let (reply, done) = oneshot::channel();
    // Where the thread has ended, the reply is dropped.
    let _ = tasks.send(Task::Errand(errand(reply)));
    drop(tasks);
    done.await.map_err(|_| ended())?.map_err(unusable)
}

/// Does something on a thread of its own, which gives way to all others. It goes on where nobody waits for it any
/// more, and has its turn until then.
async fn beside<T: Send + 'static>(
    name: &str,
    turn: OwnedSemaphorePermit,
    work: impl FnOnce(OwnedSemaphorePermit) -> Result<T, StoreError> + Send + 'static,
) -> Result<T, SessionError> {
    let (send, done) = oneshot::channel();
    let run = move || {
        threads::give_way(Priority::Low);
        drop(send.send(work(turn)));
    };
    let spawned = std::thread::Builder::new().name(name.to_owned()).spawn(run);
    spawned.map_err(|error| SessionError::Unavailable(format!("no thread for it: {error}")))?;
    let failed =
        |_| SessionError::Internal("reading the store panicked; the log says more".to_owned());
    done.await.map_err(failed)?.map_err(unusable)
}

fn ended() -> SessionError {
    SessionError::Unavailable("the server is stopping, or can't store changes any more".to_owned())
}

fn unusable(error: StoreError) -> SessionError {
    match error {
        StoreError::Gone(why) => SessionError::StorageGone(why),
        StoreError::Failed(why) | StoreError::InUse(why) => SessionError::Internal(why),
    }
}
