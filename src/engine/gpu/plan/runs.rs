//! Cycles: all at once where nothing stands on the snow, one by one under objects.

use std::collections::BTreeMap;

use crate::engine::frame::{Slot, Work};
use crate::engine::gpu::due::Due;
use crate::engine::gpu::kernels::KernelId;
use crate::engine::gpu::layout::{ALWAYS_AWAKE, EDITED, LoadJob, PUBLISH, Pass, Run, WAKE};
use crate::engine::gpu::resident::{Resident, Residents};
use crate::snow::REFERENCE_CELL_SIZE;

use super::{Dispatch, Planner};

/// Tiles that the host lists at the most, whether they are awake or not.
const FEW_TILES: usize = 512;

impl Planner<'_> {
    /// Plans the cycles of all snowpacks on tiles without objects, which run all of theirs at once.
    pub fn runs(
        &mut self,
        residents: &Residents,
        work: &[Work],
        running_tiles: usize,
        always_awake: bool,
    ) {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let run = |(tally, work): (u32, &Work)| {
            let flags = flag(work.wake, WAKE)
                | flag(work.publish, PUBLISH)
                | flag(self.evaluated.contains(&work.slot), EDITED)
                | flag(always_awake, ALWAYS_AWAKE);
            let rate = (work.run.dt / REFERENCE_CELL_SIZE) as f32;
            (work.slot, Run { cycles: work.run.cycles, flags, rate, tally })
        };
        self.tables.runs.set((0..).zip(work).map(run));
        let wakes = work.iter().any(|work| work.wake);
        if wakes || running_tiles > FEW_TILES {
            self.scheduled_runs(work);
        } else {
            self.listed_runs(residents, work, running_tiles);
        }
    }

    /// Tiles without objects, those that are due and awake listed by the device.
    fn scheduled_runs(&mut self, work: &[Work]) {
        let tile_end = self.arena.tile_end();
        let pass = Pass { count: tile_end, ..Pass::default() };
        self.dispatch(KernelId::Schedule, 0, pass, tile_end.div_ceil(64));
        let cycles = work.iter().map(|work| work.run.cycles).max().unwrap_or(0);
        for part in self.parts(cycles) {
            let backwards = *self.turns % 2;
            *self.turns = self.turns.wrapping_add(1);
            for (page, _) in (0..).zip(self.arena.pages.rows()).filter(|&(_, rows)| rows > 0) {
                let (first, length) = (self.tables.due.first_of(page), Due::length_of(page));
                let pass = Pass { first, length, backwards, ..part };
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

    /// Tiles without objects, all that are due listed by the host: where they are few, that is
    /// faster than to ask the device which of them are awake.
    fn listed_runs(&mut self, residents: &Residents, work: &[Work], count: usize) {
        let mut lists: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for work in work.iter().filter(|work| work.run.cycles > 0) {
            let Some(resident) = residents.get(work.slot) else { continue };
            for (tile, place) in (0..).zip(&resident.lot.places) {
                if !resident.loads.contains_key(&tile) {
                    let list = lists.entry(place.page).or_insert_with(|| Vec::with_capacity(count));
                    list.push(resident.lot.tiles.start + tile);
                }
            }
        }
        let cycles = work.iter().map(|work| work.run.cycles).max().unwrap_or(0);
        let parts = self.parts(cycles);
        for (page, tiles) in lists {
            let count = tiles.len() as u32;
            let length = self.tables.due.list(tiles);
            for &part in &parts {
                let pass = Pass { first: length + 1, length, ..part };
                self.dispatch(KernelId::Compact, page, pass, count);
            }
        }
    }

    /// Plans the cycles on tiles under objects: one after another, with contacts and stresses
    /// evaluated before each. `work` has all of the frame's on snowpacks with objects.
    pub fn loaded_runs<'w>(&mut self, residents: &Residents, work: impl Iterator<Item = &'w Work>) {
        let mut running: Vec<(u32, Slot, &Resident)> = work
            .filter(|work| work.run.cycles > 0)
            .filter_map(|work| Some((work.run.cycles, work.slot, residents.get(work.slot)?)))
            .filter(|(_, _, resident)| !resident.bodies.is_empty())
            .collect();
        // The longest first, so that each cycle concerns the first ones of every list.
        running.sort_by_key(|&(cycles, slot, _)| (std::cmp::Reverse(cycles), slot));
        let Some(&(most, _, _)) = running.first() else { return };

        let first_collider = self.tables.colliders.len();
        let mut colliders: Vec<u32> = Vec::new();
        let mut jobs: BTreeMap<u32, Vec<(u32, LoadJob)>> = BTreeMap::new();
        for &(cycles, slot, resident) in &running {
            let mut own = Vec::new();
            self.load_jobs(slot, resident, resident.loads.keys().copied(), &mut own);
            colliders.extend(std::iter::repeat_n(cycles, resident.bodies.len()));
            for (page, job) in own {
                jobs.entry(page).or_default().push((cycles, job));
            }
        }
        let mut lists = Vec::new();
        for (&page, jobs) in &jobs {
            let first_job = self.tables.load_jobs.len();
            self.tables.load_jobs.rows.extend(jobs.iter().map(|(_, job)| *job));
            let length = self.tables.due.list(jobs.iter().map(|(_, job)| job.tile));
            lists.push((page, first_job, length, jobs));
        }
        let edited = running.iter().all(|(_, slot, _)| self.evaluated.contains(slot));
        for cycle in 0..most {
            // Nothing has moved since the edits.
            let known = cycle == 0 && edited;
            let pass = Pass { cycle, cycles: 1, ..Pass::default() };
            let count = colliders.partition_point(|&cycles| cycles > cycle) as u32;
            if !known {
                let contact = Pass { first: first_collider, count, ..pass };
                self.dispatch(KernelId::Contact, 0, contact, count);
            }
            for &(page, first_job, length, jobs) in &lists {
                let count = jobs.partition_point(|&(cycles, _)| cycles > cycle) as u32;
                if count > 0 {
                    if !known {
                        let stress = Pass { first: first_job, count, ..pass };
                        self.dispatch(KernelId::Stress, page, stress, count);
                    }
                    let compact = Pass { first: length + 1, length, count, ..pass };
                    self.dispatch(KernelId::Compact, page, compact, count);
                }
            }
        }
    }
}
