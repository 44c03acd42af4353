//! A frame, turned into submits: one for each round of edits, the last of which also runs the
//! cycles and copies out what is reported.

use std::collections::{BTreeMap, BTreeSet};

use crate::frame::{EngineError, Frame, Slot};

use super::GpuBackend;
use super::due::Due;
use super::job::{Job, Part, Step};
use super::kernels::KernelId;
use super::plan::{Dispatch, Moving, Planner};
use super::profile::Profile;
use super::report::Reports;
use super::resident::Residents;
use super::survey::Survey;

impl GpuBackend {
    /// Carries a frame out and begins to read back what came of it.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`] where there is work for a snowpack that is not there.
    pub(super) fn carry_out(&mut self, mut frame: Frame) -> Result<(), EngineError> {
        let parted = self.part(&mut frame);
        let mut cycles: Vec<u32> = frame.work.iter().map(|work| work.run.cycles).collect();
        let survey = Survey::new(&mut frame, &self.residents)?;
        let Survey { mut rounds, mut parts, mut totals, moving, .. } = survey;
        for (&place, part) in &parted {
            let first = totals.edits;
            totals.edits += self.results_of(frame.work[place].slot, part);
            parts[place].edits = first..totals.edits;
            totals.weathers |= part.steps.iter().any(|step| matches!(step, Step::Weather(_)));
        }
        let last = rounds.pop().unwrap_or_default();

        self.tables.fit_to(&self.device, &self.arena);
        self.tables.reserve_results(&self.device, &totals);
        let mut encoder = self.encoder();
        if let Some(profile) = &mut self.profile {
            profile.begin(&mut encoder);
        }
        let mut evaluated = BTreeSet::new();
        for round in rounds {
            let (mut planner, residents) = self.planner(&mut evaluated);
            planner.edits(residents, round);
            let dispatches = planner.dispatches;
            encoder = self.submit_some(encoder, &dispatches);
        }

        let always_awake = self.always_awake;
        let (mut planner, residents) = self.planner(&mut evaluated);
        planner.edits(residents, last);
        let weighing = frame.work.iter().zip(&parts).filter(|(_, part)| part.weighs);
        planner.weigh(residents, weighing.map(|(work, _)| work.slot));
        let apart = parted.iter().map(|(&place, part)| (place, part.run));
        let runs = apart.chain(moving.iter().map(|(&place, (run, _))| (place, *run))).collect();
        planner.set_runs(&frame.work, &runs, always_awake);
        let loaded = frame.work.iter().zip(&parts).filter(|(_, part)| part.may_be_loaded);
        planner.runs(residents, &frame.work, loaded.map(|(work, _)| work), &totals);
        let mut moving: Vec<Moving> = moving.into_values().map(|(_, moving)| moving).collect();
        let mut flown = BTreeMap::new();
        for (place, part) in parted {
            let slot = frame.work[place].slot;
            let Some(resident) = residents.get_mut(slot) else { continue };
            let Some(mut job) = resident.job.take() else { continue };
            let first_result = parts[place].edits.start;
            planner.part(slot, resident, &mut job, &part, first_result, place as u32);
            flown.insert(place, job.flown(&part));
            cycles[place] = job.cycles();
            moving.extend(job.take_moving(&part, first_result));
            resident.job = Some(job);
        }
        let dispatches = planner.dispatches;
        (self.flown, self.cycles) = (flown, cycles);
        let scheduled = dispatches.iter().any(|dispatch| dispatch.kernel == KernelId::Schedule);
        let (mut encoder, dispatches) = self.take_steps(encoder, dispatches, moving);
        let (mut planner, residents) = self.planner(&mut evaluated);
        planner.dispatches = dispatches;
        planner.reports(residents, &frame.work, &totals);
        let dispatches = planner.dispatches;
        self.encode(&mut encoder, &dispatches);
        if scheduled {
            self.tables.due.clear(&mut encoder);
        }
        self.readback.copy(&self.device, &mut encoder, &self.tables, totals);
        if let Some(profile) = &self.profile {
            profile.finish(&mut encoder);
        }
        self.tables.mail.finish(&encoder);
        let buffer = encoder.finish();
        let submission = self.device.queue.submit([buffer]);
        // The device is at work: what only its results need is found out meanwhile.
        let reports = Reports::new(&frame.work, parts, &self.residents);
        self.readback.begin(submission, reports);
        Ok(())
    }

