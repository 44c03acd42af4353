//! The data directory is taken away under a running server.

use reqwest::Method;
use serde_json::{Value, json};

use crate::process::Process;
use crate::support::small;
use crate::support::wait::until;

/// Waits until `/readyz` says something of the store.
async fn store_is(server: &Process, state: &str) -> (u16, Value) {
    let told = async || server.send(Method::GET, "/readyz", None).await.unwrap();
    until(state, async || told().await.1["store"] == state).await;
    told().await
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn a_directory_that_is_removed_is_noticed_and_changes_are_refused() {
    let parent = tempfile::tempdir().unwrap();
    let (data, away) = (parent.path().join("data"), parent.path().join("away"));
    let mut server = Process::ready(&data, &["--backend", "cpu"]).await;
    let session = server.post("/v1/sessions", small()).await;
    let path = format!("/v1/sessions/{}", session["id"].as_str().unwrap());
    let falls = format!("{path}/snowfalls");
    let fall = json!({"depth": 0.1});
    server.post(&falls, fall.clone()).await;
    let mass = server.get(&format!("{path}/mass")).await;
    let (status, _) = store_is(&server, "sound").await;
    assert_eq!((status, server.metric("firn_store_gone").await), (200, 0.0));

    // Nobody asks for anything meanwhile: it is noticed all the same.
    std::fs::rename(&data, &away).unwrap();
    let (status, body) = store_is(&server, "gone").await;
    assert_eq!((status, &body["status"]), (503, &json!("read_only")));
    assert_eq!(body["schedulable"], false);
    assert_eq!(server.metric("firn_store_gone").await, 1.0);
    assert_eq!(server.metric("firn_store_healthy").await, 0.0);
    let line = server.wait_for("changes are refused").await;
    assert!(line.contains(&*data.to_string_lossy()), "{line}");
    for (method, path, body) in [
        (Method::POST, &falls, Some(&fall)),
        (Method::POST, &"/v1/sessions".to_owned(), Some(&small())),
        (Method::DELETE, &path, None),
    ] {
        let (status, problem) = server.send(method, path, body).await.unwrap();
        assert_eq!((status, &problem["type"]), (503, &json!("urn:firn:problem:storage-gone")));
        assert!(problem["detail"].as_str().unwrap().contains("restart"), "{problem}");
    }
    let read = server.get(&format!("{path}/mass")).await;
    assert_eq!(read["fallen"], mass["fallen"], "reads go on, and nothing was changed");

    // An empty one in its place is not the one that was there.
    std::fs::create_dir(&data).unwrap();
    let (status, _) = server.send(Method::POST, &falls, Some(&fall)).await.unwrap();
    assert_eq!(status, 503);
    assert_eq!(std::fs::read_dir(&data).unwrap().count(), 0, "nothing is made in it");
    std::fs::remove_dir(&data).unwrap();

    std::fs::rename(&away, &data).unwrap();
    store_is(&server, "sound").await;
    server.post(&falls, fall).await;
    let mass = server.get(&format!("{path}/mass")).await;
    server.kill().await;
    let server = Process::ready(&data, &["--backend", "cpu"]).await;
    assert_eq!(server.get(&format!("{path}/mass")).await["fallen"], mass["fallen"]);

    std::fs::remove_dir_all(&data).unwrap();
    store_is(&server, "gone").await;
    let (status, _) = server.send(Method::POST, "/v1/sessions", Some(&small())).await.unwrap();
    assert_eq!(status, 503);
    server.kill().await;
}
