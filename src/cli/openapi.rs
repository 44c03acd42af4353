//! `firn openapi`: prints the OpenAPI document.

use super::Failure;

/// Shown below the options.
pub const EXAMPLES: &str = "\
Examples:
  firn openapi > openapi.json              for code generators and API clients
  firn openapi | jq '.paths | keys'        every path";

/// Prints the document to standard output, as `api/openapi.json` holds it.
pub fn run() -> Result<(), Failure> {
    let mut document = crate::server::document()
        .to_pretty_json()
        .map_err(|error| Failure::Failed(format!("the document can't be written: {error}")))?;
    document.push('\n');
    super::print(document.as_bytes())
}
