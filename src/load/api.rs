//! The few REST calls that a run needs.

use firn_client::{Client, Error, Method, Session};
use firn_protocol::{
    ColliderBatch, ColliderSpec, SampleBatch, SampleReply, SessionSpec, SettingsPatch, SnowLayer,
    Snowfall, StepSpec,
};
use firn_snow::Grid;
use reqwest::StatusCode;
use serde_json::Value;

use super::{CELL_SIZE, LoadError, Plan};

/// Simulated time after which snow counts as settled \[s\].
const LONGEST_SETTLING: f64 = 600.0;

/// The metric that counts the time of frames.
const FRAME_TIME: &str = "firn_frame_time_seconds_total";

/// A server.
pub struct Api {
    client: Client,
}

impl Api {
    /// A run's server.
    pub fn new(plan: &Plan) -> Result<Api, LoadError> {
        Ok(Api { client: plan.client()? })
    }

    /// Creates a paused session.
    pub async fn create(&self, id: &str, plan: &Plan) -> Result<(), LoadError> {
        let (width, depth, height) = (plan.grid.width, plan.grid.depth, plan.height);
        self.create_from(&SessionSpec {
            id: Some(id.to_owned()),
            grid: Grid { width, depth, height, cell_size: CELL_SIZE },
            tick_rate: plan.tick_rate,
            paused: true,
            initial_snow: (plan.snow > 0.0)
                .then(|| SnowLayer::new(plan.snow))
                .into_iter()
                .collect(),
            ..SessionSpec::default()
        })
        .await
    }

    /// Creates a session.
    pub async fn create_from(&self, spec: &SessionSpec) -> Result<(), LoadError> {
        Ok(self.client.create(spec).await.map(drop)?)
    }

    /// Puts objects on a session's snow.
    pub async fn put(&self, id: &str, put: Vec<ColliderSpec>) -> Result<(), LoadError> {
        let batch = ColliderBatch { put, ..ColliderBatch::default() };
        Ok(self.session(id)?.change_colliders(&batch).await.map(drop)?)
    }

    /// Sends a request for a path below a session, reads the answer in pieces without keeping them, and
    /// returns its status: an error status is no failure.
    pub async fn ask(
        &self,
        method: Method,
        path: &str,
        body: Option<Value>,
    ) -> Result<StatusCode, LoadError> {
        let path = format!("/v1/sessions{path}");
        let mut response = self.client.send(method, &path, body.as_ref()).await?;
        let broken = |error| LoadError(format!("the answer to {path} broke off: {error}"));
        while response.chunk().await.map_err(broken)?.is_some() {}
        Ok(response.status())
    }

    /// Steps a paused session until its snow rests.
    pub async fn settle(&self, id: &str) -> Result<(), LoadError> {
        let step = StepSpec {
            until_settled: Some(true),
            max_seconds: Some(LONGEST_SETTLING),
            ..StepSpec::default()
        };
        Ok(self.session(id)?.step(&step).await.map(drop)?)
    }

    /// Lets snow fall in a session all the time, at a rate \[m/h\].
    pub async fn snow_at(&self, id: &str, rate: f64) -> Result<(), LoadError> {
        let settings = SettingsPatch { snowfall_rate: Some(rate), ..SettingsPatch::default() };
        Ok(self.session(id)?.set(&settings).await.map(drop)?)
    }

    /// Sets a session running.
    pub async fn unpause(&self, id: &str) -> Result<(), LoadError> {
        let settings = SettingsPatch { paused: Some(false), ..SettingsPatch::default() };
        Ok(self.session(id)?.set(&settings).await.map(drop)?)
    }

    /// Lets as little snow fall as a session takes in.
    pub async fn snow(&self, id: &str) -> Result<(), LoadError> {
        let depth = CELL_SIZE / 200.0;
        Ok(self.session(id)?.snowfall(&Snowfall::new(depth)).await.map(drop)?)
    }

    /// Reads a session's snow at some points.
    pub async fn sample(&self, id: &str, batch: &SampleBatch) -> Result<SampleReply, LoadError> {
        Ok(self.session(id)?.sample(batch).await?)
    }

    /// Ticks of a session so far.
    pub async fn tick(&self, id: &str) -> Result<u64, LoadError> {
        Ok(self.session(id)?.view().await?.tick)
    }

    /// Device time that a session has been charged with \[s\].
    pub async fn device_seconds(&self, id: &str) -> Result<f64, LoadError> {
        Ok(self.session(id)?.usage().await?.device_seconds)
    }

    /// Time that the server's frames have taken \[s\].
    pub async fn frame_seconds(&self) -> Result<f64, LoadError> {
        let unknown = |why: &str| LoadError(format!("/metrics does not tell {FRAME_TIME}: {why}"));
        let response = self.client.send(Method::GET, "/metrics", None::<&Value>).await?;
        let text = response.text().await.map_err(|error| unknown(&error.to_string()))?;
        let seconds =
            text.lines().find_map(|line| line.strip_prefix(FRAME_TIME)?.trim().parse().ok());
        seconds.ok_or_else(|| unknown("this is not a Firn server that the tool knows"))
    }

    /// Deletes a session, if it is there.
    pub async fn delete(&self, id: &str) -> Result<(), LoadError> {
        Ok(self.session(id)?.delete().await?)
    }

    fn session(&self, id: &str) -> Result<Session, LoadError> {
        Ok(self.client.session(id)?)
    }
}

impl From<Error> for LoadError {
    fn from(error: Error) -> LoadError {
        LoadError(match error {
            Error::Unreachable { .. } => {
                format!("{error}; start a server with `firn serve`, or name another with --url")
            }
            error => error.to_string(),
        })
    }
}

/// Why a client was dropped, in the same words for all that fared the same.
pub fn cause(error: &Error) -> String {
    match error {
        Error::Refused { problem, .. } => format!("refused with {}", problem.status),
        Error::Unreachable { why, .. } => format!("not connected: {why}"),
        Error::Closed { code, .. } => format!("closed with {code}"),
        Error::Unreadable { .. } => "a message that can't be read".to_owned(),
        error => error.to_string(),
    }
}
