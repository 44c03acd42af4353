//! Sessions, frames, memory and the store, read from the engine whenever somebody looks.

use std::fmt;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeLabelSet, EncodeMetric};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Unit;

use crate::session::{Sessions, StageTimes, StoreState, StoreVitals, Totals, Vitals};

use super::tenants;

/// Reads the engine's state.
#[derive(Debug)]
pub(super) struct EngineCollector(pub Sessions);

impl Collector for EngineCollector {
    fn encode(&self, mut encoder: DescriptorEncoder) -> fmt::Result {
        let totals = self.0.totals();
        tenants::write(&mut encoder, &totals)?;
        let mut write = Writer(&mut encoder);
        held(&mut write, &self.0, &totals)?;
        frames(&mut write, self.0.vitals())?;
        stages(&mut write, &self.0.vitals().stage_times())?;
        stored(&mut write, &self.0.vitals().store)
    }
}

/// What there is.
fn held(write: &mut Writer, sessions: &Sessions, totals: &Totals) -> fmt::Result {
    let bytes = Some(&Unit::Bytes);
    write.gauge("sessions", "Sessions there are", None, sessions.count() as u64)?;
    let help = "Sessions that hibernate";
    write.gauge("hibernating_sessions", help, None, sessions.vitals().hibernating())?;
    let help =
        "Sessions that came back from a damaged store and take no changes until they are unlocked";
    write.gauge("locked_sessions", help, None, totals.locked)?;
    write.gauge("tiles", "Tiles of all sessions", None, totals.tiles)?;
    let help = "Tiles of all sessions in which snow moves";
    write.gauge("active_tiles", help, None, totals.active_tiles)?;
    let help = "Device memory that the cells of all sessions take";
    write.gauge("session_memory", help, bytes, totals.device_memory)?;
    let help = "Device memory held for snowpacks";
    write.gauge("device_memory", help, bytes, sessions.vitals().memory())
}

/// How the engine keeps up.
fn frames(write: &mut Writer, vitals: &Vitals) -> fmt::Result {
    let seconds = Some(&Unit::Seconds);
    let help = "1 while frames are carried out, else 0";
    write.gauge("engine_healthy", help, None, u64::from(vitals.is_healthy()))?;
    let help = "1 while ticks slip behind the clock";
    write.gauge("engine_overloaded", help, None, u64::from(vitals.is_overloaded()))?;
    let help = "How often the engine had failed and was started anew";
    write.counter("engine_rebuilds", help, None, vitals.rebuilds())?;
    let help = "1 once the engine has failed for good and the server is about to end, else 0";
    write.gauge("engine_gave_up", help, None, u64::from(vitals.gave_up()))?;
    write.counter("frames", "Frames that were carried out", None, vitals.frames())?;
    let help = "Time that frames took, from planning to publishing";
    write.counter("frame_time", help, seconds, vitals.frame_time().as_secs_f64())?;
    let help = "Frames that sessions have waited for, because others had taken less device time";
    write.counter("frames_waited", help, None, vitals.waits())?;
    let help = "Steps of weather that alpine snowpacks have taken";
    write.counter("weather_steps", help, None, vitals.weather_steps())?;
    let help = "Time by which ticks have slipped behind the clock";
    write.counter("lag", help, seconds, vitals.slipped().as_secs_f64())
}

/// What the device did, in those frames that were timed.
fn stages(write: &mut Writer, times: &StageTimes) -> fmt::Result {
    let help = "Frames whose stages were timed on the device";
    write.counter("timed_frames", help, None, times.frames)?;
    let help = "Time that the stages of those frames took on the device";
    let seconds = Some(&Unit::Seconds);
    let kind = MetricType::Counter;
    let mut family = write.0.encode_descriptor("stage_time", help, seconds, kind)?;
    for (&stage, time) in &times.stages {
        let labels = Stage { stage };
        ConstCounter::new(time.as_secs_f64()).encode(family.encode_family(&labels)?)?;
    }
    Ok(())
}

/// What is kept.
fn stored(write: &mut Writer, store: &StoreVitals) -> fmt::Result {
    let help = "1 while changes can be stored, else 0";
    write.gauge("store_healthy", help, None, u64::from(store.is_healthy()))?;
    let help = "1 while the data directory is not where it was, else 0";
    write.gauge("store_gone", help, None, u64::from(store.state() == StoreState::Gone))?;
    let help = "1 where the store was damaged at the start, else 0";
    write.gauge("store_damaged", help, None, u64::from(store.was_damaged()))?;
    let help = "Sessions that came back from a damaged store at the start";
    write.gauge("store_revived_sessions", help, None, store.revived_sessions())?;
    let help = "Time that commits took until they were on disk";
    write.write("store_commit_duration", help, Some(&Unit::Seconds), store.commits())?;
    write.counter("store_checkpoints", "Checkpoints stored", None, store.checkpoints())?;
    let help = "Bytes of the checkpoints stored, compressed";
    write.counter("store_checkpoint", help, Some(&Unit::Bytes), store.checkpoint_bytes())?;
    let help = "Time that bringing sessions back took at the start";
    write.gauge("store_recovery", help, Some(&Unit::Seconds), store.recovery().as_secs_f64())?;
    let help = "Sessions that could not be brought back at the start";
    write.gauge("store_lost_sessions", help, None, store.lost_sessions())
}

#[derive(Clone, Debug, EncodeLabelSet)]
struct Stage {
    stage: &'static str,
}

/// Writes figures that are kept elsewhere.
struct Writer<'a, 'b>(&'a mut DescriptorEncoder<'b>);

impl Writer<'_, '_> {
    fn gauge<N>(&mut self, name: &str, help: &str, unit: Option<&Unit>, value: N) -> fmt::Result
    where
        ConstGauge<N>: EncodeMetric,
    {
        self.write(name, help, unit, &ConstGauge::new(value))
    }

    fn counter<N>(&mut self, name: &str, help: &str, unit: Option<&Unit>, value: N) -> fmt::Result
    where
        ConstCounter<N>: EncodeMetric,
    {
        self.write(name, help, unit, &ConstCounter::new(value))
    }

    fn write(
        &mut self,
        name: &str,
        help: &str,
        unit: Option<&Unit>,
        figure: &impl EncodeMetric,
    ) -> fmt::Result {
        figure.encode(self.0.encode_descriptor(name, help, unit, figure.metric_type())?)
    }
}
