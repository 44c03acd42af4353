//! What holds for every snowpack: mass is kept to the quantum, snow only moves down, rest is exact.

mod columns;
mod equilibrium;
mod requirements;
mod snowpacks;
