//! Players who watch: each streams the surface of a part of the scene.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use firn_client::{HeightField, Message, Stream, read};
use firn_protocol::stream::SubProtocol;
use firn_protocol::{ColliderView, ColumnRegion, Subscribe};
use tokio::task::JoinSet;

use crate::Failure;
use crate::scene::Scene;

const VIEWERS: u64 = 10;
/// Columns along a side of what one sees.
const SIGHT: u64 = 240;

/// The viewers. They end when this is dropped.
pub struct Viewers {
    pub seen: Arc<Seen>,
    tasks: JoinSet<Result<(), Failure>>,
}

/// What all of them saw.
#[derive(Default)]
pub struct Seen {
    pub messages: AtomicU64,
    pub bytes: AtomicU64,
    /// The deepest print of a walker \[m\].
    pub deepest: Mutex<f64>,
}

impl Viewers {
    /// Half of them take packed heights, the others JSON.
    pub async fn watch(scene: &Scene) -> Result<Viewers, Failure> {
        let seen = Arc::new(Seen::default());
        let mut tasks = JoinSet::new();
        for number in 0..VIEWERS {
            let format = SubProtocol::ALL[(number % 2) as usize];
            let stream = scene.session.stream(format).await?;
            let wish = Subscribe {
                region: Some(region(number, scene.columns())),
                colliders: true,
                terrain: true,
                ..Subscribe::default()
            };
            tasks.spawn(view(stream, wish, seen.clone()));
        }
        Ok(Viewers { seen, tasks })
    }

    /// Whether all still watch.
    pub fn check(&mut self) -> Result<(), Failure> {
        match self.tasks.try_join_next() {
            None => Ok(()),
            Some(ended) => ended?,
        }
    }
}

/// Five beside each other, in two rows.
fn region(number: u64, columns: u64) -> ColumnRegion {
    let sight = SIGHT.min(columns);
    let place = |part: u64, parts: u64| ((columns - sight) * part / (parts - 1)) as i64;
    ColumnRegion {
        column_x: place(number % 5, 5),
        column_z: place(1 + number / 5, 4),
        width: sight,
        depth: sight,
    }
}

/// Keeps a field of heights as the stream tells it.
async fn view(mut stream: Stream, wish: Subscribe, seen: Arc<Seen>) -> Result<(), Failure> {
    let id = stream.subscribe(wish.clone()).await?;
    let mut field = HeightField::new(stream.welcome(), id, &wish);
    loop {
        let raw = stream.next_raw().await?;
        seen.messages.fetch_add(1, Relaxed);
        seen.bytes.fetch_add(raw.len() as u64, Relaxed);
        if let Message::Heights(heights) = read(&raw, |_| Some(wish.quantum))? {
            field.take(&heights);
            seen.note(heights.colliders.unwrap_or_default());
        }
    }
}

impl Seen {
    fn note(&self, colliders: Vec<ColliderView>) {
        let walkers = colliders.iter().filter(|collider| collider.id.starts_with("walker"));
        let deepest = walkers.map(|walker| walker.sink_depth).fold(0.0, f64::max);
        if let Ok(mut known) = self.deepest.lock() {
            *known = known.max(deepest);
        }
    }

    pub fn deepest(&self) -> f64 {
        self.deepest.lock().map_or(f64::NAN, |deepest| *deepest)
    }
}
