//! The file with the API keys of tenants, in TOML: for each tenant its quotas and its keys.
//!
//! ```toml
//! [tenants.alpine]
//! quotas = { sessions = 20, cells = 50_000_000 }
//!
//! [[tenants.alpine.keys]]
//! hash = "2b5c…"
//! scopes = ["read", "write"]
//! ```
//!
//! Quotas belong to the tenant, so that a key can be replaced by another: both are good until the
//! old one is taken out.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use blake3::Hash;
use clap::ValueEnum;
use firn_protocol::is_valid_id;
use serde::{Deserialize, Deserializer, de};

use crate::session::Quotas;

use super::access::{ApiKey, SHORTEST_KEY};

/// Characters of a key's hash that name it where it has no name.
const SHORT_HASH: usize = 8;

/// Something that a key may be for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// Listing, reading and streaming the tenant's sessions.
    Read,
    /// Creating, changing, stepping, resetting and deleting them.
    Write,
    /// Everything about the sessions of all tenants.
    Admin,
}

impl Scope {
    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Scope::Read => "read",
            Scope::Write => "write",
            Scope::Admin => "admin",
        }
    }
}

/// All that a key is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scopes {
    read: bool,
    write: bool,
    admin: bool,
}

impl Scopes {
    /// Whether something is among them; `admin` is everything.
    pub fn allow(self, scope: Scope) -> bool {
        self.admin
            || match scope {
                Scope::Read => self.read,
                Scope::Write => self.write,
                Scope::Admin => false,
            }
    }

    /// Whether they allow all that others do.
    pub fn cover(self, others: Scopes) -> bool {
        let all = [Scope::Read, Scope::Write, Scope::Admin];
        all.into_iter().all(|scope| self.allow(scope) || !others.allow(scope))
    }
}

impl FromIterator<Scope> for Scopes {
    fn from_iter<I: IntoIterator<Item = Scope>>(scopes: I) -> Scopes {
        let mut all = Scopes::default();
        for scope in scopes {
            match scope {
                Scope::Read => all.read = true,
                Scope::Write => all.write = true,
                Scope::Admin => all.admin = true,
            }
        }
        all
    }
}

/// One key of a tenant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TenantKey {
    /// What the log calls it.
    pub name: String,
    /// Its hash: all that the server keeps.
    pub hash: Hash,
    /// What it is for.
    pub scopes: Scopes,
}

/// A tenant as the file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct TenantConfig {
    /// What it may take.
    pub quotas: Quotas,
    /// Its keys; a tenant that has none still has its quotas.
    pub keys: Vec<TenantKey>,
}

/// The tenants of a file, by name.
pub type TenantConfigs = HashMap<String, TenantConfig>;

/// Reads the file.
///
/// # Errors
/// Where it can't be read or something in it can't hold; the message names the place, and repeats no
/// secret.
pub fn read(file: &Path) -> Result<TenantConfigs, String> {
    let place = format!("--api-keys-file {}", file.display());
    let text = std::fs::read_to_string(file).map_err(|error| {
        format!("{place}: {error}; expected a TOML file that this user can read")
    })?;
    parse(&text).map_err(|error| format!("{place}: {error}"))
}

fn parse(text: &str) -> Result<TenantConfigs, String> {
    let file: File = toml::from_str(text).map_err(|error| located(text, &error))?;
    if file.tenants.is_empty() {
        return Err(
            "it holds no tenant; expected at least one table such as [tenants.alpine], or \
                    start without the file"
                .to_owned(),
        );
    }
    let (mut tenants, mut known) = (TenantConfigs::new(), HashSet::new());
    for (name, table) in file.tenants {
        if !is_valid_id(&name) {
            return Err(format!("the tenant's name '{name}' must match [A-Za-z0-9_-]{{1,64}}"));
        }
        let place = format!("tenants.{name}");
        check(&table.quotas).map_err(|error| format!("{place}.quotas: {error}"))?;
        let mut keys = Vec::new();
        for (number, key) in table.keys.into_iter().enumerate() {
            let place = format!("{place}, key {}", number + 1);
            let key = key.sound().map_err(|error| format!("{place}: {error}"))?;
            if !known.insert(key.hash) {
                return Err(format!("{place}: the same key is in the file already"));
            }
            keys.push(key);
        }
        tenants.insert(name, TenantConfig { quotas: table.quotas, keys });
    }
    Ok(tenants)
}

/// What the parser found, and where. Its own message would show the line, with what is secret in it.
fn located(text: &str, error: &toml::de::Error) -> String {
    let line = |at: usize| text.bytes().take(at).filter(|&byte| byte == b'\n').count() + 1;
    let place = error.span().map_or(String::new(), |span| format!("line {}: ", line(span.start)));
    format!("{place}{}", error.message())
}

