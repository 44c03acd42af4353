//! A session: the calls about one snowpack.

use firn_protocol::stream::SubProtocol;
use firn_protocol::{
    AirTemperature, AirTemperatureReply, BatchReply, CheckpointList, CheckpointView, Clearing,
    ClearingReply, ColliderBatch, ColliderPatch, ColliderReply, ColliderSpec, ColumnView, MassView,
    ProbeBatch, ProbeReply, ResetSpec, SampleBatch, SampleReply, SessionView, SettingsPatch,
    Snowfall, SnowfallReply, Stamp, StampBatch, StampReply, StepSpec, Terrain, UsageView,
    WeatherInput, WeatherView,
};
use reqwest::Method;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::client::{Client, checked};
use crate::error::{Error, root_cause};
use crate::stream::Stream;

/// Media type of a snapshot.
const SNAPSHOT: &str = "application/vnd.firn.snapshot";

/// A body where there is none.
const NONE: Option<&()> = None;

/// What is read of an answer about the ground.
#[derive(Deserialize)]
struct Elevations {
    heights: Vec<f64>,
}

/// A handle to a session of a server. Every call fails as [`Client::call`] does.
#[derive(Clone, Debug)]
pub struct Session {
    client: Client,
    id: String,
}

impl Session {
    pub(crate) fn new(client: Client, id: &str) -> Session {
        Session { client, id: id.to_owned() }
    }

    /// Its name.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The server that it is on.
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// The path of something below it, such as `/heights`.
    pub fn path(&self, below: &str) -> String {
        format!("/v1/sessions/{}{below}", self.id)
    }

    /// Its configuration, clock and summary.
    pub async fn view(&self) -> Result<SessionView, Error> {
        self.get("").await
    }

    /// Changes some of its settings; others stay.
    pub async fn set(&self, settings: &SettingsPatch) -> Result<SessionView, Error> {
        self.client.call(Method::PATCH, &self.path(""), Some(settings)).await
    }

    /// Ends it. One that is not there counts as ended.
    pub async fn delete(&self) -> Result<(), Error> {
        match self.client.tell(Method::DELETE, &self.path(""), NONE).await {
            Err(Error::Refused { problem, .. }) if problem.status == 404 => Ok(()),
            done => done,
        }
    }

    /// Brings it back to the state in which it was created.
    pub async fn reset(&self) -> Result<SessionView, Error> {
        self.client.call(Method::POST, &self.path("/reset"), NONE).await
    }

    /// Brings it back to a restore point.
    pub async fn reset_to_checkpoint(&self, name: &str) -> Result<SessionView, Error> {
        let to = ResetSpec { checkpoint: Some(checked(name)?.to_owned()) };
        self.post("/reset", &to).await
    }

    /// Makes it what a snapshot of the same grid and ground holds.
    pub async fn reset_to_snapshot(&self, snapshot: Vec<u8>) -> Result<SessionView, Error> {
        self.client.call_with_bytes(Method::POST, &self.path("/reset"), SNAPSHOT, snapshot).await
    }

    /// All of it in one piece.
    pub async fn snapshot(&self) -> Result<Vec<u8>, Error> {
        let path = self.path("/snapshot");
        let read = self.client.fetch(&path).await?.bytes().await;
        let unreadable = |error| Error::Unreadable { what: path, why: root_cause(&error) };
        read.map(Vec::from).map_err(unreadable)
    }

    /// Its restore points.
    pub async fn checkpoints(&self) -> Result<CheckpointList, Error> {
        self.get("/checkpoints").await
    }

    /// A restore point.
    pub async fn checkpoint(&self, name: &str) -> Result<CheckpointView, Error> {
        self.client.call(Method::GET, &self.checkpoint_path(name)?, NONE).await
    }

    /// Keeps its present state under a name; a restore point of that name is replaced.
    pub async fn put_checkpoint(&self, name: &str) -> Result<CheckpointView, Error> {
        self.client.call(Method::PUT, &self.checkpoint_path(name)?, NONE).await
    }

    /// Deletes a restore point.
    pub async fn delete_checkpoint(&self, name: &str) -> Result<(), Error> {
        self.client.tell(Method::DELETE, &self.checkpoint_path(name)?, NONE).await
    }

    /// Steps it while it is paused.
    pub async fn step(&self, step: &StepSpec) -> Result<SessionView, Error> {
        self.post("/step", step).await
    }

    /// Ends the step under way at the tick it has reached. Where there is none the server refuses with 409.
    pub async fn end_step(&self) -> Result<(), Error> {
        self.client.tell(Method::DELETE, &self.path("/step"), NONE).await
    }

    /// What it takes of the server.
    pub async fn usage(&self) -> Result<UsageView, Error> {
        self.get("/usage").await
    }

