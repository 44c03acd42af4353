//! Tenants: whom sessions belong to, and what each may take of the server.

use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Duration;

use serde::Deserialize;

use super::charge::Charge;

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
    pub(super) fn charge(&self, took: Duration) {
        self.device_ns.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
    }

    /// Device time that its sessions have taken since the server was started.
    pub fn device_time(&self) -> Duration {
        Duration::from_nanos(self.device_ns.load(Ordering::Relaxed))
    }

    /// Whether its sessions have taken more of the device of late than its quota allows.
    pub(super) fn is_over_its_share(&self, frame: u64) -> bool {
        let Some(share) = self.quotas().device_share else { return false };
        let mut looked_at = self.looked_at.lock().unwrap_or_else(PoisonError::into_inner);
        let (seen, charge) = &mut *looked_at;
        let taken = self.device_time();
        charge.add(taken - std::mem::replace(seen, taken), frame);
        charge.share(frame) > share
    }

    fn set_quotas(&self, quotas: Quotas) {
        *self.quotas.write().unwrap_or_else(PoisonError::into_inner) = quotas;
    }
}

/// Every tenant that has a session or a quota. Clones are handles to the same.
#[derive(Clone, Debug, Default)]
pub struct Tenants(Arc<RwLock<HashMap<String, Arc<Tenant>>>>);

impl Tenants {
    /// The tenant of a name.
    pub fn named(&self, name: &str) -> Arc<Tenant> {
        let known = self.0.read().unwrap_or_else(PoisonError::into_inner).get(name).cloned();
        known.unwrap_or_else(|| {
            let mut tenants = self.0.write().unwrap_or_else(PoisonError::into_inner);
            let new = || Tenant { name: name.to_owned(), ..Tenant::default() };
            tenants.entry(name.to_owned()).or_insert_with(|| Arc::new(new())).clone()
        })
    }

    /// All of them.
    pub fn all(&self) -> Vec<Arc<Tenant>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).values().cloned().collect()
    }

    /// Sets what each may take. Those that are not among them have no quotas any more.
    pub fn set_quotas(&self, quotas: &HashMap<String, Quotas>) {
        for name in quotas.keys() {
            self.named(name);
        }
        for (name, tenant) in &*self.0.read().unwrap_or_else(PoisonError::into_inner) {
            tenant.set_quotas(quotas.get(name).copied().unwrap_or_default());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotas_change_for_whoever_holds_the_tenant() {
        let tenants = Tenants::default();
        let held = tenants.named("alpine");
        assert_eq!(held.quotas(), Quotas::default());
        let quotas = Quotas { sessions: Some(3), ..Quotas::default() };
        tenants.set_quotas(&HashMap::from([("alpine".to_owned(), quotas)]));
        assert_eq!(held.quotas(), quotas);
        assert!(Arc::ptr_eq(&held, &tenants.named("alpine")));
        tenants.set_quotas(&HashMap::new());
        assert_eq!(held.quotas(), Quotas::default());
    }

    #[test]
    fn a_share_of_the_device_is_what_was_taken_of_late() {
        let tenants = Tenants::default();
        let tenant = tenants.named("alpine");
        let half = Quotas { device_share: Some(0.5), ..Quotas::default() };
        tenants.set_quotas(&HashMap::from([("alpine".to_owned(), half)]));
        // It has the whole device wherever it may.
        let mut frames = 0;
        for frame in 0..6000 {
            if !tenant.is_over_its_share(frame) {
                frames += 1;
                tenant.charge(Duration::from_secs_f64(1.0 / 60.0));
            }
        }
        assert!((2900..3100).contains(&frames), "{frames} of 6000 frames");
        assert!(!tenant.is_over_its_share(6100), "what is long ago is forgotten");
        tenants.set_quotas(&HashMap::new());
        tenant.charge(Duration::from_secs(100));
        assert!(!tenant.is_over_its_share(6100), "nothing is said of its share");
    }
}
