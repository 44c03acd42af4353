//! A device that fails when it is told to.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use firn::driver::OpenBackend;
use firn::machine;
use firn_engine::cpu::CpuBackend;
use firn_engine::frame::{Backend, DeviceInfo, EngineError, Frame, Outcome, Slot};
use firn_engine::made::{Made, Maker};

/// How devices fail. Clones are the same.
#[derive(Clone, Debug, Default)]
pub struct Switches(Arc<Flags>);

#[derive(Debug, Default)]
struct Flags {
    lost: AtomicBool,
    full: AtomicBool,
    absent: AtomicBool,
    panics: AtomicBool,
}

impl Switches {
    /// The device is lost with its next frame.
    pub fn lose(&self) {
        self.0.lost.store(true, Ordering::Relaxed);
    }

    /// Submitting the next frame panics.
    pub fn panic(&self) {
        self.0.panics.store(true, Ordering::Relaxed);
    }

    /// Whether it has no memory left.
    pub fn set_full(&self, full: bool) {
        self.0.full.store(full, Ordering::Relaxed);
    }

    /// Whether it can't be opened.
    pub fn set_absent(&self, absent: bool) {
        self.0.absent.store(absent, Ordering::Relaxed);
    }

    /// Nothing fails any more.
    pub fn heal(&self) {
        for flag in [&self.0.lost, &self.0.full, &self.0.absent, &self.0.panics] {
            flag.store(false, Ordering::Relaxed);
        }
    }

    /// What opens such a device.
    pub fn open(&self) -> OpenBackend {
        let switches = self.clone();
        Box::new(move || {
            if switches.0.absent.load(Ordering::Relaxed) {
                return Err(EngineError::DeviceFailed("it is not there".to_owned()));
            }
            let device = CpuBackend::new(None, false);
            Ok(Box::new(Device { device, switches: switches.clone(), frames: 0 }) as _)
        })
    }
}

struct Device {
    device: CpuBackend,
    switches: Switches,
    frames: u64,
}

/// Every how many frames others work while the device does: the journal may fail in the middle of one.
const OTHERS_WORK: u64 = 3;

/// Every how many frames the device takes long: the journal may fail and be whole again in the middle of one.
const LONG: u64 = 17;

/// How long, in turns of the others.
const TURNS: usize = 80;

impl Backend for Device {
    fn device(&self) -> &DeviceInfo {
        self.device.device()
    }

    fn maker(&self) -> Maker {
        self.device.maker()
    }

    fn take_in(&mut self, slot: Slot, made: Made) -> Result<u64, EngineError> {
        if self.switches.0.full.load(Ordering::Relaxed) {
            return Err(EngineError::OutOfMemory("it is full".to_owned()));
        }
        self.device.take_in(slot, made)
    }

    fn release(&mut self, slot: Slot) {
        self.device.release(slot);
    }

    fn submit(&mut self, frame: Frame) -> Result<(), EngineError> {
        let flags = &self.switches.0;
        assert!(!flags.panics.swap(false, Ordering::Relaxed), "a simulated panic");
        if flags.lost.swap(false, Ordering::Relaxed) {
            return Err(EngineError::DeviceFailed("it is lost".to_owned()));
        }
        self.device.submit(frame)
    }

    fn poll(&mut self, patience: Duration) -> Result<Option<Outcome>, EngineError> {
        self.frames += 1;
        if self.frames.is_multiple_of(OTHERS_WORK) {
            machine::pass();
        }
        if self.frames.is_multiple_of(LONG) {
            (0..TURNS).for_each(|_| machine::pass());
        }
        let mut outcome = self.device.poll(patience)?;
        if let Some(outcome) = &mut outcome {
            // The same on every machine.
            let units: u64 = outcome.work.iter().map(|work| work.units).sum();
            outcome.took = Duration::from_nanos(20 * units);
        }
        Ok(outcome)
    }

    fn memory(&self) -> u64 {
        self.device.memory()
    }

    fn lose(&mut self) {
        self.device.lose();
    }
}
