//! A game server that asks Firn about the snow: 20 walkers cross a field of packed snow with soft
//! drifts in it. Twenty times a second it asks how deep each could sink on the ways ahead, chooses
//! one, and puts the walkers' weight on the snow, all in one batch over the stream.
//!
//! ```sh
//! cargo run --release --example game_server -- http://127.0.0.1:8080 10
//! ```
//!
//! The arguments are the server's address and how long to walk \[s\]. A guarded server's key comes
//! from `FIRN_API_KEY`.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::time::Duration;

use firn_client::{Client, Message, Session, Stream};
use firn_protocol::stream::{Command, SubProtocol};
use firn_protocol::{
    ColliderBatch, ColliderSpec, Probe, ProbeBatch, Region, SessionSpec, SnowLayer, Snowfall,
};
use firn_snow::{Grid, Position, Shape};

type Failure = Box<dyn Error + Send + Sync>;

const WALKERS: usize = 20;
const RATE: f64 = 20.0;
/// Side of the field \[m\].
const FIELD: f64 = 20.0;
/// Speed of a walker \[m/s\], mass with what it carries \[kg\], radius of its footprint \[m\].
const SPEED: f64 = 1.4;
const MASS: f64 = 90.0;
const RADIUS: f64 = 0.3;
/// How far ahead a walker looks \[m\], and the turns it thinks of \[rad\].
const AHEAD: f64 = 1.2;
const TURNS: [f64; 7] = [0.0, 0.4, -0.4, 0.8, -0.8, 1.3, -1.3];
/// Depth \[m\] that a walker would rather sink than turn by one radian.
const PATIENCE: f64 = 0.15;

#[tokio::main]
async fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let url = arguments.next().unwrap_or("http://127.0.0.1:8080".to_owned());
    let seconds: f64 = arguments.next().as_deref().unwrap_or("10").parse()?;
    let key = std::env::var("FIRN_API_KEY").ok();
    let mut client = Client::new(&url)?;
    if let Some(key) = key {
        client = client.with_key(&key)?;
    }
    let field = make_field(&client).await?;
    let walked = walk(&field, seconds).await;
    field.delete().await?;
    walked
}

/// Packed snow, and soft drifts on it.
async fn make_field(client: &Client) -> Result<Session, Failure> {
    let side = (FIELD / 0.2) as u32;
    let packed = SnowLayer { depth: 1.0, density: Some(100.0), temperature: Some(-8.0) };
    let spec = SessionSpec {
        grid: Grid { width: side, depth: side, height: 20, cell_size: 0.2 },
        initial_snow: vec![packed],
        air_temperature: -8.0,
        ..SessionSpec::default()
    };
    let (field, _) = client.create(&spec).await?;
    for drift in 0..6 {
        let (x, z) = (2.0 + 3.0 * f64::from(drift), 3.0 + f64::from(drift * 5 % 7) * 2.0);
        let region = Some(Region { x, z, width: 1.6, depth: 4.0 });
        field.snowfall(&Snowfall { density: Some(20.0), region, ..Snowfall::new(1.2) }).await?;
    }
    Ok(field)
}

async fn walk(field: &Session, seconds: f64) -> Result<(), Failure> {
    let mut stream = field.stream(SubProtocol::Json).await?;
    let mut walkers: Vec<Walker> = (0..WALKERS).map(Walker::at_the_edge).collect();
    let mut beat = tokio::time::interval(Duration::from_secs_f64(1.0 / RATE));
    let mut told = Told::default();
    for step in 1..=(seconds * RATE) as i64 {
        beat.tick().await;
        let ways: Vec<Way> = walkers.iter_mut().flat_map(Walker::ways).collect();
        let probes = ways.iter().map(Way::probe).collect();
        let answer = field.probe(&ProbeBatch { probes }).await?;
        let sinks: Vec<f64> = answer.probes.iter().map(|probe| probe.sink_depth).collect();
        let choices = ways.chunks(TURNS.len()).zip(sinks.chunks(TURNS.len()));
        for (walker, (ways, sinks)) in walkers.iter_mut().zip(choices) {
            told.note(sinks[0], walker.choose(ways, sinks));
        }
        let put = walkers.iter().map(Walker::collider).collect();
        let batch = ColliderBatch { put, ..ColliderBatch::default() };
        let tick = change(&mut stream, &Command::Colliders { id: step, batch }).await?;
        if step % RATE as i64 == 0 {
            told.print(tick);
        }
    }
    stream.close().await;
    Ok(())
}

