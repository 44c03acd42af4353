//! The scene: gentle hills, half a metre of snow, and soft drifts on it.

use std::f64::consts::TAU;

use firn_client::{Client, Session};
use firn_protocol::{
    Preset, Pressing, Region, SessionSpec, SettingsPatch, SnowLayer, Snowfall, StepSpec, Terrain,
};
use firn_snow::Grid;

use crate::{Failure, RATE};

/// Name of a session that is kept.
const KEPT: &str = "demo-scene";
/// Side of a column \[m\].
const COLUMN: f64 = 0.1;
/// Waves of the ground: length along x, length along z, and height, all in metres. Objects stand
/// level: where it is steep, a car stands on the wheels uphill alone.
const WAVES: [(f64, f64, f64); 2] = [(150.0, 190.0, 0.5), (-83.0, 117.0, 0.12)];

pub struct Scene {
    pub session: Session,
    /// Its side \[m\].
    pub size: f64,
}

/// Reads the side of a scene \[m\].
pub fn side(text: &str) -> Result<f64, String> {
    let size: f64 = text.parse().map_err(|_| "give a number of metres".to_owned())?;
    if (30.0..=200.0).contains(&size) { Ok(size) } else { Err("give 30 to 200 metres".to_owned()) }
}

impl Scene {
    pub async fn make(client: &Client, size: f64, keep: bool) -> Result<Scene, Failure> {
        let id = keep.then(|| KEPT.to_owned());
        if keep {
            client.session(KEPT)?.delete().await?;
        }
        let columns = (size / COLUMN).round() as u32;
        let spec = SessionSpec {
            id,
            grid: Grid { width: columns, depth: columns, height: 16, cell_size: COLUMN },
            terrain: Some(hills(columns)),
            tick_rate: RATE,
            // A wheel passes a column within a tick or two: snow that takes longer to give way
            // would show a faint rut.
            pressing: Pressing::Within(0.0),
            paused: true,
            // A firm old layer, and new snow on it that a boot sinks into.
            initial_snow: vec![
                SnowLayer { density: Some(300.0), ..SnowLayer::new(0.15) },
                SnowLayer::new(0.4),
            ],
            ..Preset::Game.into()
        };
        let (session, _) = client.create(&spec).await?;
        let scene = Scene { session, size };
        scene.let_drifts_lie().await?;
        let running = SettingsPatch { paused: Some(false), ..SettingsPatch::default() };
        scene.session.set(&running).await?;
        Ok(scene)
    }

    /// Columns along one side.
    pub fn columns(&self) -> u64 {
        (self.size / COLUMN).round() as u64
    }

    /// Soft drifts in the way of the walkers: rectangles on each other, smaller and smaller.
    async fn let_drifts_lie(&self) -> Result<(), Failure> {
        for drift in 0..8 {
            let x = self.size * if drift % 2 == 0 { 0.17 } else { 0.8 };
            let z = self.size * (0.1 + 0.1 * f64::from(drift));
            for step in 0..4 {
                let inset = 0.3 * f64::from(step);
                let (width, depth) = (3.0 - 2.0 * inset, 6.0 - 2.0 * inset);
                let region = Some(Region { x: x + inset, z: z + inset, width, depth });
                let soft = Snowfall { density: Some(40.0), region, ..Snowfall::new(0.1) };
                self.session.snowfall(&soft).await?;
            }
        }
        let rest =
            StepSpec { until_settled: Some(true), max_seconds: Some(60.0), ..StepSpec::default() };
        self.session.step(&rest).await?;
        Ok(())
    }
}

/// Elevations of the ground, in whole millimetres.
fn hills(columns: u32) -> Terrain {
    let elevation = |x: f64, z: f64| -> f64 {
        WAVES
            .iter()
            .map(|(along_x, along_z, height)| height * (TAU * (x / along_x + z / along_z)).sin())
            .sum()
    };
    let places = (0..columns).flat_map(|z| (0..columns).map(move |x| (x, z)));
    let heights = places.map(|(x, z)| {
        let metres = elevation(f64::from(x) * COLUMN, f64::from(z) * COLUMN);
        (metres * 1000.0).round() / 1000.0
    });
    Terrain { heights: heights.collect() }
}
