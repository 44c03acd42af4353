//! The program itself: how it refuses to stand open, and what it keeps to itself.

use std::time::Duration;

use futures_util::StreamExt;
use serde_json::{Value, json};
use tokio::time::timeout;
use tokio_tungstenite::connect_async;

use crate::running::{Running, serve};

/// Beyond any wait of these tests.
const PATIENCE: Duration = Duration::from_secs(60);

const KEY: &str = "a-key-that-nobody-can-guess";

#[test]
fn it_does_not_stand_open_to_other_machines() {
    let refused = serve(&["--listen", "0.0.0.0:0"]).output().expect("it runs");
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{said}");
    for way_out in ["--api-key-file", "--allow-open", "127.0.0.1"] {
        assert!(said.contains(way_out), "{said}");
    }
    let open = Running::start(serve(&["--listen", "0.0.0.0:0", "--allow-open"]));
    assert!(open.end().contains("open"));
    let mut guarded = serve(&["--listen", "0.0.0.0:0"]);
    guarded.env("FIRN_API_KEY", KEY);
    let log = Running::start(guarded).end();
    assert!(log.contains("required") && log.contains("--tls-cert"), "{log}");
}

#[test]
fn a_key_that_could_be_guessed_is_refused_and_not_repeated() {
    let folder = std::env::temp_dir().join(format!("firn-keys-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("key");
    let name = file.to_str().unwrap();
    std::fs::write(&file, "hunter2\n").unwrap();
    for options in [["--api-key", "hunter2"], ["--api-key-file", name]] {
        let refused = serve(&options).output().expect("it runs");
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(options[0]) && !said.contains("hunter2"), "{said}");
    }
    std::fs::write(&file, format!("{KEY}\nnot this\n")).unwrap();
    let guarded = Running::start(serve(&["--listen", "127.0.0.1:0", "--api-key-file", name]));
    assert!(guarded.end().contains("required"));
    std::fs::remove_dir_all(folder).unwrap();
}

/// At the most talkative, with requests that succeed, fail, stream, and carry a key in a wrong place.
#[tokio::test(flavor = "multi_thread")]
async fn no_secret_is_logged() {
    let mut command = serve(&["--listen", "127.0.0.1:0", "--log", "trace"]);
    command.env("FIRN_API_KEY", KEY);
    let help = command.arg("--help").output().expect("it runs");
    assert!(!String::from_utf8_lossy(&help.stdout).contains(KEY));

    let mut command = serve(&["--listen", "127.0.0.1:0", "--log", "trace"]);
    command.env("FIRN_API_KEY", KEY);
    let server = Running::start(command);
    let client = reqwest::Client::new();
    let sessions = format!("{}/v1/sessions", server.url);
    let body = json!({"id": "quiet", "paused": true});
    let created = client.post(&sessions).bearer_auth(KEY).json(&body).send().await.unwrap();
    let mut created: Value = created.json().await.unwrap();
    let mut secrets = vec![KEY.to_owned()];
    for round in 0..2 {
        let token = created["token"].as_str().unwrap().to_owned();
        let viewer = created["viewer_token"].as_str().unwrap().to_owned();
        let path = format!("{sessions}/quiet");
        client.get(format!("{path}?token={token}")).send().await.unwrap();
        client.get(format!("{path}/heights")).bearer_auth(&viewer).send().await.unwrap();
        client.post(format!("{path}/reset")).bearer_auth(&viewer).send().await.unwrap();
        let stream = format!("{}/stream?token={viewer}", path.replace("http://", "ws://"));
        let (mut stream, _) = connect_async(stream).await.unwrap();
        stream.next().await.unwrap().unwrap();
        let reissue = client.post(format!("{path}/tokens")).bearer_auth(&token);
        created = reissue.send().await.unwrap().json().await.unwrap();
        let ended = async { while stream.next().await.is_some_and(|message| message.is_ok()) {} };
        timeout(PATIENCE, ended).await.expect("new tokens end the stream");
        assert!(
            connect_async(format!("{}/stream?token={viewer}", path.replace("http://", "ws://")))
                .await
                .is_err(),
            "{round}"
        );
        secrets.extend([token, viewer]);
    }
    let log = server.end();
    assert!(log.contains("/v1/sessions/quiet/stream"), "requests are logged");
    for secret in secrets {
        assert!(!log.contains(&secret), "a secret is in the log");
    }
}
