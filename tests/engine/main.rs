//! The engine without sessions: the GPU's kernels beside their twins in plain Rust.

mod alpine;
mod arena;
mod embedded;
mod frames;
mod golden;
mod kernels;
mod moves;
mod parts;
mod press;
mod render_shaders;
mod shaders;
mod sleep;
mod stamp;
mod story;
mod support;
mod times;
mod track;
mod weather;
mod winter;