/// Sends a change and waits for its answer; the tick at which it was applied.
async fn change(stream: &mut Stream, change: &Command) -> Result<u64, Failure> {
    stream.send(change).await?;
    loop {
        match stream.next().await? {
            Message::Ack(ack) => return Ok(ack.stamp.tick),
            Message::Refused { problem, .. } => return Err(problem.detail.into()),
            _ => {}
        }
    }
}

/// Somebody who walks across the field.
struct Walker {
    name: String,
    x: f64,
    z: f64,
    /// Where it wants to go, and where it goes \[rad\].
    goal: (f64, f64),
    heading: f64,
}

/// A place a step ahead, and the turn that it takes.
struct Way {
    x: f64,
    z: f64,
    heading: f64,
    turn: f64,
}

impl Way {
    fn probe(&self) -> Probe {
        Probe { x: self.x, z: self.z, mass: MASS, area: PI * RADIUS * RADIUS, duration: None }
    }
}

impl Walker {
    fn at_the_edge(number: usize) -> Walker {
        let z = FIELD * (number as f64 + 0.5) / WALKERS as f64;
        let name = format!("walker-{number}");
        Walker { name, x: 1.0, z, goal: (FIELD - 1.0, z), heading: 0.0 }
    }

    /// The ways that it could go; the first is straight to its goal.
    fn ways(&mut self) -> Vec<Way> {
        let (dx, dz) = (self.goal.0 - self.x, self.goal.1 - self.z);
        if dx.hypot(dz) < AHEAD {
            self.goal.0 = FIELD - self.goal.0;
        }
        let straight = (self.goal.1 - self.z).atan2(self.goal.0 - self.x);
        let inside = |place: f64| place.clamp(RADIUS + 0.01, FIELD - RADIUS - 0.01);
        let way = |turn: &f64| {
            let heading = straight + turn;
            let (x, z) = (self.x + AHEAD * heading.cos(), self.z + AHEAD * heading.sin());
            Way { x: inside(x), z: inside(z), heading, turn: turn.abs() }
        };
        TURNS.iter().map(way).collect()
    }

    /// Takes a step on the way that costs least; how deep it would sink there.
    fn choose(&mut self, ways: &[Way], sinks: &[f64]) -> f64 {
        // Who has begun to turn goes on that way: otherwise it would waver before a drift.
        let change = |way: &Way| (way.heading - self.heading + PI).rem_euclid(TAU) - PI;
        let cost =
            |(way, sink): &(&Way, &f64)| *sink + PATIENCE * (way.turn + 0.3 * change(way).abs());
        let cheapest = ways.iter().zip(sinks).min_by(|a, b| cost(a).total_cmp(&cost(b)));
        let (way, sink) = cheapest.expect("there is a way");
        let step = SPEED / RATE / AHEAD;
        (self.x, self.z) = (self.x + (way.x - self.x) * step, self.z + (way.z - self.z) * step);
        self.heading = way.heading;
        *sink
    }

    fn collider(&self) -> ColliderSpec {
        ColliderSpec {
            id: Some(self.name.clone()),
            mass: MASS,
            shape: Some(Shape::Disk { radius: RADIUS }),
            position: Position { x: self.x, z: self.z },
            ..ColliderSpec::default()
        }
    }
}

/// What is told once a second.
#[derive(Default)]
struct Told {
    steps: f64,
    straight: f64,
    chosen: f64,
    deepest: f64,
}

impl Told {
    fn note(&mut self, straight: f64, chosen: f64) {
        self.steps += 1.0;
        self.straight += straight;
        self.chosen += chosen;
        self.deepest = self.deepest.max(chosen);
    }

    fn print(&mut self, tick: u64) {
        println!(
            "tick {tick}: straight on they would sink {:.2} m on average; steering they sink {:.2} m, {:.2} m at most",
            self.straight / self.steps,
            self.chosen / self.steps,
            self.deepest
        );
        *self = Told::default();
    }
}
