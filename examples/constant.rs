//! A handler that returns a constant: the most that axum serves on a machine, to hold the cached
//! reads of a server against (`docs/performance.md`).
//!
//! ```sh
//! cargo run --release --example constant -- 127.0.0.1:8081
//! ```

use axum::Router;
use axum::routing::get;
use tokio::net::TcpListener;

#[tokio::main]
async fn main() -> std::io::Result<()> {
    let address = std::env::args().nth(1).unwrap_or("127.0.0.1:8081".to_owned());
    let router = Router::new().route("/", get(|| async { "constant" }));
    axum::serve(TcpListener::bind(address).await?, router).await
}
