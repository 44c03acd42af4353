//! A client that watches a session's heights, loses its connection, and resumes from anything it was told.

use firn::budget::Budget;
use firn::machine;
use firn::session::{Sessions, Visit};
use firn::stream::{EncodedTiles, Source, Subscription};
use firn_client::{HeightField, Message, Raw, Welcome};
use firn_protocol::stream::SubProtocol;
use firn_protocol::{Resume, Subscribe};
use rand::Rng;
use rand::rngs::SmallRng;

use crate::watched::Watched;

/// Steps that heights are rounded to \[m\].
const QUANTUM: f64 = 0.001;

/// Step that elevations of the ground are rounded to \[m\].
const GROUND_STEP: f64 = 1e-4;

/// States that a client remembers.
const REMEMBERED: usize = 16;

/// What a client sees, and what it has seen.
pub struct Viewer {
    session: String,
    protocol: SubProtocol,
    open: Option<Open>,
    /// Whole fields, as they were told.
    seen: Vec<HeightField>,
    /// The newest state that it was told of, and of which session by its `sid`.
    newest: Option<(String, Resume)>,
    /// Streams that went on exactly from where another ended.
    pub recovered: u64,
}

/// A stream that is open.
struct Open {
    visit: Visit,
    subscription: Subscription,
    field: HeightField,
    watched: Watched,
}

impl Viewer {
    /// A client that has seen nothing.
    pub fn new(session: String, protocol: SubProtocol) -> Viewer {
        Viewer { session, protocol, open: None, seen: Vec::new(), newest: None, recovered: 0 }
    }

    /// The session that it watches.
    pub fn session(&self) -> &str {
        &self.session
    }

    /// Whether its stream is open.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Loses the connection.
    pub fn cut(&mut self) {
        self.open = None;
    }

    /// Another session has the name now.
    pub fn forget(&mut self) {
        self.open = None;
        self.seen.clear();
    }

    /// Connects, resuming from something that it was told, mostly.
    pub fn connect(&mut self, sessions: &Sessions, dice: &mut SmallRng) {
        let Ok(visit) = sessions.get(&self.session) else { return };
        let (grid, settings, stamp) = {
            let mirror = visit.mirror();
            (mirror.grid, mirror.settings, mirror.stamp_at(visit.frame()))
        };
        let welcome = Welcome {
            session: self.session.clone(),
            epoch: visit.epoch.clone(),
            stamp,
            tile_size: firn_snow::TILE_SIDE,
            grid,
            settings,
        };
        let chosen = (!self.seen.is_empty() && dice.random_bool(0.9))
            .then(|| self.seen[dice.random_range(0..self.seen.len())].clone());
        let resume: Option<Resume> = chosen.as_ref().and_then(HeightField::resume);
        let watched = Watched::new(&grid, dice);
        let watch = vec![watched.wish.clone()];
        let wish =
            Subscribe { max_rate: 60.0, terrain: true, resume, watch, ..Subscribe::default() };
        let encoded = visit.companion::<EncodedTiles>();
        let source = Source {
            grid,
            recovers: &|resume| visit.recovers(&resume.epoch, resume.seq),
            protocol: self.protocol,
            encoded: &encoded,
        };
        let Ok(subscription) = Subscription::new(1, &wish, source, machine::now().into()) else {
            return;
        };
        let mut field = chosen.unwrap_or_else(|| HeightField::new(&welcome, 1, &wish));
        if field.reconnect(&welcome, 1).is_err() {
            field = HeightField::new(&welcome, 1, &wish);
        }
        self.open = Some(Open { visit, subscription, field, watched });
    }

    /// Takes what is new.
    ///
    /// # Errors
    /// Where that can't be right.
    pub fn take(&mut self) -> Result<(), String> {
        let Some(Open { visit, subscription, field, watched }) = &mut self.open else {
            return Ok(());
        };
        if visit.gone().is_cancelled() {
            self.forget();
            return Ok(());
        }
        let unsent = Budget::new(1 << 30);
        let mut copied = subscription.copy(&visit.mirror(), visit.frame(), &unsent);
        for event in copied.iter_mut().flat_map(|copied| copied.crossings.drain(..)) {
            watched.hear(event)?;
        }
        let parts = copied.and_then(|copied| subscription.message(copied, machine::now().into()));
        for part in parts.into_iter().flatten() {
            let raw = match part {
                axum::extract::ws::Message::Text(text) => Raw::Text(text.as_str().into()),
                axum::extract::ws::Message::Binary(bytes) => Raw::Binary(bytes),
                _ => continue,
            };
            let read = firn_client::read(&raw, |_| Some(QUANTUM));
            let Message::Heights(told) = read.map_err(|error| error.to_string())? else {
                return Err("a stream tells something else than heights".to_owned());
            };
            let newest = Resume { epoch: visit.epoch.clone(), seq: told.seq };
            let sid = visit.sid.to_string();
            let before = self.newest.replace((sid.clone(), newest));
            // Another epoch begins above all that was told in those before.
            if let Some((_, before)) = before.filter(|(named, _)| *named == sid)
                && told.seq + u64::from(before.epoch == visit.epoch) <= before.seq
            {
                return Err(format!(
                    "seq {} of epoch {} is told after {before:?}",
                    told.seq, visit.epoch
                ));
            }
            self.recovered += u64::from(told.recovered == Some(true));
            field.take(&told);
        }
        if field.resume().is_some()
            && self.seen.last().is_none_or(|last| last.resume() != field.resume())
        {
            self.seen.push(field.clone());
            if self.seen.len() > REMEMBERED {
                self.seen.remove(0);
            }
        }
        Ok(())
    }

    /// Compares what it sees with what is there.
    ///
    /// # Errors
    /// Where that is something else.
    pub fn check(&mut self) -> Result<(), String> {
        self.take()?;
        let Some(Open { visit, field, watched, .. }) = &self.open else { return Ok(()) };
        let mirror = visit.mirror();
        watched.check(&mirror)?;
        let grid = mirror.grid;
        for (x, z) in (0..grid.depth).flat_map(|z| (0..grid.width).map(move |x| (x, z))) {
            let there = grid.metres(mirror.height(x, z).into());
            let seen = field.height(x, z).unwrap_or(f64::NAN);
            let same = (seen - there).abs() <= QUANTUM * 0.5001;
            if !same {
                return Err(format!(
                    "column {x}/{z} is {there} m high, and a client that was told seq {:?} sees {seen}",
                    field.resume()
                ));
            }
            let ground = mirror.ground.height(&grid, x, z);
            let seen = field.ground_height(x, z).unwrap_or(f64::NAN);
            let same = (seen - ground).abs() <= GROUND_STEP * 0.5001;
            if !same {
                return Err(format!(
                    "the ground at {x}/{z} is {ground} m high, and a client that was told seq {:?} sees {seen}",
                    field.resume()
                ));
            }
        }
        Ok(())
    }
}
