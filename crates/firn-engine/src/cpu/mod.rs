//! The reference columns behind the same frames as the GPU's: for machines without an adapter, and
//! for tests that compare the two.

mod edit;
mod job;

use std::collections::{HashMap, VecDeque};
use std::time::{Duration, Instant};

use firn_snow::{Grid, Snowpack};

use super::frame::{
    Backend, DeviceInfo, EngineError, Frame, Outcome, Slot, Work, WorkOutcome, cell_bytes,
};
use super::made::{Kind, Made, Maker};
use super::published::{Published, TileColumns};
use job::Job;

/// Steps snowpacks on the CPU.
///
/// A frame is carried out when it is submitted; its outcome waits to be polled.
#[derive(Debug)]
pub struct CpuBackend {
    device: DeviceInfo,
    snowpacks: HashMap<Slot, Resident>,
    outcomes: VecDeque<Outcome>,
    memory: u64,
    memory_budget: Option<u64>,
    always_awake: bool,
    lost: bool,
}

/// A snowpack, and work of it that has begun and not ended.
#[derive(Debug)]
struct Resident {
    snowpack: Box<Snowpack>,
    job: Option<Job>,
}

/// Tiles of the snowpacks that publish in a frame.
#[derive(Debug, Default)]
struct Tiles {
    /// How many have been numbered.
    numbered: u32,
    /// Those that changed, by their numbers.
    changed: Vec<(u32, TileColumns)>,
}

impl CpuBackend {
    /// A backend without snowpacks, which holds no more than `memory_budget` bytes of them, and
    /// which lets no tile sleep where they are to be `always_awake`.
    pub fn new(memory_budget: Option<u64>, always_awake: bool) -> CpuBackend {
        CpuBackend {
            device: DeviceInfo { adapter: "cpu".into(), backend: "cpu".into() },
            snowpacks: HashMap::new(),
            outcomes: VecDeque::new(),
            memory: 0,
            memory_budget,
            always_awake,
            lost: false,
        }
    }

    /// Carries out one snowpack's part of a frame, or some of it.
    fn work(&mut self, work: Work, tiles: &mut Tiles) -> Result<WorkOutcome, EngineError> {
        let slot = work.slot;
        let resident = self.snowpacks.get_mut(&slot).ok_or_else(|| {
            EngineError::DeviceFailed(format!("a frame has work for slot {slot}, which is empty"))
        })?;
        let mut job = match resident.job.take() {
            Some(mut job) if work.resume => {
                job.resume(&work);
                job
            }
            _ => Job::new(work),
        };
        let snowpack = &mut resident.snowpack;
        if !job.go_on(snowpack) {
            let so_far = job.so_far();
            resident.job = Some(job);
            return Ok(so_far);
        }
        let (mut outcome, changed) = job.report(snowpack);
        let first = tiles.numbered;
        tiles.numbered += snowpack.grid().tiles();
        outcome.tiles = first..tiles.numbered;
        tiles.changed.extend(changed.into_iter().map(|(tile, heights)| (first + tile, heights)));
        Ok(outcome)
    }
}

impl Backend for CpuBackend {
    fn device(&self) -> &DeviceInfo {
        &self.device
    }

    fn maker(&self) -> Maker {
        Maker::Columns { always_awake: self.always_awake }
    }

    fn take_in(&mut self, slot: Slot, made: Made) -> Result<u64, EngineError> {
        let Kind::Columns(snowpack) = made.kind else {
            return Err(EngineError::DeviceFailed("a snowpack was made for another".to_owned()));
        };
        let needed = bytes(snowpack.grid());
        if let Some(allowed) = self.memory_budget
            && needed > allowed.saturating_sub(self.memory)
        {
            return Err(EngineError::OutOfMemory(format!(
                "the snowpack needs {needed} bytes; {} of the {allowed} allowed are held already",
                self.memory
            )));
        }
        self.release(slot);
        self.snowpacks.insert(slot, Resident { snowpack, job: None });
        self.memory += needed;
        Ok(0)
    }

    fn release(&mut self, slot: Slot) {
        if let Some(resident) = self.snowpacks.remove(&slot) {
            self.memory -= bytes(resident.snowpack.grid());
            // Millions of columns take a while.
            rayon::spawn(move || drop(resident));
        }
    }

