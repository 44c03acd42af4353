//! Device time: who takes much of it is parted and waits, and nobody else does.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use firn::config::BackendChoice;
use firn::session::{Change, Quotas, Session, SessionError};
use firn_protocol::{AirTemperature, SessionSpec, StepSpec};
use firn_snow::Grid;
use futures_util::poll;
use serde_json::{Value, json};
use tokio::time::timeout;

use crate::on_each_backend;
use crate::raw::reached;
use crate::support::Server;
use crate::support::wait::until;
use crate::watched::{self, Part};

on_each_backend!(
    nobody_waits_for_a_session_that_takes_much,
    those_who_take_much_get_the_same_time,
    a_tenant_gets_no_more_than_its_share,
    who_floods_one_session_delays_no_other,
);

const SIDE: u32 = 96;
const HEIGHT: u32 = 40;

/// A session in which each tick has a cycle for each quarter of 4 s, on snow that never comes to rest, with
/// objects on it or without.
async fn hostile(server: &Server, id: &str, objects: u32) -> Arc<Session> {
    let body = json!({
        "id": id,
        "grid": {"width": SIDE, "depth": SIDE, "height": HEIGHT, "cell_size": 0.2},
        "initial_snow": [{"depth": 5.0}], "snowfall_rate": 5, "time_scale": 1000, "tick_rate": 240,
        "paused": objects > 0,
    });
    let path = server.create(body).await;
    let object = |i: u32| {
        let (x, z) = (f64::from(i % 40), f64::from(i / 40 % 40));
        json!({"id": format!("o{i}"), "mass": 100 + i, "shape": {"type": "disk", "radius": 0.5},
            "position": {"x": 1.0 + 0.4 * x, "z": 1.0 + 0.4 * z}})
    };
    let put: Vec<Value> = (0..objects).map(object).collect();
    if objects > 0 {
        server.post(&format!("{path}/colliders:batch"), json!({"put": put})).await.expect(200);
        server.patch(&path, json!({"paused": false})).await.expect(200);
    }
    server.sessions.peek(id).unwrap()
}

/// A session like that of most games, and its slot: the first that there is.
async fn neighbour(server: &Server) -> Arc<Session> {
    let grid = json!({"width": 16, "depth": 16, "height": 20, "cell_size": 0.2});
    server.create(json!({"id": "neighbour", "grid": grid, "initial_snow": [{"depth": 1.0}]})).await;
    server.sessions.peek("neighbour").unwrap()
}

async fn waits(session: &Session) -> u64 {
    session.inspect(|simulation| simulation.waits()).await.unwrap()
}

fn part_of(frame: &[Part], slot: u32) -> Option<&Part> {
    frame.iter().find(|part| part.slot == slot)
}

async fn nobody_waits_for_a_session_that_takes_much(backend: BackendChoice) {
    for objects in [0, 500] {
        let (server, log) = watched::start(backend).await;
        let neighbour = neighbour(&server).await;
        let hostile = hostile(&server, "hostile", objects).await;
        until("it takes several frames", async || {
            log.since(0).iter().flatten().any(|part| part.slot == 1 && part.unfinished)
        })
        .await;
        for celsius in 1..=12 {
            let change = Change::AirTemperature(AirTemperature { celsius: -f64::from(celsius) });
            // It arrives in the middle of a frame.
            log.hold().await;
            let next = log.len();
            let mut change = Box::pin(neighbour.change(change));
            assert!(poll!(&mut change).is_pending());
            log.let_go();
            change.await.unwrap();
            let frames = log.since(next);
            assert!(part_of(&frames[0], 0).is_some(), "{objects} objects: {frames:?}");
        }
        assert_eq!(waits(&neighbour).await, 0);
        // The largest that can't be parted is a row of tiles on which snow falls, or a tile under all objects.
        let row = u64::from(SIDE * 8 * HEIGHT);
        let indivisible = 4 * row.max(u64::from(64 * HEIGHT * objects));
        let parts: Vec<Part> = log.since(0).into_iter().flatten().filter(|p| p.slot == 1).collect();
        for part in &parts[2..] {
            if let Some(limit) = part.limit {
                assert!(part.units <= limit + indivisible, "{part:?}");
            }
        }
        assert!(hostile.device_time() > neighbour.device_time());
        server.stop().await;
    }
}

async fn those_who_take_much_get_the_same_time(backend: BackendChoice) {
    let (server, log) = watched::start(backend).await;
    let neighbour = neighbour(&server).await;
    let one = hostile(&server, "one", 0).await;
    let objects = hostile(&server, "objects", 300).await;
    let other = hostile(&server, "other", 0).await;
    let all = [&one, &objects, &other];
    let before = all.map(|session| session.device_time());
    let waited = server.sessions.vitals().waits();
    let frame = log.len();
    until("they have had their frames", async || log.len() > frame + 150).await;
    let mut times: Vec<Duration> =
        all.iter().zip(before).map(|(session, before)| session.device_time() - before).collect();
    times.sort();
    assert!(times[2] < 3 * times[0], "{times:?}");
    assert!(server.sessions.vitals().waits() > waited, "none of them ever waited");
    assert_eq!(waits(&neighbour).await, 0);
    server.stop().await;
}

