//! Answers that are kept for requests with an `Idempotency-Key`.

use firn::config::BackendChoice;
use reqwest::Method;

use crate::raw::metric;
use crate::support::{Reply, Server, small};
use crate::{allocated, alone};

async fn fall(server: &Server, path: &str, key: Option<String>) -> Reply {
    let mut headers = vec![("content-type", "application/json")];
    headers.extend(key.as_deref().map(|key| ("idempotency-key", key)));
    server.send(Method::POST, path, &headers, br#"{"depth": 0.001}"#.to_vec()).await
}

#[test]
fn what_keys_take_is_counted() {
    alone(keys());
}

async fn keys() {
    // So few that the journal is not cut short meanwhile.
    const REQUESTS: usize = 2000;
    let server = Server::start(BackendChoice::Cpu).await;
    let path = server.create(small()).await;
    let url = format!("{path}/snowfalls");
    // What a number of requests leaves behind.
    let left = async |keyed: bool| {
        let before = allocated::settled().await;
        // One after the other, so that each has a frame and an entry in the journal for itself.
        for number in 0..REQUESTS {
            let answer = fall(&server, &url, keyed.then(|| format!("key {number}"))).await;
            assert_eq!(answer.status, 200);
        }
        allocated::settled().await - before
    };
    // Room for the connections, and for what is measured without keys.
    left(false).await;
    let without = left(false).await;
    let with = left(true).await;
    let counted = metric(&server, "firn_kept_answers_bytes").await as f64;
    let taken = (with - without) as f64;
    let each = taken / REQUESTS as f64;
    // What the allocator adds to each of the small pieces is counted too.
    assert!((0.9..1.3).contains(&(counted / taken)), "{counted} of {taken}, {each} for each");
    server.stop().await;
}
