//! The reference columns behind the same frames as the GPU's: for machines without an adapter, and
//! for tests that compare the two.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use super::frame::{
    BYTES_PER_CELL, Backend, DeviceInfo, Edit, EngineError, Frame, Layout, Outcome, Slot,
    TileCells, Work, WorkOutcome,
};
use super::published::{Published, TileColumns};
use crate::snow::{Column, Grid, Snowpack, TILE_COLUMNS};

/// Bytes of what is kept for each column besides its slots.
const BYTES_PER_COLUMN: u64 = 8;

/// Steps snowpacks on the CPU.
///
/// A frame is carried out when it is submitted; its outcome waits to be polled.
#[derive(Debug)]
pub struct CpuBackend {
    device: DeviceInfo,
    snowpacks: HashMap<Slot, Snowpack>,
    outcomes: VecDeque<Outcome>,
    memory: u64,
    memory_budget: Option<u64>,
    always_awake: bool,
    lost: bool,
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

    /// Carries out one snowpack's part of a frame.
    fn work(&mut self, work: Work, tiles: &mut Tiles) -> Result<WorkOutcome, EngineError> {
        let slot = work.slot;
        let snowpack = self.snowpacks.get_mut(&slot).ok_or_else(|| {
            EngineError::DeviceFailed(format!("a frame has work for slot {slot}, which is empty"))
        })?;
        // What is restored is left as it was saved.
        let edited = work.edits.last().is_some_and(|edit| !matches!(edit, Edit::Restore(_)));
        let mut put = false;
        let mut edits = Vec::with_capacity(work.edits.len());
        for edit in work.edits {
            // The depth an object sinks counts from where it was put, not from later snow.
            if put && matches!(edit, Edit::Deposit(_) | Edit::Clear { .. }) {
                snowpack.evaluate();
                put = false;
            }
            put |= matches!(edit, Edit::PutCollider { .. });
            edits.push(apply(snowpack, edit));
        }
        if work.wake {
            snowpack.wake();
        }
        if edited && work.run.cycles == 0 {
            snowpack.evaluate();
        }
        let mut outcome = WorkOutcome {
            slot,
            edits,
            last_change: snowpack.run(work.run.cycles, work.run.dt),
            ..WorkOutcome::default()
        };
        if work.publish {
            outcome.active_tiles = snowpack.active_tiles();
            outcome.contacts = snowpack.contacts().map(|(id, c)| (id.clone(), *c)).collect();
            let first = tiles.numbered;
            tiles.numbered += snowpack.grid().tiles();
            outcome.tiles = first..tiles.numbered;
            tiles.changed.extend(snowpack.take_dirty().map(|(tile, h)| (first + tile, h)));
        }
        if work.tally {
            outcome.mass = snowpack.mass();
        }
        let height = snowpack.grid().height;
        outcome.gathered =
            work.gather.iter().map(|&tile| tile_cells(snowpack.tile(tile), height)).collect();
        outcome.samples = work
            .samples
            .iter()
            .map(|wanted| snowpack.sample(wanted.columns, wanted.y0, wanted.height, wanted.dt))
            .collect();
        Ok(outcome)
    }
}

impl Backend for CpuBackend {
    fn device(&self) -> &DeviceInfo {
        &self.device
    }

    fn create(&mut self, slot: Slot, layout: &Layout) -> Result<(), EngineError> {
        let needed = bytes(&layout.grid);
        if let Some(allowed) = self.memory_budget
            && needed > allowed.saturating_sub(self.memory)
        {
            return Err(EngineError::OutOfMemory(format!(
                "the snowpack needs {needed} bytes; {} of the {allowed} allowed are held already",
                self.memory
            )));
        }
        self.release(slot);
        let snowpack =
            Snowpack::new(layout.grid, layout.material, &layout.ground, self.always_awake);
        self.snowpacks.insert(slot, snowpack);
        self.memory += needed;
        Ok(())
    }

    fn release(&mut self, slot: Slot) {
        if let Some(snowpack) = self.snowpacks.remove(&slot) {
            self.memory -= bytes(snowpack.grid());
        }
    }

    fn submit(&mut self, frame: Frame) -> Result<(), EngineError> {
        if self.lost {
            return Err(EngineError::DeviceFailed("the device was lost".to_owned()));
        }
        let mut outcome = Outcome::default();
        let mut tiles = Tiles::default();
        for work in frame.work {
            let done = self.work(work, &mut tiles)?;
            outcome.work.push(done);
        }
        outcome.published = Published::from_tiles(tiles.changed.into_iter());
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

/// Applies a change; returns the mass quanta that it refused or removed.
fn apply(snowpack: &mut Snowpack, edit: Edit) -> u64 {
    match edit {
        Edit::Deposit(fall) => {
            return snowpack.deposit(fall.columns, fall.depth, fall.mass, fall.temperature);
        }
        Edit::Clear { columns, depth } => return snowpack.clear(columns, depth),
        Edit::PutCollider { id, collider, placed } => {
            snowpack.put_collider(id, collider.mass, collider.footprint.clone(), placed);
        }
        Edit::RemoveCollider { id } => snowpack.remove_collider(&id),
        Edit::SetMaterial(material) => snowpack.set_material(material),
        Edit::Restore(contents) => {
            for (tile, cells) in (0..).zip(contents.tiles.iter()) {
                let columns = (0..TILE_COLUMNS).map(|column| cells.column(column).collect());
                snowpack.restore_tile(tile, columns.map(|cells| Column { cells }));
            }
            let colliders = contents.colliders.iter().map(|(id, placement, contact)| {
                (id.clone(), placement.mass, placement.footprint.clone(), *contact)
            });
            snowpack.restore_colliders(colliders);
        }
    }
    0
}

/// A tile's cells, slot by slot; without columns, all of them empty.
fn tile_cells(columns: Option<&[Column]>, height: u32) -> TileCells {
    let mut cells = TileCells::empty(height);
    for (index, column) in columns.unwrap_or_default().iter().enumerate() {
        for (slot, cell) in column.cells.iter().enumerate() {
            let at = slot * TILE_COLUMNS as usize + index;
            cells.mass[at] = cell.mass;
            cells.thickness[at] = cell.thickness;
            cells.temperature[at] = cell.temperature;
            cells.stress[at] = cell.stress;
        }
    }
    cells
}

/// Bytes that a snowpack of whole tiles takes.
fn bytes(grid: &Grid) -> u64 {
    let column = u64::from(grid.height) * BYTES_PER_CELL + BYTES_PER_COLUMN;
    u64::from(grid.tiles()) * u64::from(TILE_COLUMNS) * column
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::frame::{Deposit, Run};
    use crate::snow::{CELL, ColumnRect, Material};

    fn layout(width: u32, depth: u32) -> Layout {
        let grid = Grid { width, depth, height: 4, cell_size: 0.2 };
        Layout { grid, material: Material::default(), ground: Vec::new() }
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
        let tile = 64 * (4 * 16 + 8);
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
