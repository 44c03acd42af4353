//! How often clients reached the limits of what they may take.

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::registry::Registry;

use crate::limit::Limit;

/// Counts how often each limit was reached.
#[derive(Clone, Debug, Default)]
pub struct LimitMetrics(Family<Label, Counter>);

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Label {
    limit: &'static str,
}

impl LimitMetrics {
    pub(super) fn register(registry: &mut Registry) -> LimitMetrics {
        let metrics = LimitMetrics::default();
        let help = "How often limits were reached: requests refused, connections and streams ended";
        registry.register("limits_reached", help, metrics.0.clone());
        // What has not occurred yet reads 0, so that alerts and rates can watch it.
        for limit in Limit::ALL {
            drop(metrics.0.get_or_create(&Label { limit: limit.name() }));
        }
        metrics
    }

    /// Counts that a limit was reached.
    pub fn reached(&self, limit: Limit) {
        self.0.get_or_create(&Label { limit: limit.name() }).inc();
    }

    /// How often a limit was reached.
    pub fn count(&self, limit: Limit) -> u64 {
        self.0.get_or_create(&Label { limit: limit.name() }).get()
    }
}
