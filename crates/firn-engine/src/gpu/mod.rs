//! All snowpacks of the process in one arena on the GPU, stepped by the same few dispatches.

mod arena;
mod buffer;
pub mod device;
mod due;
mod encode;
mod furnish;
mod job;
pub mod kernels;
pub mod layout;
mod mapped;
mod orders;
mod pages;
mod plan;
mod profile;
mod ranges;
mod readback;
mod report;
mod resident;
mod results;
mod runs;
mod sections;
pub mod stopwatch;
mod survey;
mod tables;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, Instant};

use super::frame::{Backend, DeviceInfo, EngineError, Frame, Outcome, Slot, WorkOutcome};
use super::made::{Kind, Made, Maker};
use arena::Arena;
use device::{Device, Purpose};

pub use device::{Failures, REQUIRED_FEATURES, required_limits};
use job::Flown;
use kernels::{KERNELS, KernelId, Pipeline};
use profile::Profile;
use readback::Readback;
use resident::{Resident, Residents};
use tables::Tables;

/// Units of memory that is cleared when a snowpack is made; where it is more, frames clear it.
const FURNISHED_AT_ONCE: u64 = 1 << 18;

/// The arena and its kernels on one device.
#[derive(Debug)]
pub struct GpuBackend {
    device: Device,
    pipelines: Vec<Pipeline>,
    arena: Arena,
    tables: Tables,
    residents: Residents,
    readback: Readback,
    outcomes: VecDeque<Outcome>,
    /// When the frame in flight was submitted.
    submitted: Instant,
    /// Parts of work in the frame in flight, by their places in it.
    flown: BTreeMap<usize, Flown>,
    /// Places of the work in it in which objects move, with 1 + the last cycle in which one does.
    moved: Vec<(usize, u32)>,
    /// Cycles of each work in it, those of a part's whole work where it is one.
    cycles: Vec<u32>,
    always_awake: bool,
    one_by_one: bool,
    turns: u32,
    profile: Option<Profile>,
}

impl GpuBackend {
    /// Opens the best adapter and compiles the kernels. Snowpacks may take no more than
    /// `memory_budget` bytes, and no tile sleeps where they are to be `always_awake`, which makes
    /// no difference to any result.
    ///
    /// # Errors
    /// [`EngineError::NoAdapter`], and [`EngineError::DeviceFailed`] where a kernel does not
    /// compile.
    pub fn new(memory_budget: Option<u64>, always_awake: bool) -> Result<GpuBackend, EngineError> {
        GpuBackend::on(Device::open(Purpose::Step)?, memory_budget, always_awake)
    }

    /// Compiles the kernels on a device that belongs to somebody else, such as a game that draws with it.
    /// It has to be opened with [`REQUIRED_FEATURES`] and at least [`required_limits`]. Snowpacks may take
    /// no more than `memory_budget` bytes.
    ///
    /// The owner keeps the device's callbacks: errors of Firn's own calls do not reach them, and what they
    /// are told can be passed on to [`GpuBackend::failures`]. The first failure is for good: a backend whose
    /// device has failed is to be dropped, and another made.
    ///
    /// [`Backend::submit`] waits until the frame before has been read back. In a render loop, look for the
    /// outcome with [`Backend::poll`] and no patience, and submit once it is there.
    ///
    /// # Errors
    /// [`EngineError::NoAdapter`] where the device was opened with less, and
    /// [`EngineError::DeviceFailed`] where a kernel does not compile.
    pub fn with_device(
        device: wgpu::Device,
        queue: wgpu::Queue,
        memory_budget: Option<u64>,
    ) -> Result<GpuBackend, EngineError> {
        GpuBackend::on(Device::of(device, queue)?, memory_budget, false)
    }

    fn on(
        device: Device,
        memory_budget: Option<u64>,
        always_awake: bool,
    ) -> Result<GpuBackend, EngineError> {
        let scope = device.scope();
        let pipelines = KERNELS.iter().map(|kernel| kernel.pipeline(&device.device)).collect();
        let arena = Arena::new(&device, memory_budget.unwrap_or(u64::MAX));
        let tables = Tables::new(&device);
        let readback = Readback::new(&device);
        drop(scope);
        device.check()?;
        Ok(GpuBackend {
            device,
            pipelines,
            arena,
            tables,
            residents: Residents::default(),
            readback,
            outcomes: VecDeque::new(),
            submitted: Instant::now(),
            flown: BTreeMap::new(),
            moved: Vec::new(),
            cycles: Vec::new(),
            always_awake,
            one_by_one: false,
            turns: 0,
            profile: None,
        })
    }

    /// Where failures of the device are noted; the owner of one may do so too.
    pub fn failures(&self) -> Failures {
        self.device.failures()
    }

    /// Says whether every cycle of a run is to be a dispatch of its own, as the cycles of snow under
    /// objects are. The results are the same.
    pub fn run_one_by_one(&mut self, one_by_one: bool) {
        self.one_by_one = one_by_one;
    }

    /// Takes the time of every kernel from now on, which makes frames a little slower. Returns
    /// whether the adapter can.
    pub fn take_times(&mut self) -> bool {
        self.take_times_of_one_in(1)
    }

    /// Takes the time of every kernel of one frame in `frames`, which is at least 1. Returns whether
    /// the adapter can.
    pub fn take_times_of_one_in(&mut self, frames: u32) -> bool {
        let _scope = self.device.scope();
        self.profile = Profile::new(&self.device, frames);
        self.profile.is_some()
    }

