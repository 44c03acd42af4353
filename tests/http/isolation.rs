//! What goes wrong in one session stays in it.

use crate::on_each_backend;
use crate::support::{Server, small};
use firn::config::BackendChoice;
use firn::session::{Change, SessionError, Snowfall};
use serde_json::json;

on_each_backend!(a_panic_ends_its_session_and_no_other);

async fn a_panic_ends_its_session_and_no_other(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (bad, good) = (server.create(small()).await, server.create(small()).await);
    let name = bad.rsplit('/').next().unwrap();
    let session = server.sessions.get(name).unwrap();
    let waiting = {
        let session = session.clone();
        tokio::spawn(async move {
            session.inspect(|_| -> () { panic!("this test panics on purpose") }).await
        })
    };
    assert!(waiting.await.unwrap().is_err());
    // The name is free again, whoever still holds the session learns that it is gone.
    server.get(&bad).await.problem(404);
    assert!(session.gone().is_cancelled());
    let snowfall = Snowfall { depth: 0.1, density: None, temperature: None, region: None };
    let refused = session.change(Change::Snowfall(snowfall)).await;
    assert!(matches!(refused, Err(SessionError::NotFound { .. })), "{refused:?}");

    // The other one lives on, its snow too, and there is room for new ones.
    let stepped = server.step(&good, 60).await;
    assert_eq!(stepped["tick"], 60);
    let mass = server.get(&format!("{good}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);
    let mut again = small();
    again["id"] = json!(name);
    server.create(again).await;
    server.get("/readyz").await.expect(200);
    server.stop().await;
}
