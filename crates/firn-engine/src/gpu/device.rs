//! The graphics device: which one is taken, and what has gone wrong with it.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use tracing::warn;

use crate::frame::{DeviceInfo, EngineError};

use super::kernels::{KERNELS, LARGEST_WORKGROUP, PASS_BYTES};
use super::stopwatch::STOPWATCH_FEATURES;

/// Features without which a device can't run the kernels.
pub const REQUIRED_FEATURES: wgpu::Features = wgpu::Features::IMMEDIATES;

/// The least limits with which a device can run the kernels. Larger ones of
/// `max_storage_buffer_binding_size` and `max_buffer_size` mean fewer, larger pages of cells.
pub fn required_limits() -> wgpu::Limits {
    wgpu::Limits {
        max_storage_buffers_per_shader_stage: most_storage_buffers(),
        max_immediate_size: PASS_BYTES,
        max_compute_invocations_per_workgroup: LARGEST_WORKGROUP,
        max_compute_workgroup_size_x: LARGEST_WORKGROUP,
        ..wgpu::Limits::default()
    }
}

/// What a device is for.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    /// To step snowpacks.
    Step,
    /// To draw pictures.
    Draw,
}

/// The first failure of a device. Clones share it.
///
/// A program that lends its device to Firn keeps its own callbacks for errors and for the loss of the device.
/// They can note a failure here; the backend's next call then returns it.
#[derive(Clone, Debug, Default)]
pub struct Failures(Arc<Mutex<Option<String>>>);

impl Failures {
    /// Notes a failure, where it is the first.
    pub fn note(&self, what: impl Into<String>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| what.into());
    }

    fn first(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Until this is dropped, errors of this thread's calls to the device go to its [`Failures`], not to its
/// owner's callback.
#[must_use]
#[derive(Debug)]
pub struct Scope {
    failures: Failures,
    scopes: Vec<wgpu::ErrorScopeGuard>,
}

impl Drop for Scope {
    fn drop(&mut self) {
        // The innermost first. Errors are known when a call returns, so there is nothing to wait for.
        while let Some(scope) = self.scopes.pop() {
            if let Some(error) = pollster::block_on(scope.pop()) {
                self.failures.note(error.to_string());
            }
        }
    }
}

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
    failures: Failures,
}

impl Device {
    /// Opens the best adapter: discrete before integrated, virtual and software ones.
    ///
    /// # Errors
    /// [`EngineError::NoAdapter`] where none can run the kernels.
    pub fn open(purpose: Purpose) -> Result<Device, EngineError> {
        // One at a time: with two threads opening devices at once, NVIDIA's driver was seen to hang.
        static OPENING: Mutex<()> = Mutex::new(());
        let _turn = OPENING.lock().unwrap_or_else(PoisonError::into_inner);
        let instance = instance(purpose);
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
            required_features: REQUIRED_FEATURES | (features & STOPWATCH_FEATURES),
            ..Default::default()
        }))
        .map_err(|error| error.to_string())?;
        let device = Device::around(device, queue);
        let failures = device.failures();
        device.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            failures.note(error.to_string());
        }));
        let failures = device.failures();
        device.device.set_device_lost_callback(move |reason, message| {
            // A device that we drop ourselves is lost as well; nobody is left to ask then.
            failures.note(format!("the device was lost ({reason:?}): {message}"));
        });
        Ok(device)
    }

    /// A device that belongs to somebody else, who keeps its callbacks.
    ///
    /// # Errors
    /// [`EngineError::NoAdapter`] where it can't run the kernels.
    pub fn of(device: wgpu::Device, queue: wgpu::Queue) -> Result<Device, EngineError> {
        suffices(&device.limits(), device.features()).map_err(|reason| {
            EngineError::NoAdapter(format!(
                "the device was not opened with what it takes: {reason}"
            ))
        })?;
        Ok(Device::around(device, queue))
    }

    fn around(device: wgpu::Device, queue: wgpu::Queue) -> Device {
        let adapter = device.adapter_info();
        let info = DeviceInfo {
            adapter: adapter.name.clone(),
            backend: adapter.backend.to_str().to_owned(),
        };
        Device { device, queue, info, adapter, failures: Failures::default() }
    }

    /// Where failures are noted.
    pub fn failures(&self) -> Failures {
        self.failures.clone()
    }

    /// Notes what goes wrong with this thread's calls until the scope is dropped.
    pub fn scope(&self) -> Scope {
        let filters = [
            wgpu::ErrorFilter::Internal,
            wgpu::ErrorFilter::OutOfMemory,
            wgpu::ErrorFilter::Validation,
        ];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter)).into();
        Scope { failures: self.failures.clone(), scopes }
    }

    /// What has gone wrong, if anything has.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`] with the first thing.
    pub fn check(&self) -> Result<(), EngineError> {
        self.failures.first().map_or(Ok(()), |what| Err(EngineError::DeviceFailed(what)))
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

/// The process's Vulkan instance for a purpose. It is never dropped: a driver leaves destructors behind in every
/// thread that has called it, and must not be unloaded before those threads have ended.
///
/// There is one instance for each purpose. A software driver starts its threads once for each instance, at the
/// priority of the thread that opens its first device. With one instance for both, drawing would run at the
/// priority of stepping.
fn instance(purpose: Purpose) -> &'static wgpu::Instance {
    static STEP: OnceLock<wgpu::Instance> = OnceLock::new();
    static DRAW: OnceLock<wgpu::Instance> = OnceLock::new();
    let instance = match purpose {
        Purpose::Step => &STEP,
        Purpose::Draw => &DRAW,
    };
    instance.get_or_init(|| {
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
        let enough = required_limits();
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
