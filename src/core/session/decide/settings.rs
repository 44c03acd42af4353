//! Settings of a session.

use firn_protocol::{Settings, SettingsPatch};

use crate::core::session::{Check, Command, Decision, SessionError, SessionState, Told};

impl SessionState {
    pub(crate) fn decide_settings(&self, patch: &SettingsPatch) -> Result<Decision, SessionError> {
        let old = self.settings;
        let settings = Settings {
            air_temperature: patch.air_temperature.unwrap_or(old.air_temperature),
            time_scale: patch.time_scale.unwrap_or(old.time_scale),
            tick_rate: patch.tick_rate.unwrap_or(old.tick_rate),
            paused: patch.paused.unwrap_or(old.paused),
            snowfall_rate: patch.snowfall_rate.unwrap_or(old.snowfall_rate),
            pressing: patch.pressing.unwrap_or(old.pressing),
            idle_timeout_s: patch.idle_timeout_s.unwrap_or(old.idle_timeout_s),
            delete_after_s: patch.delete_after_s.unwrap_or(old.delete_after_s),
        };
        let stiffness_exponent =
            patch.stiffness_exponent.unwrap_or(self.material.stiffness_exponent);
        let mut check = Check::default();
        check.settings(&settings, self.physics());
        check.range("/stiffness_exponent", stiffness_exponent, 3.0, 6.0, "");
        check.finish()?;
        let weather = patch.air_temperature.and_then(|celsius| self.weather_with(celsius));
        let command = Command::Settings { settings, stiffness_exponent, weather };
        Ok(Decision { command, told: Told::Settings })
    }
}
