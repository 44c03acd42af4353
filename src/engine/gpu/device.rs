//! The graphics device: which one is taken, and what has gone wrong with it.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use tracing::warn;

use crate::engine::frame::{DeviceInfo, EngineError};

use super::kernels::{KERNELS, LARGEST_WORKGROUP, PASS_BYTES};
use super::stopwatch::STOPWATCH_FEATURES;

/// A device, its queue, and the first thing that went wrong with it.
#[derive(Debug)]
pub struct Device {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Name and interface of the adapter.
    pub info: DeviceInfo,
    /// Everything that the adapter says of itself.
    pub adapter: wgpu::AdapterInfo,
    failure: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens the best adapter: discrete before integrated, virtual and software ones.
    ///
    /// # Errors
    /// [`EngineError::NoAdapter`] where none can run the kernels.
    pub fn open() -> Result<Device, EngineError> {
        let instance = instance();
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
        let mut reasons = Vec::new();
        for adapter in adapters {
            match Device::from_adapter(&adapter) {
                Ok(device) => return Ok(device),
                Err(reason) => {
                    let name = adapter.get_info().name;
                    warn!(adapter = name, "passed over: {reason}");
                    reasons.push(format!("{name}: {reason}"));
                }
            }
        }
        Err(EngineError::NoAdapter(if reasons.is_empty() {
            "no Vulkan, Metal or DirectX 12 driver was found; on Debian and Ubuntu the packages \
             'libvulkan1 mesa-vulkan-drivers' hold one that needs no hardware"
                .to_owned()
        } else {
            reasons.join("; ")
        }))
    }

    fn from_adapter(adapter: &wgpu::Adapter) -> Result<Device, String> {
        let (limits, features) = (adapter.limits(), adapter.features());
        suffices(&limits, features)?;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("firn"),
            required_limits: limits,
            required_features: wgpu::Features::IMMEDIATES | (features & STOPWATCH_FEATURES),
            ..Default::default()
        }))
        .map_err(|error| error.to_string())?;
        let info = adapter.get_info();
        let failure = Arc::new(Mutex::new(None));
        let note = |failure: &Arc<Mutex<Option<String>>>| {
            let failure = failure.clone();
            move |what: String| {
                failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(what);
            }
        };
        let uncaptured = note(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            uncaptured(error.to_string());
        }));
        let lost = note(&failure);
        device.set_device_lost_callback(move |reason, message| {
            // A device that we drop ourselves is lost as well; nobody is left to ask then.
            lost(format!("the device was lost ({reason:?}): {message}"));
        });
        Ok(Device {
            device,
            queue,
            info: DeviceInfo {
                adapter: info.name.clone(),
                backend: info.backend.to_str().to_owned(),
            },
            adapter: info,
            failure,
        })
    }

    /// What has gone wrong outside of an error scope, if anything has.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`] with the first thing.
    pub fn check(&self) -> Result<(), EngineError> {
        match &*self.failure.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(what) => Err(EngineError::DeviceFailed(what.clone())),
        }
    }

    /// Makes buffers; says so where the device's memory doesn't hold them.
    ///
    /// # Errors
    /// [`EngineError::OutOfMemory`]; what was made is to be dropped then.
    pub fn allocate<T>(&self, make: impl FnOnce() -> T) -> Result<T, EngineError> {
        // A size over a limit arrives as a validation error.
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        let memory = pollster::block_on(memory.pop());
        let validation = pollster::block_on(validation.pop());
        match memory.or(validation) {
            None => Ok(made),
            Some(error) => Err(EngineError::OutOfMemory(error.to_string())),
        }
    }

    /// Largest buffer in bytes that a kernel can bind.
    pub fn largest_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// Whether frames are short enough to be waited for without going to sleep: a device of its
    /// own leaves the host's processors alone meanwhile.
    pub fn is_quick(&self) -> bool {
        !matches!(self.adapter.device_type, wgpu::DeviceType::Cpu | wgpu::DeviceType::Other)
    }

    /// Workgroups along x and y for a number of them in all.
    pub fn groups(&self, count: u32) -> (u32, u32) {
        let most = self.device.limits().max_compute_workgroups_per_dimension;
        if count <= most { (count, 1) } else { (most, count.div_ceil(most)) }
    }
}

/// The process's one way to its drivers, never given up: a driver leaves destructors behind in every
/// thread that has called it, and must not be unloaded before those threads have ended.
fn instance() -> &'static wgpu::Instance {
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    INSTANCE.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::PRIMARY;
        // Indirect arguments come from our own kernel: no need to check them at every dispatch.
        descriptor.flags = wgpu::InstanceFlags::default()
            .difference(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        wgpu::Instance::new(descriptor)
    })
}

fn rank(device_type: wgpu::DeviceType) -> u32 {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Cpu => 3,
        wgpu::DeviceType::Other => 4,
    }
}

/// Whether the kernels run within some limits, and why not.
fn suffices(limits: &wgpu::Limits, features: wgpu::Features) -> Result<(), String> {
    let immediates = match features.contains(wgpu::Features::IMMEDIATES) {
        true => limits.max_immediate_size,
        false => 0,
    };
    let threads =
        limits.max_compute_invocations_per_workgroup.min(limits.max_compute_workgroup_size_x);
    for (what, most, needed) in [
        (
            "storage buffers bound at a time",
            limits.max_storage_buffers_per_shader_stage,
            most_storage_buffers(),
        ),
        ("bytes of immediates", immediates, PASS_BYTES),
        ("threads in a workgroup", threads, LARGEST_WORKGROUP),
    ] {
        if most < needed {
            return Err(format!("it takes {most} {what}; {needed} are needed"));
        }
    }
    Ok(())
}

/// Most storage buffers that a kernel binds.
fn most_storage_buffers() -> u32 {
    KERNELS.iter().map(|kernel| kernel.bindings.len() as u32).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_that_can_not_run_the_kernels_is_passed_over_with_a_reason() {
        let enough = wgpu::Limits {
            max_storage_buffers_per_shader_stage: most_storage_buffers(),
            max_immediate_size: PASS_BYTES,
            max_compute_invocations_per_workgroup: LARGEST_WORKGROUP,
            max_compute_workgroup_size_x: LARGEST_WORKGROUP,
            ..wgpu::Limits::default()
        };
        assert_eq!(suffices(&enough, wgpu::Features::IMMEDIATES), Ok(()));
        let reason = |limits: wgpu::Limits, features| suffices(&limits, features).unwrap_err();
        let immediates = reason(enough.clone(), wgpu::Features::empty());
        assert!(immediates.contains("0 bytes of immediates"), "{immediates}");
        let small = wgpu::Limits { max_compute_workgroup_size_x: 128, ..enough.clone() };
        let threads = reason(small, wgpu::Features::IMMEDIATES);
        assert!(threads.contains("128 threads") && threads.contains("256"), "{threads}");
        let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..enough };
        assert!(reason(few, wgpu::Features::IMMEDIATES).contains("4 storage buffers"));
    }
}
