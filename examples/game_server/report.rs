//! What the game saw: how late the server answered, what viewers got, and what it cost the server.

use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use firn_client::Client;

use crate::Failure;
use crate::scene::Scene;
use crate::viewers::Seen;

pub struct Report {
    begun: Instant,
    tick: u64,
    before: Figures,
}

impl Report {
    pub async fn begin(scene: &Scene) -> Result<Report, Failure> {
        let tick = scene.session.view().await?.tick;
        let before = Figures::read(scene.session.client()).await?;
        Ok(Report { begun: Instant::now(), tick, before })
    }

    /// Seconds since it began.
    pub fn seconds(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Prints what was seen since it began.
    pub async fn print(
        &self,
        scene: &Scene,
        late: &mut [Duration],
        seen: &Seen,
    ) -> Result<(), Failure> {
        let seconds = self.seconds();
        let ticks = scene.session.view().await?.tick - self.tick;
        let now = Figures::read(scene.session.client()).await?;
        let (messages, bytes) = (seen.messages.load(Relaxed), seen.bytes.load(Relaxed));
        println!(
            "ticks          {ticks} in {seconds:.1} s, {:.1} a second",
            ticks as f64 / seconds
        );
        println!("answers        {}", lateness(late));
        println!("viewers        {messages} messages, {:.1} MB", bytes as f64 / 1e6);
        println!("deepest print  {:.2} m", seen.deepest());
        println!("frames         {}\n", now.since(&self.before));
        Ok(())
    }
}

/// Median and p99 of how late answers were.
fn lateness(late: &mut [Duration]) -> String {
    late.sort_unstable();
    let at = |part: f64| {
        let place = (late.len() as f64 * part) as usize;
        late.get(place).map_or(f64::NAN, |late| late.as_secs_f64() * 1e3)
    };
    format!("{} of them, median {:.1} ms, p99 {:.1} ms", late.len(), at(0.5), at(0.99))
}

/// What the server says of its frames.
struct Figures {
    frames: f64,
    /// Seconds that they took.
    time: f64,
    /// Those whose time on the device was taken, and that time.
    timed: f64,
    device: f64,
}

impl Figures {
    async fn read(client: &Client) -> Result<Figures, Failure> {
        let text = client.fetch("/metrics").await?.text().await?;
        // One series, or all of one name added up.
        let sum = |name: &str| -> f64 {
            let of_name = |line: &&str| line.split(['{', ' ']).next() == Some(name);
            let values = text.lines().filter(of_name).filter_map(|line| line.rsplit(' ').next());
            values.filter_map(|value| value.parse::<f64>().ok()).sum()
        };
        Ok(Figures {
            frames: sum("firn_frames_total"),
            time: sum("firn_frame_time_seconds_total"),
            timed: sum("firn_timed_frames_total"),
            device: sum("firn_stage_time_seconds_total"),
        })
    }

    fn since(&self, before: &Figures) -> String {
        let frames = self.frames - before.frames;
        let mean = 1e3 * (self.time - before.time) / frames;
        let timed = self.timed - before.timed;
        let device = 1e3 * (self.device - before.device) / timed;
        let all = format!("{frames} of {mean:.1} ms on average");
        if timed == 0.0 {
            return format!("{all}; the device timed none of them");
        }
        format!("{all}; of those timed the device took {device:.1} ms")
    }
}
