//! Changes of clients, checked and completed to commands, or refused.

mod bodies;
mod objects;
mod settings;
mod stamps;
mod weather;

use crate::core::session::{Change, Command, Decision, SessionError, SessionState, Told};

impl SessionState {
    /// Decides what a change does, or refuses it whole. `most` is how many objects there may be; `None`
    /// where the change was allowed before.
    pub fn decide(&self, change: &Change, most: Option<usize>) -> Result<Decision, SessionError> {
        match change {
            Change::Snowfall(snowfall) => self.decide_snowfall(snowfall),
            Change::Clearing(clearing) => self.decide_clearing(clearing),
            Change::AirTemperature(air) => self.decide_air_temperature(air),
            Change::Weather(weather) => self.decide_weather(weather),
            Change::Settings(patch) => self.decide_settings(patch),
            Change::CreateCollider(spec) => self.decide_new_object(spec, most),
            Change::PutCollider(spec) => self.decide_object(spec, most),
            Change::PatchCollider { id, patch } => self.decide_patch(id, patch, most),
            Change::DeleteCollider { id } => self.decide_removal(id),
            Change::Colliders(batch) => self.decide_batch(batch, most),
            Change::Stamps(batch) => self.decide_stamps(batch),
            // It was checked before it came here: that takes a while.
            Change::Ground(ground) => {
                Ok(Decision { command: Command::Ground(ground.clone()), told: Told::Ground })
            }
        }
    }
}
