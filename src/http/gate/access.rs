//! Who may do what: the operator's API key everything, a tenant's what its scopes say about the
//! tenant's sessions, a session's token everything about it, its viewer's token only reads. Where no
//! API key is configured nobody is asked.
//!
//! Tokens are compared by their hashes, in a time that does not depend on where they differ.

use std::sync::Arc;

use blake3::Hash;
use governor::Quota;
use tokio::sync::watch;

use crate::config::{AccessConfig, Scope};
use crate::limit::Limit;
use crate::problem::Problem;
use crate::session::{Grant, Session, TokenHashes};

use super::failures::Failures;
use super::keys::{Key, Keys, Owner};
use super::rates::{Rates, whole_seconds};

/// What decides who may do what.
#[derive(Debug)]
pub struct Access {
    config: AccessConfig,
    keys: watch::Sender<Arc<Keys>>,
    rates: Rates<[u8; 32]>,
    /// What happens to those who have no right token.
    pub failures: Failures,
}

/// Who sent a request.
#[derive(Clone, Debug)]
pub enum Caller {
    /// Anybody: the server is open.
    Anyone,
    /// Who has the operator's API key, by its hash.
    Operator(Hash),
    /// Who has a key of a tenant.
    Tenant(Arc<Key>),
    /// Who has one of the session's tokens, by its hash.
    Holder(Hash, Grant),
}

/// Why nobody knows who sent a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stranger {
    /// It has no token.
    Missing,
    /// Its token is nobody's.
    Unknown,
}

impl Caller {
    /// Whether it may do something, with the sessions that it reaches.
    pub fn may(&self, scope: Scope) -> bool {
        match self {
            Caller::Anyone | Caller::Operator(_) => true,
            Caller::Tenant(key) => key.key.scopes.allow(scope),
            Caller::Holder(_, Grant::Everything) => scope != Scope::Admin,
            Caller::Holder(_, Grant::Reads) => scope == Scope::Read,
        }
    }

    /// The tenant that it creates sessions for.
    pub fn tenant(&self) -> Option<&str> {
        match self {
            Caller::Tenant(key) => Some(&key.tenant),
            Caller::Anyone | Caller::Operator(_) | Caller::Holder(..) => None,
        }
    }

    /// The tenant whose sessions alone are there for it.
    pub fn confined_to(&self) -> Option<&str> {
        self.tenant().filter(|_| !self.may(Scope::Admin))
    }

    /// Whether a session is there for it.
    pub fn reaches(&self, session: &Session) -> bool {
        let owner = session.tenant.as_ref().map(|tenant| &*tenant.name);
        self.confined_to().is_none_or(|tenant| owner == Some(tenant))
    }

    /// Whether it may stay where a session's tokens are now these.
    pub fn is_known_to(&self, tokens: &TokenHashes) -> bool {
        match self {
            Caller::Anyone | Caller::Operator(_) | Caller::Tenant(_) => true,
            Caller::Holder(token, grant) => tokens.grant(token) == Some(*grant),
        }
    }

    /// Whether it may stay where these are the API keys now.
    pub fn is_among(&self, keys: &Keys) -> bool {
        match self {
            Caller::Anyone | Caller::Holder(..) => true,
            Caller::Operator(key) => matches!(keys.owner(key), Some(Owner::Operator)),
            Caller::Tenant(key) => keys.still_allow(key),
        }
    }

    /// What the log calls it. The names of tenants and keys have no slash.
    pub fn name(&self) -> String {
        match self {
            Caller::Anyone => "anyone".to_owned(),
            Caller::Operator(_) => "operator".to_owned(),
            Caller::Tenant(key) => format!("{}/{}", key.tenant, key.key.name),
            Caller::Holder(_, Grant::Everything) => "session token".to_owned(),
            Caller::Holder(_, Grant::Reads) => "viewer token".to_owned(),
        }
    }
}

impl Default for Access {
    /// An open server.
    fn default() -> Self {
        Access::new(&AccessConfig::default()).expect("no key is no wrong key")
    }
}

impl Access {
    /// What a configuration says.
    ///
    /// # Errors
    /// Those of [`AccessConfig::key`] and [`AccessConfig::tenants`].
    pub fn new(config: &AccessConfig) -> Result<Access, String> {
        let access = Access {
            config: config.clone(),
            keys: watch::Sender::default(),
            rates: Rates::new(Quota::per_second(config.requests_per_second)),
            failures: Failures::new(config.auth_failures_per_minute),
        };
        access.read_operator_key()?;
        access.read_tenant_keys()?;
        Ok(access)
    }

    /// Where keys are read from.
    pub fn config(&self) -> &AccessConfig {
        &self.config
    }

    /// Reads the operator's API key again; the present one holds where that fails.
    ///
    /// # Errors
    /// Those of [`AccessConfig::key`], and where it is a tenant's too.
    pub fn read_operator_key(&self) -> Result<(), String> {
        let operator = self.config.key()?.map(|key| key.hash());
        let keys = self.keys().with_operator(operator);
        let keys = keys.map_err(|error| format!("--api-key-file: {error}"))?;
        self.keys.send_replace(Arc::new(keys));
        Ok(())
    }

