//! What a session has to do in a frame, and who waits for it.

use std::collections::BTreeSet;
use std::sync::Arc;

use firn_engine::frame::{ColumnRead, Edit, SampleBox, Stamp};
use firn_protocol::{BatchResults, MassView, SampleBatch};
use firn_snow::{Cell, ColumnRect};

use crate::core::record::Once;
use crate::core::session::{
    Advance, Answer, Applied, Clock, Gathered, Receipted, Sampled, SessionError,
};
use crate::core::snapshot::Snapshot;

/// Changes of one session in one frame after which others of it wait for the next.
pub(crate) const MOST_CHANGES: usize = 4096;

/// What is waiting for the next frame.
#[derive(Debug, Default)]
pub(crate) struct Orders {
    pub edits: Vec<Edit>,
    /// Edits whose outcome goes into the ledger.
    pub counted: Vec<Counted>,
    /// Objects on which more snow lies, or less.
    pub weighed: BTreeSet<Arc<str>>,
    /// Changes that were made or refused for it, each object of a batch for itself.
    pub changes: usize,
    pub wake: bool,
    pub replies: Vec<Reply>,
    /// Columns wanted.
    pub gathers: Vec<Gather>,
    pub tallies: Vec<Answer<MassView>>,
    /// Boxes of the fixed grid wanted.
    pub samples: Vec<(SampleBox, Answer<Sampled>)>,
    /// Everything wanted, as it can be restored.
    pub snapshots: Vec<Answer<Snapshot>>,
    /// A snapshot is wanted for a checkpoint.
    pub checkpoint: bool,
    /// Settings, colliders or anything else that has no tile changed.
    pub changed: bool,
    /// There is a reset among it.
    pub reset: bool,
    /// A step has ended of which streams were told how far it had come.
    pub step_told: bool,
}

/// Columns that somebody wants, and the points at which the surface is wanted beside them.
#[derive(Debug)]
pub(crate) struct Gather {
    pub columns: Vec<ColumnRead>,
    /// Columns of alpine snow that are to be summed up.
    pub totals: Option<ColumnRect>,
    pub surface: Option<Arc<SampleBatch>>,
    pub reply: Answer<Gathered>,
}

/// An edit of which the device finds out what goes into the ledger.
#[derive(Clone, Debug)]
pub(crate) enum Counted {
    /// What of a snowfall found no room.
    Refused(usize),
    /// What was cleared away.
    Cleared(usize),
    /// What an object laid down that found no room, of so much snow on each column.
    Returned { edit: usize, id: Arc<str>, snow: Cell },
}

/// What went with the frame in flight.
#[derive(Debug, Default)]
pub(crate) struct Flight {
    pub orders: Orders,
    pub advance: Advance,
    /// Steps of weather.
    pub weathered: u64,
    pub clock_before: Option<Clock>,
    pub publish: bool,
    /// Round that it is published in.
    pub round: u64,
}

/// An answer that is due when the frame is published.
#[derive(Debug)]
pub(crate) enum Reply {
    /// To the change that made a snowpack.
    Created(Answer<Receipted<()>>),
    /// To a reset, and to a step that has ended.
    Done(Answer<Receipted<()>>),
    /// To a change, of which `edit` was the last edit.
    Change { told: Told, edit: usize, once: Option<Once>, answer: Answer<Receipted<Applied>> },
}

/// What the answer to a change tells.
#[derive(Clone, Debug)]
pub(crate) enum Told {
    /// `refused` is what was refused without asking the backend.
    Snowfall {
        fallen: u128,
        refused: u128,
        columns: ColumnRect,
    },
    /// So many edits clear some of the columns.
    Clearing {
        columns: ColumnRect,
        edits: usize,
    },
    AirTemperature,
    Weather,
    Collider {
        id: Arc<str>,
        created: bool,
    },
    /// What each stamp presses.
    Stamps(Vec<Arc<Stamp>>),
    /// What was done of each entry, where errors are skipped.
    Batch(Option<Box<BatchResults>>),
    Settings,
    Ground,
    Stamp,
}

impl Orders {
    /// Whether there is something that a frame is to be made for.
    pub fn are_urgent(&self) -> bool {
        self.are_awaited() || self.changes >= MOST_CHANGES
    }

    /// Cells of the fixed grid and of columns that are wanted.
    pub fn read_cells(&self) -> u64 {
        let columns = self.gathers.iter().flat_map(|wanted| &wanted.columns).map(ColumnRead::cells);
        let totals = self.gathers.iter().filter_map(|wanted| wanted.totals);
        let totals = totals.map(|columns| columns.columns());
        let samples = self.samples.iter().map(|(wanted, _)| wanted.cells());
        samples.chain(columns).chain(totals).sum()
    }

    /// Whether somebody waits for the frame, which is published at once then: nobody does for snow that falls by
    /// itself.
    pub fn are_awaited(&self) -> bool {
        !self.replies.is_empty() || self.want_reads()
    }

    fn want_reads(&self) -> bool {
        !self.gathers.is_empty()
            || !self.tallies.is_empty()
            || !self.samples.is_empty()
            || !self.snapshots.is_empty()
            || self.checkpoint
    }

    /// Tells everybody who waits why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        for reply in self.replies {
            match reply {
                Reply::Created(answer) | Reply::Done(answer) => answer.refuse(why),
                Reply::Change { answer, .. } => answer.refuse(why),
            }
        }
        self.gathers.into_iter().for_each(|wanted| wanted.reply.refuse(why));
        self.tallies.into_iter().for_each(|answer| answer.refuse(why));
        self.snapshots.into_iter().for_each(|answer| answer.refuse(why));
        self.samples.into_iter().for_each(|(_, answer)| answer.refuse(why));
    }
}
