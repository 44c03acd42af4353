//! Sessions, frames, memory and the store, read from the engine whenever somebody looks.

use std::fmt;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Unit;

use crate::session::{Sessions, StoreVitals};

/// Reads the engine's state.
#[derive(Debug)]
pub(super) struct EngineCollector(pub Sessions);

impl Collector for EngineCollector {
    fn encode(&self, mut encoder: DescriptorEncoder) -> fmt::Result {
        let sessions = &self.0;
        let vitals = sessions.vitals();
        let mut write = Writer(&mut encoder);
        write.gauge("sessions", "Sessions there are", None, sessions.count() as i64)?;
        let healthy = i64::from(vitals.is_healthy());
        write.gauge("engine_healthy", "1 while frames are carried out, else 0", None, healthy)?;
        let overloaded = i64::from(vitals.is_overloaded());
        write.gauge(
            "engine_overloaded",
            "1 while ticks slip behind the clock",
            None,
            overloaded,
        )?;
        let memory = vitals.memory() as i64;
        let help = "Device memory held for snowpacks";
        write.gauge("device_memory", help, Some(&Unit::Bytes), memory)?;
        write.counter("frames", "Frames that were carried out", None, vitals.frames())?;
        let time = vitals.frame_time().as_secs_f64();
        let help = "Time that frames took, from planning to publishing";
        write.counter("frame_time", help, Some(&Unit::Seconds), time)?;
        let lag = vitals.slipped().as_secs_f64();
        let help = "Time by which ticks have slipped behind the clock";
        write.counter("lag", help, Some(&Unit::Seconds), lag)?;
        let help = "Sessions that hibernate";
        write.gauge("hibernating_sessions", help, None, vitals.hibernating() as i64)?;
        write_store(&mut write, &vitals.store)
    }
}

fn write_store(write: &mut Writer, store: &StoreVitals) -> fmt::Result {
    let help = "1 while changes can be stored, else 0";
    write.gauge("store_healthy", help, None, i64::from(store.is_healthy()))?;
    let help = "Time that commits took until they were on disk";
    write.write("store_commit_duration", help, Some(&Unit::Seconds), store.commits())?;
    write.counter("store_checkpoints", "Checkpoints stored", None, store.checkpoints())?;
    let help = "Bytes of the checkpoints stored, compressed";
    write.counter("store_checkpoint", help, Some(&Unit::Bytes), store.checkpoint_bytes())?;
    let help = "Time that bringing sessions back took at the start";
    write.gauge("store_recovery", help, Some(&Unit::Seconds), store.recovery().as_secs_f64())?;
    let help = "Sessions that could not be brought back at the start";
    write.gauge("store_lost_sessions", help, None, store.lost_sessions() as i64)
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
