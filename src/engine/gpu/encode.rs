//! A frame, turned into submits: one for each round of edits, the last of which also runs the
//! cycles and copies out what is reported.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::engine::frame::{Edit, Frame, SampleBox, Slot, Work};

use super::GpuBackend;
use super::kernels::KernelId;
use super::plan::{Dispatch, Planner, Round};
use super::profile::Profile;
use super::readback::Copies;
use super::resident::{self, Residents};

impl GpuBackend {
    /// Carries a frame out and begins to read back what came of it.
    pub(super) fn carry_out(&mut self, mut frame: Frame) {
        let Survey { edits, mut rounds, tiles, groups, running, samples } = self.survey(&mut frame);
        let last = rounds.pop().unwrap_or_default();

        self.tables.fit_to(&self.device, &self.arena);
        let total = edits.iter().map(|&count| u64::from(count)).sum();
        let mut encoder =
            self.tables.begin_frame(&self.device, total, tiles, groups.len() as u64, samples);
        if let Some(profile) = &mut self.profile {
            profile.begin(&mut encoder);
        }
        let mut evaluated = BTreeSet::new();
        for round in rounds {
            let (mut planner, residents) = self.planner(&mut evaluated);
            planner.edits(residents, round);
            let dispatches = planner.dispatches;
            self.encode(&mut encoder, &dispatches);
            self.tables.mail.finish(&encoder);
            self.device.queue.submit([encoder.finish()]);
            encoder = self.device.device.create_command_encoder(&Default::default());
        }

        let tile_end = self.arena.tile_end();
        let pages: Vec<u32> =
            (0..self.arena.pages.len()).map(|page| self.arena.page_rows(page)).collect();
        let always_awake = self.always_awake;
        let (mut planner, residents) = self.planner(&mut evaluated);
        planner.edits(residents, last);
        planner.runs(residents, &frame.work, running, tile_end, &pages, always_awake);
        planner.reports(residents, &frame.work, &groups);
        planner.samples(residents, &frame.work);
        let dispatches = planner.dispatches;
        self.encode(&mut encoder, &dispatches);

        let copies = Copies::new(&frame.work, &edits, &self.residents, &self.tables, tiles, groups);
        self.readback.copy(&self.device, &mut encoder, &self.tables, copies);
        if let Some(profile) = &self.profile {
            profile.finish(&mut encoder);
        }
        self.tables.mail.finish(&encoder);
        let buffer = encoder.finish();
        let submission = self.device.queue.submit([buffer]);
        self.readback.begin(submission);
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

    /// Looks through the work of a frame, and takes the edits out of it.
    fn survey(&self, frame: &mut Frame) -> Survey {
        let mut found = Survey { edits: Vec::with_capacity(frame.work.len()), ..Survey::default() };
        let mut number = 0;
        frame.work.retain_mut(|work| {
            let Some(resident) = self.residents.get(work.slot) else { return false };
            found.edits.push(work.edits.len() as u32);
            if !work.edits.is_empty() {
                found.take_edits(work, number);
                number += found.edits.last().copied().unwrap_or(0);
            }
            let own = &resident.lot.tiles;
            if work.publish {
                let own = own.start / 64..own.end.div_ceil(64);
                found.groups = match &found.groups {
                    groups if groups.is_empty() => own,
                    groups => groups.start.min(own.start)..groups.end.max(own.end),
                };
                found.tiles += resident.lot.tiles.len() as u64;
            }
            if work.run.cycles > 0 {
                found.running += own.len();
            }
            found.samples += work.samples.iter().map(SampleBox::cells).sum::<u64>();
            true
        });
        found
    }

    /// Writes the rows that dispatches work on, and encodes the dispatches.
    fn encode(&mut self, encoder: &mut wgpu::CommandEncoder, dispatches: &[Dispatch]) {
        self.tables.flush(&self.device, encoder, &self.arena);
        for dispatch in dispatches {
            let (kernel, page) = (dispatch.kernel, dispatch.page);
            self.tables.bind(&self.device, &self.arena, &self.pipelines, kernel, page);
        }
        if dispatches.iter().any(|dispatch| dispatch.kernel == KernelId::Schedule) {
            self.tables.clear_schedule(encoder, &self.arena);
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
        let offset = dispatch.pass * super::tables::PASS_STRIDE;
        let binding = self.tables.binding(dispatch.kernel, dispatch.page);
        pass.set_pipeline(&self.pipelines[dispatch.kernel as usize].pipeline);
        pass.set_bind_group(0, binding, &[offset]);
        match dispatch.groups {
            Some(groups) => {
                let (x, y) = self.device.groups(groups);
                pass.dispatch_workgroups(x, y, 1);
            }
            None => {
                let arguments = self.tables.arguments.buffer();
                pass.dispatch_workgroups_indirect(arguments, u64::from(dispatch.page) * 12);
            }
        }
    }
}

/// What the work of a frame amounts to.
#[derive(Default)]
struct Survey {
    /// Edits of each snowpack.
    edits: Vec<u32>,
    /// The edits, round by round, each with its number in the frame.
    rounds: Vec<Vec<(Slot, Round)>>,
    /// Most tiles that can be published, and the groups of 64 that they are among.
    tiles: u64,
    groups: Range<u32>,
    /// Tiles of the snowpacks that run.
    running: usize,
    /// Cells of the fixed grid.
    samples: u64,
}

impl Survey {
    /// Takes the edits of one snowpack, the first of which has a number.
    fn take_edits(&mut self, work: &mut Work, number: u32) {
        let edits: Vec<(u32, Edit)> = (number..).zip(std::mem::take(&mut work.edits)).collect();
        for (i, round) in resident::rounds(edits).into_iter().enumerate() {
            if self.rounds.len() <= i {
                self.rounds.push(Vec::new());
            }
            self.rounds[i].push((work.slot, round));
        }
    }
}
