//! A machine whose time and chance a seed tells.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant, SystemTime};

use firn::driver::ManualJournal;
use firn::machine::{Simulated, Work};
use rand::rngs::SmallRng;
use rand::{Rng, RngCore, SeedableRng};

/// Time that passes while somebody waits.
const WAIT: Duration = Duration::from_millis(5);

/// Waits in one step, of which there are never so many.
const MOST_PASSES: u64 = 100_000;

/// When people's clocks begin.
const BEGINNING: Duration = Duration::from_secs(1_800_000_000);

/// Who works beside the world.
#[derive(Clone, Copy, Debug)]
pub enum Worker {
    /// Commits what the world hands over.
    Commits,
    /// Makes checkpoints of snapshots.
    Packs,
    /// Reads what is stored, and does what else takes long.
    Reads,
}

impl Worker {
    /// All of them.
    pub const ALL: [Worker; 3] = [Worker::Commits, Worker::Packs, Worker::Reads];
}

/// The journal of the life that the server is in.
pub type Journal = Rc<RefCell<Option<ManualJournal>>>;

/// One thread, on which everything happens in an order that a seed tells.
pub struct Machine {
    began: Instant,
    passed: Cell<Duration>,
    /// How far people's clocks are ahead of that \[s\].
    ahead: Cell<i64>,
    dice: RefCell<SmallRng>,
    aside: RefCell<VecDeque<Work>>,
    journal: Journal,
    /// How often somebody has waited in this step.
    passes: Cell<u64>,
    /// Until when each worker gets no time.
    stalled: [Cell<Duration>; 3],
}

impl Machine {
    /// A machine that has just been switched on.
    pub fn new(seed: u64) -> Machine {
        Machine {
            began: Instant::now(),
            passed: Cell::default(),
            ahead: Cell::default(),
            dice: RefCell::new(SmallRng::seed_from_u64(seed)),
            aside: RefCell::default(),
            journal: Journal::default(),
            passes: Cell::default(),
            stalled: Default::default(),
        }
    }

    /// Where the journal is put that works while others wait.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Lets time pass.
    pub fn advance(&self, time: Duration) {
        self.passed.set(self.passed.get() + time);
    }

    /// Sets people's clocks.
    pub fn set_date(&self, ahead: i64) {
        self.ahead.set(ahead);
    }

    /// Does what was put aside first, if anything was.
    pub fn read(&self) {
        let work = self.aside.borrow_mut().pop_front();
        if let Some(work) = work {
            work();
        }
    }

    /// Has a worker get no time for a while.
    pub fn stall(&self, worker: Worker, time: Duration) {
        self.stalled[worker as usize].set(self.passed.get() + time);
    }

    /// Whether a worker gets time.
    pub fn works(&self, worker: Worker) -> bool {
        self.passed.get() >= self.stalled[worker as usize].get()
    }

    /// All workers get time again.
    pub fn heal(&self) {
        self.stalled.iter().for_each(|stalled| stalled.set(Duration::ZERO));
    }

    /// A step begins.
    pub fn begin(&self) {
        self.passes.set(0);
    }

    /// Puts other work aside, in place of what is there.
    pub fn swap(&self, aside: VecDeque<Work>) -> VecDeque<Work> {
        self.aside.replace(aside)
    }

    /// Forgets what was put aside: the process is dead.
    pub fn forget(&self) {
        self.aside.borrow_mut().clear();
    }
}

impl Simulated for Machine {
    fn now(&self) -> Instant {
        self.began + self.passed.get()
    }

    fn date(&self) -> SystemTime {
        let people = SystemTime::UNIX_EPOCH + BEGINNING + self.passed.get();
        match self.ahead.get() {
            ahead @ 0.. => people + Duration::from_secs(ahead as u64),
            behind => people - Duration::from_secs(behind.unsigned_abs()),
        }
    }

    fn fill(&self, bytes: &mut [u8]) {
        self.dice.borrow_mut().fill_bytes(bytes);
    }

    fn take(&self, work: Work) {
        self.aside.borrow_mut().push_back(work);
    }

    fn pass(&self) {
        self.passes.set(self.passes.get() + 1);
        assert!(self.passes.get() < MOST_PASSES, "somebody waits for ever");
        self.advance(WAIT);
        if self.works(Worker::Reads) {
            self.read();
        }
        // Where the journal itself waits it is at work already.
        if let Ok(mut journal) = self.journal.try_borrow_mut()
            && let Some(journal) = journal.as_mut()
        {
            if self.works(Worker::Packs) && self.dice.borrow_mut().random_bool(0.5) {
                journal.pack();
            }
            if self.works(Worker::Commits) {
                journal.commit();
            }
        }
    }
}
