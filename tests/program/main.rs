//! The program itself, as it is started from a shell.

mod experiments;
mod gate;
mod load;
mod manners;
mod running;
#[path = "../support/mod.rs"]
mod support;
mod telemetry;
