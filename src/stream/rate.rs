//! How fast one client may send commands.

use tokio::time::Instant;

/// Lets through `rate` commands a second on average, and as many at once after a pause.
#[derive(Clone, Copy, Debug)]
pub struct CommandRate {
    rate: f64,
    left: f64,
    at: Instant,
}

impl CommandRate {
    /// A rate of at least one command a second.
    pub fn new(per_second: u32, now: Instant) -> CommandRate {
        let rate = f64::from(per_second.max(1));
        CommandRate { rate, left: rate, at: now }
    }

    /// Whether one more command is within the rate.
    pub fn allows(&mut self, now: Instant) -> bool {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + passed * self.rate).min(self.rate);
        self.at = now;
        let allows = self.left >= 1.0;
        if allows {
            self.left -= 1.0;
        }
        allows
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_second_of_commands_may_come_at_once_and_then_one_at_a_time() {
        let start = Instant::now();
        let mut rate = CommandRate::new(4, start);
        assert!((0..4).all(|_| rate.allows(start)));
        assert!(!rate.allows(start));
        let later = start + Duration::from_millis(250);
        assert!(rate.allows(later));
        assert!(!rate.allows(later));
        let much_later = start + Duration::from_secs(60);
        assert!((0..4).all(|_| rate.allows(much_later)));
        assert!(!rate.allows(much_later));
    }
}
