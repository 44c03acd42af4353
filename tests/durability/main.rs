//! Nothing acknowledged is ever lost: restarts, kills, power cuts, full disks, damaged files, lost
//! devices.

mod kill;
mod process;
mod restart;
mod script;
#[path = "../support/mod.rs"]
mod support;
