//! Rows of the backend's tables.

use std::collections::BTreeSet;

use firn_engine::frame::Slot;

/// Rows of the backend's tables, lowest free one first.
#[derive(Debug, Default)]
pub(crate) struct Slots {
    free: BTreeSet<Slot>,
    next: Slot,
}

impl Slots {
    pub fn take(&mut self) -> Slot {
        self.free.pop_first().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    pub fn give_back(&mut self, slot: Slot) {
        self.free.insert(slot);
    }
}
