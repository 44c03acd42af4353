//! How many files this process may have open: every connection is one.

/// Allows this process a number of open files, where it may have fewer.
///
/// # Errors
/// Why it can't, with what is allowed.
#[cfg(unix)]
pub fn allow(wanted: u64) -> Result<(), String> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    if limit.current.is_none_or(|current| current >= wanted) {
        return Ok(());
    }
    let raised = Rlimit { current: Some(wanted), maximum: limit.maximum };
    setrlimit(Resource::Nofile, raised).map_err(|error| {
        let most = limit.maximum.map_or("any".to_owned(), |most| most.to_string());
        format!("{wanted} open files are needed, {most} are allowed: {error}")
    })
}

/// Other systems have no such limit.
#[cfg(not(unix))]
pub fn allow(_: u64) -> Result<(), String> {
    Ok(())
}