    /// The kernels of the newest frame in their order, each with the time that it took on the
    /// device, those of its dispatches that followed each other together, where times are taken. The
    /// frame's outcome has to be polled before.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    pub fn kernel_times(&self) -> Result<Vec<(KernelId, Duration)>, EngineError> {
        self.profile.as_ref().map_or(Ok(Vec::new()), |profile| profile.kernels(&self.device))
    }

    /// Fills all memory that no snowpack owns with rubbish, to show that none is ever read.
    pub fn poison(&mut self) {
        let _scope = self.device.scope();
        self.arena.poison(&self.device);
    }
}

impl Backend for GpuBackend {
    fn device(&self) -> &DeviceInfo {
        &self.device.info
    }

    fn maker(&self) -> Maker {
        Maker::Rows
    }

    fn take_in(&mut self, slot: Slot, made: Made) -> Result<u64, EngineError> {
        let Made { layout, kind: Kind::Rows } = made else {
            return Err(EngineError::DeviceFailed("a snowpack was made for another".to_owned()));
        };
        let scope = self.device.scope();
        let lot = self.arena.take(&self.device, slot, &layout)?;
        let unfurnished = self.arena.begin_to_furnish(&lot);
        let units = self.arena.units_to_furnish(&lot, &unfurnished);
        let mut resident = Resident::new(lot, layout, unfurnished);
        if self.always_awake {
            resident.awake = None;
        }
        if units <= FURNISHED_AT_ONCE {
            self.arena.furnish(&self.device, &mut resident, u64::MAX);
        }
        self.tables.set_session(&self.device, slot, &resident.row);
        let left = if resident.unfurnished.is_some() { units } else { 0 };
        self.residents.insert(slot, resident);
        drop(scope);
        self.device.check()?;
        Ok(left)
    }

    fn release(&mut self, slot: Slot) {
        if let Some(resident) = self.residents.remove(slot) {
            let scope = self.device.scope();
            self.tables.forget_bodies(resident.bodies.values());
            self.arena.give_back(&self.device, resident.lot);
            // Bindings hold the buffers of pages that were released.
            self.tables.fit_to(&self.device, &self.arena);
            // Callbacks of the device's owner may run in a poll, and its errors are not ours.
            drop(scope);
            // A failure shows at the next submit.
            let _ = self.device.device.poll(wgpu::PollType::Poll);
        }
    }

    fn submit(&mut self, frame: Frame) -> Result<(), EngineError> {
        // The tables of a frame are read back from before the next one writes them.
        while !self.readback.is_idle() {
            self.fetch(Duration::from_millis(100))?;
        }
        self.submitted = Instant::now();
        let scope = self.device.scope();
        self.carry_out(frame)?;
        drop(scope);
        self.device.check()
    }

    fn poll(&mut self, patience: Duration) -> Result<Option<Outcome>, EngineError> {
        let deadline = Instant::now() + patience;
        while self.outcomes.is_empty() && !self.readback.is_idle() {
            let left = deadline.saturating_duration_since(Instant::now());
            if !self.fetch(left)? {
                break;
            }
        }
        Ok(self.outcomes.pop_front())
    }

    fn memory(&self) -> u64 {
        self.arena.memory()
    }

    fn stage_times(&self) -> Result<Vec<(&'static str, Duration)>, EngineError> {
        let times = self.kernel_times()?;
        Ok(times.into_iter().map(|(kernel, time)| (KERNELS[kernel as usize].name, time)).collect())
    }

    fn lose(&mut self) {
        self.device.device.destroy();
    }
}

impl GpuBackend {
    /// Takes in the outcome of the frame in flight, waiting for it no longer than `patience`.
    /// Returns whether it has arrived.
    fn fetch(&mut self, patience: Duration) -> Result<bool, EngineError> {
        let arrived = self.readback.fetch(&self.device, &self.arena, &self.tables, patience);
        self.device.check()?;
        match arrived? {
            Some((mut outcome, awake)) => {
                outcome.took = self.submitted.elapsed();
                for (place, until) in std::mem::take(&mut self.moved) {
                    let own = &mut outcome.work[place];
                    own.last_change = own.last_change.max(until);
                }
                for (place, flown) in std::mem::take(&mut self.flown) {
                    self.take_in(&mut outcome.work[place], &flown);
                }
                self.note_rest(&outcome.work);
                for (slot, awake) in awake {
                    self.note_awake(slot, awake);
                }
                self.outcomes.push_back(outcome);
                Ok(true)
            }
            None => Ok(false),
        }
    }

    /// Notes of which snowpacks all tiles are at rest: those in which the last cycle changed nothing.
    fn note_rest(&mut self, outcomes: &[WorkOutcome]) {
        let cycles = std::mem::take(&mut self.cycles);
        for (outcome, cycles) in outcomes.iter().zip(&cycles) {
            if outcome.last_change < *cycles && !outcome.unfinished {
                self.note_awake(outcome.slot, Some(BTreeSet::new()));
            }
        }
    }

    /// Notes which tiles of a snowpack may be awake.
    fn note_awake(&mut self, slot: Slot, awake: Option<BTreeSet<u32>>) {
        if let Some(resident) = self.residents.get_mut(slot)
            && !self.always_awake
        {
            resident.awake = awake;
        }
    }

    /// Takes in what came of a part of some work.
    fn take_in(&mut self, outcome: &mut WorkOutcome, flown: &Flown) {
        let Some(resident) = self.residents.get_mut(outcome.slot) else { return };
        let Some(mut job) = resident.job.take() else { return };
        *outcome = job.take_in(flown, std::mem::take(outcome));
        if outcome.unfinished {
            resident.job = Some(job);
        }
    }
}
