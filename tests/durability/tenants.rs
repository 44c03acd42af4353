//! Whom sessions belong to outlives the server.

use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::process::Process;
use crate::support::small;

const OPERATOR: &str = "the-key-of-the-operator";
const ALPINE: &str = "the-key-of-alpine-that-reads-and-writes";
const BALTIC: &str = "the-key-of-baltic-that-reads-and-writes";

async fn send(
    server: &Process,
    key: &str,
    method: Method,
    path: &str,
    body: &Value,
) -> (u16, Value) {
    let mut request = Client::new().request(method, format!("{}{path}", server.url));
    if !body.is_null() {
        request = request.json(body);
    }
    let answer = request.bearer_auth(key).send().await.expect("it answers");
    let status = answer.status().as_u16();
    (status, serde_json::from_slice(&answer.bytes().await.unwrap()).unwrap_or_default())
}

/// Names and tenants of the sessions that a key lists.
async fn list(server: &Process, key: &str) -> Vec<(String, Value)> {
    let (status, page) = send(server, key, Method::GET, "/v1/sessions", &Value::Null).await;
    assert_eq!(status, 200, "{page}");
    let item = |item: &Value| (item["id"].as_str().unwrap().to_owned(), item["tenant"].clone());
    page["items"].as_array().unwrap().iter().map(item).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_belong_to_their_tenants_after_a_kill_and_count_for_their_quotas() {
    let data = tempfile::tempdir().unwrap();
    let keys = tempfile::NamedTempFile::new().unwrap();
    let entry = |tenant: &str, key: &str| {
        format!(
            "[[tenants.{tenant}.keys]]\nkey = \"{key}\"\nscopes = [\"read\", \"write\"]\n\
             [tenants.{tenant}.quotas]\nsessions = 2\n"
        )
    };
    let text = entry("alpine", ALPINE) + &entry("baltic", BALTIC);
    std::fs::write(keys.path(), text).unwrap();
    let file = keys.path().to_str().unwrap();
    let options = ["--backend", "cpu", "--api-key", OPERATOR, "--api-keys-file", file];
    let mut server = Process::ready(data.path(), &options).await;
    let named = |id: &str| {
        let mut body = small();
        body["id"] = json!(id);
        body
    };
    for (key, id) in [(ALPINE, "a1"), (BALTIC, "b1"), (ALPINE, "a2"), (OPERATOR, "c1")] {
        assert_eq!(send(&server, key, Method::POST, "/v1/sessions", &named(id)).await.0, 201);
    }
    let tokens = "/v1/sessions/a1/tokens";
    // What is written anew of a session says whose it is, too.
    assert_eq!(send(&server, ALPINE, Method::POST, tokens, &Value::Null).await.0, 200);
    let own = |id: &str, tenant: &str| (id.to_owned(), json!(tenant));
    let alpine = [own("a1", "alpine"), own("a2", "alpine")];
    for _ in 0..2 {
        server.kill().await;
        server = Process::ready(data.path(), &options).await;
        assert_eq!(list(&server, ALPINE).await, alpine);
        assert_eq!(list(&server, BALTIC).await, [own("b1", "baltic")]);
        let others = [own("b1", "baltic"), ("c1".to_owned(), Value::Null)];
        assert_eq!(list(&server, OPERATOR).await, [&alpine[..], &others].concat());
        let (status, problem) = send(&server, ALPINE, Method::POST, "/v1/sessions", &small()).await;
        assert_eq!(status, 429, "{problem}");
        let (status, _) = send(&server, BALTIC, Method::GET, "/v1/sessions/a1", &Value::Null).await;
        assert_eq!(status, 404);
    }
    let (status, _) = send(&server, ALPINE, Method::DELETE, "/v1/sessions/a1", &Value::Null).await;
    assert_eq!(status, 204);
    assert_eq!(send(&server, ALPINE, Method::POST, "/v1/sessions", &small()).await.0, 201);
    server.kill().await;
}
