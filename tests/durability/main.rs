//! Nothing acknowledged is ever lost: restarts, kills, power cuts, full disks, damaged files, lost
//! devices.

mod backup;
mod checkpoints;
#[path = "../stream/client.rs"]
#[allow(dead_code)]
mod client;
mod clock;
mod damage;
mod device;
mod disk;
mod drain;
mod faults;
mod format;
mod frames;
mod giving_up;
mod gone;
mod hibernation;
mod kill;
mod process;
mod rest;
mod restart;
mod resume;
mod salvage;
mod script;
mod secrets;
mod slow;
#[path = "../support/mod.rs"]
mod support;
mod tenants;
mod upkeep;
