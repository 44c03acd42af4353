//! API keys of tenants: what their scopes allow, what they see, and what their quotas hold.

use std::collections::BTreeSet;
use std::time::Duration;

use firn::config::{AccessConfig, ApiKey, BackendChoice};
use reqwest::Method;
use serde_json::{Value, json};
use tempfile::NamedTempFile;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::support::{Options, Server, small};

const OPERATOR: &str = "the-key-of-the-operator";
const ALPINE: &str = "the-key-of-alpine-that-reads-and-writes";
const ALPINE_READS: &str = "the-key-of-alpine-that-reads";
const ALPINE_WRITES: &str = "the-key-of-alpine-that-writes";
const BALTIC: &str = "the-key-of-baltic-that-reads-and-writes";
const ADMIN: &str = "the-key-of-baltic-for-everything";

/// Beyond any wait of these tests.
const PATIENCE: Duration = Duration::from_secs(60);

/// A file with the keys above; `quotas` are those of alpine.
fn keys_file(quotas: &str) -> NamedTempFile {
    let key = |tenant: &str, key: &str, scopes: &str| {
        format!("[[tenants.{tenant}.keys]]\nkey = \"{key}\"\nscopes = [{scopes}]\n")
    };
    let text = [
        format!("[tenants.alpine]\nquotas = {{ {quotas} }}\n"),
        key("alpine", ALPINE, "\"read\", \"write\""),
        key("alpine", ALPINE_READS, "\"read\""),
        key("alpine", ALPINE_WRITES, "\"write\""),
        key("baltic", BALTIC, "\"read\", \"write\""),
        key("baltic", ADMIN, "\"admin\""),
    ];
    let file = NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), text.concat()).expect("it can be written");
    file
}

/// A server with the operator's key and those of a file, which has to outlive its start.
async fn serve(file: &NamedTempFile) -> Server {
    let access = AccessConfig {
        api_key: Some(ApiKey::from(OPERATOR)),
        api_keys_file: Some(file.path().to_owned()),
        auth_failures_per_minute: 1_000_000.try_into().unwrap(),
        ..AccessConfig::default()
    };
    Server::start_with(BackendChoice::Cpu, Options { access, ..Options::default() }).await
}

/// A body of a small session of a name.
fn named(id: &str) -> Value {
    let mut body = small();
    body["id"] = json!(id);
    body
}

async fn create(server: &Server, key: &str, id: &str) -> Value {
    server.send_as(key, Method::POST, "/v1/sessions", &named(id)).await.expect(201)
}

