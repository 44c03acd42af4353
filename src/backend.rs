//! The backend that the options ask for.

use firn_engine::cpu::CpuBackend;
use firn_engine::frame::{Backend, EngineError};
use firn_engine::gpu::GpuBackend;
use tracing::warn;

use crate::config::{BackendChoice, EngineConfig};

/// Of so many frames the stages of one are timed on the device: about one a second. It divides
/// neither the publications' beat nor the usual tick rates', so that each kind of frame has its turn.
const TIMED_FRAME: u32 = 61;

/// Opens what the snowpacks will live on.
///
/// # Errors
/// Where there is no adapter and `auto` was not asked for, or the adapter can't be used.
pub fn open(config: &EngineConfig) -> Result<Box<dyn Backend + Send>, EngineError> {
    let on_cpu = || Box::new(CpuBackend::new(config.device_memory, false));
    if config.backend == BackendChoice::Cpu {
        return Ok(on_cpu());
    }
    match GpuBackend::new(config.device_memory, false) {
        Ok(mut backend) => {
            backend.take_times_of_one_in(TIMED_FRAME);
            Ok(Box::new(backend))
        }
        Err(EngineError::NoAdapter(why)) if config.backend == BackendChoice::Auto => {
            warn!("no usable graphics adapter ({why}); computing on the CPU");
            Ok(on_cpu())
        }
        Err(EngineError::NoAdapter(why)) => {
            Err(EngineError::NoAdapter(format!("{why}; or compute on the CPU with --backend cpu")))
        }
        Err(error) => Err(error),
    }
}
