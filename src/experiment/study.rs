//! The outcome of an experiment, beside the thesis's and the oracle's.

use firn_protocol::ColumnView;

use super::reference::Row;

/// The outcome of an experiment.
#[derive(Clone, Debug)]
pub struct Study {
    /// Short name, for files.
    pub name: String,
    /// What was done.
    pub title: String,
    /// Columns of snow.
    pub profiles: Vec<Profile>,
    /// Heights over time, all at the same instants.
    pub histories: Vec<History>,
    /// The height \[m\] that the thesis has in the end.
    pub thesis_height: Option<f64>,
    /// The oracle's heights: time \[s\] and height \[m\].
    pub oracle_heights: Vec<(f64, f64)>,
    /// The quantities that are compared.
    pub rows: Vec<Row>,
}

/// A column of snow at some time.
#[derive(Clone, Debug)]
pub struct Profile {
    /// Which, when.
    pub label: String,
    /// Simulated time \[s\].
    pub time: f64,
    /// The column.
    pub column: ColumnView,
    /// Whether this is a final state; the others lead to it.
    pub last: bool,
}

/// A height over time.
#[derive(Clone, Debug)]
pub struct History {
    /// Whose.
    pub label: String,
    /// Time \[s\] and height \[m\].
    pub points: Vec<(f64, f64)>,
}

impl Study {
    /// Sentences about all quantities that are not as expected.
    pub fn deviations(&self) -> Vec<String> {
        let deviations = self.rows.iter().filter_map(Row::deviation);
        deviations.map(|told| format!("{}: {told}", self.name)).collect()
    }
}

impl Profile {
    pub(super) fn new(label: impl Into<String>, time: f64, column: &ColumnView) -> Profile {
        Profile { label: label.into(), time, column: column.clone(), last: false }
    }

    pub(super) fn last(self) -> Profile {
        Profile { last: true, ..self }
    }
}