fn check(quotas: &Quotas) -> Result<(), String> {
    match quotas.device_share {
        Some(share) if !(share > 0.0 && share <= 1.0) => {
            Err(format!("device_share is {share}; expected a part above 0 and up to 1"))
        }
        _ => Ok(()),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    tenants: BTreeMap<String, TenantTable>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct TenantTable {
    quotas: Quotas,
    keys: Vec<KeyTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyTable {
    name: Option<String>,
    key: Option<Secret>,
    hash: Option<Secret>,
    #[serde(default)]
    scopes: Vec<Scope>,
}

impl KeyTable {
    fn sound(self) -> Result<TenantKey, String> {
        let hash = match (self.key, self.hash) {
            (Some(Secret(key)), None) => {
                let key = ApiKey::from(&*key);
                key.is_sound().then(|| key.hash()).ok_or_else(|| {
                    format!(
                        "`key` has at least {SHORTEST_KEY} characters, visible ASCII without \
                         spaces; `firn key` makes one"
                    )
                })?
            }
            (None, Some(Secret(hash))) => Hash::from_hex(hash)
                .map_err(|_| "`hash` is a BLAKE3 hash, 64 hexadecimal digits".to_owned())?,
            _ => return Err("expected either `hash` or `key`".to_owned()),
        };
        if self.scopes.is_empty() {
            return Err("expected `scopes`, at least one of read, write and admin".to_owned());
        }
        let name = self.name.unwrap_or_else(|| hash.to_hex()[..SHORT_HASH].to_owned());
        if !is_valid_id(&name) {
            return Err(format!("the key's name '{name}' must match [A-Za-z0-9_-]{{1,64}}"));
        }
        Ok(TenantKey { name, hash, scopes: self.scopes.into_iter().collect() })
    }
}

/// A text that no message repeats.
struct Secret(String);

impl<'de> Deserialize<'de> for Secret {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Secret, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Value {
            Text(String),
            Other(de::IgnoredAny),
        }
        match Value::deserialize(from)? {
            Value::Text(text) => Ok(Secret(text)),
            Value::Other(_) => Err(de::Error::custom("expected a text in quotes")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "2b5c1d0e2b5c1d0e2b5c1d0e2b5c1d0e2b5c1d0e2b5c1d0e2b5c1d0e2b5c1d0e";

    #[test]
    fn a_file_says_who_may_what() {
        let text = format!(
            "[tenants.alpine]\nquotas = {{ sessions = 2, device_share = 0.5 }}\n\
             [tenants.idle]\n\
             [[tenants.alpine.keys]]\nhash = \"{HASH}\"\nscopes = [\"read\"]\n\
             [[tenants.alpine.keys]]\nname = \"new\"\nkey = \"0123456789abcdef\"\n\
             scopes = [\"write\", \"read\"]\n"
        );
        let tenants = parse(&text).unwrap();
        assert_eq!(tenants["idle"], TenantConfig { quotas: Quotas::default(), keys: Vec::new() });
        let TenantConfig { quotas, keys } = &tenants["alpine"];
        assert_eq!((quotas.sessions, quotas.cells), (Some(2), None));
        assert_eq!(quotas.device_share, Some(0.5));
        assert_eq!((&*keys[0].name, &*keys[1].name), (&HASH[..8], "new"));
        assert_eq!(keys[1].hash, blake3::hash(b"0123456789abcdef"));
        let allowed = |key: &TenantKey| {
            [Scope::Read, Scope::Write, Scope::Admin].map(|scope| key.scopes.allow(scope))
        };
        assert_eq!(allowed(&keys[0]), [true, false, false]);
        assert_eq!(allowed(&keys[1]), [true, true, false]);
        assert!(keys[1].scopes.cover(keys[0].scopes) && !keys[0].scopes.cover(keys[1].scopes));
        let admin = Scopes::from_iter([Scope::Admin]);
        assert!(admin.allow(Scope::Write) && admin.cover(keys[1].scopes));
    }

    #[test]
    fn what_is_wrong_with_a_file_is_said_without_its_secrets() {
        let key = |lines: &str| format!("[tenants.a]\n[[tenants.a.keys]]\n{lines}\n");
        let quota = |quota: &str| format!("[tenants.a]\nquotas = {{ {quota} }}\n");
        let read = "scopes = [\"read\"]";
        let twice = key(&format!("hash = \"{HASH}\"\n{read}")).replace("[tenants.a]\n", "");
        for (text, words) in [
            (String::new(), "no tenant"),
            ("[tenant.a]".to_owned(), "line 1: unknown field `tenant`"),
            ("[tenants.\"a b\"]".to_owned(), "'a b'"),
            (quota("session = 1"), "line 2: unknown field `session`"),
            (quota("sessions = -1"), "line 2: "),
            (quota("device_share = 0"), "tenants.a.quotas: device_share"),
            (quota("device_share = 1.5"), "device_share is 1.5"),
            (quota("device_share = nan"), "device_share is NaN"),
            (quota("requests_per_second = 0"), "line 2: "),
            (key(read), "tenants.a, key 1: expected either `hash` or `key`"),
            (key("key = \"hunter2\"\nscopes = [\"read\"]"), "at least 16 characters"),
            (key("key = 270102701027010\nscopes = [\"read\"]"), "line 3: expected a text"),
            (key("key = \"hunter2hunter2hunter2"), "line 3: "),
            (key("key = hunter2hunter2hunter2"), "line 3: "),
            (key("hash = \"hunter2hunter2hunter2\"\nscopes = [\"read\"]"), "64 hexadecimal"),
            (key(&format!("hash = \"{HASH}\"")), "at least one of read, write and admin"),
            (key(&format!("hash = \"{HASH}\"\nscopes = [\"rea\"]")), "unknown variant `rea`"),
            (key(&format!("hash = \"{HASH}\"\n{read}\nname = \"a b\"")), "'a b'"),
            (format!("{twice}{twice}"), "tenants.a, key 2: the same key"),
        ] {
            let error = parse(&text).unwrap_err();
            assert!(error.contains(words), "{words}: {error}");
            assert!(!error.contains("hunter2") && !error.contains("2701027010"), "{error}");
        }
    }
}
