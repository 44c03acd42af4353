//! What the sessions of each tenant are and take. Those of the operator have an empty name.

use std::fmt;

use firn_protocol::MemoryBytes;
use prometheus_client::encoding::{DescriptorEncoder, EncodeLabelSet, EncodeMetric};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Unit;

use crate::session::Totals;

/// Writes the sessions and the memory of every tenant.
pub(super) fn write(encoder: &mut DescriptorEncoder<'_>, totals: &Totals) -> fmt::Result {
    let kind = MetricType::Gauge;
    let help = "Sessions of each tenant";
    let mut family = encoder.encode_descriptor("tenant_sessions", help, None, kind)?;
    for (tenant, held) in &totals.tenants {
        let labels = ByTenant { tenant: tenant.clone() };
        ConstGauge::new(held.sessions).encode(family.encode_family(&labels)?)?;
    }
    let help = "Device time that the sessions of each tenant have been charged with";
    let (seconds, counter) = (Some(&Unit::Seconds), MetricType::Counter);
    let mut family = encoder.encode_descriptor("tenant_device", help, seconds, counter)?;
    for (tenant, held) in &totals.tenants {
        let labels = ByTenant { tenant: tenant.clone() };
        let taken = ConstCounter::new(held.device_time.as_secs_f64());
        taken.encode(family.encode_family(&labels)?)?;
    }
    let help = "Memory that the sessions of each tenant take, by what it is for";
    let bytes = Some(&Unit::Bytes);
    let mut family = encoder.encode_descriptor("tenant_memory", help, bytes, kind)?;
    for (tenant, held) in &totals.tenants {
        let MemoryBytes { device, host, journal, streams } = held.memory;
        for (part, bytes) in
            [("device", device), ("host", host), ("journal", journal), ("streams", streams)]
        {
            let labels = ByPart { tenant: tenant.clone(), part };
            ConstGauge::new(bytes).encode(family.encode_family(&labels)?)?;
        }
    }
    Ok(())
}

#[derive(Clone, Debug, EncodeLabelSet)]
struct ByTenant {
    tenant: String,
}

#[derive(Clone, Debug, EncodeLabelSet)]
struct ByPart {
    tenant: String,
    part: &'static str,
}
