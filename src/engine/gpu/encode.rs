//! A frame, turned into submits: one for each round of edits, the last of which also runs the
//! cycles and copies out what is reported.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::engine::frame::{Edit, Frame, SampleBox, Slot, Work};

use super::GpuBackend;
use super::kernels::KernelId;
use super::plan::{Dispatch, Planner, Round};
use super::readback::Copies;
use super::resident::{self, Residents};

impl GpuBackend {
    /// Carries a frame out and begins to read back what came of it.
    pub(super) fn carry_out(&mut self, mut frame: Frame) {
        if let Some(profile) = &mut self.profile {
            profile.reset();
        }
        frame.work.retain(|work| self.residents.get(work.slot).is_some());
        let edits: Vec<u32> = frame.work.iter().map(|work| work.edits.len() as u32).collect();
        let mut rounds = take_rounds(&mut frame.work);
        let last = rounds.pop().unwrap_or_default();

        let (tiles, groups) = self.publishable(&frame.work);
        self.tables.fit_to(&self.device, &self.arena);
        let total = edits.iter().map(|&count| u64::from(count)).sum();
        let samples = frame.work.iter().flat_map(|work| &work.samples).map(SampleBox::cells).sum();
        let mut encoder =
            self.tables.begin_frame(&self.device, total, tiles, groups.len() as u64, samples);
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
        planner.runs(residents, &frame.work, tile_end, &pages, always_awake);
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
        let submission = self.device.queue.submit([encoder.finish()]);
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
            dispatches: Vec::new(),
        };
        (planner, &mut self.residents)
    }

    /// Most tiles that a frame can publish, and the groups of 64 that they are among.
    fn publishable(&self, work: &[Work]) -> (u64, Range<u32>) {
        let published = work.iter().filter(|work| work.publish);
        let lots = published.filter_map(|work| self.residents.get(work.slot)).map(|r| &r.lot.tiles);
        lots.fold((0, 0..0), |(count, groups), tiles| {
            let own = tiles.start / 64..tiles.end.div_ceil(64);
            let all = if groups.is_empty() {
                own
            } else {
                groups.start.min(own.start)..groups.end.max(own.end)
            };
            (count + tiles.len() as u64, all)
        })
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
        match &mut self.profile {
            None => {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                dispatches.iter().for_each(|dispatch| self.dispatch(&mut pass, dispatch));
            }
            Some(_) => self.encode_timed(encoder, dispatches),
        }
    }

    /// Encodes dispatches one by one, with a stamp before each and after the last.
    fn encode_timed(&mut self, encoder: &mut wgpu::CommandEncoder, dispatches: &[Dispatch]) {
        let Some(mut profile) = self.profile.take() else { return };
        for dispatch in dispatches {
            profile.stamp(encoder, Some(dispatch.kernel));
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.dispatch(&mut pass, dispatch);
        }
        profile.stamp(encoder, None);
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

/// Takes the edits out of the work, round by round, each with its number in the frame.
fn take_rounds(work: &mut [Work]) -> Vec<Vec<(Slot, Round)>> {
    let mut rounds: Vec<Vec<(Slot, Round)>> = Vec::new();
    let mut number = 0;
    for work in work {
        let edits: Vec<(u32, Edit)> = (number..).zip(std::mem::take(&mut work.edits)).collect();
        number += edits.len() as u32;
        for (i, round) in resident::rounds(edits).into_iter().enumerate() {
            if rounds.len() <= i {
                rounds.push(Vec::new());
            }
            rounds[i].push((work.slot, round));
        }
    }
    rounds
}
