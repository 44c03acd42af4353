//! The thread that draws: pictures never wait in the frames of the snowpacks, nor the other way
//! round.
//!
//! The device is opened when the first picture is asked for, and closed when none has been for a
//! while.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use firn_engine::frame::EngineError;
use tokio::sync::oneshot;
use tracing::warn;

use crate::threads::{self, Priority};

use super::painter::{Painter, Shot};

/// Pictures that may wait while one is drawn.
const WAITING: usize = 8;

/// Time without a picture after which the device is closed.
const IDLE: Duration = Duration::from_secs(60);

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// Too many pictures are wanted at once.
    #[error("{WAITING} pictures are waiting to be drawn already")]
    Busy,
    /// The device, or what was asked of it, failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// Making the picture panicked.
    #[error("making the picture failed")]
    Panicked,
    /// The picture can't be written down.
    #[error("the picture can't be encoded: {0}")]
    Encoding(#[from] png::EncodingError),
}

/// Draws what it is given.
pub(super) trait Paint {
    /// The pixels, row by row: red, green, blue and alpha.
    fn paint(&mut self, shot: &Shot) -> Result<Vec<u8>, EngineError>;
}

type Open = dyn Fn() -> Result<Box<dyn Paint>, EngineError> + Send + Sync;
type Reply = oneshot::Sender<Result<Vec<u8>, RenderError>>;

/// Draws pictures, one after the other.
pub struct Renderer {
    open: Arc<Open>,
    worker: Mutex<Option<Worker>>,
}

struct Worker {
    inbox: SyncSender<(Shot, Reply)>,
    thread: JoinHandle<()>,
}

impl Default for Renderer {
    fn default() -> Self {
        Renderer::with(Arc::new(|| Ok(Box::new(Painter::open()?))))
    }
}

impl fmt::Debug for Renderer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Renderer").finish_non_exhaustive()
    }
}

impl Renderer {
    fn with(open: Arc<Open>) -> Renderer {
        Renderer { open, worker: Mutex::new(None) }
    }

    /// Draws; the pixels come row by row: red, green, blue and alpha.
    ///
    /// # Errors
    /// [`RenderError::Busy`] at once where too many wait, otherwise [`RenderError::Engine`].
    pub(super) async fn paint(&self, shot: Shot) -> Result<Vec<u8>, RenderError> {
        let (reply, answer) = oneshot::channel();
        self.send(shot, reply)?;
        answer.await.map_err(|_| failed("drawing panicked".to_owned()))?
    }

    fn send(&self, shot: Shot, reply: Reply) -> Result<(), RenderError> {
        let mut slot = self.worker.lock().unwrap_or_else(PoisonError::into_inner);
        let worker = match slot.take() {
            Some(worker) => worker,
            None => Worker::start(self.open.clone())
                .map_err(|error| failed(format!("no thread to draw on: {error}")))?,
        };
        let sent = worker.inbox.try_send((shot, reply));
        *slot = Some(worker);
        sent.map_err(|error| match error {
            TrySendError::Full(_) => RenderError::Busy,
            TrySendError::Disconnected(_) => failed("the thread that draws has ended".to_owned()),
        })
    }
}

impl Drop for Renderer {
    fn drop(&mut self) {
        let worker = self.worker.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(Worker { inbox, thread }) = worker {
            // A device must not be in use when the process ends.
            drop(inbox);
            let _ = thread.join();
        }
    }
}

fn failed(why: String) -> RenderError {
    RenderError::Engine(EngineError::DeviceFailed(why))
}

impl Worker {
    fn start(open: Arc<Open>) -> std::io::Result<Worker> {
        let (inbox, shots) = sync_channel(WAITING);
        let builder = std::thread::Builder::new().name("render".to_owned());
        let thread = builder.spawn(move || work(&shots, &*open))?;
        Ok(Worker { inbox, thread })
    }
}