    fn submit(&mut self, frame: Frame) -> Result<(), EngineError> {
        if self.lost {
            return Err(EngineError::DeviceFailed("the device was lost".to_owned()));
        }
        let begun = Instant::now();
        let mut outcome = Outcome::default();
        let mut tiles = Tiles::default();
        for work in frame.work {
            let done = self.work(work, &mut tiles)?;
            outcome.work.push(done);
        }
        outcome.published = Published::from_tiles(tiles.changed.into_iter());
        outcome.took = begun.elapsed();
        self.outcomes.push_back(outcome);
        Ok(())
    }

    fn poll(&mut self, _patience: Duration) -> Result<Option<Outcome>, EngineError> {
        Ok(self.outcomes.pop_front())
    }

    fn memory(&self) -> u64 {
        self.memory
    }

    fn lose(&mut self) {
        self.lost = true;
    }
}

/// Bytes that a snowpack of whole tiles takes.
fn bytes(grid: &Grid) -> u64 {
    cell_bytes(grid) + Snowpack::bytes(grid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Deposit, Edit, Layout, Run};
    use firn_snow::{CELL, ColumnRect, Material};

    fn layout(width: u32, depth: u32) -> Layout {
        let grid = Grid { width, depth, height: 4, cell_size: 0.2 };
        Layout { grid, material: Material::default(), ground: Default::default(), surface: None }
    }

    fn outcome(backend: &mut CpuBackend, work: Work) -> Outcome {
        backend.submit(Frame { work: vec![work] }).expect("the slot is taken");
        backend.poll(Duration::ZERO).expect("nothing fails").expect("the frame has been done")
    }

    #[test]
    fn a_frame_edits_runs_and_reports() {
        let mut backend = CpuBackend::new(None, false);
        backend.create(3, &layout(9, 2)).expect("there is room");
        let columns = ColumnRect { x0: 7, z0: 1, x1: 9, z1: 2 };
        let fall = Deposit { columns, depth: 5 * CELL, mass: 5 << 20, temperature: -3.0 };
        let edits = vec![Edit::Deposit(fall), Edit::Clear { columns, depth: 3 * CELL }];
        let run = Run { cycles: 2, dt: 0.25 };
        let work = Work {
            slot: 3,
            edits,
            run,
            publish: true,
            tally: true,
            gather: vec![1],
            ..Work::default()
        };
        let done = outcome(&mut backend, work);
        let own = &done.work[0];
        assert_eq!(
            own.edits,
            [2 << 20, 2 << 20],
            "one cell of each column is refused, one cleared"
        );
        assert_eq!((own.slot, own.mass, own.last_change), (3, 6 << 20, 0));
        let tiles: Vec<_> = done.published.tiles(own.tiles.clone()).collect();
        assert_eq!(tiles.len(), 2, "a new snowpack is reported whole");
        assert_eq!((tiles[1].0, tiles[1].1[8]), (1, 3 * CELL));
        let cells = &own.gathered[0];
        assert_eq!(cells.mass.len(), 4 * 64);
        assert_eq!([0, 8, 72, 136, 200].map(|i| cells.mass[i]), [0, 1 << 20, 1 << 20, 1 << 20, 0]);
        assert!((cells.stress[8] - 3.0 * 39.24).abs() < 0.01);

        let idle = outcome(&mut backend, Work { slot: 3, publish: true, ..Work::default() });
        assert!(idle.published.count() == 0, "nothing has changed since");
        assert!(backend.poll(Duration::ZERO).expect("nothing fails").is_none());
    }

    #[test]
    fn memory_beyond_the_budget_is_refused() {
        let tile = bytes(&layout(1, 1).grid);
        let mut backend = CpuBackend::new(Some(3 * tile), false);
        backend.create(0, &layout(9, 2)).expect("two tiles fit");
        assert_eq!(backend.memory(), 2 * tile);
        let refused = backend.create(1, &layout(9, 2)).expect_err("two more do not");
        assert!(matches!(refused, EngineError::OutOfMemory(_)), "{refused}");
        assert_eq!(backend.memory(), 2 * tile);
        backend.release(0);
        assert_eq!(backend.memory(), 0);
        backend.create(1, &layout(24, 1)).expect("three tiles fit now");
        let nobody = Frame { work: vec![Work::default()] };
        assert!(matches!(backend.submit(nobody), Err(EngineError::DeviceFailed(_))));
    }
}