    /// Plans the steps of snowpacks in which objects move, after what is planned already. What the tables have no more
    /// room for is submitted. Returns an encoder for what follows, and what is planned and not submitted.
    fn take_steps(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        mut dispatches: Vec<Dispatch>,
        mut moving: Vec<Moving>,
    ) -> (wgpu::CommandEncoder, Vec<Dispatch>) {
        let mut evaluated = BTreeSet::new();
        let mut moves = !moving.is_empty();
        while moves {
            let (mut planner, residents) = self.planner(&mut evaluated);
            planner.dispatches = dispatches;
            moves = planner.step(residents, &mut moving);
            let full = planner.is_full();
            dispatches = planner.dispatches;
            if full {
                encoder = self.submit_some(encoder, &dispatches);
                dispatches.clear();
            }
        }
        let mut moved = Vec::new();
        let (mut planner, residents) = self.planner(&mut evaluated);
        for mut moving in moving {
            planner.mark_moved(residents, &mut moving);
            match residents.get_mut(moving.slot()).and_then(|it| it.job.as_mut()) {
                Some(job) => job.keep_moving(moving),
                None => moved.push(moving.moved()),
            }
        }
        self.moved = moved;
        (encoder, dispatches)
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.device.create_command_encoder(&Default::default())
    }

    /// Submits what is planned so far. Returns an encoder for what follows.
    fn submit_some(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        dispatches: &[Dispatch],
    ) -> wgpu::CommandEncoder {
        self.encode(&mut encoder, dispatches);
        self.tables.mail.finish(&encoder);
        self.device.queue.submit([encoder.finish()]);
        self.encoder()
    }

    /// Says what this frame does of work that is too much for one, or goes on. What is done and reported
    /// besides is left in the frame.
    fn part(&mut self, frame: &mut Frame) -> BTreeMap<usize, Part> {
        let mut parted = BTreeMap::new();
        for (place, work) in frame.work.iter_mut().enumerate() {
            let Some(resident) = self.residents.get_mut(work.slot) else { continue };
            if work.wake {
                resident.awake = None;
            }
            let most = work.limit.unwrap_or(u64::MAX);
            let furnished = self.arena.furnish(&self.device, resident, most);
            if work.limit.is_none() && !work.resume {
                continue;
            }
            let mut job = match resident.job.take() {
                Some(mut job) if work.resume => {
                    job.resume(work);
                    job
                }
                _ => Box::new(Job::new(std::mem::take(work))),
            };
            let mut part = job.next_part(resident, furnished);
            *work = std::mem::take(&mut part.work);
            resident.job = Some(job);
            parted.insert(place, part);
        }
        parted
    }

    /// Results of edits that a part has.
    fn results_of(&self, slot: Slot, part: &Part) -> u32 {
        let snows = part.steps.iter().any(|step| matches!(step, Step::Snow(_)));
        let job = self.residents.get(slot).and_then(|resident| resident.job.as_ref());
        job.filter(|_| snows || part.moves > 0).map_or(0, |job| job.edits())
    }

    fn planner<'a>(
        &'a mut self,
        evaluated: &'a mut BTreeSet<Slot>,
    ) -> (Planner<'a>, &'a mut Residents) {
        let planner = Planner {
            device: &self.device,
            arena: &self.arena,
            tables: &mut self.tables,
            evaluated,
            one_by_one: self.one_by_one,
            turns: &mut self.turns,
            dispatches: Vec::new(),
        };
        (planner, &mut self.residents)
    }

    /// Writes the rows that dispatches work on, and encodes the dispatches.
    fn encode(&mut self, encoder: &mut wgpu::CommandEncoder, dispatches: &[Dispatch]) {
        self.tables.flush(&self.device, encoder, &self.arena);
        for dispatch in dispatches {
            let (kernel, page) = (dispatch.kernel, dispatch.page);
            self.tables.bind(&self.device, &self.arena, &self.pipelines, kernel, page);
        }
        if self.profile.as_ref().is_some_and(Profile::is_taking_times) {
            self.encode_timed(encoder, dispatches);
        } else {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            dispatches.iter().for_each(|dispatch| self.dispatch(&mut pass, dispatch));
        }
    }

    /// Encodes dispatches with a stamp before the first, and one after all that are of one kernel
    /// and follow each other.
    fn encode_timed(&mut self, encoder: &mut wgpu::CommandEncoder, dispatches: &[Dispatch]) {
        let Some(mut profile) = self.profile.take() else { return };
        profile.stamp(encoder, None);
        for alike in dispatches.chunk_by(|a, b| a.kernel == b.kernel) {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            alike.iter().for_each(|dispatch| self.dispatch(&mut pass, dispatch));
            drop(pass);
            profile.stamp(encoder, Some(alike[0].kernel));
        }
        self.profile = Some(profile);
    }

    fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, dispatch: &Dispatch) {
        let binding = self.tables.binding(dispatch.kernel, dispatch.page);
        pass.set_pipeline(&self.pipelines[dispatch.kernel as usize].pipeline);
        pass.set_bind_group(0, binding, &[]);
        pass.set_immediates(0, bytemuck::bytes_of(&dispatch.pass));
        match dispatch.groups {
            Some(groups) => {
                let (x, y) = self.device.groups(groups);
                pass.dispatch_workgroups(x, y, 1);
            }
            None => {
                let lists = self.tables.due.buffer();
                pass.dispatch_workgroups_indirect(lists, Due::arguments_of(dispatch.page));
            }
        }
    }
}