    /// Lets snow fall. Above objects it lies on them, unless they do not shelter.
    pub async fn snowfall(&self, snowfall: &Snowfall) -> Result<SnowfallReply, Error> {
        self.post("/snowfalls", snowfall).await
    }

    /// Clears snow to a depth, but not under objects that stand there.
    pub async fn clear(&self, clearing: &Clearing) -> Result<ClearingReply, Error> {
        self.post("/clearings", clearing).await
    }

    /// Gives the air another temperature \[°C\].
    pub async fn air_temperature(&self, celsius: f64) -> Result<AirTemperatureReply, Error> {
        let air = AirTemperature { celsius };
        self.client.call(Method::PUT, &self.path("/air-temperature"), Some(&air)).await
    }

    /// The weather of alpine snow: what was told, what holds now, and what of that was worked out.
    ///
    /// # Errors
    /// [`Error::Refused`] where the session has other physics.
    pub async fn weather(&self) -> Result<WeatherView, Error> {
        self.get("/weather").await
    }

    /// Gives alpine snow another weather: one that holds until it is replaced, or a series.
    ///
    /// # Errors
    /// [`Error::Refused`] where it is none, or the session has other physics.
    pub async fn put_weather(&self, weather: &WeatherInput) -> Result<Stamp, Error> {
        self.client.call(Method::PUT, &self.path("/weather"), Some(weather)).await
    }

    /// Elevation of the ground under each column \[m\], row by row.
    pub async fn terrain(&self) -> Result<Vec<f64>, Error> {
        let Elevations { heights } = self.get("/terrain").await?;
        Ok(heights)
    }

    /// Lays other ground under the snow.
    pub async fn put_terrain(&self, terrain: &Terrain) -> Result<Stamp, Error> {
        self.client.call(Method::PUT, &self.path("/terrain"), Some(terrain)).await
    }

    /// Puts an object on the snow; the server names it where it has no id.
    pub async fn create_collider(&self, collider: &ColliderSpec) -> Result<ColliderReply, Error> {
        self.post("/colliders", collider).await
    }

    /// Changes parts of an object; others stay. With `sweep` it is pushed to its new position in the next cycle, and leaves a
    /// track.
    pub async fn patch_collider(
        &self,
        id: &str,
        patch: &ColliderPatch,
    ) -> Result<ColliderReply, Error> {
        self.client.call(Method::PATCH, &self.collider_path(id)?, Some(patch)).await
    }

    /// An object, and how it stands.
    pub async fn collider(&self, id: &str) -> Result<ColliderReply, Error> {
        self.client.call(Method::GET, &self.collider_path(id)?, NONE).await
    }

    /// Takes an object away.
    pub async fn delete_collider(&self, id: &str) -> Result<(), Error> {
        self.client.tell(Method::DELETE, &self.collider_path(id)?, NONE).await
    }

    /// Puts and removes objects in one frame: all or none, or those that are not in error.
    pub async fn change_colliders(&self, batch: &ColliderBatch) -> Result<BatchReply, Error> {
        self.post("/colliders:batch", batch).await
    }

    /// The material cells of a column.
    pub async fn column(&self, x: u32, z: u32) -> Result<ColumnView, Error> {
        self.get(&format!("/columns/{x}/{z}")).await
    }

    /// The mass ledger.
    pub async fn mass(&self) -> Result<MassView, Error> {
        self.get("/mass").await
    }

    /// Presses prints into the snow, at once.
    pub async fn stamp(&self, stamps: &StampBatch) -> Result<StampReply, Error> {
        self.post("/stamps", stamps).await
    }

    /// How deep loads would sink, without putting them on the snow.
    pub async fn probe(&self, probes: &ProbeBatch) -> Result<ProbeReply, Error> {
        self.post("/probes", probes).await
    }

    /// The snow at some points.
    pub async fn sample(&self, samples: &SampleBatch) -> Result<SampleReply, Error> {
        self.post("/samples", samples).await
    }

    /// Opens a height stream, and reads its welcome.
    pub async fn stream(&self, protocol: SubProtocol) -> Result<Stream, Error> {
        Stream::open(&self.client, &self.id, protocol).await
    }

    fn checkpoint_path(&self, name: &str) -> Result<String, Error> {
        Ok(self.path(&format!("/checkpoints/{}", checked(name)?)))
    }

    fn collider_path(&self, id: &str) -> Result<String, Error> {
        Ok(self.path(&format!("/colliders/{}", checked(id)?)))
    }

    async fn get<T: DeserializeOwned>(&self, below: &str) -> Result<T, Error> {
        self.client.call(Method::GET, &self.path(below), NONE).await
    }

    async fn post<T: DeserializeOwned>(
        &self,
        below: &str,
        body: &impl Serialize,
    ) -> Result<T, Error> {
        self.client.call(Method::POST, &self.path(below), Some(body)).await
    }
}
