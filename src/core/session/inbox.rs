//! What is asked of one session waits here, wherever its snow is, until the session is between two ticks and
//! the coming frame has room for it. Requests are taken in the order in which they came, so that the answers,
//! the journal entry and the snapshot of a frame show the same moment.

use std::collections::VecDeque;
use std::sync::Arc;

use firn_engine::frame::ColumnRead;
use firn_protocol::{MassView, SampleBatch, StepSpec};
use firn_snow::ColumnRect;

use crate::core::record::Once;
use crate::core::session::{
    Answer, Applied, CellBox, Change, Command, Decision, Disturbed, Gather, Gathered, MOST_CHANGES,
    MOST_SAMPLES, Receipted, Reply, Sampled, SessionError, Simulation, Told, press,
};
use crate::core::snapshot::Snapshot;

/// Something to be run with a simulation.
pub(crate) type Look = Box<dyn FnOnce(&Simulation) + Send>;

/// What a session is asked.
pub(crate) enum Request {
    Change {
        change: Box<Change>,
        once: Option<Once>,
        reply: Answer<Receipted<Applied>>,
    },
    Step {
        number: u64,
        step: StepSpec,
        reply: Answer<Receipted<()>>,
    },
    Reset {
        to: Beginning,
        reply: Answer<Receipted<()>>,
    },
    Snapshot {
        reply: Answer<Snapshot>,
    },
    Gather {
        columns: Vec<ColumnRead>,
        totals: Option<ColumnRect>,
        surface: Option<Arc<SampleBatch>>,
        reply: Answer<Gathered>,
    },
    Sample {
        wanted: CellBox,
        reply: Answer<Sampled>,
    },
    Mass {
        reply: Answer<MassView>,
    },
    Inspect {
        look: Look,
        reply: Answer<()>,
    },
}

impl Request {
    /// Refuses it, and says why.
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

/// What a session is reset to.
pub(crate) enum Beginning {
    /// The state that it was created in, and the snapshot that it was made from, where it was.
    Origin(Option<Box<Snapshot>>),
    /// What a snapshot holds, and the snapshot as bytes: the session comes back from those from then on.
    Snapshot(Box<Snapshot>, Vec<u8>),
}

/// Requests that wait for one session, the oldest first.
#[derive(Default)]
pub(crate) struct Inbox(VecDeque<Request>);

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

    /// Forgets a step that nobody waits for.
    pub fn forget_step(&mut self, step: u64) {
        let is_it =
            |request: &Request| matches!(request, Request::Step { number, .. } if *number == step);
        self.0.retain(|request| !is_it(request));
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
    pub(crate) fn drain(
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
    pub(crate) fn takes(&self, inbox: &Inbox) -> bool {
        inbox.0.front().is_some_and(|request| self.has_room_for(request))
    }

    /// Why a request can't be taken in, whatever is done before it.
    pub(crate) fn conflict(&self, request: &Request) -> Option<SessionError> {
        let steps = matches!(request, Request::Step { .. } | Request::Reset { .. });
        (steps && self.step.is_some()).then(|| {
            SessionError::Conflict(
                "the session is being stepped; wait for that, or end it with DELETE …/step"
                    .to_owned(),
            )
        })
    }

    fn has_room_for(&self, request: &Request) -> bool {
        let fits = match request {
            // The ticks that it has put off come first.
            Request::Snapshot { .. } => !self.answered_first,
            Request::Sample { wanted, .. } => {
                self.next.read_cells() + wanted.cells() <= MOST_SAMPLES
            }
            Request::Gather { columns, totals, .. } => {
                let summed = totals.map_or(0, |columns| columns.columns());
                let cells = columns.iter().map(ColumnRead::cells).sum::<u64>() + summed;
                let waiting = self.next.read_cells();
                waiting == 0 || waiting + cells <= MOST_SAMPLES
            }
            _ => self.next.changes < MOST_CHANGES,
        };
        fits && !self.portions.are_under_way() && self.replay.is_none()
    }

    fn take(&mut self, request: Request, most_colliders: usize) {
        match request {
            Request::Change { change, once, reply } => {
                self.change(*change, once, most_colliders, reply);
            }
            Request::Step { number, step, reply } => self.begin_step(number, &step, reply),
            Request::Reset { to, reply } => self.begin_reset(to, reply),
            Request::Snapshot { reply } => self.next.snapshots.push(reply),
            Request::Gather { columns, totals, surface, reply } => {
                self.next.gathers.push(Gather { columns, totals, surface, reply });
            }
            Request::Sample { wanted, reply } => {
                self.next.samples.push((self.sample_box(&wanted), reply));
            }
            Request::Mass { reply } => self.next.tallies.push(reply),
            Request::Inspect { look, reply } => {
                look(self);
                reply.give(Ok(()));
            }
        }
    }

    /// Takes a change into the next frame, or refuses it whole.
    pub(crate) fn change(
        &mut self,
        change: Change,
        once: Option<Once>,
        most_colliders: usize,
        answer: Answer<Receipted<Applied>>,
    ) {
        self.next.changes += change.entries();
        let tick = self.state.clock.tick();
        match self.decide(&change, most_colliders) {
            Ok(Decision { command, told }) => {
                match &told {
                    // It is known already what they cover.
                    Told::Stamps(prints) => {
                        let disturbed = press(prints.iter().cloned(), &mut self.next);
                        self.disturbed(disturbed);
                    }
                    _ => self.carry_out(&command),
                }
                self.log.record(tick, command);
                let edit = self.next.edits.len().saturating_sub(1);
                self.next.replies.push(Reply::Change { told, edit, once, answer });
            }
            Err(why) => answer.refuse(&why),
        }
    }

    fn decide(&mut self, change: &Change, most: usize) -> Result<Decision, SessionError> {
        let decision = self.state.decide(change, Some(most))?;
        let (less, more) = self.state.object_words(&decision.command);
        self.object_rows.try_take(self.object_rows.taken().saturating_sub(less) + more)?;
        Ok(decision)
    }

    /// Takes a command into the next frame that was carried out before.
    pub(crate) fn repeat(&mut self, command: &Command) {
        if *command == Command::Reset {
            let origin = self.session.origin_snapshot();
            self.begin_anew(origin.as_ref());
        } else {
            let (less, more) = self.state.object_words(command);
            self.object_rows.take(self.object_rows.taken().saturating_sub(less) + more);
            self.carry_out(command);
        }
    }

    /// Has the next frame carry out a command.
    pub(crate) fn carry_out(&mut self, command: &Command) {
        let disturbed = self.state.apply(command, &mut self.next);
        self.disturbed(disturbed);
    }

    /// Notes what may move again.
    fn disturbed(&mut self, Disturbed { tiles, all }: Disturbed) {
        if let Some(tiles) = tiles {
            self.disturb(tiles);
        }
        if all {
            self.wake();
        }
    }
}
