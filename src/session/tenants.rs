//! All tenants, by name.

use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock};

use crate::core::tenant::{Quotas, Tenant};

/// Every tenant that has a session or a quota. Clones are handles to the same.
#[derive(Clone, Debug, Default)]
pub struct Tenants(Arc<RwLock<HashMap<String, Arc<Tenant>>>>);

impl Tenants {
    /// The tenant of a name.
    pub fn named(&self, name: &str) -> Arc<Tenant> {
        let known = self.0.read().unwrap_or_else(PoisonError::into_inner).get(name).cloned();
        known.unwrap_or_else(|| {
            let mut tenants = self.0.write().unwrap_or_else(PoisonError::into_inner);
            let new = || Arc::new(Tenant::new(name.to_owned()));
            tenants.entry(name.to_owned()).or_insert_with(new).clone()
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
    use std::time::Duration;

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
