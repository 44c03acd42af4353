//! Firn simulates snowpacks on the GPU and serves them over HTTP and WebSocket.
//!
//! This is the server. The parts usable without it are separate crates: [`firn_snow`], [`firn_engine`],
//! [`firn_protocol`] and [`firn_client`]. `docs/architecture.md` describes the modules and their dependencies.

pub mod backend;
pub mod bench;
pub mod budget;
pub mod caaml;
pub mod cli;
pub mod config;
pub mod core;
pub mod diagram;
pub mod driver;
pub mod experiment;
pub mod http;
pub mod journal;
pub mod limit;
pub mod load;
pub mod machine;
pub mod metrics;
pub mod open_files;
pub mod problem;
pub mod quote;
pub mod render;
pub mod season;
pub mod server;
pub mod session;
pub mod store;
pub mod stream;
pub mod telemetry;
pub mod threads;
