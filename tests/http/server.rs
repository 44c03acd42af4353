//! The server itself: health, its document, and how it stops.

use firn::config::BackendChoice;
use serde_json::json;

use crate::on_each_backend;
use crate::support::{Server, slow, small};

on_each_backend!(it_says_how_it_is, it_stops_gracefully, many_clients_are_served_at_once);

async fn it_says_how_it_is(backend: BackendChoice) {
    let server = Server::start(backend).await;
    assert_eq!(server.get("/livez").await.expect(200), json!({"status": "alive"}));
    let ready = server.get("/readyz").await.expect(200);
    assert_eq!(ready["status"], "ready");
    assert_eq!(ready["auth"], "open");
    assert_eq!((&ready["sessions"], &ready["capacity"]), (&json!(0), &json!(100)));
    assert_eq!(ready["schedulable"], true);
    for field in ["adapter", "backend"] {
        assert!(ready[field].as_str().is_some_and(|text| !text.is_empty()), "{ready}");
    }
    if backend == BackendChoice::Cpu {
        assert_eq!((&ready["adapter"], &ready["backend"]), (&json!("cpu"), &json!("cpu")));
    } else {
        assert_ne!(ready["backend"], "cpu");
    }
    server.create(small()).await;
    assert_eq!(server.get("/readyz").await.expect(200)["sessions"], 1);

    let document = server.get("/openapi.json").await;
    assert_eq!(document.header("content-type"), "application/json");
    let generated = serde_json::to_value(firn::server::document()).unwrap();
    assert_eq!(document.expect(200), generated);
    server.stop().await;
}

async fn it_stops_gracefully(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(slow()).await;
    let url = format!("{}{path}/step", server.url);
    let long = tokio::spawn(async move {
        let body = json!({"ticks": 1_000_000});
        let reply = reqwest::Client::new().post(url).json(&body).send().await.unwrap();
        (reply.status().as_u16(), reply.text().await.unwrap())
    });
    while server.get(&path).await.expect(200)["tick"] == 0 {
        tokio::task::yield_now().await;
    }
    // The step is answered, though not as it was meant to be, and the server ends.
    let address = server.url.clone();
    server.stop().await;
    let (status, body) = long.await.unwrap();
    assert_eq!(status, 503, "{body}");
    assert!(body.contains("stopping"), "{body}");
    let refused = reqwest::Client::new().get(format!("{address}/livez")).send().await;
    assert!(refused.is_err(), "nobody listens any more");
}

async fn many_clients_are_served_at_once(backend: BackendChoice) {
    let server = std::sync::Arc::new(Server::start(backend).await);
    let mut clients = tokio::task::JoinSet::new();
    for client in 0..12 {
        let server = server.clone();
        clients.spawn(async move {
            let width = 1 + client * 3;
            let grid = json!({"width": width, "depth": 9, "height": 20, "cell_size": 0.2});
            let path = server.create(json!({"grid": grid, "paused": true})).await;
            for _ in 0..3 {
                let fallen = json!({"depth": 0.1 * f64::from(1 + client)});
                server.post(&format!("{path}/snowfalls"), fallen).await.expect(200);
                server.step(&path, 20).await;
            }
            let heights = server.heights(&path).await;
            assert_eq!(heights.len(), 9 * width as usize);
            assert!(heights.iter().all(|&h| h == heights[0] && h > 0.0), "{heights:?}");
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            assert_eq!(mass["imbalance_quanta"], 0);
            assert_eq!(server.delete(&path).await.status, 204);
            (client, heights[0])
        });
    }
    let mut depths: Vec<(i32, f64)> = clients.join_all().await;
    depths.sort_by_key(|(client, _)| *client);
    assert!(depths.windows(2).all(|pair| pair[0].1 < pair[1].1), "each its own: {depths:?}");
    assert_eq!(server.sessions.count(), 0);
    std::sync::Arc::into_inner(server).expect("all clients are done").stop().await;
}
