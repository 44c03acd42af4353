//! Events, and where they happened.

use firn_protocol::Event;
use firn_snow::ColumnRect;

/// An event, and where it happened.
#[derive(Clone, Debug)]
pub struct Happening {
    /// What happened.
    pub event: Event,
    /// Columns that it is about; nothing where it is about all of the session.
    pub columns: Option<ColumnRect>,
}

impl From<Event> for Happening {
    fn from(event: Event) -> Happening {
        Happening { event, columns: None }
    }
}
