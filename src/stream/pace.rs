//! When a subscription's next message may be sent. No I/O.

use std::time::Duration;

use tokio::time::Instant;

/// How much a client would miss if it were told nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum News {
    Nothing,
    /// Something has changed between two ticks.
    Change,
    /// A tick was taken, or the view has moved.
    Tick,
}

/// Keeps a subscription's messages apart, and knows whether there is something to tell.
#[derive(Debug)]
pub struct Pace {
    /// Mean time between two messages, at least.
    period: Duration,
    /// When a message about a new tick may be sent; a period later, one about anything else.
    turn: Instant,
    /// Tick of the newest message.
    told_tick: u64,
    /// What there is to tell.
    news: News,
}

impl Pace {
    /// At most so many messages per second \[Hz\]; the first may be sent at once.
    pub fn new(max_rate: f64, now: Instant) -> Pace {
        let period = Duration::from_secs_f64(1.0 / max_rate);
        Pace { period, turn: now, told_tick: 0, news: News::Tick }
    }

    /// Notes that there may be something to tell, and of which tick.
    pub fn mark(&mut self, tick: u64) {
        let news = if tick > self.told_tick { News::Tick } else { News::Change };
        self.news = self.news.max(news);
    }

    /// Notes that the view has moved.
    pub fn mark_move(&mut self) {
        self.news = News::Tick;
    }

    /// When the next message may be sent, where there may be one.
    ///
    /// The rate is kept on average. A tick may be told up to one period early: otherwise a client
    /// that asks for as many messages as there are ticks would get each as late after its tick as
    /// it happened to subscribe after one. Changes between ticks wait for their turn: otherwise
    /// they would take that of the tick after them.
    pub fn due(&self) -> Option<Instant> {
        match self.news {
            News::Nothing => None,
            News::Change => Some(self.turn + self.period),
            News::Tick => Some(self.turn),
        }
    }

    /// Puts the next message off.
    pub fn put_off(&mut self, until: Instant) {
        self.turn = self.turn.max(until);
    }

    /// Notes that everything up to a tick was taken to be told.
    pub fn take_news(&mut self, tick: u64) {
        self.told_tick = tick;
        self.news = News::Nothing;
    }

    /// Notes that the first message was told.
    pub fn begin(&mut self, now: Instant) {
        self.turn = now;
    }

    /// Notes that something was told.
    pub fn take_turn(&mut self, now: Instant) {
        self.turn = now.max(self.turn + self.period);
    }
}