/// Draws what arrives until nobody can ask for more.
fn work(shots: &Receiver<(Shot, Reply)>, open: &Open) {
    // So do the threads of a software device that it opens.
    threads::give_way(Priority::Low);
    let mut painter = None;
    loop {
        match shots.recv_timeout(IDLE) {
            // The client has gone away: nothing is drawn.
            Ok((_, reply)) if reply.is_closed() => {}
            Ok((shot, reply)) => {
                let drawn = catch_unwind(AssertUnwindSafe(|| draw(&mut painter, open, &shot)));
                let drawn = drawn.unwrap_or_else(|_| {
                    painter = None;
                    Err(EngineError::DeviceFailed("drawing panicked".to_owned()))
                });
                let _ = reply.send(drawn.map_err(RenderError::Engine));
            }
            Err(RecvTimeoutError::Timeout) => painter = None,
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Draws; a device that fails is opened anew, once.
fn draw(
    painter: &mut Option<Box<dyn Paint>>,
    open: &Open,
    shot: &Shot,
) -> Result<Vec<u8>, EngineError> {
    if let Some(open) = painter {
        match open.paint(shot) {
            Err(EngineError::DeviceFailed(why)) => {
                warn!("the device that draws failed: {why}; it is opened anew");
                *painter = None;
            }
            drawn => return drawn,
        }
    }
    let drawn = painter.insert(open()?).paint(shot);
    if matches!(drawn, Err(EngineError::DeviceFailed(_))) {
        *painter = None;
    }
    drawn
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::sync::mpsc;

    use super::*;
    use crate::render::{Picture, Snow, shoot};
    use crate::session::Ground;
    use firn_snow::{ColumnRect, Grid};

    fn shot() -> Shot {
        let region = ColumnRect { x0: 0, z0: 0, x1: 1, z1: 1 };
        let snow = Snow::from_depths((&Grid::default(), &Ground::level()), region, vec![0.0], &[]);
        shoot(&Picture::default(), &snow).0
    }

    /// Draws what a function says.
    struct Told<F>(F);

    impl<F: FnMut() -> Result<Vec<u8>, EngineError>> Paint for Told<F> {
        fn paint(&mut self, _shot: &Shot) -> Result<Vec<u8>, EngineError> {
            self.0()
        }
    }

    #[tokio::test]
    async fn too_many_pictures_at_once_are_refused_and_the_others_drawn() {
        let (go, gate) = mpsc::channel::<()>();
        let gate = Arc::new(Mutex::new(gate));
        let renderer = Renderer::with(Arc::new(move || {
            let gate = gate.clone();
            let wait = move || {
                gate.lock().unwrap().recv().unwrap();
                Ok(vec![7])
            };
            Ok(Box::new(Told(wait)))
        }));
        // One may have been taken out of the queue, so that as many wait, and one more is drawn.
        let asked: Vec<_> = (0..WAITING + 2)
            .map(|_| {
                let (reply, answer) = oneshot::channel();
                (renderer.send(shot(), reply), answer)
            })
            .collect();
        let refused = asked.iter().filter(|(sent, _)| matches!(sent, Err(RenderError::Busy)));
        let refused = refused.count();
        assert!((1..=2).contains(&refused), "{refused}");
        for _ in 0..WAITING + 2 - refused {
            go.send(()).unwrap();
        }
        for (sent, answer) in asked {
            if sent.is_ok() {
                assert_eq!(answer.await.unwrap().unwrap(), [7]);
            }
        }
    }

    #[tokio::test]
    async fn a_device_that_fails_is_opened_anew_once() {
        let opened = Arc::new(AtomicU32::new(0));
        let count = opened.clone();
        let renderer = Renderer::with(Arc::new(move || {
            let number = count.fetch_add(1, Ordering::Relaxed) + 1;
            let mut drawn = 0;
            let paint = move || {
                drawn += 1;
                // The first device is lost after a picture, the third one at once, the fourth
                // panics.
                match (number, drawn) {
                    (1, 2) | (3, 1) => Err(EngineError::DeviceFailed("lost".to_owned())),
                    (2, 2) => Err(EngineError::DeviceFailed("lost as well".to_owned())),
                    (4, 1) => panic!("while drawing"),
                    _ => Ok(vec![number as u8]),
                }
            };
            Ok(Box::new(Told(paint)))
        }));
        let draw = async || renderer.paint(shot()).await;
        assert_eq!(draw().await.unwrap(), [1]);
        assert_eq!(draw().await.unwrap(), [2], "drawn by a new device");
        let failed = draw().await.unwrap_err();
        assert!(matches!(&failed, RenderError::Engine(EngineError::DeviceFailed(_))), "{failed}");
        assert_eq!(opened.load(Ordering::Relaxed), 3);
        assert!(draw().await.unwrap_err().to_string().contains("panicked"));
        assert_eq!(draw().await.unwrap(), [5]);
    }

    #[tokio::test]
    async fn without_an_adapter_that_is_what_is_said() {
        let renderer =
            Renderer::with(Arc::new(|| Err(EngineError::NoAdapter("none here".to_owned()))));
        let failed = renderer.paint(shot()).await.unwrap_err();
        assert!(matches!(&failed, RenderError::Engine(EngineError::NoAdapter(_))), "{failed}");
    }
}
