//! What is asked of one session waits here, wherever its snow is, until the session is between two ticks and
//! the coming frame has room for it. It is taken in the order in which it came: what is told, journaled and
//! saved of a frame is of one moment.

use std::collections::VecDeque;

use firn_engine::frame::SampleBox;
use firn_protocol::{MassView, StepSpec};
use firn_snow::ColumnRect;

use super::answer::Answer;
use super::change::{Applied, Change};
use super::error::SessionError;
use super::gather::{Gathered, MOST_SAMPLES, Sampled};
use super::keyed::Once;
use super::orders::MOST_CHANGES;
use super::receipt::Receipted;
use super::simulation::Simulation;
use super::snapshot::Snapshot;

/// Something to be run with a simulation.
pub(super) type Look = Box<dyn FnOnce(&Simulation) + Send>;

/// What a session is asked.
pub(super) enum Request {
    Change { change: Change, once: Option<Once>, reply: Answer<Receipted<Applied>> },
    Step { step: StepSpec, reply: Answer<Receipted<()>> },
    Reset { saved: Option<Box<Snapshot>>, reply: Answer<Receipted<()>> },
    Snapshot { reply: Answer<Snapshot> },
    Gather { tiles: Vec<u32>, reply: Answer<Gathered> },
    Sample { columns: ColumnRect, y0: u32, height: u32, reply: Answer<Sampled> },
    Mass { reply: Answer<MassView> },
    Inspect { look: Look, reply: Answer<()> },
}

impl Request {
    /// Tells whoever sent it why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        match self {
            Request::Change { reply, .. } => reply.refuse(why),
            Request::Step { reply, .. } | Request::Reset { reply, .. } => reply.refuse(why),
            Request::Inspect { reply, .. } => reply.refuse(why),
            Request::Snapshot { reply } => reply.refuse(why),
            Request::Gather { reply, .. } => reply.refuse(why),
            Request::Sample { reply, .. } => reply.refuse(why),
            Request::Mass { reply } => reply.refuse(why),
        }
    }

    /// Whether it has to be made durable.
    fn changes(&self) -> bool {
        matches!(self, Request::Change { .. } | Request::Step { .. } | Request::Reset { .. })
    }
}

/// Requests that wait for one session, the oldest first.
#[derive(Default)]
pub(super) struct Inbox(VecDeque<Request>);

impl Inbox {
    /// Adds a request. Only one reset may wait: each brings a whole snowpack along.
    pub fn push(&mut self, request: Request) {
        let resets = |waiting: &Request| matches!(waiting, Request::Reset { .. });
        if resets(&request) && self.0.iter().any(resets) {
            let conflict = "the session is being reset; wait for that".to_owned();
            request.refuse(&SessionError::Conflict(conflict));
        } else {
            self.0.push_back(request);
        }
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Tells everybody who waits why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        self.0.into_iter().for_each(|request| request.refuse(why));
    }
}

impl Simulation {
    /// Takes in what waits, as much as the coming frame should carry. Changes are refused where nothing can
    /// be stored; `most_colliders` is how many objects there may be.
    pub(super) fn drain(
        &mut self,
        inbox: &mut Inbox,
        most_colliders: usize,
        refusal: Option<&SessionError>,
    ) {
        while let Some(request) = inbox.0.pop_front_if(|request| self.has_room_for(request)) {
            match refusal.filter(|_| request.changes()) {
                Some(why) => request.refuse(why),
                None => self.take(request, most_colliders),
            }
        }
    }

    /// Whether it may take in something of what waits.
    pub(super) fn takes(&self, inbox: &Inbox) -> bool {
        inbox.0.front().is_some_and(|request| self.has_room_for(request))
    }

    /// Why a request can't be taken in, whatever is done before it.
    pub(super) fn conflict(&self, request: &Request) -> Option<SessionError> {
        let steps = matches!(request, Request::Step { .. } | Request::Reset { .. });
        (steps && self.step.is_some()).then(|| {
            SessionError::Conflict("the session is being stepped already; wait for that".to_owned())
        })
    }

    fn has_room_for(&self, request: &Request) -> bool {
        let fits = match request {
            // The ticks that it has put off come first.
            Request::Snapshot { .. } => !self.answered_first,
            Request::Sample { columns, height, .. } => {
                let cells = columns.columns() * u64::from(*height);
                self.next.sampled_cells() + cells <= MOST_SAMPLES
            }
            _ => self.next.changes < MOST_CHANGES,
        };
        fits && !self.portions.are_under_way() && self.replay.is_none()
    }

    fn take(&mut self, request: Request, most_colliders: usize) {
        match request {
            Request::Change { change, once, reply } => {
                self.change(change, once, most_colliders, reply);
            }
            Request::Step { step, reply } => self.begin_step(&step, reply),
            Request::Reset { saved, reply } => self.begin_reset(saved.as_deref(), reply),
            Request::Snapshot { reply } => self.next.snapshots.push(reply),
            Request::Gather { tiles, reply } => self.next.gathers.push((tiles, reply)),
            Request::Sample { columns, y0, height, reply } => {
                let dt = self.cycle_length();
                self.next.samples.push((SampleBox { columns, y0, height, dt }, reply));
            }
            Request::Mass { reply } => self.next.tallies.push(reply),
            Request::Inspect { look, reply } => {
                look(self);
                reply.give(Ok(()));
            }
        }
    }
}
