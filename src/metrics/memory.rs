//! Memory that requests and their answers take, read whenever somebody looks.

use std::fmt;
use std::sync::Arc;

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric};
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Unit;

use crate::budget::Budget;
use crate::session::KeyedRequests;

/// Reads how much there is of each.
#[derive(Debug)]
pub(super) struct MemoryCollector {
    pub bodies: Budget,
    pub unsent: Budget,
    pub keyed: Arc<KeyedRequests>,
}

impl Collector for MemoryCollector {
    fn encode(&self, mut encoder: DescriptorEncoder) -> fmt::Result {
        let mut gauge = |name, help, bytes: u64| {
            let gauge = ConstGauge::new(bytes);
            let kind = gauge.metric_type();
            gauge.encode(encoder.encode_descriptor(name, help, Some(&Unit::Bytes), kind)?)
        };
        let help = "Memory of bodies that are arriving, and of unfinished messages of streams";
        gauge("bodies", help, self.bodies.held())?;
        let help = "Memory of answers and stream messages that clients have not taken yet";
        gauge("unsent", help, self.unsent.held())?;
        let help = "Memory of requests with a key, and of their answers, kept for repeats";
        gauge("kept_answers", help, self.keyed.bytes())
    }
}
