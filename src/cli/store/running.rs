//! What `firn store` asks a running server for.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use firn_client::{Client, Error, Method};
use firn_protocol::{CompactReply, VerifyReply};

use crate::cli::Failure;
use crate::config::{AccessConfig, ApiKey};

use super::output::{Output, unwritten};

/// A running server.
#[derive(Args, Clone, Debug)]
pub struct Running {
    /// Ask a running server, as in http://127.0.0.1:8080, and leave --data-dir aside; only http, without TLS.
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// The server's API key, where it asks for one: the operator's, or one with the scope `admin`.
    #[arg(long, env = "FIRN_API_KEY", hide_env_values = true, value_name = "KEY")]
    api_key: Option<ApiKey>,
    /// File that holds the API key in its first line.
    #[arg(long, env = "FIRN_API_KEY_FILE", value_name = "FILE", conflicts_with = "api_key")]
    api_key_file: Option<PathBuf>,
}

impl Running {
    /// The server to ask, if one was named.
    ///
    /// # Errors
    /// Where its address or the key can't be used.
    pub fn client(&self) -> Result<Option<Client>, Failure> {
        let Some(url) = &self.server else { return Ok(None) };
        let usage = |error: Error| Failure::Usage(error.to_string());
        let client = Client::new(url).map_err(usage)?;
        let (api_key, api_key_file) = (self.api_key.clone(), self.api_key_file.clone());
        let access = AccessConfig { api_key, api_key_file, ..AccessConfig::default() };
        match access.key().map_err(Failure::Usage)? {
            Some(key) => client.with_key(key.secret()).map(Some).map_err(usage),
            None => Ok(Some(client)),
        }
    }
}

/// Has a server copy its store into a file.
pub fn backup(client: &Client, path: &Path) -> Result<u64, Failure> {
    let (output, mut file) = Output::begin(path)?;
    let bytes = wait(download(client, &mut file, path))?;
    output.finish(&file)?;
    Ok(bytes)
}

async fn download(client: &Client, file: &mut File, path: &Path) -> Result<u64, Failure> {
    let broken = |error| Failure::Failed(format!("the backup broke off: {error}; try again"));
    let mut response = client.fetch("/v1/store/backup").await.map_err(refused)?;
    let mut bytes = 0;
    while let Some(piece) = response.chunk().await.map_err(broken)? {
        file.write_all(&piece).map_err(|error| unwritten(path, &error))?;
        bytes += piece.len() as u64;
    }
    Ok(bytes)
}

/// Has a server verify its store.
pub fn verify(client: &Client) -> Result<VerifyReply, Failure> {
    wait(async {
        client.call(Method::POST, "/v1/store/verify", None::<&()>).await.map_err(refused)
    })
}

/// Has a server compact its store.
pub fn compact(client: &Client) -> Result<CompactReply, Failure> {
    wait(async {
        client.call(Method::POST, "/v1/store/compact", None::<&()>).await.map_err(refused)
    })
}

fn wait<T>(answer: impl Future<Output = Result<T, Failure>>) -> Result<T, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.map_err(|error| Failure::Failed(format!("starting threads: {error}")))?.block_on(answer)
}

fn refused(error: Error) -> Failure {
    let advice = match error.problem().map(|problem| problem.status) {
        Some(401) => "; give the key with --api-key-file or in FIRN_API_KEY",
        Some(404) => "; this server is older than 0.2, or something else",
        _ => "",
    };
    Failure::Failed(format!("{error}{advice}"))
}
