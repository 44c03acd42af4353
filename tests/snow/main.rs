//! The physics without any device: golden cases, and what holds for every snowpack: mass is kept to the quantum, snow only moves
//! down, rest is exact.

mod columns;
mod equilibrium;
mod golden;
mod ledger;
mod requirements;
mod snowpacks;
