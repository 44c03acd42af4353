//! When a snowpack is stepped: ticks, simulated time, and the cycles they make.

use firn_engine::frame::Run;
use serde::{Deserialize, Serialize};

/// Frames per second: the instants at which ticks can fall.
pub const FRAME_RATE: f64 = 60.0;

/// Simulated time that has to be pending before it is spent \[s\], with its relative slack.
const DUE: f64 = (1.0 - 1e-6) / 60.0;

/// Ticks beyond which nothing is waited for.
const FARTHEST: u64 = 1 << 44;

/// Longest cycle \[s\].
const LONGEST_CYCLE: f64 = 0.25;

/// A snowpack's clock.
///
/// It counts ticks. Simulated time is derived from them, so that no sum of many small steps drifts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    tick: u64,
    /// Simulated time of one tick \[s\].
    dt: f64,
    tick_rate: f64,
    /// Tick of the last change of `dt`, and simulated time then.
    mark: (u64, f64),
    /// Tick since which simulated time is pending, and what was pending then already \[s\].
    pending: (u64, f64),
}

/// Ticks that were taken at once, and the equal cycles they make.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Advance {
    /// Ticks taken.
    pub ticks: u64,
    /// The cycles; none where the ticks only saved up time.
    pub run: Run,
    /// Simulated time by which objects move in a cycle \[s\]: more than its own where a tick is too long for all of
    /// its cycles to be carried out.
    pub stride: f64,
    /// Ticks up to the first spending, from one to the next, and cycles in each.
    first: u64,
    each: u64,
    cycles: u32,
}

impl Advance {
    /// Cycles that are taken together, whatever the ticks are cut into.
    pub fn cycles_at_once(&self) -> u32 {
        self.cycles.max(1)
    }

    /// Ticks after which nothing moves any more, where the last change was in a cycle (counted
    /// from 1; 0 for none). `None` where the run ended in a change, or had no cycle.
    pub fn settled_after(&self, last_change: u32) -> Option<u64> {
        if last_change >= self.run.cycles {
            return None;
        }
        let spendings = u64::from(last_change / self.cycles);
        Some(self.first + spendings * self.each)
    }
}

impl Clock {
    /// A clock at tick 0.
    pub fn new(tick_rate: f64, time_scale: f64) -> Clock {
        Clock { tick: 0, dt: time_scale / tick_rate, tick_rate, mark: (0, 0.0), pending: (0, 0.0) }
    }

    /// Whether it is a clock of a rate \[Hz\] and scale, and not impossible.
    pub(crate) fn is_sound(&self, tick_rate: f64, time_scale: f64) -> bool {
        let sound = |(tick, time): (u64, f64)| tick <= self.tick && time.is_finite() && time >= 0.0;
        self.tick_rate == tick_rate
            && self.dt == time_scale / tick_rate
            && self.tick < 1 << 53
            && sound(self.mark)
            && sound(self.pending)
            && self.pending() <= 1.0 / 60.0
    }

    /// Ticks so far.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Simulated time of one tick \[s\].
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Simulated time \[s\].
    pub fn sim_time(&self) -> f64 {
        self.mark.1 + (self.tick - self.mark.0) as f64 * self.dt
    }

    /// Simulated time saved up and not yet spent \[s\].
    fn pending(&self) -> f64 {
        self.pending.1 + (self.tick - self.pending.0) as f64 * self.dt
    }

    /// Ticks until simulated time reaches some value \[s\], at least one; none where it never will.
    pub fn ticks_until(&self, time: f64) -> Option<u64> {
        if self.dt <= 0.0 {
            return None;
        }
        let reached = |ticks: u64| {
            self.mark.1 + (self.tick.saturating_add(ticks) - self.mark.0) as f64 * self.dt >= time
        };
        let mut ticks = (((time - self.sim_time()) / self.dt).ceil().max(1.0)) as u64;
        // The quotient is rounded; the product decides.
        while ticks > 1 && reached(ticks - 1) {
            ticks -= 1;
        }
        // Where a tick is too short to be told from none, it never comes.
        if !reached(ticks) {
            ticks = ticks.checked_add(1).filter(|ticks| reached(*ticks))?;
        }
        // What is farther away than half a million years never comes, and frames up to it can't be told apart.
        Some(ticks).filter(|ticks| *ticks < FARTHEST)
    }

