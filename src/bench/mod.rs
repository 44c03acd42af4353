//! `firn bench`: what snow costs on a device, through the engine that serves it, beside the layout
//! that it replaces.

mod bandwidth;
mod case;
mod crowd;
mod field;
mod frames;
mod host;
mod objects;
mod report;
mod single;
mod snowfall;
mod spread;
mod stamps;
mod thesis;
mod weather;

use firn_engine::frame::EngineError;
use firn_engine::gpu::device::{Device, Purpose};

use crate::config::BackendChoice;
use crate::session::SessionError;

pub use case::{Case, Target};
pub use frames::Parts;
pub use report::{Clock, CopyRate, DeviceFacts, Measured, Report};
pub use spread::Spread;

use bandwidth::copy_rate;

/// What is measured.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The cases, in any order; all of them where there are none.
    pub cases: Vec<Case>,
    /// Part of the columns of large worlds and of the number of sessions, above 0 and up to 1.
    pub scale: f64,
    /// How often each thing is measured, at least once.
    pub samples: u32,
    /// What computes.
    pub backend: BackendChoice,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The device failed, or does not hold what is asked for.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A session could not be made or changed.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The operating system refused threads.
    #[error("starting threads: {0}")]
    Threads(#[from] std::io::Error),
    /// A case did not come to its end.
    #[error("case '{case}': {what}")]
    Stuck {
        /// The case.
        case: &'static str,
        /// What did not happen.
        what: String,
    },
}

impl Plan {
    fn wants(&self, case: Case) -> bool {
        self.cases.is_empty() || self.cases.contains(&case)
    }

    fn wants_any(&self, cases: &[Case]) -> bool {
        cases.iter().any(|&case| self.wants(case))
    }

    /// Columns along each side of a square world that has `side` of them at full scale.
    fn side(&self, side: u32) -> u32 {
        ((f64::from(side) * self.scale.sqrt()).round() as u32).max(8)
    }

    /// Sessions of a crowd that has `count` of them at full scale.
    fn count(&self, count: u32) -> u32 {
        ((f64::from(count) * self.scale).round() as u32).max(2)
    }
}

/// Measures the cases one after another; `observe` is told what is being done.
///
/// # Errors
/// [`BenchError`]; what was measured before is lost.
pub fn run(plan: &Plan, observe: &mut dyn FnMut(&str)) -> Result<Report, BenchError> {
    observe("opening the device");
    let device = match plan.backend {
        BackendChoice::Cpu => None,
        BackendChoice::Gpu => Some(Device::open(Purpose::Step)?),
        BackendChoice::Auto => match Device::open(Purpose::Step) {
            Err(EngineError::NoAdapter(_)) => None,
            opened => Some(opened?),
        },
    };
    observe("copying a large buffer");
    let facts = DeviceFacts::new(device.as_ref(), copy_rate(device.as_ref(), plan)?);
    let mut report = Report::new(plan, facts);
    field::measure(plan, device.as_ref(), &mut report, observe)?;
    let on_gpu = device.is_some();
    if let Some(device) = device {
        thesis::measure(plan, &device, &mut report, observe)?;
    }
    single::measure(plan, &mut report, observe)?;
    snowfall::measure(plan, &mut report, observe)?;
    objects::measure(plan, &mut report, observe)?;
    stamps::measure(plan, &mut report, observe)?;
    weather::measure(plan, on_gpu, &mut report, observe)?;
    crowd::measure(plan, &mut report, observe)?;
    report.compare();
    Ok(report)
}
