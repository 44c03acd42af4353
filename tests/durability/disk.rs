//! A disk that fails in all the ways that disks do.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, ErrorKind};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use firn::driver::Durability;
use firn::store::RedbStore;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use redb::{Builder, StorageBackend};

/// Bytes that a disk writes whole or not at all.
const SECTOR: usize = 512;

/// How a disk fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failing {
    /// Nothing new can be written.
    Full,
    /// Nothing can be written at all.
    ReadOnly,
    /// What was written is there, but nobody can say for how long.
    NoSync,
    /// As before, for one sync.
    NoSyncOnce,
    /// Whoever writes panics.
    Panic,
}

/// A disk with one file. Clones are the same.
#[derive(Clone, Debug, Default)]
pub struct Disk(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    /// As it is read.
    bytes: Vec<u8>,
    /// As it is after a power cut, if nothing of the rest has reached the disk.
    synced: Vec<u8>,
    unsynced: Vec<Operation>,
    failing: Option<Failing>,
    /// How long it takes to sync.
    delay: Duration,
    /// Of all operations so far.
    fingerprint: DefaultHasher,
    /// Operations until the power fails, and what tells what is left then.
    until_cut: Option<(u64, u64)>,
    /// What was left.
    left: Option<Disk>,
}

#[derive(Debug, Hash)]
enum Operation {
    Write(u64, Vec<u8>),
    Length(u64),
}

impl Operation {
    fn apply(&self, bytes: &mut Vec<u8>) {
        match self {
            Operation::Write(at, data) => {
                let (at, end) = (*at as usize, *at as usize + data.len());
                if bytes.len() < end {
                    bytes.resize(end, 0);
                }
                bytes[at..end].copy_from_slice(data);
            }
            Operation::Length(length) => bytes.resize(*length as usize, 0),
        }
    }
}

impl State {
    fn cut(&self, seed: u64) -> Disk {
        let mut dice = SmallRng::seed_from_u64(seed);
        let mut bytes = self.synced.clone();
        for operation in &self.unsynced {
            match operation {
                Operation::Length(_) if dice.random_bool(0.5) => operation.apply(&mut bytes),
                Operation::Length(_) => {}
                Operation::Write(at, data) => {
                    for (i, sector) in data.chunks(SECTOR).enumerate() {
                        if dice.random_bool(0.5) {
                            let at = at + (i * SECTOR) as u64;
                            Operation::Write(at, sector.to_vec()).apply(&mut bytes);
                        }
                    }
                }
            }
        }
        let synced = bytes.clone();
        let fingerprint = self.fingerprint.clone();
        Disk(Arc::new(Mutex::new(State { bytes, synced, fingerprint, ..State::default() })))
    }

    /// An operation is about to be done.
    fn count(&mut self) {
        match &mut self.until_cut {
            Some((0, seed)) => {
                let seed = *seed;
                self.until_cut = None;
                self.left = Some(self.cut(seed));
            }
            Some((operations, _)) => *operations -= 1,
            None => {}
        }
    }
}

impl Disk {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// A store on it.
    pub fn durability(&self, checkpoint_interval: Duration) -> Durability {
        let disk = self.clone();
        let open = move |check| {
            let mut builder = Builder::new();
            builder.set_check_integrity_on_open(check).create_with_backend(disk.clone())
        };
        let store = RedbStore::with(Box::new(open)).expect("the disk holds a database");
        Durability { store: Box::new(store), checkpoint_interval, accept_loss: false }
    }

    /// Makes it fail from now on, or no longer.
    pub fn fail(&self, failing: Option<Failing>) {
        self.state().failing = failing;
    }

    /// Makes it take some time for every sync from now on.
    #[allow(dead_code, reason = "a simulation has other ways to let time pass")]
    pub fn slow_down(&self, delay: Duration) {
        self.state().delay = delay;
    }

    /// What is on it after a power cut: all that was synced, and of the rest any sectors.
    pub fn cut(&self, seed: u64) -> Disk {
        self.state().cut(seed)
    }

    /// Has the power fail before one of the coming operations; `None` for no longer.
    #[allow(dead_code, reason = "a process can't be killed by its own disk")]
    pub fn cut_at(&self, operation_and_seed: Option<(u64, u64)>) {
        self.state().until_cut = operation_and_seed;
    }

    /// What is on it after that, where it has happened.
    #[allow(dead_code, reason = "as above")]
    pub fn left(&self) -> Option<Disk> {
        self.state().left.take()
    }

    /// A hash of all that was done to it.
    #[allow(dead_code, reason = "only in a simulation is it the same twice")]
    pub fn fingerprint(&self) -> u64 {
        self.state().fingerprint.finish()
    }

    fn change(&self, operation: Operation) -> io::Result<()> {
        self.state().count();
        let failing = self.state().failing;
        match failing {
            Some(Failing::Full) => return Err(ErrorKind::StorageFull.into()),
            Some(Failing::ReadOnly) => return Err(ErrorKind::ReadOnlyFilesystem.into()),
            Some(Failing::Panic) => panic!("the disk has no manners"),
            Some(Failing::NoSync | Failing::NoSyncOnce) | None => {}
        }
        let mut state = self.state();
        operation.apply(&mut state.bytes);
        operation.hash(&mut state.fingerprint);
        state.unsynced.push(operation);
        Ok(())
    }
}

impl StorageBackend for Disk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.state().bytes.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let state = self.state();
        let (at, end) = (offset as usize, offset as usize + out.len());
        let found = state.bytes.get(at..end).ok_or(ErrorKind::UnexpectedEof)?;
        out.copy_from_slice(found);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.change(Operation::Length(len))
    }

    fn sync_data(&self) -> io::Result<()> {
        let delay = self.state().delay;
        std::thread::sleep(delay);
        let mut state = self.state();
        state.count();
        if state.failing.is_some() {
            state.failing = state.failing.filter(|&failing| failing != Failing::NoSyncOnce);
            return Err(io::Error::other("the disk does not answer"));
        }
        let State { synced, unsynced, .. } = &mut *state;
        unsynced.drain(..).for_each(|operation| operation.apply(synced));
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.change(Operation::Write(offset, data.to_vec()))
    }
}
