//! A device of which is written down what it does.

use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use firn::backend;
use firn::config::{BackendChoice, EngineConfig};
use firn::driver::Durability;
use firn_engine::frame::{Backend, EngineError, Frame, Outcome, Slot, Work, WorkOutcome};

use crate::support::device::{Watch, Watched};
use crate::support::wait::until;
use crate::support::{Options, Server};

/// What one session did in a frame.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub slot: Slot,
    pub limit: Option<u64>,
    pub units: u64,
    pub unfinished: bool,
}

/// What was done, frame by frame.
#[derive(Clone, Debug, Default)]
pub struct Log(Arc<Mutex<Vec<Vec<Part>>>>, Arc<Gate>);

/// Holds a frame when it is about to be submitted.
#[derive(Debug, Default)]
struct Gate {
    /// Whether frames are to be held, and whether one is.
    state: Mutex<(bool, bool)>,
    opened: Condvar,
}

impl Gate {
    fn pass(&self) {
        let mut state = self.state.lock().unwrap();
        while state.0 {
            state.1 = true;
            state = self.opened.wait(state).unwrap();
        }
        state.1 = false;
    }
}

impl Log {
    /// Holds the next frame, which is planned already and is the last one in the log, until
    /// [`Log::let_go`].
    pub async fn hold(&self) {
        self.1.state.lock().unwrap().0 = true;
        until("a frame is held", async || self.1.state.lock().unwrap().1).await;
    }

    /// Lets the held frame go.
    pub fn let_go(&self) {
        self.1.state.lock().unwrap().0 = false;
        self.1.opened.notify_all();
    }

    /// The frames after so many.
    pub fn since(&self, frame: usize) -> Vec<Vec<Part>> {
        self.0.lock().unwrap()[frame..].to_vec()
    }

    /// How many frames there are.
    pub fn len(&self) -> usize {
        self.0.lock().unwrap().len()
    }
}

#[derive(Clone)]
struct Notes(Log);

/// Time for a unit.
const UNIT: Duration = Duration::from_nanos(20);

/// Starts a server on a device that takes a fixed time for each unit, and says so: what is much on one machine
/// is much on all, whatever else they do. Writes down what it does.
pub async fn start(backend: BackendChoice) -> (Server, Log) {
    let log = Log::default();
    let (engine, notes) = (EngineConfig { backend, device_memory: None }, Notes(log.clone()));
    let open = Box::new(move || {
        let (device, watch) = (backend::open(&engine)?, notes.clone());
        Ok(Box::new(Watched { device, watch }) as Box<dyn Backend + Send>)
    });
    (Server::start_on(open, Options::default(), Durability::ephemeral()).await, log)
}

impl Watch for Notes {
    fn submitted(&mut self, frame: &Frame) -> Result<(), EngineError> {
        let part =
            |work: &Work| Part { slot: work.slot, limit: work.limit, units: 0, unfinished: false };
        self.0.0.lock().unwrap().push(frame.work.iter().map(part).collect());
        self.0.1.pass();
        Ok(())
    }

    fn done(&mut self, outcome: &mut Outcome) {
        let units: u64 = outcome.work.iter().map(|work| work.units).sum();
        outcome.took = UNIT * u32::try_from(units).unwrap_or(u32::MAX);
        std::thread::sleep(outcome.took);
        let mut log = self.0.0.lock().unwrap();
        let done = |(part, work): (&mut Part, &WorkOutcome)| {
            (part.units, part.unfinished) = (work.units, work.unfinished);
        };
        log.last_mut().unwrap().iter_mut().zip(&outcome.work).for_each(done);
    }
}
