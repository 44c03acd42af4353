//! What Firn takes from the machine that it runs on and that is never the same twice: time, chance, and
//! threads for work on the side. A simulation brings a machine of its own for the thread that it runs on, on
//! which a seed tells all of it.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use ulid::Ulid;

/// Work on the side.
pub type Work = Box<dyn FnOnce() + Send>;

/// A machine that is simulated.
pub trait Simulated {
    /// The time of a clock that never goes back.
    fn now(&self) -> Instant;

    /// The time of a clock that people set.
    fn date(&self) -> SystemTime;

    /// Fills some bytes by chance.
    fn fill(&self, bytes: &mut [u8]);

    /// Takes work on the side.
    fn take(&self, work: Work);

    /// Lets others do something, and time pass: somebody waits.
    fn pass(&self);
}

// Of one thread: what others do, as those that work on many sessions at once, has the real machine.
thread_local! {
    static SIMULATED: RefCell<Option<Rc<dyn Simulated>>> = const { RefCell::new(None) };
}

fn simulated() -> Option<Rc<dyn Simulated>> {
    SIMULATED.with_borrow(Clone::clone)
}

/// Puts a machine under this thread until what is returned is dropped.
#[must_use]
pub fn simulate(machine: Rc<dyn Simulated>) -> Guard {
    Guard(SIMULATED.replace(Some(machine)))
}

/// Puts the machine from before back when it is dropped.
pub struct Guard(Option<Rc<dyn Simulated>>);

impl Drop for Guard {
    fn drop(&mut self) {
        SIMULATED.set(self.0.take());
    }
}

/// The time of a clock that never goes back.
pub fn now() -> Instant {
    simulated().map_or_else(Instant::now, |machine| machine.now())
}

/// Time that has passed since then.
pub fn since(then: Instant) -> Duration {
    now().saturating_duration_since(then)
}

/// The time of a clock that people set.
pub fn date() -> SystemTime {
    simulated().map_or_else(SystemTime::now, |machine| machine.date())
}

/// Fills some bytes by chance.
///
/// # Errors
/// Where the operating system has no random numbers.
pub fn fill(bytes: &mut [u8]) -> Result<(), getrandom::Error> {
    match simulated() {
        Some(machine) => {
            machine.fill(bytes);
            Ok(())
        }
        None => getrandom::fill(bytes),
    }
}

/// A new name that sorts by the time at which it was made.
pub fn ulid() -> Ulid {
    let Some(machine) = simulated() else { return Ulid::generate() };
    let mut chance = [0; 16];
    machine.fill(&mut chance);
    let since = machine.date().duration_since(UNIX_EPOCH).unwrap_or_default();
    Ulid::from_parts(since.as_millis() as u64, u128::from_le_bytes(chance))
}

/// Has something done beside everything else; `spawn` puts it on a thread.
pub fn aside(work: Work, spawn: impl FnOnce(Work)) {
    match simulated() {
        Some(machine) => machine.take(work),
        None => spawn(work),
    }
}

/// Waits for what comes out of a channel.
///
/// # Errors
/// Where nothing has come in time, or will ever come.
pub fn receive<T>(channel: &Receiver<T>, patience: Duration) -> Result<T, RecvTimeoutError> {
    let look = || match channel.try_recv() {
        Ok(received) => Some(Ok(received)),
        Err(TryRecvError::Disconnected) => Some(Err(RecvTimeoutError::Disconnected)),
        Err(TryRecvError::Empty) => None,
    };
    wait(now() + patience, look, || channel.recv_timeout(patience))
        .unwrap_or(Err(RecvTimeoutError::Timeout))
}

/// Lets others work. A simulated device calls this where a real one would keep the world waiting.
pub fn pass() {
    if let Some(machine) = simulated() {
        machine.pass();
    }
}

/// Waits up to some time for something that others do. On a simulated machine they do it while this looks for
/// it again and again; on a real one `block` waits by itself.
pub fn wait<T>(
    deadline: Instant,
    mut look: impl FnMut() -> Option<T>,
    block: impl FnOnce() -> T,
) -> Option<T> {
    let Some(machine) = simulated() else { return Some(block()) };
    loop {
        let found = look();
        if found.is_some() || machine.now() >= deadline {
            return found;
        }
        machine.pass();
    }
}
