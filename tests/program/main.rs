//! The program itself, as it is started from a shell.

mod experiments;
mod gate;
mod load;
#[path = "../support/mod.rs"]
mod support;
