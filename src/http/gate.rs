//! What stands between the network and the handlers: connections, names, pages, tokens.

mod access;
mod admit;
mod audit;
mod connections;
mod failures;
mod http1;
mod keys;
mod neighbours;
mod rates;
mod reload;
mod unfinished;

use axum_server::tls_rustls::RustlsConfig;

use crate::config::{AccessConfig, ConnectionConfig};

pub use access::{Access, Caller};
pub use admit::{Admitted, Peer, Visitor, admit, bearer, guard};
pub use connections::Door;
pub use http1::Http1;
pub use neighbours::{Neighbours, check_host, check_origin};
pub use reload::reload;
pub use unfinished::Unfinished;

/// Who gets in, and how.
#[derive(Debug, Default)]
pub struct Gate {
    /// Who may do what.
    pub access: Access,
    /// What the server is called, and which web pages may use it.
    pub neighbours: Neighbours,
    /// Limits of connections.
    pub connections: ConnectionConfig,
    /// Certificate and key, where connections are encrypted.
    pub tls: Option<RustlsConfig>,
}

impl Gate {
    /// What a configuration says. The default is an open server without TLS.
    ///
    /// # Errors
    /// Where an API key, the certificate or the certificate's key can't be used.
    pub fn new(access: &AccessConfig, connections: ConnectionConfig) -> Result<Gate, String> {
        Ok(Gate {
            access: Access::new(access)?,
            neighbours: Neighbours::new(access),
            tls: connections::tls(&connections)?,
            connections,
        })
    }

    /// Whether it comes from files, in part at least, so that they can be read again.
    pub fn has_files(&self) -> bool {
        let access = self.access.config();
        access.api_key_file.is_some() || access.api_keys_file.is_some() || self.tls.is_some()
    }
}
