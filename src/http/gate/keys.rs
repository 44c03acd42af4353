//! The API keys that are good at one time: the operator's, and those of tenants.

use std::collections::HashMap;
use std::sync::Arc;

use blake3::Hash;
use governor::Quota;

use crate::config::{TenantConfigs, TenantKey};
use crate::session::Quotas;

use super::rates::Rates;

/// A key of a tenant.
#[derive(Debug)]
pub struct Key {
    /// Name of the tenant.
    pub tenant: String,
    /// What it is, and what it is for.
    pub key: TenantKey,
}

/// The API keys that are good at one time. Where they change, they are replaced as a whole.
#[derive(Debug, Default)]
pub struct Keys {
    operator: Option<Hash>,
    tenants: TenantConfigs,
    by_hash: HashMap<[u8; 32], Arc<Key>>,
    /// Of tenants with a rate of their own.
    rates: HashMap<String, Arc<Rates<[u8; 32]>>>,
}

/// Whose a token is.
#[derive(Clone, Debug)]
pub enum Owner {
    /// The operator's.
    Operator,
    /// A tenant's.
    Tenant(Arc<Key>),
}

impl Keys {
    /// Another key of the operator's, and the same ones of tenants.
    ///
    /// # Errors
    /// Where a tenant has the same key.
    pub fn with_operator(&self, operator: Option<Hash>) -> Result<Keys, String> {
        self.with(operator, self.tenants.clone())
    }

    /// Other keys of tenants, and the same one of the operator's.
    ///
    /// # Errors
    /// Where one is the operator's.
    pub fn with_tenants(&self, tenants: TenantConfigs) -> Result<Keys, String> {
        self.with(self.operator, tenants)
    }

    fn with(&self, operator: Option<Hash>, tenants: TenantConfigs) -> Result<Keys, String> {
        let mut by_hash = HashMap::new();
        let mut rates = HashMap::new();
        for (name, tenant) in &tenants {
            for key in &tenant.keys {
                if Some(key.hash) == operator {
                    return Err(format!(
                        "the API key of the operator is that of the tenant '{name}' as well; a key \
                         is one person's"
                    ));
                }
                let key = Key { tenant: name.clone(), key: key.clone() };
                by_hash.insert(*key.key.hash.as_bytes(), Arc::new(key));
            }
            if let Some(rate) = tenant.quotas.requests_per_second {
                let before = self.tenants.get(name);
                let same = before.and_then(|before| before.quotas.requests_per_second);
                let known = self.rates.get(name).filter(|_| same == Some(rate)).cloned();
                let rates_of =
                    known.unwrap_or_else(|| Arc::new(Rates::new(Quota::per_second(rate))));
                rates.insert(name.clone(), rates_of);
            }
        }
        Ok(Keys { operator, tenants, by_hash, rates })
    }

    /// Whose a token of a hash is.
    pub fn owner(&self, token: &Hash) -> Option<Owner> {
        // The table is asked for a hash: how long that takes says nothing about the keys.
        if self.operator == Some(*token) {
            return Some(Owner::Operator);
        }
        self.by_hash.get(token.as_bytes()).cloned().map(Owner::Tenant)
    }

    /// Whether a key of a tenant still allows all that it did.
    pub fn still_allow(&self, before: &Key) -> bool {
        let now = self.by_hash.get(before.key.hash.as_bytes());
        now.is_some_and(|now| {
            now.tenant == before.tenant && now.key.scopes.cover(before.key.scopes)
        })
    }

    /// The rate of a tenant that has one of its own.
    pub fn rates(&self, tenant: &str) -> Option<&Arc<Rates<[u8; 32]>>> {
        self.rates.get(tenant)
    }

    /// What tenants may take.
    pub fn quotas(&self) -> HashMap<String, Quotas> {
        self.tenants.iter().map(|(name, tenant)| (name.clone(), tenant.quotas)).collect()
    }
}
