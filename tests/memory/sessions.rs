//! What the server says that sessions take of memory, beside what it asks the system for.
//! Cells are on the graphics device, so that all that is asked for is what is kept on the host.

use std::time::Duration;

use firn::config::BackendChoice;
use firn::driver::Durability;
use firn::session::{Change, Once};
use firn::store::Ephemeral;
use firn_protocol::{ColliderBatch, ColliderSpec, SessionSpec, SnowLayer, Snowfall, Terrain};
use firn_snow::{Position, Shape};

use crate::support::wait::until;
use crate::support::{Options, Server, skips_gpu};
use crate::{allocated, alone};

/// Sessions of each kind.
const SESSIONS: usize = 20;

/// A part of the memory of all sessions, as the server tells it.
async fn told(server: &Server, part: &str) -> i64 {
    let text = String::from_utf8(server.get("/metrics").await.body).unwrap();
    let name = format!("firn_tenant_memory_bytes{{tenant=\"\",part=\"{part}\"}} ");
    let value = text.lines().find_map(|line| line.strip_prefix(&name));
    value.unwrap_or_else(|| panic!("no {name}in {text}")).parse().expect("a number")
}

/// A paused session without snow.
fn bare(side: u32, terrain: bool) -> SessionSpec {
    let mut spec = SessionSpec { paused: true, ..SessionSpec::default() };
    (spec.grid.width, spec.grid.depth, spec.grid.height) = (side, side, 8);
    let columns = (side * side) as usize;
    spec.terrain = terrain.then(|| Terrain { heights: vec![1.0; columns].into() });
    spec
}

/// One with layers of snow.
fn snowy() -> SessionSpec {
    let layer = |number: i32| SnowLayer {
        depth: 0.1,
        temperature: Some(-f64::from(number)),
        density: None,
    };
    SessionSpec { initial_snow: (1..8).map(layer).collect(), ..bare(128, false) }
}

fn objects(count: usize) -> ColliderBatch {
    let object = |number: usize| ColliderSpec {
        id: Some(format!("object-{number}")),
        mass: 10.0,
        shape: Some(Shape::Disk { radius: 0.3 }),
        position: Position { x: 2.0 + 0.01 * number as f64, z: 2.0 },
        ..ColliderSpec::default()
    };
    ColliderBatch { put: (0..count).map(object).collect(), ..ColliderBatch::default() }
}

/// Makes sessions, does something with each, and sees to it that the memory that they take is what
/// the server says, within a tenth.
async fn compare(
    server: &Server,
    what: &str,
    spec: SessionSpec,
    act: impl AsyncFn(&firn::session::Session),
) {
    let before =
        (allocated::settled().await, told(server, "host").await + told(server, "journal").await);
    for number in 0..SESSIONS {
        let id = Some(format!("{what}-{number}"));
        // Each has a ground of its own.
        let own = |ground: &Terrain| Terrain { heights: ground.heights.to_vec().into() };
        let terrain = spec.terrain.as_ref().map(own);
        let spec = SessionSpec { id, terrain, ..spec.clone() };
        let (session, _) = server.sessions.create(spec).await.unwrap();
        act(&session).await;
    }
    let after =
        (allocated::settled().await, told(server, "host").await + told(server, "journal").await);
    let (taken, counted) = (after.0 - before.0, after.1 - before.1);
    println!("{what}: {taken} bytes are taken, {counted} counted");
    let off = (counted - taken).abs() as f64 / taken as f64;
    assert!(off <= 0.1, "{what}: {taken} bytes are taken, {counted} counted");
}

#[test]
fn what_is_counted_is_what_is_taken() {
    if skips_gpu() {
        eprintln!("SKIPPED: FIRN_SKIP_GPU_TESTS=1");
        return;
    }
    alone(sessions());
}

async fn sessions() {
    let durability = Durability {
        store: Box::new(Ephemeral),
        checkpoint_interval: Duration::from_secs(3600),
        accept_loss: false,
    };
    let mut options = Options::default();
    options.limits.sessions = 10 * SESSIONS;
    let server = Server::start_stored(BackendChoice::Gpu, options, durability).await;
    // What is made once for all of them.
    let (first, _) = server.sessions.create(bare(256, true)).await.unwrap();
    first.change(Change::Colliders(objects(64))).await.unwrap();
    first.snapshot().await.unwrap();
    server.sessions.delete(&first).await.unwrap();
    drop(first);
    assert_eq!(told(&server, "host").await, 0);

    compare(&server, "level", bare(256, false), async |_| ()).await;
    compare(&server, "terrain", bare(256, true), async |_| ()).await;
    compare(&server, "snow", snowy(), async |_| ()).await;
    compare(&server, "objects", bare(64, false), async |session| {
        session.change(Change::Colliders(objects(500))).await.unwrap();
    })
    .await;
    let fall =
        Change::Snowfall(Snowfall { depth: 0.001, density: None, temperature: None, region: None });
    compare(&server, "changes", bare(8, false), async |session| {
        for _ in 0..500 {
            session.change(fall.clone()).await.unwrap();
        }
    })
    .await;
    compare(&server, "keyed", bare(8, false), async |session| {
        for number in 0..500u32 {
            let mut key = *blake3::hash(session.id.as_bytes()).as_bytes();
            key[..4].copy_from_slice(&number.to_le_bytes());
            let once = Once { key, request: key, secret: key };
            session.change_once(fall.clone(), Some(once)).await.unwrap();
        }
    })
    .await;
    server.stop().await;
    checkpoints().await;
}

/// Snow that is kept as a checkpoint, and in the snapshot that a session was made from.
async fn checkpoints() {
    let durability = Durability {
        store: Box::new(Ephemeral),
        checkpoint_interval: Duration::from_millis(50),
        accept_loss: false,
    };
    let server = Server::start_stored(BackendChoice::Gpu, Options::default(), durability).await;
    let spec = snowy();
    let (warm, _) = server.sessions.create(spec.clone()).await.unwrap();
    wait_for_checkpoints(&server).await;
    let snapshot = warm.snapshot().await.unwrap().encode().unwrap();
    compare(&server, "checkpoints", spec, async |_| {
        wait_for_checkpoints(&server).await;
    })
    .await;
    let before = told(&server, "journal").await;
    let restored = server.sessions.restore(snapshot.clone().into(), None, None, None).await;
    let (restored, _) = restored.unwrap();
    let origin = told(&server, "journal").await - before;
    assert!(origin >= snapshot.len() as i64, "{origin} for {}", snapshot.len());
    let memory = restored.memory();
    let body = server.get(&format!("/v1/sessions/{}/usage", restored.id)).await.expect(200);
    assert_eq!(body["memory_bytes"]["device"], memory.device);
    assert_eq!(body["memory_bytes"]["host"], memory.host);
    assert_eq!(memory.device, 128 * 128 * 8 * 16);
    assert_eq!(told(&server, "device").await, (SESSIONS as i64 + 2) * memory.device as i64);
    server.stop().await;
}

/// Waits until a checkpoint of each session is stored.
async fn wait_for_checkpoints(server: &Server) {
    let stored = &server.sessions.vitals().store;
    until("checkpoints are stored", async || {
        stored.checkpoints() >= server.sessions.count() as u64
    })
    .await;
}
