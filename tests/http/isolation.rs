//! What goes wrong in one session stays in it.

use firn::config::BackendChoice;
use serde_json::json;

use crate::on_each_backend;
use crate::support::{Server, small};

on_each_backend!(a_session_that_panics_is_brought_back_and_no_other_notices);

async fn a_session_that_panics_is_brought_back_and_no_other_notices(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (bad, good) = (server.create(small()).await, server.create(small()).await);
    let live = server.create(json!({"grid": {"width": 9}, "initial_snow": [{"depth": 1}]})).await;
    server.post(&format!("{bad}/snowfalls"), json!({"depth": 0.3})).await.expect(200);
    server.step(&bad, 30).await;
    let before = server.get(&format!("{bad}/digest")).await.expect(200);
    let session = server.sessions.get(bad.rsplit('/').next().unwrap()).unwrap();
    for _ in 0..3 {
        let panicked = session.inspect(|_| -> () { panic!("this test panics on purpose") });
        assert!(panicked.await.is_err());
        assert!(!session.gone().is_cancelled());
        let after = server.get(&format!("{bad}/digest")).await.expect(200);
        assert_eq!(after["digest"], before["digest"]);
    }
    server.post(&format!("{bad}/snowfalls"), json!({"depth": 0.1})).await.expect(200);
    let mass = server.get(&format!("{bad}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);

    // The others live on, and there is room for new ones.
    assert_eq!(server.step(&good, 60).await["tick"], 60);
    let tick = server.get(&live).await.expect(200)["tick"].as_u64().unwrap();
    while server.get(&live).await.expect(200)["tick"].as_u64().unwrap() <= tick {
        tokio::task::yield_now().await;
    }
    server.create(small()).await;
    server.get("/readyz").await.expect(200);
    server.stop().await;
}
