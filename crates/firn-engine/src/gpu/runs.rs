//! What each snowpack does in a frame: a row for every slot, of which the device is told what has
//! changed since the frame before.

use std::ops::Range;

use crate::frame::Slot;

use super::buffer::{Mail, Table};
use super::layout::Run;

/// Rows by slot. All but those of the frame's own snowpacks say that nothing is to be done.
#[derive(Debug)]
pub struct Runs {
    rows: Vec<Run>,
    /// Slots of the snowpacks in the frame, and in the frame before.
    busy: Vec<Slot>,
    before: Vec<Slot>,
    /// Rows as the device has them.
    told: Vec<Run>,
    /// Slots among which are all whose rows are not as the device has them.
    changed: Range<usize>,
    table: Table,
}

const ROW_BYTES: u64 = std::mem::size_of::<Run>() as u64;

impl Runs {
    /// No rows.
    pub fn new(table: Table) -> Runs {
        let (busy, before) = (Vec::new(), Vec::new());
        Runs { rows: Vec::new(), busy, before, told: Vec::new(), changed: 0..0, table }
    }

    /// The buffer as it is now.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.table.buffer()
    }

    /// Makes room for a slot.
    pub fn reserve(&mut self, slot: Slot) {
        let count = slot as usize + 1;
        if self.rows.len() < count {
            self.rows.resize(count, Run::default());
        }
    }

    /// Says what the snowpacks of a frame do; all others do nothing.
    pub fn set(&mut self, runs: impl Iterator<Item = (Slot, Run)>) {
        std::mem::swap(&mut self.busy, &mut self.before);
        self.busy.clear();
        for &slot in &self.before {
            self.rows[slot as usize] = Run::default();
        }
        for (slot, run) in runs {
            self.rows[slot as usize] = run;
            self.busy.push(slot);
        }
        let (mut first, mut end) = (usize::MAX, 0);
        for slot in self.before.iter().chain(&self.busy).map(|&slot| slot as usize) {
            if self.told.get(slot) != Some(&self.rows[slot]) {
                (first, end) = (first.min(slot), end.max(slot + 1));
            }
        }
        self.changed = first.min(end)..end;
    }

    /// Gives the rows that have changed to the mail. Returns whether the buffer was replaced.
    pub fn flush(&mut self, device: &wgpu::Device, mail: &mut Mail) -> bool {
        let grew = self.table.reserve(device, self.rows.len() as u64 * ROW_BYTES);
        if grew || self.told.len() < self.rows.len() {
            self.told.resize(self.rows.len(), Run::default());
            self.changed = 0..self.rows.len();
        }
        let changed = std::mem::take(&mut self.changed);
        let rows = &self.rows[changed.clone()];
        let first = changed.start as u64 * ROW_BYTES;
        mail.write(self.table.buffer(), first, bytemuck::cast_slice(rows));
        self.told[changed].copy_from_slice(rows);
        grew
    }
}
