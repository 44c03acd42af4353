//! What may fail.

use std::time::Duration;

use rand::Rng;

use crate::client::Request;
use crate::disk::Failing;
use crate::machine::Worker;
use crate::model::Operation;

use super::Simulation;

impl Simulation {
    /// Draws what fails.
    pub(super) fn fault(&mut self) -> Result<(), String> {
        match self.dice.random_range(0..108) {
            0..8 => {
                self.report.fault("device lost");
                self.device.lose();
            }
            8..12 => {
                self.report.fault("panic");
                self.device.panic();
            }
            12..18 => {
                self.report.fault("device full");
                self.device.set_full(true);
            }
            18..34 => self.device.heal(),
            34..38 => {
                self.report.fault("device absent");
                self.device.set_absent(true);
            }
            38..52 => {
                let ways = [
                    Failing::Full,
                    Failing::ReadOnly,
                    Failing::NoSync,
                    Failing::NoSyncOnce,
                    Failing::NoSyncOnce,
                    Failing::Panic,
                ];
                self.report.fault("disk");
                self.disk.fail(Some(ways[self.dice.random_range(0..ways.len())]));
            }
            52..70 => self.disk.fail(None),
            70..80 if !self.waiting.is_empty() => {
                let place = self.dice.random_range(0..self.waiting.len());
                // The server finishes these also when their client has gone. A repeat waits for the first.
                let Request { operation, once, .. } = &self.waiting[place];
                let kept =
                    once.is_some() || matches!(operation, Operation::Create(_) | Operation::Delete);
                if !kept {
                    self.report.fault("request abandoned");
                    self.give_up(place);
                }
            }
            80..86 => {
                self.report.fault("connection lost");
                let place = self.dice.random_range(0..self.viewers.len());
                self.viewers[place].cut();
            }
            86..89 => {
                self.report.fault("clock set");
                let ahead = self.dice.random_range(-100_000_000..100_000_000);
                self.machine.set_date(ahead);
            }
            89..92 => {
                self.report.fault("machine stalled");
                let seconds = self.dice.random_range(1..100);
                self.machine.advance(Duration::from_secs(seconds));
            }
            92..94 => {
                self.report.fault("crash");
                self.crash()?;
            }
            94..98 => {
                self.report.fault("power cut");
                let operations = self.dice.random_range(0..60);
                self.disk.cut_at(Some((operations, self.dice.random())));
            }
            98..104 => self.stall(),
            104..106 => self.die_young()?,
            106..108 => {
                self.report.fault("stop");
                self.stop()?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Some of those who work beside the world get no time for a while. What has waited for a commit may
    /// fail then.
    fn stall(&mut self) {
        for worker in Worker::ALL {
            if self.dice.random_bool(0.6) {
                self.report.fault("worker stalled");
                let milliseconds = self.dice.random_range(20..2000);
                self.machine.stall(worker, Duration::from_millis(milliseconds));
            }
        }
        if self.dice.random_bool(0.5) {
            self.disk.fail(Some(Failing::NoSyncOnce));
        }
    }

    /// The process dies again and again before it has made a checkpoint, while clients only watch.
    fn die_young(&mut self) -> Result<(), String> {
        self.report.fault("young death");
        for _ in 0..self.dice.random_range(2..5) {
            if self.dice.random_bool(0.5) {
                self.device.lose();
            }
            for _ in 0..self.dice.random_range(20..100) {
                self.machine.begin();
                match self.dice.random_range(0..4) {
                    0 => self.turn()?,
                    1 => self.work(Worker::Commits),
                    2 => self.work(Worker::Reads),
                    _ => self.watch()?,
                }
                self.look()?;
            }
            self.crash()?;
        }
        Ok(())
    }
}
