//! The few REST calls that a run needs.

use reqwest::{Client, Method, Response, StatusCode};
use serde_json::{Value, json};

use crate::config::ApiKey;

use super::{CELL_SIZE, LoadError, Plan};

/// Snow at the beginning \[m\].
const SNOW: f64 = 2.0;

/// Simulated time after which snow counts as settled \[s\].
const LONGEST_SETTLING: f64 = 600.0;

/// A server.
pub struct Api {
    client: Client,
    base: String,
    key: Option<ApiKey>,
}

impl Api {
    /// A run's server.
    pub fn new(plan: &Plan) -> Result<Api, LoadError> {
        let (url, key) = (&plan.url, plan.api_key.clone());
        let base = url.trim_end_matches('/').to_owned();
        if !base.starts_with("http://") {
            return Err(LoadError(format!(
                "'{url}' is no address without TLS, as in http://127.0.0.1:8080"
            )));
        }
        let client = Client::builder()
            .build()
            .map_err(|error| LoadError(format!("no HTTP client: {error}")))?;
        Ok(Api { client, base, key })
    }

    /// Creates a paused session.
    pub async fn create(&self, id: &str, plan: &Plan) -> Result<(), LoadError> {
        let body = json!({
            "id": id,
            "grid": {"width": plan.grid.width, "depth": plan.grid.depth, "height": plan.height,
                     "cell_size": CELL_SIZE},
            "tick_rate": plan.tick_rate,
            "paused": true,
            "initial_snow": [{"depth": SNOW}],
        });
        self.call(Method::POST, "", Some(body)).await.map(drop)
    }

    /// Steps a paused session until its snow rests.
    pub async fn settle(&self, id: &str) -> Result<(), LoadError> {
        let body = json!({"until_settled": true, "max_seconds": LONGEST_SETTLING});
        self.call(Method::POST, &format!("/{id}/step"), Some(body)).await.map(drop)
    }

    /// Sets a session running.
    pub async fn unpause(&self, id: &str) -> Result<(), LoadError> {
        let body = json!({"paused": false});
        self.call(Method::PATCH, &format!("/{id}"), Some(body)).await.map(drop)
    }

    /// Lets as little snow fall as a session takes in.
    pub async fn snow(&self, id: &str) -> Result<(), LoadError> {
        let body = json!({"depth": CELL_SIZE / 200.0});
        let response = self.call(Method::POST, &format!("/{id}/snowfalls"), Some(body)).await?;
        // The connection is only used again once the answer is read.
        let read = response.bytes().await;
        read.map(drop).map_err(|error| LoadError(format!("an answer broke off: {error}")))
    }

    /// Ticks of a session so far.
    pub async fn tick(&self, id: &str) -> Result<u64, LoadError> {
        let response = self.call(Method::GET, &format!("/{id}"), None).await?;
        let session: Value = response
            .json()
            .await
            .map_err(|error| LoadError(format!("the session '{id}' can't be read: {error}")))?;
        session["tick"].as_u64().ok_or_else(|| LoadError(format!("'{id}' has no tick")))
    }

    /// Deletes a session, if it is there.
    pub async fn delete(&self, id: &str) -> Result<(), LoadError> {
        let response = self.send(Method::DELETE, &format!("/{id}"), None).await?;
        if response.status() == StatusCode::NOT_FOUND {
            return Ok(());
        }
        checked(response, "DELETE").await.map(drop)
    }

    async fn call(
        &self,
        method: Method,
        path: &str,
        body: Option<Value>,
    ) -> Result<Response, LoadError> {
        let what = format!("{method} /v1/sessions{path}");
        checked(self.send(method, path, body).await?, &what).await
    }

    async fn send(
        &self,
        method: Method,
        path: &str,
        body: Option<Value>,
    ) -> Result<Response, LoadError> {
        let url = format!("{}/v1/sessions{path}", self.base);
        let mut request = self.client.request(method, &url);
        if let Some(key) = &self.key {
            request = request.bearer_auth(key.secret());
        }
        if let Some(body) = body {
            request = request.json(&body);
        }
        request.send().await.map_err(|error| {
            LoadError(format!(
                "{url} can't be reached: {}; start a server with `firn serve`, or name another \
                 with --url",
                root_cause(&error)
            ))
        })
    }
}

/// What is behind an error: the outer ones repeat what was tried.
fn root_cause(error: &dyn std::error::Error) -> String {
    error.source().map_or_else(|| error.to_string(), root_cause)
}

/// A response, unless it is a problem.
async fn checked(response: Response, what: &str) -> Result<Response, LoadError> {
    let status = response.status();
    if status.is_success() {
        return Ok(response);
    }
    let problem: Value = response.json().await.unwrap_or_default();
    let detail = problem["detail"].as_str().unwrap_or("no details").to_owned();
    Err(LoadError(format!("{what} was answered with {status}: {detail}")))
}
