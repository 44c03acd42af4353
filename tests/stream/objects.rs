//! Objects that move and carry snow, by the Rust client, `firn-client`.

use firn::config::BackendChoice;
use firn_client::{Client, Message, Session};
use firn_protocol::stream::{Command, SubProtocol};
use firn_protocol::{
    Clearing, ColliderPatch, ColliderReply, ColliderSpec, Pressing, SessionSpec, SnowLayer,
    Snowfall, StepSpec, Subscribe,
};
use firn_snow::{Grid, Position, Shape};
use tokio::time::timeout;

use crate::on_each_backend;
use crate::support::wait::PATIENCE;
use crate::support::{Server, numbers};

on_each_backend!(
    an_object_moves_and_follows_a_path,
    a_sweep_leaves_a_track,
    snow_lies_on_objects,
    an_object_is_patched_over_the_stream,
);

/// 6 m × 2 m of snow that gives way at once, at 20 ticks a second.
async fn soft(server: &Server) -> Session {
    let spec = SessionSpec {
        grid: Grid { width: 60, depth: 20, height: 20, cell_size: 0.1 },
        pressing: Pressing::Within(0.0),
        paused: true,
        tick_rate: 20.0,
        initial_snow: vec![SnowLayer::new(1.0)],
        ..SessionSpec::default()
    };
    Client::new(&server.url).unwrap().create(&spec).await.unwrap().0
}

fn ski() -> ColliderSpec {
    ColliderSpec {
        id: Some("ski".to_owned()),
        mass: 60.0,
        shape: Some(Shape::Box { width: 0.2, depth: 0.2 }),
        position: at(0.55, 1.0),
        ..ColliderSpec::default()
    }
}

fn at(x: f64, z: f64) -> Position {
    Position { x, z }
}

fn is_near(place: Position, x: f64, z: f64) -> bool {
    (place.x - x).abs() < 1e-6 && (place.z - z).abs() < 1e-6
}

async fn step(session: &Session, ticks: u64) {
    session.step(&StepSpec { ticks: Some(ticks), ..StepSpec::default() }).await.unwrap();
}

/// How deep the row of columns at z = 1 m is pressed.
async fn dents(server: &Server, session: &Session) -> Vec<f64> {
    let read = server.get(&session.path("/heights")).await.expect(200);
    let heights = numbers(&read["heights"]);
    heights[600..660].iter().map(|height| heights[0] - height).collect()
}

async fn an_object_moves_and_follows_a_path(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = soft(&server).await;
    let spec = ColliderSpec { velocity: at(2.0, 0.0), turn_rate: 90.0, ..ski() };
    let put = session.create_collider(&spec).await.unwrap().collider.body;
    assert_eq!((put.motion.velocity, put.motion.turn_rate), (at(2.0, 0.0), 90.0));
    step(&session, 20).await;
    let moved = session.collider("ski").await.unwrap().collider.body;
    assert!(is_near(moved.position, 2.55, 1.0) && (moved.heading - 90.0).abs() < 1e-6, "{moved:?}");

    let path = Some(vec![[2.55, 0.5], [1.55, 0.5]]);
    let patch = ColliderPatch { path, over: Some(1.5), ..ColliderPatch::default() };
    let told = session.patch_collider("ski", &patch).await.unwrap().collider.body.motion;
    assert!((told.speed.unwrap() - 1.0).abs() < 1e-9 && told.velocity.is_zero(), "{told:?}");
    step(&session, 20).await;
    let underway = session.collider("ski").await.unwrap().collider.body;
    assert!(is_near(underway.position, 2.05, 0.5), "{underway:?}");
    assert_eq!(underway.motion.path, [[1.55, 0.5]]);
    step(&session, 20).await;
    let there = session.collider("ski").await.unwrap().collider.body;
    assert!(is_near(there.position, 1.55, 0.5) && there.motion.path.is_empty(), "{there:?}");

    let fast = ColliderPatch { velocity: Some(at(80.0, 80.0)), ..ColliderPatch::default() };
    let refused = session.patch_collider("ski", &fast).await.unwrap_err();
    assert_eq!(refused.problem().unwrap().errors[0].pointer, "/velocity");
    server.stop().await;
}

