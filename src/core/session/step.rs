//! Stepping a paused session as fast as the machine can, a slice in each frame.

use firn_protocol::StepSpec;

use crate::core::session::{Answer, Check, Clock, Receipted, Reply, SessionError, Simulation};
use crate::core::snapshot::Snapshot;

/// Most ticks of one step.
const MOST_TICKS: u64 = 1_000_000;

/// A step under way.
#[derive(Debug)]
pub(crate) struct StepJob {
    /// Tells it from others of the session.
    pub number: u64,
    pub goal: Goal,
    pub answer: Answer<Receipted<()>>,
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
    /// Ticks it may still take.
    pub fn remaining(&self) -> u64 {
        match self.goal {
            Goal::Ticks(ticks) | Goal::Settled(ticks) => ticks,
        }
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
            Ok(goal) => self.step = Some(StepJob { number, goal, answer }),
        }
    }

    /// Ends a step that nobody waits for.
    pub(crate) fn forget_step(&mut self, number: u64) {
        if self.step.as_ref().is_some_and(|job| job.number == number) {
            self.end_step();
        }
    }

    /// Begins a reset, or refuses it.
    pub(crate) fn begin_reset(&mut self, saved: Option<&Snapshot>, answer: Answer<Receipted<()>>) {
        if self.step.is_some() {
            answer.give(Err(SessionError::Conflict(
                "the session is being stepped; wait for that".into(),
            )));
        } else {
            let rows = saved.map_or(0, Snapshot::object_rows);
            match self.object_rows.try_take(rows) {
                Ok(()) => self.reset(saved, answer),
                Err(why) => answer.refuse(&why),
            }
        }
    }
}