async fn a_tenant_gets_no_more_than_its_share(backend: BackendChoice) {
    const SHARE: f64 = 0.1;
    let (server, _) = watched::start(backend).await;
    let quotas = Quotas { device_share: Some(SHARE), ..Quotas::default() };
    server.sessions.tenants().set_quotas(&HashMap::from([("alpine".to_owned(), quotas)]));
    let alpine = server.sessions.tenants().named("alpine");
    let small = SessionSpec { id: Some("small".to_owned()), ..SessionSpec::default() };
    let large = SessionSpec {
        id: Some("large".to_owned()),
        grid: Grid { width: SIDE, depth: SIDE, height: HEIGHT, cell_size: 0.2 },
        time_scale: 1000.0,
        tick_rate: 240.0,
        snowfall_rate: 5.0,
        ..SessionSpec::default()
    };
    let mut theirs = Vec::new();
    for spec in [small, large] {
        theirs.push(server.sessions.create_once(spec, Some("alpine"), None).await.unwrap().0);
    }
    until("they wait", async || server.sessions.vitals().waits() > 0).await;
    // How long they may take the device is a matter of beats, however long those take.
    let taken = || (theirs[0].frame(), alpine.device_time());
    let before = taken();
    until("ten seconds of beats have passed", async || theirs[0].frame() > before.0 + 600).await;
    let after = taken();
    let share = (after.1 - before.1).as_secs_f64() / ((after.0 - before.0) as f64 / 60.0);
    assert!((0.3 * SHARE..1.5 * SHARE).contains(&share), "{share}");
    let change = Change::AirTemperature(AirTemperature { celsius: -20.0 });
    theirs[0].change(change).await.unwrap();
    let usage = server.get("/v1/sessions/large/usage").await.expect(200);
    assert!(usage["device_seconds"].as_f64().unwrap() > 0.0);
    let metrics = server.app.metrics.encode().unwrap();
    let line = "firn_tenant_device_seconds_total{tenant=\"alpine\"} ";
    let told = metrics.lines().find_map(|it| it.strip_prefix(line)).unwrap();
    assert!(told.parse::<f64>().unwrap() >= after.1.as_secs_f64() - 1e-6, "{told}");
    server.stop().await;
}

async fn who_floods_one_session_delays_no_other(backend: BackendChoice) {
    let (server, log) = watched::start(backend).await;
    let neighbour = neighbour(&server).await;
    // A tick of thousands of cycles.
    let grid = json!({"width": 64, "depth": 64, "height": 20, "cell_size": 0.2});
    let long = json!({"id": "hostile", "grid": grid, "initial_snow": [{"depth": 3.0}], "paused": true,
        "tick_rate": 1, "time_scale": 1000});
    let path = server.create(long).await;
    let sledge = json!({"id": "sledge", "mass": 300, "position": {"x": 6.4, "z": 6.4},
        "shape": {"type": "box", "width": 6.4, "depth": 6.4}});
    server.post(&format!("{path}/colliders"), sledge).await.expect(201);
    let hostile = server.sessions.peek("hostile").unwrap();
    let stepped = hostile.clone();
    let step = tokio::spawn(async move {
        stepped.step(StepSpec { ticks: Some(1), ..StepSpec::default() }).await
    });
    until("it is under way", async || {
        log.since(0).iter().flatten().any(|part| part.slot == 1 && part.unfinished)
    })
    .await;
    let cold = || Change::AirTemperature(AirTemperature { celsius: -20.0 });
    let flood: Vec<_> = (0..5000)
        .map(|_| {
            let hostile = hostile.clone();
            tokio::spawn(async move { hostile.change(cold()).await })
        })
        .collect();
    until("no more may wait", async || {
        let url = format!("{path}/snowfalls");
        // Where one more may wait, it does.
        let reply =
            timeout(Duration::from_millis(50), server.post(&url, json!({"depth": 0}))).await;
        reply.is_ok_and(|reply| (reply.status, reply.header("retry-after")) == (429, "1"))
    })
    .await;
    assert!(reached(&server, "waiting-requests").await > 0);
    let before = log.len();
    neighbour.change(cold()).await.unwrap();
    let place = log.since(before).iter().position(|frame| part_of(frame, 0).is_some());
    assert!(place.is_some_and(|place| place <= 1), "{place:?}");
    let mut refused = 0;
    for change in flood {
        match change.await.unwrap() {
            Ok(_) => {}
            Err(SessionError::TooManyWaiting(_)) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    step.await.unwrap().unwrap();
    assert!(refused >= 5000 - 4096, "{refused}");
    server.stop().await;
}