    /// The last frame before so many ticks have fallen after a frame.
    pub fn frame_before(&self, from: u64, ticks: u64) -> u64 {
        let frames = (ticks.saturating_sub(1) as f64 * FRAME_RATE / self.tick_rate) as u64;
        let mut frame = from.saturating_add(frames);
        while frame > from && self.ticks_between(from, frame) >= ticks {
            frame -= 1;
        }
        while self.ticks_between(from, frame + 1) < ticks {
            frame += 1;
        }
        frame
    }

    /// Changes rate and scale from the present tick on.
    pub fn set_rate(&mut self, tick_rate: f64, time_scale: f64) {
        self.mark = (self.tick, self.sim_time());
        self.pending = (self.tick, self.pending());
        self.tick_rate = tick_rate;
        self.dt = time_scale / tick_rate;
    }

    /// Ticks per second \[Hz\].
    pub fn tick_rate(&self) -> f64 {
        self.tick_rate
    }

    /// Ticks that fall after frame `from` up to frame `to`; none where `to` is the earlier one.
    pub fn ticks_between(&self, from: u64, to: u64) -> u64 {
        ticks_between(self.tick_rate, from, to)
    }

    /// Length \[s\] of the cycles once nothing is pending; `None` where time stands still.
    pub fn steady_cycle(&self) -> Option<f64> {
        let spent = ticks_until(DUE, self.dt)? as f64 * self.dt;
        Some(spent / cycles_in(spent))
    }

    /// Takes up to `ticks` ticks, no more than can be run as equal cycles of one length, and about
    /// `cycles` of them at the most.
    pub fn advance(&mut self, ticks: u64, cycles: u32) -> Advance {
        self.advance_within(ticks, cycles, u32::MAX)
    }

    /// As [`Clock::advance`], but carries out no more than some cycles each time that time is spent: where that takes
    /// more, nothing happens in the rest of it.
    pub fn advance_within(&mut self, ticks: u64, cycles: u32, most: u32) -> Advance {
        if ticks == 0 {
            return Advance::default();
        }
        let Some(first) = ticks_until(DUE - self.pending(), self.dt).filter(|&k| k <= ticks) else {
            self.tick += ticks;
            return Advance { ticks, ..Advance::default() };
        };
        let spent = self.pending.1 + (self.tick + first - self.pending.0) as f64 * self.dt;
        let all = cycles_in(spent);
        let count = all.min(f64::from(most));
        let each = ticks_until(DUE, self.dt).unwrap_or(u64::MAX);
        let alike = spent == each as f64 * self.dt;
        let spendings = if alike {
            let most = u64::from(cycles / count as u32).max(1);
            (1 + (ticks - first) / each).min(most)
        } else {
            1
        };
        let taken = first + (spendings - 1) * each;
        self.tick += taken;
        self.pending = (self.tick, 0.0);
        Advance {
            ticks: taken,
            run: Run { cycles: spendings as u32 * count as u32, dt: spent / all },
            stride: spent / count,
            first,
            each,
            cycles: count as u32,
        }
    }

    /// Takes exactly `ticks` ticks of a snowpack in which nothing moves.
    pub fn pass(&mut self, mut ticks: u64) {
        while ticks > 0 {
            ticks -= self.advance(ticks, u32::MAX).ticks;
        }
    }
}

/// Ticks of a rate \[Hz\] that fall after frame `from` up to frame `to`; none where `to` is the earlier
/// one. They fall on the same frames in all sessions of one rate.
pub(crate) fn ticks_between(tick_rate: f64, from: u64, to: u64) -> u64 {
    let ticks = |frame: u64| (frame as f64 * tick_rate / FRAME_RATE + 1e-9).floor() as u64;
    ticks(to).saturating_sub(ticks(from))
}

/// Number of equal cycles in which a time \[s\] is spent.
fn cycles_in(spent: f64) -> f64 {
    (spent / LONGEST_CYCLE - 1e-9).ceil().max(1.0)
}

