//! The steps that a frame does of work that is too much for one.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::frame::{Edit, Slot};
use crate::gpu::job::{Job, Part, Step, When};
use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{AFTER_EDITS, LoadJob, Pass, UNDER_OBJECTS};
use crate::gpu::resident::Resident;

use super::Planner;
use super::edits::by_page;
use super::runs::compaction_of;
use super::weather::WeatherPart;

impl Planner<'_> {
    /// Plans a part of a job, which has a place among the work and the results of whose edits begin at a number.
    pub fn part(
        &mut self,
        slot: Slot,
        resident: &mut Resident,
        job: &mut Job,
        part: &Part,
        first_result: u32,
        place: u32,
    ) {
        // Rows of its objects, with a cycle after what they are for and without.
        let mut rows: [Option<u32>; 2] = [None; 2];
        for step in &part.steps {
            match step {
                Step::Write(tiles) => {
                    let edits = job.round().iter();
                    edits.for_each(|(_, edit)| self.write(resident, edit, tiles.clone()));
                }
                Step::Snow(rows) => {
                    let round = job.round().iter();
                    let edits: Vec<(u32, Edit)> =
                        round.map(|(n, edit)| (first_result + n, edit.clone())).collect();
                    self.snow_on(resident, &edits, rows.clone());
                }
                Step::Weather(rows) => {
                    resident.note_weather();
                    let weatherings = job.round().iter().filter_map(|(_, edit)| match edit {
                        Edit::Weather(weathering) => Some(weathering.clone()),
                        _ => None,
                    });
                    for weathering in weatherings {
                        let part = WeatherPart { slot, place, rows: rows.clone(), weathering };
                        self.weather(|_| Some(&*resident), &[part]);
                    }
                }
                Step::Objects => self.objects(slot, resident, job),
                Step::Touch(objects, when) => {
                    let rows = &mut rows[usize::from(when.runs)];
                    let row = || self.collider_rows(slot, resident, when.runs);
                    let first = *rows.get_or_insert_with(row);
                    self.touch(first, objects.clone(), *when);
                }
                Step::Press(tiles, when) => {
                    let rows = &mut rows[usize::from(when.runs)];
                    let row = || self.collider_rows(slot, resident, when.runs);
                    let first = *rows.get_or_insert_with(row);
                    self.press_tiles(first, resident, tiles, *when);
                }
                Step::Weigh(count) => self.weigh_some(resident, *count),
                Step::Free(tiles) => {
                    let pass = Pass { cycles: part.run.cycles, ..Pass::default() };
                    self.compact(KernelId::Compact, resident, tiles, pass);
                }
                Step::Loaded(tiles, cycle) => {
                    let flags = UNDER_OBJECTS;
                    let pass = Pass { cycle: *cycle, cycles: 1, flags, ..Pass::default() };
                    self.compact(compaction_of(job.pressing()), resident, tiles, pass);
                }
            }
        }
    }

    /// Carries out what is left of a round.
    fn objects(&mut self, slot: Slot, resident: &mut Resident, job: &mut Job) {
        let mut stressed = BTreeSet::new();
        let mut moved = false;
        for (_, edit) in job.end_round() {
            moved |= self.alter(slot, resident, edit, &mut stressed);
        }
        if moved {
            self.mark_loaded(slot, resident);
        }
        stressed.extend(resident.loads.keys().copied());
        for tile in &stressed {
            resident.unweighed.remove(tile);
        }
        resident.wake(stressed.iter().copied());
        job.press_later(stressed.into_iter().collect());
    }

    /// Has contacts of some objects evaluated, by their rows, the first of all objects having a row.
    fn touch(&mut self, first: u32, rows: Range<u32>, when: When) {
        let (first, count) = (first + rows.start, rows.len() as u32);
        let pass = Pass { first, count, cycle: when.cycle, flags: flags(when), ..Pass::default() };
        self.dispatch(KernelId::Contact, 0, pass, count);
    }

    /// Has stresses of some tiles evaluated.
    fn press_tiles(&mut self, first: u32, resident: &mut Resident, tiles: &[u32], when: When) {
        let mut jobs: Vec<(u32, LoadJob)> = Vec::new();
        self.load_jobs(first, resident, tiles.iter().copied(), &mut jobs);
        for (page, jobs) in by_page(jobs) {
            let (first, count) = (self.tables.orders.load_jobs.len(), jobs.len() as u32);
            self.tables.orders.load_jobs.extend(jobs);
            let flags = flags(when);
            let pass = Pass { first, count, cycle: when.cycle, flags, ..Pass::default() };
            self.dispatch(KernelId::Stress, page, pass, count);
        }
        if when.after_edits {
            resident.bodies.values_mut().for_each(|body| body.placed = false);
        }
    }

    /// Has a kernel compact some tiles.
    fn compact(&mut self, kernel: KernelId, resident: &Resident, tiles: &[u32], pass: Pass) {
        let mut pages: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &tile in tiles {
            let rows = pages.entry(resident.page(tile)).or_default();
            rows.push(resident.lot.tiles.start + tile);
        }
        self.compact_listed(kernel, pages, pass);
    }
}

fn flags(when: When) -> u32 {
    if when.after_edits { AFTER_EDITS } else { 0 }
}
