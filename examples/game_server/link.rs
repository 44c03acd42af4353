//! The connection over which the game tells the server what happens, and how late it answers.

use std::time::{Duration, Instant};

use firn_client::{Ack, Message, Session, Stream};
use firn_protocol::stream::{Command, SubProtocol};
use firn_protocol::{ProbeBatch, ProbeView};

use crate::Failure;

pub struct Link {
    stream: Stream,
    /// Commands so far. Their numbers are their ids.
    commands: i64,
    /// When those were sent that have no answer yet.
    open: Vec<(i64, Instant)>,
    /// Tick of the last answer.
    pub tick: u64,
    /// How late answers were.
    pub late: Vec<Duration>,
}

impl Link {
    pub async fn open(session: &Session) -> Result<Link, Failure> {
        let stream = session.stream(SubProtocol::Json).await?;
        Ok(Link { stream, commands: 0, open: Vec::new(), tick: 0, late: Vec::new() })
    }

    /// Sends a command, whose id it returns, and does not wait for the answer.
    pub async fn send(&mut self, command: impl FnOnce(i64) -> Command) -> Result<i64, Failure> {
        self.commands += 1;
        self.open.push((self.commands, Instant::now()));
        self.stream.send(&command(self.commands)).await?;
        Ok(self.commands)
    }

    /// Waits until every command has its answer.
    pub async fn answers(&mut self) -> Result<Vec<Ack>, Failure> {
        let mut answers = Vec::new();
        while !self.open.is_empty() {
            match self.stream.next().await? {
                Message::Ack(ack) => {
                    let answered = self.open.extract_if(.., |(id, _)| *id == ack.id);
                    self.late.extend(answered.map(|(_, sent)| sent.elapsed()));
                    self.tick = self.tick.max(ack.stamp.tick);
                    answers.push(ack);
                }
                Message::Refused { problem, .. } => {
                    return Err(format!(
                        "the server refused a command: {} {:?}",
                        problem.detail, problem.errors
                    )
                    .into());
                }
                _ => {}
            }
        }
        Ok(answers)
    }

    /// Asks how deep loads would sink \[m\].
    pub async fn probe(&mut self, batch: ProbeBatch) -> Result<Vec<f64>, Failure> {
        self.send(|id| Command::Probes { id, batch }).await?;
        let mut ack = self.answers().await?.pop().ok_or("the server did not answer the probes")?;
        let probes = ack.reply.remove("probes").unwrap_or_default();
        let probes: Vec<ProbeView> = serde_json::from_value(probes)?;
        Ok(probes.iter().map(|probe| probe.sink_depth).collect())
    }
}
