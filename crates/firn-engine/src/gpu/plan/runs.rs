//! Cycles: all at once where nothing stands on the snow, one by one under objects.

use std::collections::{BTreeMap, BTreeSet};

use firn_snow::{Pressing, REFERENCE_CELL_SIZE};

use crate::frame::{self, Work};
use crate::gpu::due::Due;
use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{
    ALWAYS_AWAKE, BACKWARDS, EDITED, LoadJob, PARTED, PUBLISH, Pass, Run, UNDER_OBJECTS, WAKE,
};
use crate::gpu::resident::{Resident, Residents};
use crate::gpu::survey::Totals;

use super::{Dispatch, Planner};

/// Tiles that the host lists at the most, whether they are awake or not.
pub const FEW_TILES: usize = 512;

/// Objects and the tiles under them, on the snowpacks that run: those with the most cycles first, so
/// that each cycle concerns the first of every list.
struct Loaded {
    /// First of the objects, and the cycles of each.
    first: u32,
    objects: Vec<u32>,
    /// Tiles of each page.
    tiles: Vec<LoadedTiles>,
    /// What a cycle of them takes.
    kernels: Vec<KernelId>,
    /// Contacts and stresses of the first cycle have been evaluated after edits.
    known: bool,
}

/// Tiles of one page under objects.
struct LoadedTiles {
    page: u32,
    /// First of the jobs that evaluate their stress.
    first: u32,
    /// Cycles and number of each.
    tiles: Vec<(u32, u32)>,
}

