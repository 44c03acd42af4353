//! Stepping paused sessions over HTTP.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::sessions::deep;
use crate::support::wait::until;
use crate::support::{Server, slow, small};

on_each_backend!(
    a_session_is_stepped_by_ticks_and_by_seconds,
    a_session_is_stepped_until_it_has_settled,
    a_step_can_be_refused,
    an_abandoned_step_ends_early,
    a_step_tells_how_far_it_has_come_and_ends_when_told_to,
);

async fn a_session_is_stepped_by_ticks_and_by_seconds(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(deep()).await;
    let stepped = server.step(&path, 120).await;
    assert_eq!(stepped["tick"], 120);
    assert!((stepped["sim_time"].as_f64().unwrap() - 2.0).abs() < 1e-9);
    assert!(stepped["summary"]["mean_height"].as_f64().unwrap() < 3.5, "snow settles");
    let step = format!("{path}/step");
    let stepped = server.post(&step, json!({"seconds": 0.5})).await.expect(200);
    assert_eq!(stepped["tick"], 150);
    assert_eq!(stepped, server.get(&path).await.expect(200), "it answers like GET");
    server.stop().await;
}

async fn a_session_is_stepped_until_it_has_settled(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(deep()).await;
    let step = format!("{path}/step");
    let body = json!({"until_settled": true, "max_seconds": 3600});
    let settled = server.post(&step, body.clone()).await.expect(200);
    assert_eq!(settled["settled"], true);
    let tick = settled["tick"].as_u64().unwrap();
    assert!(tick > 0 && tick < 3600 * 60, "{tick}");
    let heights = server.heights(&path).await;
    let again = server.post(&step, body).await.expect(200);
    assert_eq!(again["tick"].as_u64(), Some(tick), "it has settled already");
    let later = server.step(&path, 100).await;
    assert_eq!(later["tick"].as_u64(), Some(tick + 100), "time passes in settled snow too");
    assert_eq!(server.heights(&path).await, heights, "nothing moves any more");

    let fresh = server.create(deep()).await;
    let body = json!({"until_settled": true, "max_seconds": 1});
    let reply = server.post(&format!("{fresh}/step"), body).await.expect(200);
    assert_eq!((&reply["tick"], &reply["settled"]), (&json!(60), &json!(false)));
    server.stop().await;
}

async fn a_step_can_be_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let step = format!("{path}/step");
    for (body, pointer) in [
        (json!({}), ""),
        (json!({"ticks": 1, "seconds": 1}), ""),
        (json!({"ticks": 0}), "/ticks"),
        (json!({"ticks": 1_000_001}), "/ticks"),
        (json!({"ticks": -1}), "/ticks"),
        (json!({"ticks": 1.5}), "/ticks"),
        (json!({"seconds": 0}), "/seconds"),
        (json!({"seconds": -2}), "/seconds"),
        (json!({"seconds": 1e9}), "/seconds"),
        (json!({"until_settled": true}), "/max_seconds"),
        (json!({"until_settled": true, "max_seconds": 0}), "/max_seconds"),
        (json!({"ticks": 1, "max_seconds": 5}), "/max_seconds"),
        (json!({"steps": 1}), "/steps"),
    ] {
        let reply = server.post(&step, body.clone()).await;
        assert!(reply.pointers(422).iter().any(|p| p == pointer), "{body}: {:?}", reply.json());
    }
    assert_eq!(server.get(&path).await.expect(200)["tick"], 0, "nothing was stepped");
    server.patch(&path, json!({"paused": false})).await.expect(200);
    server.post(&step, json!({"ticks": 1})).await.problem(409);
    server.stop().await;
}

async fn an_abandoned_step_ends_early(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(slow()).await;
    let url = format!("{}{path}/step", server.url);
    let body = json!({"ticks": 1_000_000});
    let long = tokio::spawn(async move {
        reqwest::Client::new().post(url).json(&body).send().await.map(|reply| reply.status())
    });
    while server.get(&path).await.expect(200)["tick"] == 0 {
        tokio::task::yield_now().await;
    }
    let step = format!("{path}/step");
    server.post(&step, json!({"ticks": 1})).await.problem(409);
    server.post(&format!("{path}/reset"), json!({})).await.problem(409);
    // Reads and changes go on meanwhile.
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.1})).await.expect(200);

    long.abort();
    let stepped = loop {
        let reply = server.post(&step, json!({"ticks": 1})).await;
        if reply.status != 409 {
            break reply.expect(200);
        }
        tokio::task::yield_now().await;
    };
    assert!(stepped["tick"].as_u64().unwrap() < 1_000_000, "the tick it had reached is kept");
    server.stop().await;
}

async fn a_step_tells_how_far_it_has_come_and_ends_when_told_to(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(slow()).await;
    let step = format!("{path}/step");
    let paused = server.get(&path).await.expect(200);
    assert_eq!((&paused["state"], &paused["progress"]), (&json!("paused"), &Value::Null));
    server.delete(&step).await.problem(409);

    let begun = || async {
        let stepping = async || server.get(&path).await.expect(200)["state"] == "stepping";
        until("the step is under way", stepping).await;
        server.get(&path).await.expect(200)
    };
    let watched = async {
        let mut before = begun().await;
        let listed = server.get("/v1/sessions").await.expect(200);
        assert_eq!(listed["items"][0]["state"], "stepping");
        while before["progress"]["done"].as_u64().unwrap() < 3 {
            let now = server.get(&path).await.expect(200);
            assert_eq!(now["progress"]["of"], 1_000_000);
            assert_eq!(now["progress"]["done"], now["tick"], "it began at tick 0");
            assert!(now["tick"].as_u64() >= before["tick"].as_u64());
            before = now;
        }
        server.delete(&step).await.expect(204);
        server.get(&path).await.expect(200)
    };
    let (stepped, ended) = tokio::join!(server.post(&step, json!({"ticks": 1_000_000})), watched);
    let stepped = stepped.expect(200);
    assert_eq!(stepped, ended, "who ends it, and who waits for it, see the same");
    assert_eq!((&ended["state"], &ended["progress"]), (&json!("paused"), &Value::Null));
    assert!((3..1_000_000).contains(&ended["tick"].as_u64().unwrap()), "{}", ended["tick"]);
    server.delete(&step).await.problem(409);

    let further = ended["tick"].as_u64().unwrap() + 7;
    assert_eq!(server.step(&path, 7).await["tick"], further);
    server.stop().await;
}
