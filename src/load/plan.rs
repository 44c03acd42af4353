//! What load is put on a server.

use std::str::FromStr;
use std::time::Duration;

use firn_client::Client;
use firn_protocol::stream::SubProtocol;

use crate::config::ApiKey;

use super::{LoadError, mover};

/// Sides of a rectangle in columns, such as `32x16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Columns along x, at least 1.
    pub width: u32,
    /// Columns along z, at least 1.
    pub depth: u32,
}

impl FromStr for Extent {
    type Err = String;

    fn from_str(text: &str) -> Result<Extent, String> {
        let side = |text: &str| text.parse().ok().filter(|&side| side > 0);
        text.split_once('x')
            .and_then(|(width, depth)| Some(Extent { width: side(width)?, depth: side(depth)? }))
            .ok_or_else(|| "expected columns along x and z, such as 32x32".to_owned())
    }
}

/// What load is put on.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The server, `http://host:port`.
    pub url: String,
    /// The server's API key, where it asks for one.
    pub api_key: Option<ApiKey>,
    /// How viewers are told heights.
    pub protocol: SubProtocol,
    /// Sessions, each with its own objects.
    pub sessions: usize,
    /// Viewers of all sessions together.
    pub clients: usize,
    /// How many of them stop reading for `stall` when the run begins.
    pub slow_clients: usize,
    /// How long they do.
    pub stall: Duration,
    /// What each viewer watches.
    pub region: Extent,
    /// Columns of each session.
    pub grid: Extent,
    /// Cells that each of their columns can hold.
    pub height: u32,
    /// Moving objects in each session.
    pub colliders: usize,
    /// Ticks per second of each session \[Hz\]; objects are moved as often.
    pub tick_rate: f64,
    /// Most messages per second to a viewer \[Hz\].
    pub max_rate: f64,
    /// Length of the run.
    pub duration: Duration,
    /// Fresh snow that each session begins with \[m\].
    pub snow: f64,
    /// Snow that falls in them during the run \[m/h\].
    pub snowfall_rate: f64,
    /// Whether the snow has settled before the run.
    pub settled: bool,
    /// The server's process, where its memory is to be measured.
    pub server_pid: Option<u32>,
}

impl Plan {
    /// The server, asked as the plan says.
    ///
    /// # Errors
    /// Where its address is none.
    pub(super) fn client(&self) -> Result<Client, LoadError> {
        let client = Client::new(&self.url)?;
        Ok(match &self.api_key {
            Some(key) => client.with_key(key.secret())?,
            None => client,
        })
    }

    /// Says what can't be carried out.
    ///
    /// # Errors
    /// The first thing.
    pub(super) fn check(&self) -> Result<(), LoadError> {
        let least = mover::LEAST_SIDE;
        let wrong = if self.sessions == 0 || self.clients == 0 {
            "there must be at least one session and one client".to_owned()
        } else if self.slow_clients > self.clients {
            format!("{} slow clients are more than all {}", self.slow_clients, self.clients)
        } else if self.grid.width < least || self.grid.depth < least {
            format!("objects move on grids of at least {least}x{least} columns")
        } else if self.region.width > self.grid.width || self.region.depth > self.grid.depth {
            "the region is larger than the grid".to_owned()
        } else {
            return Ok(());
        };
        Err(LoadError(wrong))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extent_is_two_numbers() {
        assert_eq!("32x16".parse(), Ok(Extent { width: 32, depth: 16 }));
        for text in ["", "32", "32x", "x3", "0x3", "3x-1", "3x4x5", "axb"] {
            assert!(text.parse::<Extent>().is_err(), "{text}");
        }
    }
}
