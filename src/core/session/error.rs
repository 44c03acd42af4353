//! What can go wrong with a request about a session.

use firn_engine::frame::EngineError;

use crate::quote::quote;

/// One part of a request that can't be accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Invalid {
    /// JSON pointer to the field in the body, or the name of a path or query parameter.
    pub pointer: String,
    /// What was expected and what was found.
    pub detail: String,
}

impl Invalid {
    /// A field, and what is wrong with it.
    pub fn new(pointer: impl Into<String>, detail: impl Into<String>) -> Invalid {
        Invalid { pointer: pointer.into(), detail: detail.into() }
    }
}

/// Why a request about a session was not carried out. Nothing has changed where one is returned.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SessionError {
    /// There is no such session, collider or column.
    #[error("there is no {kind} {}", quote(.id))]
    NotFound {
        /// What was looked for.
        kind: &'static str,
        /// The name it was looked for by.
        id: String,
    },
    /// The state of the session does not allow it now.
    #[error("{0}")]
    Conflict(String),
    /// The client may not do this.
    #[error("{0}")]
    Forbidden(String),
    /// Fields are invalid or beyond a limit of a session.
    #[error("the request is not valid")]
    Invalid(Vec<Invalid>),
    /// As many requests wait for the session as may.
    #[error("{0}")]
    TooManyWaiting(String),
    /// A total of the whole server is reached.
    #[error("{0}")]
    ServerFull(String),
    /// A quota of the tenant is reached.
    #[error("{0}")]
    QuotaReached(String),
    /// The device's memory is full.
    #[error("{0}")]
    OutOfMemory(String),
    /// The server's own memory is full.
    #[error("{0}")]
    NoMemory(String),
    /// The change can't be stored: the disk is full, or fails.
    #[error("{0}")]
    StorageFailed(String),
    /// What is stored is not where it was any more: the next start would not find the change.
    #[error("{0}")]
    StorageGone(String),
    /// The session takes no changes until an administrator unlocks it.
    #[error("{0}")]
    Locked(String),
    /// The engine is stopping, or has failed.
    #[error("{0}")]
    Unavailable(String),
    /// Handling the request failed inside the server.
    #[error("{0}")]
    Internal(String),
}

impl SessionError {
    /// The snow of a session feels no weather.
    pub fn feels_no_weather() -> SessionError {
        SessionError::Conflict(
            "the snow of this session has the physics 'thesis' and feels no weather; create a session with \
             \"physics\": \"alpine\" for that, or let snow fall and set the temperature of the air"
                .to_owned(),
        )
    }
}

impl From<EngineError> for SessionError {
    fn from(error: EngineError) -> SessionError {
        match error {
            EngineError::OutOfMemory(_) => SessionError::OutOfMemory(error.to_string()),
            _ => SessionError::Unavailable(error.to_string()),
        }
    }
}

/// Collects what is wrong with a request, so that its author learns all of it at once.
#[derive(Debug, Default)]
pub struct Check(Vec<Invalid>);

impl Check {
    /// Notes a field as invalid.
    pub fn reject(&mut self, pointer: impl Into<String>, detail: impl Into<String>) {
        self.0.push(Invalid::new(pointer, detail));
    }

    /// What was read, or notes what is wrong with it.
    pub fn take<T>(&mut self, read: Result<T, Invalid>) -> Option<T> {
        read.map_err(|invalid| self.0.push(invalid)).ok()
    }

    /// Notes a number outside `lowest..=highest`, or not finite.
    pub fn range(
        &mut self,
        pointer: impl Into<String>,
        value: f64,
        lowest: f64,
        highest: f64,
        unit: &str,
    ) {
        if !(lowest..=highest).contains(&value) {
            let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
            let detail = format!("{} is not within {lowest} to {highest}{unit}", short(value));
            self.reject(pointer, detail);
        }
    }

    /// Everything noted so far.
    pub fn errors(&self) -> impl ExactSizeIterator<Item = &Invalid> {
        self.0.iter()
    }

    /// Takes over what was noted elsewhere.
    pub fn join(&mut self, other: Check) {
        self.0.extend(other.0);
    }

    /// Whether nothing has been noted so far.
    pub fn passed(&self) -> bool {
        self.0.is_empty()
    }

    /// Everything noted, as one error.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] where anything was noted.
    pub fn finish(self) -> Result<(), SessionError> {
        if self.0.is_empty() { Ok(()) } else { Err(SessionError::Invalid(self.0)) }
    }
}

/// A number in few digits, however large or small it is.
fn short(value: f64) -> String {
    let plain = value == 0.0 || (1e-6..1e16).contains(&value.abs()) || !value.is_finite();
    if plain { value.to_string() } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_told_in_few_digits() {
        let told = [0.0, -0.5, 1e-5, 5e-324, -1e300, 123456789.5, f64::NAN].map(short);
        assert_eq!(told, ["0", "-0.5", "0.00001", "5e-324", "-1e300", "123456789.5", "NaN"]);
    }
}