impl Planner<'_> {
    /// Says what the snowpacks do in this frame; `parted` are the runs of those of which a part is done,
    /// by their places among the work.
    pub fn set_runs(
        &mut self,
        work: &[Work],
        parted: &BTreeMap<usize, frame::Run>,
        always_awake: bool,
    ) {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let run = |(tally, work): (u32, &Work)| {
            let part = parted.get(&(tally as usize));
            let flags = flag(work.wake, WAKE)
                | flag(work.publish, PUBLISH)
                | flag(self.evaluated.contains(&work.slot), EDITED)
                | flag(always_awake, ALWAYS_AWAKE)
                | flag(part.is_some(), PARTED);
            let frame::Run { cycles, dt } = *part.unwrap_or(&work.run);
            let (rate, press) = compaction_in(dt, work.pressing);
            (work.slot, Run { cycles, flags, rate, tally, press })
        };
        self.tables.runs.set((0..).zip(work).map(run));
    }

    /// Plans the cycles of all snowpacks. `loaded` has the work on all snowpacks with objects.
    pub fn runs<'w>(
        &mut self,
        residents: &Residents,
        work: &[Work],
        loaded: impl Iterator<Item = &'w Work>,
        totals: &Totals,
    ) {
        let loaded = self.loaded(residents, loaded);
        if let Some(loaded) = loaded.as_ref().filter(|loaded| !loaded.known) {
            self.press(loaded, 0);
        }
        if !totals.wakes && (totals.running <= FEW_TILES || are_few(residents, work)) {
            self.listed_runs(residents, work, totals);
        } else {
            self.scheduled_runs(totals);
        }
        self.press_first(residents, work);
        if let Some(loaded) = loaded {
            self.later_cycles(&loaded);
        }
    }

    /// Plans the first cycle on tiles under objects where those press; elsewhere it is like that of all others.
    fn press_first(&mut self, residents: &Residents, work: &[Work]) {
        let mut pages: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for work in
            work.iter().filter(|work| work.run.cycles > 0 && work.pressing != Pressing::Creep)
        {
            let Some(resident) = residents.get(work.slot) else { continue };
            for &tile in resident.loads.keys() {
                let tiles = pages.entry(resident.page(tile)).or_default();
                tiles.push(resident.lot.tiles.start + tile);
            }
        }
        self.compact_listed(KernelId::Press, pages, Pass::default());
    }

    /// Has a kernel go through lists of tiles, by their pages.
    pub(super) fn compact_listed(
        &mut self,
        kernel: KernelId,
        pages: BTreeMap<u32, Vec<u32>>,
        pass: Pass,
    ) {
        for (page, tiles) in pages {
            let count = tiles.len() as u32;
            let length = self.tables.due.list(tiles);
            self.dispatch(kernel, page, Pass { first: length + 1, count, length, ..pass }, count);
        }
    }

    /// Due tiles that are awake, listed by the device.
    fn scheduled_runs(&mut self, totals: &Totals) {
        let tile_end = self.arena.tile_end();
        let pass = Pass { count: tile_end, ..Pass::default() };
        self.dispatch(KernelId::Schedule, 0, pass, tile_end.div_ceil(64));
        for part in self.parts(totals.cycles) {
            let flags = if *self.turns % 2 == 1 { BACKWARDS } else { 0 };
            *self.turns = self.turns.wrapping_add(1);
            for page in self.arena.pages.cleared() {
                let (first, length) = (self.tables.due.first_of(page), Due::length_of(page));
                let pass = Pass { first, length, flags, ..part };
                let kernel = KernelId::Compact;
                self.dispatches.push(Dispatch { kernel, page, pass, groups: None });
            }
        }
    }

    /// The parts that a number of cycles is dispatched in: one is enough.
    fn parts(&self, cycles: u32) -> Vec<Pass> {
        if self.one_by_one {
            return (0..cycles).map(|cycle| Pass { cycle, cycles: 1, ..Pass::default() }).collect();
        }
        vec![Pass { cycles: u32::MAX, ..Pass::default() }]
    }

    /// All due tiles that may be awake, listed by the host: where they are few, that is faster than to ask the
    /// device which of them are.
    fn listed_runs(&mut self, residents: &Residents, work: &[Work], totals: &Totals) {
        let mut lists: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for work in work.iter().filter(|work| work.run.cycles > 0) {
            let Some(resident) = residents.get(work.slot) else { continue };
            for tile in resident.free().chain(resident.loads.keys().copied()) {
                let list = lists.entry(resident.page(tile));
                let list = list.or_insert_with(|| Vec::with_capacity(FEW_TILES));
                list.push(resident.lot.tiles.start + tile);
            }
        }
        let parts = self.parts(totals.cycles);
        for (page, tiles) in lists {
            let count = tiles.len() as u32;
            let length = self.tables.due.list(tiles);
            for &part in &parts {
                let pass = Pass { first: length + 1, length, ..part };
                self.dispatch(KernelId::Compact, page, pass, count);
            }
        }
    }

    /// Adds the objects of the snowpacks that run to the tables, and jobs for the tiles under them.
    fn loaded<'w>(
        &mut self,
        residents: &Residents,
        work: impl Iterator<Item = &'w Work>,
    ) -> Option<Loaded> {
        let mut running: Vec<(&Work, &Resident)> = work
            .filter(|work| work.run.cycles > 0)
            .filter_map(|work| Some((work, residents.get(work.slot)?)))
            .filter(|(_, resident)| !resident.bodies.is_empty())
            .collect();
        running.sort_by_key(|(work, _)| (std::cmp::Reverse(work.run.cycles), work.slot));
        let known = running.iter().all(|(work, _)| self.evaluated.contains(&work.slot));
        if running.first().is_none_or(|(work, _)| known && work.run.cycles == 1) {
            return None;
        }
        let first = self.tables.orders.colliders.len();
        let mut objects = Vec::new();
        let mut pages: BTreeMap<u32, Vec<(u32, LoadJob)>> = BTreeMap::new();
        for &(work, resident) in &running {
            let (mut own, cycles) = (Vec::new(), work.run.cycles);
            let first = self.collider_rows(work.slot, resident, true);
            self.load_jobs(first, resident, resident.loads.keys().copied(), &mut own);
            objects.extend(std::iter::repeat_n(cycles, resident.body_rows()));
            for (page, job) in own {
                pages.entry(page).or_default().push((cycles, job));
            }
        }
        let tiles = |(page, jobs): (u32, Vec<(u32, LoadJob)>)| {
            let first = self.tables.orders.load_jobs.len();
            self.tables.orders.load_jobs.extend(jobs.iter().map(|(_, job)| *job));
            let tiles = jobs.into_iter().map(|(cycles, job)| (cycles, job.tile)).collect();
            LoadedTiles { page, first, tiles }
        };
        let tiles = pages.into_iter().map(tiles).collect();
        let kernels: BTreeSet<KernelId> =
            running.iter().map(|(work, _)| compaction_of(work.pressing)).collect();
        let kernels = kernels.into_iter().collect();
        Some(Loaded { first, objects, tiles, kernels, known })
    }

    /// Has contacts and stresses evaluated before a cycle.
    fn press(&mut self, loaded: &Loaded, cycle: u32) {
        let count = loaded.objects.partition_point(|&cycles| cycles > cycle) as u32;
        let contact = Pass { first: loaded.first, count, cycle, ..Pass::default() };
        self.dispatch(KernelId::Contact, 0, contact, count);
        for tiles in &loaded.tiles {
            let count = tiles.with_cycle(cycle);
            let stress = Pass { first: tiles.first, count, cycle, ..Pass::default() };
            self.dispatch(KernelId::Stress, tiles.page, stress, count);
        }
    }

    /// Plans the cycles after the first on tiles under objects.
    fn later_cycles(&mut self, loaded: &Loaded) {
        let most = loaded.objects.first().copied().unwrap_or(0);
        if most < 2 {
            return;
        }
        let list = |tiles: &LoadedTiles| {
            let tiles = tiles.tiles[..tiles.with_cycle(1) as usize].iter();
            self.tables.due.list(tiles.map(|&(_, tile)| tile))
        };
        let lists: Vec<u32> = loaded.tiles.iter().map(list).collect();
        for cycle in 1..most {
            self.press(loaded, cycle);
            for (tiles, &length) in loaded.tiles.iter().zip(&lists) {
                let (first, count) = (length + 1, tiles.with_cycle(cycle));
                let flags = UNDER_OBJECTS;
                let pass =
                    Pass { first, count, length, cycle, cycles: 1, flags, ..Pass::default() };
                for &kernel in &loaded.kernels {
                    self.dispatch(kernel, tiles.page, pass, count);
                }
            }
        }
    }
}

