//! Requests: how many, and how long they took.

use std::time::Duration;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::family::{Family, MetricConstructor};
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};

/// Times requests.
#[derive(Clone, Debug)]
pub struct RequestMetrics(Family<Request, Histogram, Buckets>);

/// What requests are told apart by.
#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Request {
    /// The HTTP method; `other` for those that no route knows.
    pub method: &'static str,
    /// The route, as the API description writes it: names of sessions are left out. Empty where
    /// there is none.
    pub route: String,
    /// The status of the answer.
    pub status: u16,
}

impl RequestMetrics {
    pub(super) fn register(registry: &mut Registry) -> RequestMetrics {
        let times = Family::new_with_constructor(Buckets);
        let help = "Time from a request to its answer; streams count until they are upgraded";
        registry.register_with_unit("request_duration", help, Unit::Seconds, times.clone());
        RequestMetrics(times)
    }

    /// Counts an answered request.
    pub fn answered(&self, request: &Request, took: Duration) {
        self.0.get_or_create(request).observe(took.as_secs_f64());
    }
}

/// Half a millisecond, a cached read, to 16 s, a long step, by factors of two.
#[derive(Clone, Debug)]
struct Buckets;

impl MetricConstructor<Histogram> for Buckets {
    fn new_metric(&self) -> Histogram {
        Histogram::new((0..16).map(|step| 0.0005 * f64::from(1 << step)))
    }
}
