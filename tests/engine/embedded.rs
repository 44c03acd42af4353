//! The engine on a device that belongs to somebody else.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use firn_engine::frame::{Backend, EngineError, Frame, Layout, Work};
use firn_engine::gpu::device::Device;
use firn_engine::gpu::{GpuBackend, REQUIRED_FEATURES, required_limits};
use firn_snow::{Grid, Material};

use crate::support::{self, cells, edit, run};

/// A device as a game opens it, and whether its owner has been told of an error.
fn device(
    features: wgpu::Features,
    limits: wgpu::Limits,
) -> (wgpu::Device, wgpu::Queue, Arc<AtomicBool>) {
    // A driver must not be unloaded before the threads that have called it have ended.
    static INSTANCE: LazyLock<wgpu::Instance> = LazyLock::new(|| {
        wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle())
    });
    let instance = &*INSTANCE;
    let opening = async {
        let adapter = instance.request_adapter(&Default::default()).await.expect("an adapter");
        let descriptor = wgpu::DeviceDescriptor {
            required_features: features,
            required_limits: limits,
            ..Default::default()
        };
        adapter.request_device(&descriptor).await.expect("a device")
    };
    let (device, queue) = pollster::block_on(opening);
    let told = Arc::new(AtomicBool::new(false));
    let tell = told.clone();
    device.on_uncaptured_error(Arc::new(move |_| tell.store(true, Ordering::Relaxed)));
    (device, queue, told)
}

fn layout() -> Layout {
    let grid = Grid { width: 24, depth: 16, height: 12, cell_size: 0.2 };
    Layout { grid, material: Material::default(), ground: Default::default(), surface: None }
}

#[test]
fn snow_on_a_borrowed_device_is_the_same() {
    let Some(mut own) = support::gpu(false) else { return };
    let (device, queue, told) = device(REQUIRED_FEATURES, required_limits());
    let mut borrowed = GpuBackend::with_device(device, queue, None).unwrap();
    let layout = layout();
    let after = |backend: &mut dyn Backend| {
        backend.create(0, &layout).unwrap();
        edit(backend, 0, vec![support::snow(&layout.grid, layout.grid.all(), 1.0, 20.0, -5.0)]);
        run(backend, 0, 120, 1.0 / 60.0);
        cells(backend, 0, &layout.grid)
    };
    assert!(after(&mut own) == after(&mut borrowed), "the cells differ");
    assert!(!told.load(Ordering::Relaxed), "the owner is told of an error");
}

#[test]
fn the_owner_keeps_its_callbacks_and_hears_nothing_of_our_errors() {
    let Some(_) = support::gpu(false) else { return };
    let (device, queue, told) = device(REQUIRED_FEATURES, required_limits());
    let mut backend = GpuBackend::with_device(device.clone(), queue.clone(), None).unwrap();
    backend.create(0, &layout()).unwrap();
    backend.failures().note("the game has lost its device");
    let error = backend.submit(Frame { work: vec![Work::default()] }).unwrap_err();
    assert!(error.to_string().contains("the game has lost its device"), "{error}");

    let size = device.limits().max_buffer_size + 1;
    let usage = wgpu::BufferUsages::UNIFORM;
    let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
    let ours = Device::of(device.clone(), queue).unwrap();
    let scope = ours.scope();
    drop(device.create_buffer(&descriptor));
    drop(scope);
    assert!(ours.check().is_err(), "an error of ours is lost");
    assert!(!told.load(Ordering::Relaxed), "the owner is told of an error of ours");
    // An error of its own still reaches it.
    drop(device.create_buffer(&descriptor));
    assert!(told.load(Ordering::Relaxed), "the owner's callback is gone");
}

#[test]
fn a_device_that_was_opened_with_less_is_refused() {
    let Some(_) = support::gpu(false) else { return };
    let limits = wgpu::Limits { max_immediate_size: 0, ..required_limits() };
    let (device, queue, _) = device(wgpu::Features::empty(), limits);
    match GpuBackend::with_device(device, queue, None).map(drop).unwrap_err() {
        EngineError::NoAdapter(why) => assert!(why.contains("immediates"), "{why}"),
        other => panic!("{other}"),
    }
}