/// Names of all sessions that a key lists, a few at a time.
async fn list(server: &Server, key: &str) -> Vec<String> {
    let (mut names, mut cursor) = (Vec::new(), String::new());
    loop {
        let path = format!("/v1/sessions?limit=2{cursor}");
        let page = server.send_as(key, Method::GET, &path, &Value::Null).await.expect(200);
        let items = page["items"].as_array().unwrap();
        names.extend(items.iter().map(|item| item["id"].as_str().unwrap().to_owned()));
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={next}"),
            None => return names,
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_scope_allows_what_it_is_for() {
    let file = keys_file("");
    let server = serve(&file).await;
    assert_eq!(server.get("/readyz").await.expect(200)["auth"], "required");
    create(&server, ALPINE, "peak").await;
    let url = |part: &str| format!("/v1/sessions/peak{part}");
    let probes = json!({"probes": [{"x": 1, "z": 0.7, "mass": 80, "area": 0.1}]});
    let reads = [
        (Method::GET, url(""), Value::Null),
        (Method::HEAD, url("/heights"), Value::Null),
        (Method::GET, url("/snapshot"), Value::Null),
        (Method::POST, url("/probes"), probes),
        (Method::POST, url("/samples"), json!({"points": [[1, 0.7]]})),
        (Method::GET, "/v1/sessions".to_owned(), Value::Null),
    ];
    let changes = [
        (Method::POST, url("/snowfalls"), json!({"depth": 0.1})),
        (Method::PATCH, url(""), json!({"time_scale": 2})),
        (Method::POST, url("/step"), json!({"ticks": 1})),
        (Method::POST, url("/reset"), json!({})),
        (Method::POST, url("/tokens"), Value::Null),
        (Method::POST, "/v1/sessions".to_owned(), small()),
    ];
    for (key, may_read, may_write) in [
        (OPERATOR, true, true),
        (ALPINE, true, true),
        (ALPINE_READS, true, false),
        (ALPINE_WRITES, false, true),
        (ADMIN, true, true),
    ] {
        for (calls, may, scope) in [(&reads[..], may_read, "read"), (&changes, may_write, "write")]
        {
            for (method, path, body) in calls {
                let reply = server.send_as(key, method.clone(), path, body).await;
                if may {
                    assert!(matches!(reply.status, 200 | 201), "{key} {method} {path}");
                } else if method != Method::HEAD {
                    let problem = reply.problem(403);
                    let named = problem["detail"].as_str().unwrap().contains(scope);
                    assert!(named, "{key} {method} {path}: {problem}");
                }
            }
        }
    }
    server.send_as(ALPINE_READS, Method::DELETE, &url(""), &Value::Null).await.problem(403);
    server.send_as(ALPINE_WRITES, Method::DELETE, &url(""), &Value::Null).await.expect(204);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tenant_sees_its_own_sessions_alone() {
    let file = keys_file("");
    let server = serve(&file).await;
    for (key, tenant, ids) in [
        (ALPINE, json!("alpine"), ["a1", "b1", "c1"]),
        (BALTIC, json!("baltic"), ["a2", "b2", "c2"]),
        (OPERATOR, Value::Null, ["a3", "b3", "c3"]),
    ] {
        for id in ids {
            assert_eq!(create(&server, key, id).await["tenant"], tenant);
        }
    }
    assert_eq!(list(&server, ALPINE).await, ["a1", "b1", "c1"]);
    assert_eq!(list(&server, ALPINE_READS).await, ["a1", "b1", "c1"]);
    assert_eq!(list(&server, BALTIC).await, ["a2", "b2", "c2"]);
    let all = ["a1", "a2", "a3", "b1", "b2", "b3", "c1", "c2", "c3"];
    assert_eq!(list(&server, ADMIN).await, all);
    assert_eq!(list(&server, OPERATOR).await, all);
    let metrics = String::from_utf8(server.get("/metrics").await.body).unwrap();
    for tenant in ["alpine", "baltic", ""] {
        let sessions = format!("firn_tenant_sessions{{tenant=\"{tenant}\"}} 3\n");
        // 2 × 1 tiles of 64 columns with 20 slots of 16 bytes, three times.
        let memory = "firn_tenant_memory_bytes";
        let device = format!("{memory}{{tenant=\"{tenant}\",part=\"device\"}} 122880\n");
        let streams = format!("{memory}{{tenant=\"{tenant}\",part=\"streams\"}} 0\n");
        for line in [sessions, device, streams] {
            assert!(metrics.contains(&line), "{line} in {metrics}");
        }
    }
    // What is deleted is not listed any more, by whomever.
    server.send_as(ADMIN, Method::DELETE, "/v1/sessions/b1", &Value::Null).await.expect(204);
    server.send_as(BALTIC, Method::DELETE, "/v1/sessions/b2", &Value::Null).await.expect(204);
    assert_eq!(list(&server, ALPINE).await, ["a1", "c1"]);
    assert_eq!(list(&server, BALTIC).await, ["a2", "c2"]);
    // Names are everybody's: this one is taken.
    let taken = server.send_as(BALTIC, Method::POST, "/v1/sessions", &named("a1")).await;
    taken.problem(409);
    server.stop().await;
}

/// Whatever a tenant asks about a session of somebody else, with whatever body, it gets the answer
/// that it gets for a name that nobody has.
#[tokio::test(flavor = "multi_thread")]
async fn sessions_of_others_are_not_there() {
    let file = keys_file("");
    let server = serve(&file).await;
    create(&server, ALPINE, "taken").await;
    create(&server, OPERATOR, "other").await;
    let document = server.get("/openapi.json").await.expect(200);
    let mut calls = 0;
    for (template, item) in document["paths"].as_object().unwrap() {
        if !template.contains("{id}") {
            continue;
        }
        for method in item.as_object().unwrap().keys() {
            let method: Method = method.to_uppercase().parse().unwrap();
            for (media_type, body) in
                [("application/json", "{}"), ("application/json", "{"), ("text/plain", "snow")]
            {
                let mut answers = BTreeSet::new();
                for id in ["taken", "other", "empty"] {
                    let url = template.replace("{id}", id).replace("{cid}", "c");
                    let url = url.replace("{column_x}/{column_z}", "x/y");
                    let bearer = format!("Bearer {BALTIC}");
                    let headers = [("authorization", &*bearer), ("content-type", media_type)];
                    let reply = server.send(method.clone(), &url, &headers, body.into()).await;
                    // Unlocking is no tenant's, whosever the session is.
                    let status = if url.ends_with("/unlock") { 403 } else { 404 };
                    assert_eq!(reply.status, status, "{method} {url}");
                    let mut told: Vec<String> = reply
                        .headers
                        .iter()
                        .map(|(name, value)| format!("{name}: {value:?}"))
                        .collect();
                    told.retain(|header| !header.starts_with("date"));
                    let text = String::from_utf8(reply.body).unwrap().replace(id, "?");
                    answers.insert((told, text));
                }
                assert_eq!(answers.len(), 1, "{method} {template}: {answers:#?}");
                calls += 1;
            }
        }
    }
    assert!(calls > 60, "{calls}");
    // Their own tokens let in whoever has them, whosever the session is.
    let path = "/v1/sessions/taken";
    server.send_as(ADMIN, Method::GET, path, &Value::Null).await.expect(200);
    let tokens =
        server.send_as(ALPINE, Method::POST, &format!("{path}/tokens"), &Value::Null).await;
    let token = tokens.expect(200)["token"].as_str().unwrap().to_owned();
    server.send_as(&token, Method::GET, path, &Value::Null).await.expect(200);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_one_tenant_creates_is_repeated_for_nobody_else() {
    let file = keys_file("");
    let server = serve(&file).await;
    let make = async |key: &str| {
        let bearer = format!("Bearer {key}");
        let headers = [
            ("authorization", &*bearer),
            ("content-type", "application/json"),
            ("idempotency-key", "the same"),
        ];
        let body = small().to_string().into_bytes();
        server.send(Method::POST, "/v1/sessions", &headers, body).await
    };
    let mut made = Vec::new();
    for key in [ALPINE, BALTIC, OPERATOR] {
        let (first, again) = (make(key).await, make(key).await);
        assert_eq!(first.header("idempotent-replayed"), "", "{key}");
        assert_eq!(again.header("idempotent-replayed"), "true", "{key}");
        assert_eq!(first.expect(201), again.expect(201), "{key}");
        made.push(first.json()["token"].as_str().unwrap().to_owned());
    }
    assert_eq!(made.iter().collect::<BTreeSet<_>>().len(), 3, "each has a session of its own");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn quotas_are_counted_from_the_moment_a_name_is_taken() {
    // A small session has 16 × 8 × 20 cells in whole tiles.
    let file = keys_file("sessions = 3, cells = 9000");
    let server = serve(&file).await;
    let mut racing = tokio::task::JoinSet::new();
    for _ in 0..20 {
        let request = reqwest::Client::new().post(format!("{}/v1/sessions", server.url));
        let request = request.bearer_auth(ALPINE).json(&small());
        racing.spawn(async move { request.send().await.expect("it answers").status().as_u16() });
    }
    let mut statuses = racing.join_all().await;
    statuses.sort_unstable();
    assert_eq!(statuses, [vec![201; 3], vec![429; 17]].concat());
    let refused = server.send_as(ALPINE, Method::POST, "/v1/sessions", &small()).await;
    let problem = refused.problem(429);
    assert_eq!(problem["type"], "urn:firn:problem:quota-reached");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("'alpine' holds 3 sessions") && detail.contains("`sessions`"));
    assert_ne!(refused.header("retry-after"), "");

    // A snapshot that is restored counts the same, also where its session is an admin's to read.
    let mine = list(&server, ALPINE).await;
    let path = |id: &str| format!("/v1/sessions/{id}");
    let snapshot = format!("{}/snapshot", path(&mine[0]));
    let snapshot = server.send_as(ADMIN, Method::GET, &snapshot, &Value::Null).await.body;
    let restore = async |key: &str| {
        let bearer = format!("Bearer {key}");
        let media_type = "application/vnd.firn.snapshot";
        let headers = [("authorization", &*bearer), ("content-type", media_type)];
        server.send(Method::POST, "/v1/sessions", &headers, snapshot.clone()).await
    };
    restore(ALPINE).await.problem(429);
    assert_eq!(restore(BALTIC).await.expect(201)["tenant"], "baltic");
    server.send_as(ALPINE, Method::DELETE, &path(&mine[0]), &Value::Null).await.expect(204);
    assert_eq!(restore(ALPINE).await.expect(201)["tenant"], "alpine");

    // One place again, and 3880 cells: too few for a session that is twice as high.
    server.send_as(ALPINE, Method::DELETE, &path(&mine[1]), &Value::Null).await.expect(204);
    let mut high = small();
    high["grid"]["height"] = json!(40);
    let refused = server.send_as(ALPINE, Method::POST, "/v1/sessions", &high).await.problem(429);
    let detail = refused["detail"].as_str().unwrap();
    assert!(
        detail.contains("5120 cells more than the 5120") && detail.contains("9000"),
        "{detail}"
    );
    server.send_as(BALTIC, Method::POST, "/v1/sessions", &high).await.expect(201);
    // What is not valid takes no place.
    let mut wrong = small();
    wrong["tick_rate"] = json!(0);
    server.send_as(ALPINE, Method::POST, "/v1/sessions", &wrong).await.problem(422);
    server.send_as(ALPINE, Method::POST, "/v1/sessions", &small()).await.expect(201);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tenant_has_a_rate_of_its_own() {
    let file = keys_file("requests_per_second = 3");
    let server = serve(&file).await;
    let token = create(&server, ALPINE, "peak").await["token"].as_str().unwrap().to_owned();
    for (secret, path) in [(ALPINE, "/v1/sessions"), (&*token, "/v1/sessions/peak")] {
        let mut refused = None;
        for _ in 0..1000 {
            let reply = server.send_as(secret, Method::GET, path, &Value::Null).await;
            if reply.status == 429 {
                refused = Some(reply.problem(429));
                break;
            }
        }
        let refused = refused.expect("a thousand requests are more than 3 a second");
        let detail = refused["detail"].as_str().unwrap();
        assert!(detail.contains("requests_per_second") && detail.contains("'alpine'"), "{detail}");
    }
    for key in [BALTIC, OPERATOR] {
        for _ in 0..100 {
            server.send_as(key, Method::GET, "/v1/sessions", &Value::Null).await.expect(200);
        }
    }
    server.stop().await;
}

/// While its body arrives, the session may be deleted, and its name go to somebody else.
#[tokio::test(flavor = "multi_thread")]
async fn a_request_is_about_the_session_that_it_was_let_in_for() {
    let file = keys_file("");
    let server = serve(&file).await;
    create(&server, BALTIC, "name").await;
    let body = r#"{"depth": 0.5}"#;
    let head = format!(
        "POST /v1/sessions/name/snowfalls HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer \
         {BALTIC}\r\ncontent-type: application/json\r\ncontent-length: {}\r\nconnection: close\r\n\
         expect: 100-continue\r\n\r\n",
        body.len()
    );
    let mut stream = TcpStream::connect(server.url.split_once("://").unwrap().1).await.unwrap();
    stream.write_all(head.as_bytes()).await.unwrap();
    // The body is asked for once the request was let in.
    let mut told = vec![0; 25];
    timeout(PATIENCE, stream.read_exact(&mut told)).await.expect("it is asked for").unwrap();
    assert_eq!(told, b"HTTP/1.1 100 Continue\r\n\r\n");
    let path = "/v1/sessions/name";
    server.send_as(BALTIC, Method::DELETE, path, &Value::Null).await.expect(204);
    create(&server, ALPINE, "name").await;
    stream.write_all(body.as_bytes()).await.unwrap();
    let mut answer = String::new();
    timeout(PATIENCE, stream.read_to_string(&mut answer)).await.expect("it ends").unwrap();
    assert!(answer.starts_with("HTTP/1.1 404"), "{answer}");
    let mass = server.send_as(ALPINE, Method::GET, &format!("{path}/mass"), &Value::Null).await;
    let before = 1.0 * 2.0 * 1.4 * 20.0;
    let fallen = mass.expect(200)["fallen"].as_f64().unwrap();
    assert!((fallen - before).abs() < 0.1, "{fallen} kg have fallen on a session of alpine's");
    server.stop().await;
}
