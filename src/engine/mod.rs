//! All the snowpacks of this process, stepped in frames by one backend: the GPU's arena or, where
//! there is no adapter, the reference columns.

pub mod cpu;
pub mod frame;
pub mod gpu;
pub mod published;
