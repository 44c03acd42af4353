//! A tenant: whom sessions belong to, and what it may take of the server.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError, RwLock};
use std::time::Duration;

use serde::Deserialize;

use crate::core::session::Charge;

/// What one tenant may take of the server. Where nothing is said, the server's own limits hold alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Quotas {
    /// Sessions at a time.
    pub sessions: Option<usize>,
    /// Cells of all its sessions together.
    pub cells: Option<u64>,
    /// Largest part of the device's time that its sessions get together: above 0, at most 1.
    pub device_share: Option<f64>,
    /// Requests per second with its keys together, and with each token of its sessions.
    pub requests_per_second: Option<NonZeroU32>,
}

/// Whom sessions belong to.
#[derive(Debug, Default)]
pub struct Tenant {
    /// Its name, `[A-Za-z0-9_-]{1,64}`.
    pub name: String,
    quotas: RwLock<Quotas>,
    /// Device time that its sessions have taken \[ns\].
    device_ns: AtomicU64,
    /// What of it has been looked at, and when.
    looked_at: Mutex<(Duration, Charge)>,
}

impl Tenant {
    /// What it may take, as it was read last.
    pub fn quotas(&self) -> Quotas {
        *self.quotas.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Charges it with device time.
    pub(crate) fn charge(&self, took: Duration) {
        self.device_ns.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
    }

    /// Device time that its sessions have taken since the server was started.
    pub fn device_time(&self) -> Duration {
        Duration::from_nanos(self.device_ns.load(Ordering::Relaxed))
    }

    /// One that has taken nothing yet, and has no quotas.
    pub(crate) fn new(name: String) -> Tenant {
        Tenant { name, ..Tenant::default() }
    }

    /// Whether its sessions have taken more of the device of late than its quota allows.
    pub(crate) fn is_over_its_share(&self, frame: u64) -> bool {
        let Some(share) = self.quotas().device_share else { return false };
        let mut looked_at = self.looked_at.lock().unwrap_or_else(PoisonError::into_inner);
        let (seen, charge) = &mut *looked_at;
        let taken = self.device_time();
        charge.add(taken - std::mem::replace(seen, taken), frame);
        charge.share(frame) > share
    }

    /// Sets what it may take.
    pub(crate) fn set_quotas(&self, quotas: Quotas) {
        *self.quotas.write().unwrap_or_else(PoisonError::into_inner) = quotas;
    }
}
