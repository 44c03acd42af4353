//! `firn openapi`: prints the OpenAPI document.

use std::io::{ErrorKind, Write};

use super::Failure;

/// Prints the document to standard output, as `api/openapi.json` holds it.
pub fn run() -> Result<(), Failure> {
    let mut document = crate::http::document()
        .to_pretty_json()
        .map_err(|error| Failure::Failed(format!("the document can't be written: {error}")))?;
    document.push('\n');
    match std::io::stdout().write_all(document.as_bytes()) {
        // Whoever reads it may have seen enough.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::Failed(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}
