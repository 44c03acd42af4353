//! The REST interface: a real server on each backend, asked over a real socket.

mod auth;
mod bodies;
mod burden;
mod caaml;
mod cells;
mod checkpoints;
mod colliders;
mod compression;
mod docs;
mod errors;
mod golden;
mod heights;
mod isolation;
mod metrics;
mod moving;
mod origin;
mod portions;
mod presets;
mod probes;
mod profile;
mod render;
mod repeat;
mod samples;
mod server;
mod sessions;
mod snapshots;
mod snow;
mod snowing;
mod stamps;
mod steps;
mod strangers;
#[path = "../support/mod.rs"]
mod support;
mod tenants;
mod terrain;
mod viewer;
