//! Thousands of snowpacks on one device, stepped in frames.
//!
//! A frame is plain data: for each snowpack its edits, a number of cycles, and what is to be reported. Two
//! backends carry frames out, to the same bits: [`gpu::GpuBackend`] with all snowpacks in one arena on a
//! graphics device, and [`cpu::CpuBackend`] with those of [`firn_snow`]. A program that has a device of its
//! own, as a game does, shares it by [`gpu::GpuBackend::with_device`]; the example `embedded` does.
//!
//! ```
//! use std::time::Duration;
//!
//! use firn_engine::cpu::CpuBackend;
//! use firn_engine::frame::{Backend, Deposit, Edit, Frame, Layout, Run, Work};
//! use firn_snow::{CELL, ColumnRect, Grid, MASS_QUANTA, Material};
//!
//! let grid = Grid { width: 16, depth: 8, height: 10, cell_size: 0.2 };
//! let mut backend = CpuBackend::new(None, false);
//! backend.create(0, &Layout { grid, material: Material::default(), ground: Default::default(), surface: None })?;
//!
//! // 40 cm of snow of 50 kg/m³ on the first tile, and a second of time.
//! let snowfall = Edit::Deposit(Deposit {
//!     columns: ColumnRect { x0: 0, z0: 0, x1: 8, z1: 8 },
//!     depth: 2 * CELL,
//!     mass: (0.4 * 50.0 * MASS_QUANTA) as u32,
//!     temperature: -5.0,
//! });
//! let run = Run { cycles: 60, dt: 1.0 / 60.0 };
//! let work = Work { slot: 0, edits: vec![snowfall], run, publish: true, ..Work::default() };
//! backend.submit(Frame { work: vec![work] })?;
//!
//! let outcome = backend.poll(Duration::from_secs(10))?.expect("the frame has ended");
//! for (tile, heights) in outcome.published.tiles(outcome.work[0].tiles.clone()) {
//!     println!("tile {tile}: {:.2} m in its first column", grid.metres(heights[0].into()));
//! }
//! # Ok::<(), firn_engine::frame::EngineError>(())
//! ```

pub use {firn_snow, wgpu};

pub mod cpu;
pub mod frame;
pub mod gpu;
pub mod made;
pub mod parallel;
pub mod published;
pub mod reserve;
