//! Answers that are kept for requests with an `Idempotency-Key`.

use firn::config::BackendChoice;
use futures_util::StreamExt;
use futures_util::stream;
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
    const REQUESTS: usize = 4000;
    let server = Server::start(BackendChoice::Cpu).await;
    let path = server.create(small()).await;
    let url = format!("{path}/snowfalls");
    // What a number of requests leaves behind.
    let left = async |first: usize, keyed: bool| {
        let before = allocated::settled().await;
        let requests = (first..first + REQUESTS)
            .map(|number| fall(&server, &url, keyed.then(|| format!("key {number}"))));
        let answers = stream::iter(requests).buffer_unordered(16);
        answers.for_each(async |answer| assert_eq!(answer.status, 200)).await;
        allocated::settled().await - before
    };
    // Room for the connections, and for what is measured without keys.
    left(0, false).await;
    let without = left(0, false).await;
    let with = left(0, true).await;
    let counted = metric(&server, "firn_kept_answers_bytes").await as f64;
    let taken = (with - without) as f64;
    let each = taken / REQUESTS as f64;
    // What the allocator adds to each of the small pieces is counted too.
    assert!((0.9..1.3).contains(&(counted / taken)), "{counted} of {taken}, {each} for each");
    server.stop().await;
}
