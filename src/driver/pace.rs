//! Whether the engine keeps up with the clock.

use std::time::Duration;

/// Time over which slipping is averaged \[s\].
const MEMORY: f64 = 2.0;

/// Share of the time that slips from which on the engine counts as overloaded, and the share below
/// which it no longer does.
const OVERLOADED: f64 = 0.05;
const RELIEVED: f64 = 0.01;

/// Watches how much of the time slips: ticks that are not taken because frames were too slow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Pace {
    slipping: f64,
    overloaded: bool,
}

impl Pace {
    /// Notes that of some time a part has slipped. Returns whether the engine is overloaded.
    pub fn note(&mut self, passed: Duration, slipped: Duration) -> bool {
        let passed = passed.as_secs_f64();
        if passed > 0.0 {
            let share = (slipped.as_secs_f64() / passed).min(1.0);
            let kept = (-passed / MEMORY).exp();
            self.slipping = kept * self.slipping + (1.0 - kept) * share;
        }
        let most = if self.overloaded { RELIEVED } else { OVERLOADED };
        self.overloaded = self.slipping > most;
        self.overloaded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEAT: Duration = Duration::from_millis(16);

    #[test]
    fn one_slow_frame_is_no_overload_and_many_are() {
        let mut pace = Pace::default();
        assert!(!pace.note(BEAT * 3, BEAT * 2));
        let late = (0..1000).position(|_| pace.note(BEAT * 2, BEAT)).unwrap();
        assert!((2..40).contains(&late), "{late}");
    }

    #[test]
    fn an_overload_passes_when_nothing_slips_any_more() {
        let mut pace = Pace::default();
        while !pace.note(BEAT * 4, BEAT * 3) {}
        let beats = (0..10_000).position(|_| !pace.note(BEAT, Duration::ZERO)).unwrap();
        assert!((100..1000).contains(&beats), "{beats}");
    }
}
