//! Firn simulates snowpacks on the GPU and serves them over HTTP and WebSocket.
//!
//! Modules depend on each other in one direction: `cli` → `http`, `stream`, `experiment` →
//! `render`, `diagram` → `session` → `engine` → `snow`. `docs/architecture.md` describes how they work together.

#![deny(missing_docs)]

pub mod bench;
pub mod cli;
pub mod config;
pub mod diagram;
pub mod engine;
pub mod experiment;
pub mod http;
pub mod load;
pub mod metrics;
pub mod open_files;
pub mod parallel;
pub mod problem;
pub mod render;
pub mod session;
pub mod snow;
pub mod store;
pub mod stream;
pub mod telemetry;
