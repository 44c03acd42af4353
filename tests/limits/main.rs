//! What one client may take of a server: connections, bodies, answers, keys, memory, device time.

mod answers;
mod bodies;
mod connections;
mod gate;
mod keyed;
mod large;
mod raw;
mod shares;
#[path = "../support/mod.rs"]
mod support;
mod watched;
