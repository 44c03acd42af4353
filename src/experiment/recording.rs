//! Carrying out one set-up: a session is created, snowed on and stepped, and noted down on the way.

use firn_protocol::{ColliderBatch, ColliderView, ColumnView, SnowLayer, Snowfall, StepSpec};

use crate::session::{Change, Session, SessionError, Sessions};

use super::setup::{Plate, Setup};

/// Ticks between two samples of the height.
const SAMPLING: u64 = 120;

/// Tick at which the snow is noted down early, at 30 s: about when the thesis did.
const EARLY: u64 = 1800;

/// What was seen of one snowpack.
#[derive(Clone, Debug)]
pub(super) struct Recording {
    /// The column without an object: in the beginning, after 30 s, and at the end of each phase.
    pub fresh: ColumnView,
    pub early: ColumnView,
    pub phases: Vec<ColumnView>,
    /// Time \[s\] and height of that column \[m\].
    pub heights: Vec<(f64, f64)>,
    pub plates: Vec<PlateRecord>,
    /// Largest difference in height \[m\] between columns, of all samples.
    pub unevenness: f64,
    /// Mass that fell and mass that is there in the end, for a column on average \[kg\].
    pub fallen: f64,
    pub present: f64,
    /// Mass out of balance, in quanta.
    pub imbalance: i64,
}

/// What was seen of one plate.
#[derive(Clone, Debug)]
pub(super) struct PlateRecord {
    pub plate: Plate,
    /// How it stands in the end.
    pub view: ColliderView,
    /// The column under its centre in the end.
    pub column: ColumnView,
    /// Time \[s\] and elevation of its bottom \[m\].
    pub bottoms: Vec<(f64, f64)>,
}

/// Carries out a set-up from beginning to end, and deletes its session.
///
/// # Errors
/// Those of the session.
pub(super) async fn carry_out(
    sessions: &Sessions,
    setup: &Setup,
    progress: &dyn Fn(u64),
) -> Result<Recording, SessionError> {
    let (session, _tokens) = sessions.create(setup.spec()).await?;
    let recording = record(&session, setup, progress).await;
    sessions.delete(&session).await?;
    recording
}

async fn record(
    session: &Session,
    setup: &Setup,
    progress: &dyn Fn(u64),
) -> Result<Recording, SessionError> {
    let put: Vec<_> = setup.plates.iter().map(Plate::spec).collect();
    if !put.is_empty() {
        session
            .change(Change::Colliders(ColliderBatch { put, ..ColliderBatch::default() }))
            .await?;
    }
    let mut samples = Samples::default();
    let (mut fresh, mut early) = (None, None);
    let mut phases = Vec::new();
    let column = || session.column(setup.free.0, setup.free.1);
    let mut tick = 0;
    for phase in &setup.phases {
        if let Some(snow) = phase {
            session.change(Change::Snowfall(everywhere(snow))).await?;
        }
        if fresh.is_none() {
            fresh = Some(column().await?);
        }
        samples.take(session, setup);
        let end = tick + setup.phase_ticks();
        while tick < end {
            let ticks = SAMPLING.min(end - tick);
            session.step(StepSpec { ticks: Some(ticks), ..StepSpec::default() }).await?;
            tick += ticks;
            samples.take(session, setup);
            progress(ticks);
            if tick == EARLY {
                early = Some(column().await?);
            }
        }
        phases.push(column().await?);
    }
    let mut plates = Vec::new();
    for (plate, bottoms) in setup.plates.iter().zip(samples.bottoms) {
        plates.push(plate_record(session, plate, bottoms).await?);
    }
    let mass = session.mass().await?;
    let columns = setup.grid.columns() as f64;
    Ok(Recording {
        fresh: fresh.expect("every set-up has a phase"),
        early: early.expect("every phase is longer than 30 s"),
        phases,
        heights: samples.heights,
        plates,
        unevenness: samples.unevenness,
        fallen: mass.fallen / columns,
        present: mass.present / columns,
        imbalance: mass.imbalance_quanta,
    })
}

fn everywhere(snow: &SnowLayer) -> Snowfall {
    Snowfall {
        depth: snow.depth,
        density: snow.density,
        temperature: snow.temperature,
        region: None,
    }
}

/// Heights over time.
#[derive(Debug, Default)]
struct Samples {
    heights: Vec<(f64, f64)>,
    bottoms: Vec<Vec<(f64, f64)>>,
    unevenness: f64,
}

impl Samples {
    fn take(&mut self, session: &Session, setup: &Setup) {
        let mirror = session.mirror();
        let time = mirror.clock.sim_time();
        let height = mirror.height(setup.free.0, setup.free.1);
        self.heights.push((time, mirror.grid.metres(u64::from(height))));
        let summary = mirror.summary();
        self.unevenness = self.unevenness.max(summary.max_height - summary.min_height);
        self.bottoms.resize(setup.plates.len(), Vec::new());
        for (plate, bottoms) in setup.plates.iter().zip(&mut self.bottoms) {
            let view = mirror.colliders.iter().find(|view| view.id == plate.id);
            bottoms.extend(view.map(|view| (time, view.bottom)));
        }
    }
}

async fn plate_record(
    session: &Session,
    plate: &Plate,
    bottoms: Vec<(f64, f64)>,
) -> Result<PlateRecord, SessionError> {
    let view = session.mirror().colliders.iter().find(|view| view.id == plate.id).cloned();
    let view = view.ok_or(SessionError::NotFound { kind: "collider", id: plate.id.to_owned() })?;
    let cell_size = session.spec.grid.cell_size;
    let column = |metres: f64| (metres / cell_size) as u32;
    let column = session.column(column(plate.position.x), column(plate.position.z)).await?;
    Ok(PlateRecord { plate: *plate, view, column, bottoms })
}
