//! The engine without sessions: the GPU's kernels beside their twins in plain Rust.

mod arena;
mod frames;
mod golden;
mod kernels;
mod render_shaders;
mod shaders;
mod sleep;
mod support;
mod times;
mod track;
mod weather;
