//! Commands of anybody, one a line: read, applied to a small snowpack and stepped. Nothing panics, and
//! no mass is lost.

#![no_main]

use std::sync::OnceLock;

use firn::driver::{Driver, WorldConfig};
use firn::session::{Limits, SessionError, Sessions};
use firn::stream::Request;
use firn_engine::cpu::CpuBackend;
use firn_protocol::{SessionSpec, SettingsPatch, SnowLayer, StepSpec};
use firn_snow::Grid;
use libfuzzer_sys::fuzz_target;

const LIMITS: Limits = Limits {
    sessions: 2,
    columns_per_session: 4096,
    columns: 8192,
    cells_per_session: 4096,
    cells: 8192,
    colliders_per_session: 16,
};

fn sessions() -> &'static Sessions {
    static SESSIONS: OnceLock<Sessions> = OnceLock::new();
    SESSIONS.get_or_init(|| {
        let config = WorldConfig { limits: LIMITS, publish_rate: 20.0, sleep: true };
        let backend = Box::new(CpuBackend::new(None, false));
        let (sessions, world) = Driver::start(backend, config).expect("the world starts");
        // It lives as long as the process.
        std::mem::forget(world);
        sessions
    })
}

/// Refusals are fine; a session that failed is not.
fn sound<T>(result: Result<T, SessionError>) -> Option<T> {
    if let Err(SessionError::Internal(why) | SessionError::Unavailable(why)) = &result {
        panic!("{why}");
    }
    result.ok()
}

async fn play(text: &str) {
    let spec = SessionSpec {
        grid: Grid { width: 5, depth: 4, height: 8, ..Grid::default() },
        paused: true,
        initial_snow: vec![SnowLayer::new(0.7)],
        ..SessionSpec::default()
    };
    let (session, _tokens) = sessions().create(spec).await.expect("there is room");
    for line in text.lines().take(16) {
        if let Ok(Request::Change { change, .. }) = Request::parse(line) {
            sound(session.change(change).await);
        }
    }
    let pause = SettingsPatch { paused: Some(true), ..SettingsPatch::default() };
    sound(session.change(firn::session::Change::Settings(pause)).await);
    sound(session.step(StepSpec { ticks: Some(30), ..StepSpec::default() }).await);
    let mass = sound(session.mass().await).expect("it is there");
    assert_eq!(mass.imbalance_quanta, 0);
    sessions().delete(&session.id).await.expect("it is there");
}

fuzz_target!(|input: &[u8]| {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    runtime.block_on(play(text));
});
