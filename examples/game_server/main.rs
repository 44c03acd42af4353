//! A game server with a hundred metres of snow: twenty walkers, a car, a plough, and ten viewers.
//!
//! The snow is simulated by Firn. This program is the rest of the game. Twenty times a second it
//! moves everybody, tells the server in one batch, and clears the road behind the plough. Viewers
//! stream the surface as players would.
//!
//! ```sh
//! cargo run --release --example game_server -- http://127.0.0.1:8080 10
//! ```
//!
//! The arguments are the server's address and how long to play \[s\], `inf` for as long as it is
//! not interrupted. With `--keep` the session is called `demo-scene` and stays when the game ends.
//! A guarded server's key comes from `FIRN_API_KEY`.

mod car;
mod link;
mod place;
mod plough;
mod report;
mod scene;
mod sweep;
mod viewers;
mod walkers;

use std::error::Error;
use std::pin::pin;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use firn_client::Client;
use firn_protocol::stream::Command;
use firn_protocol::{ColliderBatch, ProbeBatch};
use tokio::time::{MissedTickBehavior, interval};

use car::Car;
use link::Link;
use plough::Plough;
use report::Report;
use scene::Scene;
use viewers::Viewers;
use walkers::{Walkers, Way};

type Failure = Box<dyn Error + Send + Sync>;

/// Turns of the game per second, and ticks of its snow.
const RATE: f64 = 20.0;
/// Turns of the game from one report to the next.
const REPORTED: u64 = 200;

/// A game server on a hundred metres of snow.
#[derive(Parser)]
struct Options {
    /// Address of the Firn server.
    #[arg(default_value = "http://127.0.0.1:8080")]
    server: String,
    /// How long to play [s]; inf: until it is interrupted.
    #[arg(default_value_t = 10.0)]
    seconds: f64,
    /// Call the session demo-scene, and leave it when the game ends.
    #[arg(long)]
    keep: bool,
    /// Side of the scene [m], from 30 to 200.
    #[arg(long, default_value_t = 100.0, value_parser = scene::side)]
    size: f64,
    /// Key of a guarded server.
    #[arg(long, env = "FIRN_API_KEY", hide_env_values = true)]
    key: Option<String>,
}

#[tokio::main]
async fn main() -> ExitCode {
    match run(Options::parse()).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("game_server: {why}");
            ExitCode::FAILURE
        }
    }
}

async fn run(options: Options) -> Result<(), Failure> {
    let mut client = Client::new(&options.server)?;
    if let Some(key) = &options.key {
        client = client.with_key(key)?;
    }
    let scene = Scene::make(&client, options.size, options.keep).await?;
    println!("look at {}/#/sessions/{}\n", options.server, scene.session.id());
    let played = play(&scene, options.seconds).await;
    if !options.keep {
        scene.session.delete().await?;
    }
    played
}

/// Plays for so many seconds or until it is interrupted, and tells what it saw every ten.
async fn play(scene: &Scene, seconds: f64) -> Result<(), Failure> {
    let mut viewers = Viewers::watch(scene).await?;
    let mut game = Game::new(scene).await?;
    let mut beat = interval(Duration::from_secs_f64(1.0 / RATE));
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut interrupted = pin!(tokio::signal::ctrl_c());
    let report = Report::begin(scene).await?;
    loop {
        tokio::select! {
            _ = beat.tick() => game.turn().await?,
            _ = &mut interrupted => break,
        }
        if report.seconds() >= seconds {
            break;
        }
        if game.turns.is_multiple_of(REPORTED) {
            viewers.check()?;
            report.print(scene, &mut game.link.late, &viewers.seen).await?;
        }
    }
    game.stop().await?;
    viewers.check()?;
    report.print(scene, &mut game.link.late, &viewers.seen).await
}

/// All that moves, and the connection over which the snow is told.
struct Game {
    link: Link,
    walkers: Walkers,
    car: Car,
    plough: Plough,
    turns: u64,
    /// Tick at which the server took the last batch.
    told: u64,
}

impl Game {
    async fn new(scene: &Scene) -> Result<Game, Failure> {
        Ok(Game {
            link: Link::open(&scene.session).await?,
            walkers: Walkers::new(scene.size),
            car: Car::new(scene.size),
            plough: Plough::new(scene.size),
            turns: 0,
            told: 0,
        })
    }

    /// One turn: ask about the snow ahead, move everybody, tell the server.
    async fn turn(&mut self) -> Result<(), Failure> {
        let ways = self.walkers.look_ahead(self.turns);
        let mut put = Vec::new();
        if !ways.is_empty() {
            let probes = ways.iter().map(Way::probe).collect();
            let sinks = self.link.probe(ProbeBatch { probes }).await?;
            put = self.walkers.step(&ways, &sinks);
        }
        // A tick later than the last batch everything has moved as it was told.
        let moved = self.link.tick > self.told;
        put.push(self.car.drive(moved));
        put.push(self.plough.drive(moved));
        let batch = ColliderBatch { put, ..ColliderBatch::default() };
        let batch = self.link.send(|id| Command::Colliders { id, batch }).await?;
        let clearing = self.plough.clearing();
        self.link.send(|id| Command::Clearing { id, clearing }).await?;
        let answers = self.link.answers().await?;
        let told = answers.iter().find(|ack| ack.id == batch);
        self.told = told.map_or(self.link.tick, |ack| ack.stamp.tick);
        self.turns += 1;
        Ok(())
    }

    /// Stops what would go on by itself.
    async fn stop(&mut self) -> Result<(), Failure> {
        let put = vec![self.car.stop(), self.plough.stop()];
        let batch = ColliderBatch { put, ..ColliderBatch::default() };
        self.link.send(|id| Command::Colliders { id, batch }).await?;
        self.link.answers().await?;
        Ok(())
    }
}