    /// Reads the tenants' API keys again; the present ones hold where that fails.
    ///
    /// # Errors
    /// Those of [`AccessConfig::tenants`], and where one is the operator's too.
    pub fn read_tenant_keys(&self) -> Result<(), String> {
        let tenants = self.config.tenants()?.unwrap_or_default();
        let keys = self.keys().with_tenants(tenants);
        let keys = keys.map_err(|error| format!("--api-keys-file: {error}"))?;
        self.keys.send_replace(Arc::new(keys));
        Ok(())
    }

    /// Whether nobody is asked for a token.
    pub fn is_open(&self) -> bool {
        self.config.is_open()
    }

    /// The API keys that are good now.
    pub fn keys(&self) -> Arc<Keys> {
        self.keys.borrow().clone()
    }

    /// The API keys, as they become.
    pub fn key_changes(&self) -> watch::Receiver<Arc<Keys>> {
        self.keys.subscribe()
    }

    /// Who presents a token for a session, or for the server where there is none.
    ///
    /// # Errors
    /// [`Stranger`] where the token is missing or unknown.
    pub fn identify(
        &self,
        token: Option<&str>,
        session: Option<&Session>,
    ) -> Result<Caller, Stranger> {
        if self.is_open() {
            return Ok(Caller::Anyone);
        }
        let token = blake3::hash(token.ok_or(Stranger::Missing)?.as_bytes());
        match self.keys().owner(&token) {
            Some(Owner::Operator) => Ok(Caller::Operator(token)),
            Some(Owner::Tenant(key)) => Ok(Caller::Tenant(key)),
            None => {
                let grant = session.and_then(|session| session.tokens().grant(&token));
                grant.map(|grant| Caller::Holder(token, grant)).ok_or(Stranger::Unknown)
            }
        }
    }

    /// Counts a request of somebody, about a session where there is one.
    ///
    /// # Errors
    /// 429 where there are too many of them.
    pub fn count(&self, caller: &Caller, session: Option<&Session>) -> Result<(), Problem> {
        let keys = self.keys();
        let owner = session.and_then(|session| session.tenant.as_ref()).map(|tenant| &*tenant.name);
        let (token, tenant) = match caller {
            Caller::Anyone => return Ok(()),
            Caller::Operator(token) => (*token, None),
            Caller::Holder(token, _) => (*token, owner),
            Caller::Tenant(key) => (key.key.hash, Some(&*key.tenant)),
        };
        let quota = tenant.and_then(|tenant| Some((tenant, keys.rates(tenant)?)));
        let counted = match (quota, caller) {
            // A tenant has one rate, however many keys it has.
            (Some((tenant, rates)), Caller::Tenant(_)) => {
                rates.count(blake3::hash(tenant.as_bytes()).as_bytes())
            }
            (Some((_, rates)), _) => rates.count(token.as_bytes()),
            (None, _) => self.rates.count(token.as_bytes()),
        };
        counted.map_err(|wait| {
            let detail = match quota {
                Some((tenant, _)) => format!(
                    "these are more requests than the quota `requests_per_second` of the tenant \
                     '{tenant}' allows; the operator can raise it"
                ),
                None => "this token is used for more requests than the server takes per second; \
                         the operator can raise --requests-per-second"
                    .to_owned(),
            };
            let limit = if quota.is_some() { Limit::Quota } else { Limit::RequestsPerSecond };
            Problem::too_many_requests(detail, whole_seconds(wait)).from_limit(limit)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_of_a_tenant_share_a_rate_whenever_they_are_read() {
        const KEYS: [&str; 2] = ["one-key-of-the-tenant", "another-key-of-the-tenant"];
        let entry = |key| format!("[[tenants.a.keys]]\nkey = \"{key}\"\nscopes = [\"read\"]\n");
        let quotas = "[tenants.a.quotas]\nrequests_per_second = 1\n".to_owned();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), quotas + &KEYS.map(entry).concat()).unwrap();
        let api_keys_file = Some(file.path().to_owned());
        let access =
            Access::new(&AccessConfig { api_keys_file, ..AccessConfig::default() }).unwrap();
        let count = |key| {
            let caller = access.identify(Some(key), None).unwrap();
            access.count(&caller, None).map_err(|problem| problem.status)
        };
        assert_eq!([count(KEYS[0]), count(KEYS[1])], [Ok(()), Err(429)]);
        access.read_tenant_keys().unwrap();
        assert_eq!(count(KEYS[1]), Err(429), "reading the file again is no fresh start");
    }

    #[test]
    fn a_key_is_one_persons() {
        const KEY: &str = "the-same-key-twice";
        let file = tempfile::NamedTempFile::new().unwrap();
        let entry = format!("[[tenants.a.keys]]\nkey = \"{KEY}\"\nscopes = [\"read\"]\n");
        std::fs::write(file.path(), entry).unwrap();
        let api_keys_file = Some(file.path().to_owned());
        let api_key = Some(KEY.into());
        let config = AccessConfig { api_key, api_keys_file, ..AccessConfig::default() };
        let error = Access::new(&config).unwrap_err();
        assert!(error.contains("'a'") && !error.contains(KEY), "{error}");
    }
}
