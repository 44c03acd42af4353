//! What stands between the network and the handlers: connections, names, pages, tokens.

mod access;
mod connections;
mod neighbours;

use axum_server::tls_rustls::RustlsConfig;

use crate::config::{AccessConfig, ConnectionConfig};

pub use access::{Access, Caller, authorize, bearer};
pub use connections::Door;
pub use neighbours::{Neighbours, check_host, check_origin};

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
    /// Where the API key, the certificate or the certificate's key can't be used.
    pub fn new(access: &AccessConfig, connections: ConnectionConfig) -> Result<Gate, String> {
        Ok(Gate {
            access: Access::new(access)?,
            neighbours: Neighbours::new(access),
            tls: connections::tls(&connections)?,
            connections,
        })
    }
}
