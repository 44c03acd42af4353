//! The gate: callers who were not let in, and what was read again.

use prometheus_client::encoding::{EncodeLabelSet, EncodeLabelValue, LabelValueEncoder};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::registry::Registry;

/// Counts what happens at the gate.
#[derive(Clone, Debug, Default)]
pub struct GateMetrics {
    failures: Family<ByReason, Counter>,
    reloads: Family<ByReload, Counter>,
}

/// Why a caller was not let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AuthFailure {
    /// It had no token.
    Missing,
    /// Its token was nobody's.
    Unknown,
    /// Its token was good, but not for that.
    Forbidden,
}

/// What is read again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reload {
    /// The operator's API key.
    ApiKey,
    /// The API keys of tenants.
    ApiKeys,
    /// The certificate and its key.
    Certificate,
}

impl AuthFailure {
    /// A label for logs and counters.
    pub fn label(self) -> &'static str {
        match self {
            AuthFailure::Missing => "missing",
            AuthFailure::Unknown => "unknown",
            AuthFailure::Forbidden => "forbidden",
        }
    }
}

impl Reload {
    /// A label for logs and counters.
    pub fn label(self) -> &'static str {
        match self {
            Reload::ApiKey => "api_key",
            Reload::ApiKeys => "api_keys",
            Reload::Certificate => "certificate",
        }
    }
}

impl GateMetrics {
    pub(super) fn register(registry: &mut Registry) -> GateMetrics {
        let metrics = GateMetrics::default();
        let help = "Requests that were not let in, by reason";
        registry.register("auth_failures", help, metrics.failures.clone());
        let help = "Files that were read again, by what they hold and whether that was taken over";
        registry.register("reloads", help, metrics.reloads.clone());
        // What has not occurred yet reads 0, so that alerts and rates can watch it.
        for reason in [AuthFailure::Missing, AuthFailure::Unknown, AuthFailure::Forbidden] {
            drop(metrics.failures.get_or_create(&ByReason { reason }));
        }
        for what in [Reload::ApiKey, Reload::ApiKeys, Reload::Certificate] {
            for result in [Outcome::Ok, Outcome::Failed] {
                drop(metrics.reloads.get_or_create(&ByReload { what, result }));
            }
        }
        metrics
    }

    /// Counts a request that was not let in.
    pub fn auth_failed(&self, reason: AuthFailure) {
        self.failures.get_or_create(&ByReason { reason }).inc();
    }

    /// Counts something that was read again, and whether that was taken over.
    pub fn reloaded(&self, what: Reload, done: bool) {
        let result = if done { Outcome::Ok } else { Outcome::Failed };
        self.reloads.get_or_create(&ByReload { what, result }).inc();
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Outcome {
    Ok,
    Failed,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ByReason {
    reason: AuthFailure,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ByReload {
    what: Reload,
    result: Outcome,
}

impl EncodeLabelValue for AuthFailure {
    fn encode(&self, encoder: &mut LabelValueEncoder) -> std::fmt::Result {
        self.label().encode(encoder)
    }
}

impl EncodeLabelValue for Reload {
    fn encode(&self, encoder: &mut LabelValueEncoder) -> std::fmt::Result {
        self.label().encode(encoder)
    }
}

impl EncodeLabelValue for Outcome {
    fn encode(&self, encoder: &mut LabelValueEncoder) -> std::fmt::Result {
        let label = match self {
            Outcome::Ok => "ok",
            Outcome::Failed => "failed",
        };
        label.encode(encoder)
    }
}