async fn a_sweep_leaves_a_track(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = soft(&server).await;
    session.create_collider(&ski()).await.unwrap();
    let to = Some(at(2.55, 1.0));
    let sweep = ColliderPatch {
        position: to,
        heading: Some(90.0),
        sweep: true,
        ..ColliderPatch::default()
    };
    let swept = session.patch_collider("ski", &sweep).await.unwrap().collider.body;
    assert_eq!((swept.position, swept.motion.turn_to), (at(0.55, 1.0), Some(90.0)));
    step(&session, 1).await;
    let there = session.collider("ski").await.unwrap().collider.body;
    assert_eq!((Some(there.position), there.heading), (to, 90.0));
    let dents = dents(&server, &session).await;
    assert!(dents[6..26].iter().all(|dent| *dent > 0.05), "{dents:?}");
    server.stop().await;
}

async fn snow_lies_on_objects(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = soft(&server).await;
    let shape = Some(Shape::Box { width: 1.0, depth: 1.0 });
    let (roof, fence) = (Some("roof".to_owned()), Some("fence".to_owned()));
    let roof = ColliderSpec { id: roof, shape: shape.clone(), position: at(1.0, 1.0), ..ski() };
    session.create_collider(&roof).await.unwrap();
    let place = at(4.0, 1.0);
    let fence = ColliderSpec { id: fence, shape, position: place, shelters: false, ..ski() };
    session.create_collider(&fence).await.unwrap();
    session.snowfall(&Snowfall { density: Some(60.0), ..Snowfall::new(0.3) }).await.unwrap();
    let roof = session.collider("roof").await.unwrap().collider;
    assert!((roof.burden - 18.0).abs() < 0.02, "{roof:?}");
    let weight = roof.pressure * roof.contact_area;
    assert!((weight - 9.81 * (60.0 + roof.burden)).abs() < 0.01, "{roof:?}");
    let fence = session.collider("fence").await.unwrap().collider;
    assert_eq!((fence.body.shelters, fence.burden), (false, 0.0));
    let mass = session.mass().await.unwrap();
    assert_eq!((mass.carried, mass.imbalance_quanta), (roof.burden, 0));

    session.clear(&Clearing::default()).await.unwrap();
    assert!(session.column(10, 10).await.unwrap().height > 0.1, "a clearing spares it");
    assert_eq!(session.column(25, 10).await.unwrap().height, 0.0);
    let away = ColliderPatch { position: Some(at(2.5, 1.0)), ..ColliderPatch::default() };
    let moved = session.patch_collider("roof", &away).await.unwrap().collider;
    assert!(moved.burden < 0.01, "{moved:?}");
    assert_eq!(session.mass().await.unwrap().imbalance_quanta, 0);
    server.stop().await;
}

async fn an_object_is_patched_over_the_stream(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = soft(&server).await;
    session.create_collider(&ski()).await.unwrap();
    let mut stream = session.stream(SubProtocol::Binary).await.unwrap();
    let wish = Subscribe { colliders: true, max_rate: 60.0, ..Subscribe::default() };
    stream.subscribe(wish).await.unwrap();
    let patch = ColliderPatch {
        velocity: Some(at(1.0, 0.0)),
        path: Some(vec![[1.05, 1.0]]),
        over: Some(0.5),
        ..ColliderPatch::default()
    };
    let ski = || "ski".to_owned();
    stream.send(&Command::PatchCollider { id: 7, collider: ski(), patch }).await.unwrap();
    let lone = ColliderPatch { sweep: true, ..ColliderPatch::default() };
    stream.send(&Command::PatchCollider { id: 8, collider: ski(), patch: lone }).await.unwrap();
    let (mut acknowledged, mut refused) = (false, false);
    let mut next = async || timeout(PATIENCE, stream.next()).await.expect("it answers").unwrap();
    while !(acknowledged && refused) {
        match next().await {
            Message::Ack(ack) => {
                let told = session.collider("ski").await.unwrap();
                let collider = serde_json::from_value(ack.reply["collider"].clone()).unwrap();
                assert_eq!(ColliderReply { stamp: told.stamp, collider }, told);
                acknowledged = ack.id == 7;
            }
            Message::Refused { id, problem } => {
                assert_eq!((id, &*problem.errors[0].pointer), (Some(8), "/patch/sweep"));
                refused = true;
            }
            _ => {}
        }
    }
    step(&session, 20).await;
    loop {
        let Message::Heights(heights) = next().await else { continue };
        let list = heights.colliders.unwrap_or_default();
        if list.iter().any(|it| is_near(it.body.position, 1.55, 1.0)) {
            break;
        }
    }
    server.stop().await;
}
