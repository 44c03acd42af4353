//! The program itself, as it is started from a shell.

mod audit;
mod experiments;
mod gate;
mod load;
mod manners;
#[cfg(target_os = "linux")]
mod memory;
#[cfg(unix)]
mod reload;
mod running;
mod season;
#[path = "../support/mod.rs"]
mod support;
mod telemetry;
