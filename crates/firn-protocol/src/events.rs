//! Events of a session, as its streams report them.

use std::collections::BTreeSet;
use std::fmt;

use serde::de::value::SeqAccessDeserializer;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::session::{Progress, Settings, Stamp};
use crate::weather::WeatherNow;

/// Something that happened in a session, told to the subscriptions that want it while they last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// Snow fell because somebody asked for it; continuous snowfall shows in the settings.
    Snowfall {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// Mass that fell \[kg\], the refused part included.
        fallen_mass: f64,
        /// Mass that found no room \[kg\].
        refused_mass: f64,
    },
    /// Snow was cleared.
    Clearing {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// Mass that was removed \[kg\].
        cleared_mass: f64,
    },
    /// The settings changed, by the air's temperature or otherwise.
    Settings {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// All settings, as they are now.
        settings: Settings,
    },
    /// The weather of alpine snow is another from now on.
    Weather {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// What holds now.
        now: WeatherNow,
    },
    /// The snow lies on other ground.
    Terrain {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// Lowest elevation of the ground \[m\].
        lowest: f64,
        /// Highest elevation of the ground \[m\].
        highest: f64,
    },
    /// Nothing moves any more.
    Settled {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
    },
    /// How far a long step has come: twice a second from half a second after it began, and once when it has
    /// ended.
    StepProgress {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// How far it has come; `null` where it has ended.
        progress: Option<Progress>,
    },
    /// The session was reset: to the state it was created in, to a restore point, or to a snapshot.
    Reset {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
    },
    /// How a watch stands: told to the subscription that has it, at its begin and with each crossing.
    Watch {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// The subscription.
        subscription: i64,
        /// The watch.
        id: String,
        /// Whether it holds: whether the mean depth is `above`, or `below`, what the watch names.
        holds: bool,
        /// Mean depth of the snow in the watch's region \[m\].
        mean_depth: f64,
    },
}

impl Event {
    /// What subscriptions choose it by; none is chosen for [`Event::Watch`], which they have asked for.
    pub fn kind(&self) -> Option<EventKind> {
        match self {
            Event::Snowfall { .. } => Some(EventKind::Snowfall),
            Event::Clearing { .. } => Some(EventKind::Clearing),
            Event::Settings { .. } => Some(EventKind::Settings),
            Event::Weather { .. } => Some(EventKind::Weather),
            Event::Terrain { .. } => Some(EventKind::Terrain),
            Event::Settled { .. } => Some(EventKind::Settled),
            Event::StepProgress { .. } => Some(EventKind::StepProgress),
            Event::Reset { .. } => Some(EventKind::Reset),
            Event::Watch { .. } => None,
        }
    }

    /// When it happened.
    pub fn stamp(&self) -> Stamp {
        match self {
            Event::Snowfall { stamp, .. }
            | Event::Clearing { stamp, .. }
            | Event::Settings { stamp, .. }
            | Event::Weather { stamp, .. }
            | Event::Terrain { stamp, .. }
            | Event::Settled { stamp }
            | Event::StepProgress { stamp, .. }
            | Event::Reset { stamp }
            | Event::Watch { stamp, .. } => *stamp,
        }
    }
}

/// A kind of events that a subscription can choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// [`Event::Snowfall`].
    Snowfall,
    /// [`Event::Clearing`].
    Clearing,
    /// [`Event::Settings`].
    Settings,
    /// [`Event::Weather`].
    Weather,
    /// [`Event::Terrain`].
    Terrain,
    /// [`Event::Settled`].
    Settled,
    /// [`Event::StepProgress`].
    StepProgress,
    /// [`Event::Reset`].
    Reset,
}

impl EventKind {
    /// Every kind.
    pub const ALL: [EventKind; 8] = [
        EventKind::Snowfall,
        EventKind::Clearing,
        EventKind::Settings,
        EventKind::Weather,
        EventKind::Terrain,
        EventKind::Settled,
        EventKind::StepProgress,
        EventKind::Reset,
    ];
}

/// Kinds of events. In JSON: `true` for all, `false` for none, or an array of kinds.
///
/// ```
/// use firn_protocol::{EventKind, Events};
///
/// let some: Events = serde_json::from_str(r#"["snowfall", "reset"]"#)?;
/// assert_eq!(some, Events::from_iter([EventKind::Reset, EventKind::Snowfall]));
/// assert!(some.contains(EventKind::Reset) && !some.contains(EventKind::Settled));
/// assert_eq!(serde_json::to_string(&Events::all())?, "true");
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Events(BTreeSet<EventKind>);

impl Events {
    /// Every kind.
    pub fn all() -> Events {
        EventKind::ALL.into_iter().collect()
    }

    /// No kind.
    pub fn none() -> Events {
        Events::default()
    }

    /// Whether a kind is among them.
    pub fn contains(&self, kind: EventKind) -> bool {
        self.0.contains(&kind)
    }
}

impl FromIterator<EventKind> for Events {
    fn from_iter<I: IntoIterator<Item = EventKind>>(kinds: I) -> Events {
        Events(kinds.into_iter().collect())
    }
}

impl Serialize for Events {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.len() {
            0 => serializer.serialize_bool(false),
            kinds if kinds == EventKind::ALL.len() => serializer.serialize_bool(true),
            _ => self.0.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Events {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Events, D::Error> {
        deserializer.deserialize_any(EventsVisitor)
    }
}

struct EventsVisitor;

impl<'de> Visitor<'de> for EventsVisitor {
    type Value = Events;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("true, false or an array of kinds of events")
    }

    fn visit_bool<E>(self, all: bool) -> Result<Events, E> {
        Ok(if all { Events::all() } else { Events::none() })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, kinds: A) -> Result<Events, A::Error> {
        BTreeSet::deserialize(SeqAccessDeserializer::new(kinds)).map(Events)
    }
}
