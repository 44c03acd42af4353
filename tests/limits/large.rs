//! Large sessions: others have their frames while one is made, and while one is woken.

use std::sync::Arc;

use firn::config::BackendChoice;
use firn::session::{Change, Session};
use firn_protocol::AirTemperature;
use serde_json::json;
use tokio::task::JoinHandle;

use crate::on_each_backend;
use crate::support::wait::until;
use crate::watched::{self, Log};

on_each_backend!(nobody_waits_while_a_large_session_is_made_or_woken);

/// Changes the session in the first slot again and again until something has come to its end. Each change
/// may arrive in the middle of a frame, and is in the next.
async fn change_during<T>(session: &Session, log: &Log, task: &JoinHandle<T>) {
    for round in 0.. {
        let before = log.len();
        let celsius = -f64::from(1 + round % 2);
        session.change(Change::AirTemperature(AirTemperature { celsius })).await.unwrap();
        let frames = log.since(before);
        let place = frames.iter().position(|frame| frame.iter().any(|part| part.slot == 0));
        assert!(place.is_some_and(|place| place <= 1), "{frames:?}");
        if task.is_finished() {
            break;
        }
    }
}

async fn nobody_waits_while_a_large_session_is_made_or_woken(backend: BackendChoice) {
    let (server, log) = watched::start(backend).await;
    let server = Arc::new(server);
    let grid = json!({"width": 16, "depth": 16, "height": 20, "cell_size": 0.2});
    server.create(json!({"id": "neighbour", "grid": grid})).await;
    let neighbour = server.sessions.peek("neighbour").unwrap();

    let grid = json!({"width": 1024, "depth": 512, "height": 2, "cell_size": 0.2});
    let body = json!({"id": "large", "grid": grid, "paused": true, "idle_timeout_s": 1,
        "initial_snow": [{"depth": 0.2}]});
    let creator = server.clone();
    let making = tokio::spawn(async move { creator.create(body).await });
    change_during(&neighbour, &log, &making).await;
    let path = making.await.unwrap();

    let digest = server.get(&format!("{path}/digest")).await.expect(200);
    until("it hibernates", async || server.sessions.vitals().hibernating() == 1).await;
    let reader = server.clone();
    let reading =
        tokio::spawn(async move { reader.get(&format!("{path}/mass")).await.expect(200) });
    change_during(&neighbour, &log, &reading).await;
    assert_eq!(reading.await.unwrap()["imbalance_quanta"], 0);
    assert_eq!(
        server.get("/v1/sessions/large/digest").await.expect(200)["digest"],
        digest["digest"]
    );
    Arc::into_inner(server).unwrap().stop().await;
}
