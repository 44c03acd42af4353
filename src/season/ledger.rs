//! What has become of all that fell, in mass quanta of all columns.

use firn_snow::alpine::Exchange;

/// What has become of all that fell, in mass quanta of all columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ledger {
    /// Snow.
    pub fallen: u64,
    /// Rain.
    pub rained: u64,
    /// Vapour that settled on the snow.
    pub deposited: u64,
    /// Snow that found no room in its column.
    pub refused: u64,
    /// Ice and water that left as vapour.
    pub sublimated: u64,
    /// Water that ran off.
    pub runoff: u64,
    /// What lies there.
    pub present: u64,
    /// Snow that has fallen and is still too thin for a cell.
    pub gathered: u64,
}

impl Ledger {
    /// Enters what a column exchanged in a step.
    pub(super) fn enter(&mut self, exchange: &Exchange) {
        self.deposited += u64::from(exchange.deposited);
        self.refused += u64::from(exchange.refused);
        self.sublimated += u64::from(exchange.sublimated);
        self.runoff += u64::from(exchange.runoff);
    }

    /// Adds another one.
    pub(super) fn add(&mut self, other: &Ledger) {
        self.fallen += other.fallen;
        self.rained += other.rained;
        self.deposited += other.deposited;
        self.refused += other.refused;
        self.sublimated += other.sublimated;
        self.runoff += other.runoff;
        self.present += other.present;
        self.gathered += other.gathered;
    }

    /// What came in and neither left nor lies there: 0, or mass got lost.
    pub fn imbalance(&self) -> i128 {
        let sum = |entries: &[u64]| entries.iter().copied().map(i128::from).sum::<i128>();
        sum(&[self.fallen, self.rained, self.deposited])
            - sum(&[self.refused, self.sublimated, self.runoff, self.present, self.gathered])
    }
}
