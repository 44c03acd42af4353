//! A program that has a graphics device of its own, for drawing, and lets it snow on the same.
//!
//! ```sh
//! cargo run --release -p firn-engine --example embedded
//! ```
//!
//! It prints the surface from the side after each second, as a post pushes its way into fresh snow.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use firn_engine::frame::{Backend, Deposit, Edit, Frame, Layout, Placement, Run, Work};
use firn_engine::gpu::{GpuBackend, REQUIRED_FEATURES, required_limits};
use firn_engine::published::TileColumns;
use firn_snow::{
    Body, CELL, ColumnRect, Grid, MASS_QUANTA, Material, Position, Shape, TILE_COLUMNS,
};

/// Longest time that a frame may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// Cycles of a second.
const CYCLES: u32 = 60;

fn main() -> Result<(), Box<dyn Error>> {
    let (device, queue) = pollster::block_on(open())?;
    let mut backend = GpuBackend::with_device(device.clone(), queue, None)?;
    // The device's callbacks stay ours; the engine hears of its loss through us.
    let failures = backend.failures();
    device.set_device_lost_callback(move |_, why| failures.note(why));

    let grid = Grid { width: 32, depth: 8, height: 20, cell_size: 0.2 };
    let material = Material::default();
    backend.create(0, &Layout { grid, material, ground: Default::default(), surface: None })?;
    let mut surface: Vec<TileColumns> = vec![[0; TILE_COLUMNS as usize]; grid.tiles() as usize];

    let everywhere = ColumnRect { x0: 0, z0: 0, x1: grid.width, z1: grid.depth };
    let metre = (1.0 / grid.cell_size * f64::from(CELL)) as u32;
    let snowfall = Edit::Deposit(Deposit {
        columns: everywhere,
        depth: metre,
        mass: (material.fresh_density * MASS_QUANTA) as u32,
        temperature: -5.0,
    });
    let shape = Shape::Box { width: 1.2, depth: 1.2 };
    let position = Position { x: 3.2, z: 0.8 };
    let post = Body { mass: 200.0, shape: Some(shape), position, ..Body::default() };
    let footprints = post.on(&grid).ok_or("the post is off the grid")?;
    let (mass, cover) = (post.load(), post.cover());
    let post = Arc::new(Placement { mass, cover, footprints });
    let mut edits =
        vec![snowfall, Edit::PutCollider { id: Arc::from("post"), collider: post, placed: true }];
    for second in 1..=5 {
        let run = Run { cycles: CYCLES, dt: 1.0 / f64::from(CYCLES) };
        let edits = std::mem::take(&mut edits);
        let work = Work { slot: 0, edits, run, publish: true, ..Work::default() };
        backend.submit(Frame { work: vec![work] })?;
        let outcome = backend.poll(PATIENCE)?.ok_or("the frame did not end")?;
        for (tile, heights) in outcome.published.tiles(outcome.work[0].tiles.clone()) {
            surface[tile as usize] = *heights;
        }
        println!("after {second} s{}", drawn(&surface, &grid));
    }
    Ok(())
}

/// Opens a device as a game would, with what the engine needs beside.
async fn open() -> Result<(wgpu::Device, wgpu::Queue), Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("game"),
        required_features: REQUIRED_FEATURES,
        required_limits: required_limits(),
        ..Default::default()
    };
    Ok(adapter.request_device(&descriptor).await?)
}

/// The middle row of columns from the side: a line of text for each tenth of a metre.
fn drawn(surface: &[TileColumns], grid: &Grid) -> String {
    let z = grid.depth / 2;
    let heights: Vec<f64> = (0..grid.width)
        .map(|x| {
            let (tile, column) = grid.locate(x, z);
            grid.metres(u64::from(surface[tile as usize][column as usize]))
        })
        .collect();
    let mut text = String::new();
    for level in (0..11).rev() {
        text.push('\n');
        let from = f64::from(level) * 0.1;
        text.extend(heights.iter().map(|&height| if height > from { '#' } else { ' ' }));
    }
    text
}