/// What compacts tiles under objects.
pub(super) fn compaction_of(pressing: Pressing) -> KernelId {
    match pressing {
        Pressing::Creep => KernelId::Compact,
        Pressing::Within(_) => KernelId::Press,
    }
}

/// What kernels are told of a cycle of so many seconds: its rate, and by how much loads press in it at the most.
pub(super) fn compaction_in(dt: f64, pressing: Pressing) -> (f32, u32) {
    ((dt / REFERENCE_CELL_SIZE) as f32, pressing.step(dt).unwrap_or(0))
}

/// Whether the tiles that may be awake are so few that the host lists them.
fn are_few(residents: &Residents, work: &[Work]) -> bool {
    let running = work.iter().filter(|work| work.run.cycles > 0);
    let residents = running.filter_map(|work| residents.get(work.slot));
    let mut counts = residents.map(|resident| resident.most_free() + resident.loads.len());
    // Of thousands only the first are looked at.
    counts.try_fold(0, |sum, count| Some(sum + count).filter(|sum| *sum <= FEW_TILES)).is_some()
}

impl LoadedTiles {
    /// How many of them have a cycle.
    fn with_cycle(&self, cycle: u32) -> u32 {
        self.tiles.partition_point(|&(cycles, _)| cycles > cycle) as u32
    }
}
