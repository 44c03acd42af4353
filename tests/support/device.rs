//! A device that tests look at, or break.

use std::time::Duration;

use firn_engine::frame::{Backend, DeviceInfo, EngineError, Frame, Outcome, Slot};
use firn_engine::made::{Made, Maker};

/// What a test does with frames, beside what the device does.
pub trait Watch: Send {
    /// A frame is about to be submitted.
    fn submitted(&mut self, _frame: &Frame) -> Result<(), EngineError> {
        Ok(())
    }

    /// A frame is done. What it took may be told otherwise.
    fn done(&mut self, _outcome: &mut Outcome) {}
}

/// A device whose frames are watched.
pub struct Watched<W> {
    pub device: Box<dyn Backend + Send>,
    pub watch: W,
}

impl<W: Watch> Backend for Watched<W> {
    fn device(&self) -> &DeviceInfo {
        self.device.device()
    }

    fn maker(&self) -> Maker {
        self.device.maker()
    }

    fn take_in(&mut self, slot: Slot, made: Made) -> Result<u64, EngineError> {
        self.device.take_in(slot, made)
    }

    fn release(&mut self, slot: Slot) {
        self.device.release(slot);
    }

    fn submit(&mut self, frame: Frame) -> Result<(), EngineError> {
        self.watch.submitted(&frame)?;
        self.device.submit(frame)
    }

    fn poll(&mut self, patience: Duration) -> Result<Option<Outcome>, EngineError> {
        let mut outcome = self.device.poll(patience)?;
        if let Some(outcome) = &mut outcome {
            self.watch.done(outcome);
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
