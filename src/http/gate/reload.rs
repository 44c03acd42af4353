//! Reads keys and certificates again while the server runs. What can't be used changes nothing.

use tracing::error;

use crate::http::App;
use crate::metrics::Reload;

use super::audit;
use super::connections;

/// Reads everything again that comes from a file: each of them is taken over whole or not at all.
///
/// Whatever is let in from here on is let in by the new keys, and streams that the new ones would not
/// let in end; new connections get the new certificate.
pub fn reload(app: &App) {
    let access = &app.gate.access;
    let config = access.config();
    if config.api_key_file.is_some() {
        finish(app, Reload::ApiKey, access.read_operator_key());
    }
    if config.api_keys_file.is_some() {
        let read = access.read_tenant_keys();
        app.sessions.tenants().set_quotas(&access.keys().quotas());
        finish(app, Reload::ApiKeys, read);
    }
    if let Some(tls) = &app.gate.tls {
        let read = connections::tls(&app.gate.connections).map(|new| {
            new.into_iter().for_each(|new| tls.reload_from_config(new.get_inner()));
        });
        finish(app, Reload::Certificate, read);
    }
}

fn finish(app: &App, what: Reload, read: Result<(), String>) {
    let done = read.is_ok();
    if let Err(why) = read {
        error!("{why}; what was read before still holds");
    }
    app.metrics.gate.reloaded(what, done);
    audit::reloaded(what.label(), done);
}