/// Ticks of length `dt` until at least `time` has passed, at least one; `None` where it never will.
fn ticks_until(time: f64, dt: f64) -> Option<u64> {
    if dt <= 0.0 {
        return None;
    }
    let mut ticks = (time / dt).ceil().max(1.0);
    // The quotient is rounded; the product decides.
    if ticks > 1.0 && (ticks - 1.0) * dt >= time {
        ticks -= 1.0;
    } else if ticks * dt < time {
        ticks += 1.0;
    }
    Some(ticks as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_at_real_time_is_one_cycle() {
        let mut clock = Clock::new(60.0, 1.0);
        let advance = clock.advance(7200, u32::MAX);
        assert_eq!(advance.run, Run { cycles: 7200, dt: 1.0 / 60.0 });
        assert_eq!((clock.tick(), advance.ticks), (7200, 7200));
        assert!((clock.sim_time() - 120.0).abs() < 1e-9);
    }

    #[test]
    fn slow_ticks_save_up_time() {
        let mut clock = Clock::new(240.0, 0.1);
        let advance = clock.advance(4800, u32::MAX);
        assert_eq!(advance.run.cycles, 120);
        assert!((advance.run.dt - 1.0 / 60.0).abs() < 1e-9);
    }

    #[test]
    fn fast_ticks_make_several_equal_cycles() {
        let mut clock = Clock::new(60.0, 30.0);
        assert_eq!(clock.advance(1, u32::MAX).run, Run { cycles: 2, dt: 0.25 });
        let mut clock = Clock::new(1.0, 1000.0);
        assert_eq!(clock.advance(1, u32::MAX).run, Run { cycles: 4000, dt: 0.25 });
    }

    #[test]
    fn ticks_taken_in_any_portions_spend_the_same_time() {
        for (rate, scale) in [(90.0, 1.0), (240.0, 0.37), (7.0, 3.0), (60.0, 0.0), (144.0, 1.3)] {
            let mut whole = Clock::new(rate, scale);
            let mut parts = whole;
            let mut cycles = 0;
            let mut left = 1000;
            while left > 0 {
                let advance = whole.advance(left, u32::MAX);
                cycles += advance.run.cycles;
                left -= advance.ticks;
            }
            let one_by_one: u32 = (0..1000).map(|_| parts.advance(1, 1).run.cycles).sum();
            assert_eq!(cycles, one_by_one, "{rate} Hz, time scale {scale}");
            assert_eq!(whole.sim_time(), parts.sim_time());
        }
    }

    #[test]
    fn a_changed_rate_keeps_what_was_saved_up() {
        let mut clock = Clock::new(240.0, 0.1);
        clock.advance(30, u32::MAX);
        let before = clock.sim_time();
        clock.set_rate(60.0, 1.0);
        assert_eq!(clock.sim_time(), before);
        let advance = clock.advance(10, u32::MAX);
        assert_eq!(advance.ticks, 1, "the first spending is longer than those after it");
        assert!((advance.run.dt - (30.0 * 0.1 / 240.0 + 1.0 / 60.0)).abs() < 1e-12);
        assert_eq!(clock.advance(9, u32::MAX).run.cycles, 9);
    }

    #[test]
    fn settling_is_dated_by_the_tick_that_found_nothing_moving() {
        let mut clock = Clock::new(60.0, 1.0);
        let advance = clock.advance(100, u32::MAX);
        assert_eq!(advance.settled_after(0), Some(1));
        assert_eq!(advance.settled_after(40), Some(41));
        assert_eq!(advance.settled_after(100), None);
        let two_cycles = Clock::new(60.0, 30.0).advance(10, u32::MAX);
        assert_eq!(two_cycles.settled_after(2), Some(2));
        assert_eq!(two_cycles.settled_after(3), Some(2));
        let idle = Clock::new(60.0, 0.0).advance(10, u32::MAX);
        assert_eq!(idle.settled_after(0), None);
    }

    #[test]
    fn ticks_of_one_rate_fall_on_the_same_frames() {
        let clock = Clock::new(45.0, 1.0);
        let per_frame: Vec<u64> = (0..8).map(|f| clock.ticks_between(f, f + 1)).collect();
        assert_eq!(per_frame.iter().sum::<u64>(), 6);
        assert_eq!(clock.ticks_between(0, 60), 45);
        assert_eq!(Clock::new(240.0, 1.0).ticks_between(9, 10), 4);
    }

    #[test]
    fn what_is_too_far_away_is_not_waited_for() {
        for (rate, scale) in
            [(1.0, 1e-15), (1.0, 1e-16), (7.0, 1e-15), (1.0, 5e-324), (240.0, 1e-11)]
        {
            assert_eq!(Clock::new(rate, scale).ticks_until(900.0), None, "{rate} Hz, {scale}");
        }
        let clock = Clock::new(1.0, 1e-10);
        let ticks = clock.ticks_until(900.0).expect("it comes");
        let frame = clock.frame_before(3, ticks);
        assert!(
            clock.ticks_between(3, frame) < ticks && clock.ticks_between(3, frame + 1) >= ticks
        );
    }
}
