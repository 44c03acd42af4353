//! `firn key`: makes an API key for a tenant.

use clap::Args;
use firn_protocol::is_valid_id;

use crate::config::Scope;
use crate::session::random_secret;

use super::Failure;

/// Shown below the options.
pub const EXAMPLES: &str = "\
Examples:
  firn key alpine >> keys.toml             a key to read and write the tenant's sessions
  firn key alpine --scopes read --name map >> keys.toml
  kill -HUP $(pidof firn)                  have the server read the file again

The key is printed to standard error. Give it to its user, and do not keep it: it is not shown again.
The entry for the file of `firn serve --api-keys-file`, with the key's hash, is printed to standard
output. Quotas stand in the tenant's own table, above its keys:

  [tenants.alpine]
  quotas = { sessions = 20, cells = 50_000_000, device_share = 0.5, requests_per_second = 500 }";

/// Options of `firn key`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Name of the tenant, [A-Za-z0-9_-]{1,64}.
    #[arg(value_parser = parse_name)]
    tenant: String,

    /// What the key is for.
    #[arg(long, value_delimiter = ',', default_value = "read,write", value_name = "SCOPE")]
    scopes: Vec<Scope>,

    /// What the log calls the key; the first digits of its hash where it has no name.
    #[arg(long, value_parser = parse_name)]
    name: Option<String>,
}

/// Prints a new key and its entry.
///
/// # Errors
/// Where there are no random numbers, or standard output can't be written.
pub fn run(options: &Options) -> Result<(), Failure> {
    let no_random = |error| Failure::Failed(format!("no random numbers for a key: {error}"));
    let key = random_secret().map_err(no_random)?;
    super::print(entry(options, &key).as_bytes())?;
    eprintln!("{key}");
    Ok(())
}

fn entry(options: &Options, key: &str) -> String {
    let Options { tenant, scopes, name } = options;
    let name = name.as_ref().map_or(String::new(), |name| format!("name = \"{name}\"\n"));
    let hash = blake3::hash(key.as_bytes());
    let scopes: Vec<String> = scopes.iter().map(|scope| format!("\"{}\"", scope.name())).collect();
    let scopes = scopes.join(", ");
    format!("\n[[tenants.{tenant}.keys]]\n{name}hash = \"{hash}\"\nscopes = [{scopes}]\n")
}

fn parse_name(text: &str) -> Result<String, String> {
    let fits = is_valid_id(text).then(|| text.to_owned());
    fits.ok_or_else(|| "must match [A-Za-z0-9_-]{1,64}".to_owned())
}
