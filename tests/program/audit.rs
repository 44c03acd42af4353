//! The audit log: who did what from where, and who was not let in.

use std::time::Instant;

use reqwest::{Client, Method};
use serde_json::{Value, json};
use tokio::time::timeout;

use crate::running::{Running, serve};
use crate::support::wait::PATIENCE;

const OPERATOR: &str = "the-key-of-the-operator";
const ALPINE: &str = "the-key-of-alpine-that-reads-and-writes";

/// A server with keys; what it logs is JSON.
fn start(options: &[&str]) -> (Running, tempfile::NamedTempFile) {
    let file = tempfile::NamedTempFile::new().unwrap();
    let keys = format!(
        "[[tenants.alpine.keys]]\nname = \"main\"\nkey = \"{ALPINE}\"\n\
         scopes = [\"read\", \"write\"]\n"
    );
    std::fs::write(file.path(), keys).unwrap();
    let mut command = serve(&["--listen", "127.0.0.1:0", "--log-format", "json"]);
    command.args(options).arg("--api-keys-file").arg(file.path()).env("FIRN_API_KEY", OPERATOR);
    command.env_remove("RUST_LOG").env_remove("FIRN_LOG");
    (Running::start(command), file)
}

async fn send(server: &Running, token: &str, method: Method, path: &str, body: Value) -> Value {
    let mut request = Client::new().request(method, format!("{}{path}", server.url));
    if !token.is_empty() {
        request = request.bearer_auth(token);
    }
    if !body.is_null() {
        request = request.json(&body);
    }
    let answer = request.send().await.expect("it answers").bytes().await.unwrap();
    serde_json::from_slice(&answer).unwrap_or_default()
}

/// The lines of the audit log: who, what, the session and the result of each.
fn lines(log: &str) -> Vec<[String; 4]> {
    let lines = log.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let audit = lines.filter(|line| line["target"] == "firn::audit");
    let text = |value: &Value| value.as_str().unwrap_or("").to_owned();
    audit
        .map(|line| {
            assert_eq!((&line["level"], &line["message"]), (&json!("INFO"), &json!("audit")));
            let from_here = line["address"] == "127.0.0.1";
            assert!(from_here || line["who"] == "signal", "{line}");
            ["who", "what", "session", "result"].map(|field| text(&line[field]))
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn administrative_calls_are_told_with_who_and_what_and_without_secrets() {
    let (server, file) = start(&[]);
    let sessions = "/v1/sessions";
    let body = json!({"id": "peak", "paused": true});
    let made = send(&server, ALPINE, Method::POST, sessions, body.clone()).await;
    send(&server, OPERATOR, Method::POST, sessions, body).await;
    let token = made["token"].as_str().expect("it is made").to_owned();
    send(&server, ALPINE, Method::GET, "/v1/sessions/peak", Value::Null).await;
    let tokens = "/v1/sessions/peak/tokens";
    let anew = send(&server, &token, Method::POST, tokens, Value::Null).await;
    let anew = anew["viewer_token"].as_str().expect("there are new ones").to_owned();
    let snapshot = format!("{}/v1/sessions/peak/snapshot", server.url);
    let snapshot = Client::new().get(snapshot).bearer_auth(OPERATOR).send().await.unwrap();
    let restore = Client::new().post(format!("{}{sessions}?id=copy", server.url));
    let restore = restore.header("content-type", "application/vnd.firn.snapshot");
    let restore = restore.bearer_auth(OPERATOR).body(snapshot.bytes().await.unwrap());
    assert_eq!(restore.send().await.unwrap().status(), 201);
    send(&server, ALPINE, Method::DELETE, "/v1/sessions/copy", Value::Null).await;
    send(&server, OPERATOR, Method::DELETE, "/v1/sessions/copy", Value::Null).await;
    send(&server, OPERATOR, Method::POST, "/v1/sessions/peak/unlock", Value::Null).await;
    for (method, call) in
        [(Method::GET, "backup"), (Method::POST, "verify"), (Method::POST, "compact")]
    {
        send(&server, OPERATOR, method, &format!("/v1/store/{call}"), Value::Null).await;
    }
    #[cfg(unix)]
    {
        let count = async || {
            let metrics = reqwest::get(format!("{}/metrics", server.url)).await.unwrap();
            metrics.text().await.unwrap().contains(r#"what="api_keys",result="ok"} 1"#)
        };
        server.signal(rustix::process::Signal::HUP);
        crate::support::wait::until("it reads its keys again", count).await;
    }
    // Last, as only the first of a second is told.
    send(&server, "wrong", Method::GET, "/v1/sessions/peak", Value::Null).await;
    let (code, log) = tokio::task::spawn_blocking(|| server.stop()).await.unwrap();
    assert_eq!(code, Some(0), "{log}");
    drop(file);

    let mut expected = vec![
        ["alpine/main", "create session", "peak", "201"],
        ["operator", "create session", "", "409"],
        ["session token", "reissue tokens", "peak", "200"],
        ["operator", "restore session", "copy", "201"],
        // That it belongs to the operator is not to be known.
        ["operator", "delete session", "copy", "204"],
        ["operator", "unlock session", "peak", "200"],
        // It keeps nothing.
        ["operator", "back up store", "", "409"],
        ["operator", "verify store", "", "409"],
        ["operator", "compact store", "", "409"],
        ["signal", "reload api_keys", "", "ok"],
        ["stranger", "authenticate: unknown", "peak", "401"],
    ];
    expected.retain(|line| cfg!(unix) || line[0] != "signal");
    assert_eq!(lines(&log), expected, "{log}");
    for secret in [OPERATOR, ALPINE, &token, &anew] {
        assert!(!log.contains(secret), "a secret is in the log");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn failures_are_told_once_a_second_at_most_and_where_they_are_wanted() {
    let begin = Instant::now();
    let (server, _file) = start(&["--log", "off,firn::cli=info,firn::audit=info"]);
    let strangers = async {
        for _ in 0..300 {
            send(&server, "wrong", Method::GET, "/v1/sessions/no%20name%0A", Value::Null).await;
            send(&server, "", Method::GET, "/v1/sessions", Value::Null).await;
        }
    };
    // A log that nobody reads keeps a server waiting once there is too much in it.
    timeout(PATIENCE, strangers).await.expect("little is logged");
    let (_, log) = tokio::task::spawn_blocking(|| server.stop()).await.unwrap();
    let told = lines(&log);
    let seconds = begin.elapsed().as_secs() as usize;
    assert!((1..=seconds + 2).contains(&told.len()), "{} in {seconds} s", told.len());
    assert_eq!(told[0], ["stranger", "authenticate: unknown", "", "401"]);
    let others = log.lines().filter(|line| !line.contains("\"firn::cli::"));
    assert_eq!(others.count(), told.len(), "nothing else is told: {log}");

    let (server, _file) = start(&["--log", "info,firn::audit=off"]);
    send(&server, "wrong", Method::GET, "/v1/sessions", Value::Null).await;
    let (_, log) = tokio::task::spawn_blocking(|| server.stop()).await.unwrap();
    assert!(lines(&log).is_empty() && log.contains("listening on"), "{log}");
}
