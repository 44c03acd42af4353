//! Stepping a paused session as fast as the machine can, a slice in each frame.

use std::time::Duration;

use firn_protocol::{Event, Progress, Stamp, StepSpec};

use crate::core::session::{
    Answer, Beginning, Check, Clock, Receipted, Reply, SessionError, Simulation,
};
use crate::core::snapshot::Snapshot;

/// Most ticks of one step.
const MOST_TICKS: u64 = 1_000_000;

/// Time between two events that tell how far a step has come.
const TELL_EVERY: Duration = Duration::from_millis(500);

/// A step under way.
#[derive(Debug)]
pub(crate) struct StepJob {
    /// Tells it from others of the session.
    pub number: u64,
    pub goal: Goal,
    pub answer: Answer<Receipted<()>>,
    /// Ticks it takes at the most.
    of: u64,
    /// When streams were last told how far it has come, or it began.
    told_at: Option<Duration>,
    /// Whether they were.
    told: bool,
}

/// When a step ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Goal {
    /// After a number of ticks.
    Ticks(u64),
    /// When the snow has settled, or after a number of ticks.
    Settled(u64),
}

impl Goal {
    /// Ticks until it is reached, at the most.
    fn ticks(&self) -> u64 {
        match *self {
            Goal::Ticks(ticks) | Goal::Settled(ticks) => ticks,
        }
    }

    /// What a client asks for.
    pub fn new(step: &StepSpec, clock: &Clock) -> Result<Goal, SessionError> {
        let mut check = Check::default();
        let kinds =
            [step.ticks.is_some(), step.seconds.is_some(), step.until_settled == Some(true)];
        if kinds.iter().filter(|&&given| given).count() != 1 {
            check.reject("", "exactly one of 'ticks', 'seconds' and 'until_settled' is expected");
        }
        if step.max_seconds.is_some() != (step.until_settled == Some(true)) {
            check.reject("/max_seconds", "goes together with 'until_settled', and only with it");
        }
        if let Some(ticks) = step.ticks {
            check.range("/ticks", ticks as f64, 1.0, MOST_TICKS as f64, "ticks");
        }
        let most_seconds = MOST_TICKS as f64 * clock.dt();
        for (pointer, seconds) in [("/seconds", step.seconds), ("/max_seconds", step.max_seconds)] {
            let Some(seconds) = seconds else { continue };
            if clock.dt() == 0.0 {
                check.reject(pointer, "no time passes while 'time_scale' is 0; step by 'ticks'");
            } else {
                check.range(pointer, seconds, f64::MIN_POSITIVE, most_seconds, "s");
            }
        }
        check.finish()?;
        let ticks_in = |seconds: f64| (seconds / clock.dt() - 1e-9).ceil().max(1.0) as u64;
        Ok(match (step.ticks, step.seconds, step.max_seconds) {
            (Some(ticks), _, _) => Goal::Ticks(ticks),
            (_, Some(seconds), _) => Goal::Ticks(ticks_in(seconds)),
            (_, _, seconds) => Goal::Settled(ticks_in(seconds.unwrap_or_default())),
        })
    }
}

impl StepJob {
    /// A step that begins.
    pub fn new(number: u64, goal: Goal, answer: Answer<Receipted<()>>) -> StepJob {
        StepJob { number, goal, answer, of: goal.ticks(), told_at: None, told: false }
    }

    /// Ticks it may still take.
    pub fn remaining(&self) -> u64 {
        self.goal.ticks()
    }

    /// How far it has come.
    pub fn progress(&self) -> Progress {
        Progress { done: self.of - self.remaining(), of: self.of }
    }

    /// Whether streams are to be told at some time how far it has come.
    fn is_to_tell(&mut self, now: Duration) -> bool {
        let due = now.saturating_sub(*self.told_at.get_or_insert(now)) >= TELL_EVERY;
        if due {
            self.told_at = Some(now);
            self.told = true;
        }
        due
    }

    /// Notes that ticks were taken.
    pub fn took(&mut self, ticks: u64) {
        match &mut self.goal {
            Goal::Ticks(left) | Goal::Settled(left) => *left = left.saturating_sub(ticks),
        }
    }

    /// Whether there is nothing more to do.
    pub fn is_over(&self, settled: bool, paused: bool) -> bool {
        self.remaining() == 0 || !paused || (settled && matches!(self.goal, Goal::Settled(_)))
    }
}

impl Simulation {
    /// Begins a step, or refuses it.
    pub(crate) fn begin_step(
        &mut self,
        number: u64,
        step: &StepSpec,
        answer: Answer<Receipted<()>>,
    ) {
        let result = if !self.state.settings.paused {
            Err(SessionError::Conflict("a running session can't be stepped; pause it first".into()))
        } else if self.step.is_some() {
            Err(SessionError::Conflict("the session is being stepped already".into()))
        } else {
            Goal::new(step, &self.state.clock)
        };
        match result {
            Err(error) => answer.give(Err(error)),
            Ok(Goal::Settled(_)) if self.is_settled() => {
                self.next.replies.push(Reply::Done(answer))
            }
            Ok(goal) => {
                let job = StepJob::new(number, goal, answer);
                self.session.show_progress(job.progress());
                self.step = Some(job);
            }
        }
    }

    /// Whether a step is under way: the one of a number, where that is given.
    pub(crate) fn is_stepping(&self, number: Option<u64>) -> bool {
        let is_it = |job: &StepJob| number.is_none_or(|number| number == job.number);
        self.step.as_ref().is_some_and(is_it)
    }

    /// Ends the step under way at the tick it has reached; its answer goes out with the next frame.
    pub(crate) fn end_step(&mut self) {
        if let Some(job) = self.step.take() {
            self.next.step_told |= job.told;
            self.next.replies.push(Reply::Done(job.answer));
        }
    }

    /// Tells streams from time to time how far the step under way has come, and that it has ended.
    pub(crate) fn tell_progress(&mut self, has_ended: bool, stamp: Stamp, now: Duration) {
        if has_ended {
            self.tell(vec![Event::StepProgress { stamp, progress: None }.into()]);
        }
        if let Some(job) = &mut self.step
            && job.is_to_tell(now)
        {
            // Reads show no less than what streams were told.
            let progress = job.progress();
            self.session.show_progress(progress);
            let progress = Some(progress);
            self.tell(vec![Event::StepProgress { stamp, progress }.into()]);
        }
    }

    /// Begins a reset, or refuses it.
    pub(crate) fn begin_reset(&mut self, to: Beginning, answer: Answer<Receipted<()>>) {
        if self.step.is_some() {
            answer.give(Err(SessionError::Conflict(
                "the session is being stepped; wait for that, or end it with DELETE …/step".into(),
            )));
        } else {
            let saved = match &to {
                Beginning::Origin(saved) => saved.as_deref(),
                Beginning::Snapshot(snapshot, _) => Some(&**snapshot),
            };
            match self.object_rows.try_take(saved.map_or(0, Snapshot::object_rows)) {
                Ok(()) => self.reset(to, answer),
                Err(why) => answer.refuse(&why),
            }
        }
    }
}
