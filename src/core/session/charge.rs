//! Device time that a session has taken, and whether it waits for others that have taken less.

use std::time::Duration;

use crate::core::session::FRAME_RATE;

/// Sessions whose part of a frame takes no longer than this are in every frame.
const LIGHT: Duration = Duration::from_millis(1);

/// So are those that have taken no larger share of the device of late.
const LIGHT_SHARE: f64 = 0.05;

/// What a frame costs beside its units: nobody is charged for that.
const BESIDE: Duration = Duration::from_micros(500);

/// Time in a frame that there is for all others.
const ROOM: Duration = Duration::from_millis(12);

/// Time over which the device time of a session is remembered \[s\].
const MEMORY: f64 = 1.0;

/// Device time that was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Charge {
    /// What it took in its newest frame, and what it will take in the next.
    newest: Duration,
    /// What it took of late \[s\], up to a frame.
    recent: f64,
    frame: u64,
    /// Frames that it has waited for.
    pub waits: u64,
}

impl Charge {
    /// Adds what a frame took.
    pub fn add(&mut self, took: Duration, frame: u64) {
        self.recent = self.recent(frame) + took.as_secs_f64();
        self.newest = took;
        self.frame = frame;
    }

    /// Device time of late \[s\]: what is longer ago counts less.
    pub fn recent(&self, frame: u64) -> f64 {
        let ago = frame.saturating_sub(self.frame) as f64 / FRAME_RATE;
        self.recent * (-ago / MEMORY).exp()
    }

    /// Part of the device that it has had of late.
    pub fn share(&self, frame: u64) -> f64 {
        self.recent(frame) / MEMORY
    }

    /// Whether it takes so much that it may have to wait.
    pub fn is_heavy(&self, frame: u64) -> bool {
        self.newest > LIGHT && self.share(frame) > LIGHT_SHARE
    }
}

/// The device time of a frame, to be parted among its sessions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bill {
    /// Time that the frame took.
    pub took: Duration,
    /// Units that it had.
    pub units: u64,
}

impl Bill {
    /// What a session is charged for so many of the units.
    pub fn part(&self, units: u64) -> Duration {
        self.took.saturating_sub(BESIDE).mul_f64(units as f64 / self.units.max(1) as f64)
    }

    /// What all of them are charged together.
    pub fn sum(&self) -> Duration {
        self.part(self.units)
    }
}

/// Which of the sessions that take much wait in a frame: in ascending order of what they took of late, there
/// is room for some of them, but for one at least.
pub(crate) fn who_waits(charges: &[Charge], frame: u64) -> Vec<usize> {
    let mut heavy: Vec<usize> =
        (0..charges.len()).filter(|&place| charges[place].is_heavy(frame)).collect();
    let recent = |place: &usize| charges[*place].recent(frame);
    heavy.sort_by(|a, b| recent(a).total_cmp(&recent(b)));
    let mut taken = Duration::ZERO;
    heavy.retain(|&place| {
        let first = taken.is_zero();
        let fits = first || taken + charges[place].newest <= ROOM;
        if fits {
            taken += charges[place].newest;
        }
        !fits
    });
    heavy
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// Frames that each session is in, where they take so many milliseconds.
    fn frames(costs: &[u64], beats: u64) -> Vec<u64> {
        let mut charges = vec![Charge::default(); costs.len()];
        let mut frames = vec![0; costs.len()];
        for frame in 0..beats {
            let waiting = who_waits(&charges, frame);
            for (place, charge) in charges.iter_mut().enumerate() {
                if !waiting.contains(&place) {
                    charge.add(ms(costs[place]), frame);
                    frames[place] += 1;
                }
            }
        }
        frames
    }

    #[test]
    fn who_takes_little_never_waits() {
        assert_eq!(frames(&[1, 1, 11, 1, 500], 100)[..2], [100, 100]);
        assert_eq!(frames(&[11, 1], 100), [100, 100], "and nobody waits for that alone");
    }

    #[test]
    fn those_who_take_long_get_the_same_time() {
        let alike = frames(&[10, 10, 10, 10], 400);
        assert!(alike.iter().all(|count| (95..=110).contains(count)), "{alike:?}");
        let frames = frames(&[12, 4, 4, 4], 4000);
        let times: Vec<u64> = frames.iter().zip([12, 4, 4, 4]).map(|(n, cost)| n * cost).collect();
        let (least, most) = (times.iter().min().unwrap(), times.iter().max().unwrap());
        assert!(most - least <= most / 4, "{times:?}");
    }

    #[test]
    fn what_fits_together_is_in_one_frame() {
        assert_eq!(frames(&[6, 6], 50), [50, 50]);
        assert_eq!(frames(&[2; 6], 50), [50; 6]);
    }

    #[test]
    fn a_frame_is_charged_to_its_sessions_but_for_what_it_costs_by_itself() {
        let bill = Bill { took: ms(10), units: 1000 };
        assert_eq!(bill.sum(), ms(10) - BESIDE);
        assert_eq!(bill.part(250) + bill.part(750), bill.sum());
        let short = Bill { took: BESIDE, units: 1000 };
        assert_eq!(short.sum(), Duration::ZERO);
        assert_eq!(Bill { took: ms(10), units: 0 }.sum(), Duration::ZERO);
    }

    #[test]
    fn what_is_long_ago_is_forgotten() {
        let mut charge = Charge::default();
        charge.add(ms(500), 60);
        assert!((charge.recent(60) - 0.5).abs() < 1e-9);
        assert!((charge.recent(120) - 0.5 * (-1.0f64).exp()).abs() < 1e-9);
        for frame in 0..1000 {
            charge.add(ms(4), frame);
        }
        let share = charge.share(1000);
        assert!((share - 0.24).abs() < 0.01, "4 ms of 16.7: {share}");
    }
}
