//! What came of the measurements, for people and for programs.

use std::fmt;

use firn_engine::gpu::device::Device;
use firn_engine::gpu::stopwatch::STOPWATCH_FEATURES;
use serde::Serialize;

use super::Plan;
use super::case::{Case, Quantity, Target};
use super::frames::Parts;
use super::spread::Spread;

/// Bytes that a cell of Firn's moves where it changes: mass, thickness, temperature and stress are
/// read, thickness is written.
pub(super) const CELL_BYTES: u64 = 20;

/// Bytes that a cell moves which is looked at and does not change.
pub(super) const UNCHANGED_CELL_BYTES: u64 = 16;

/// What came of the measurements.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of Firn.
    pub firn: &'static str,
    /// The device.
    pub device: DeviceFacts,
    /// Part of the full sizes.
    pub scale: f64,
    /// What was measured.
    pub cases: Vec<Measured>,
}

/// What the device is.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceFacts {
    /// Name of the adapter, or `cpu`.
    pub adapter: String,
    /// Graphics interface, or `cpu`.
    pub backend: String,
    /// What kind of device it is.
    pub kind: String,
    /// Name of its driver.
    pub driver: String,
    /// Version of its driver.
    pub driver_version: String,
    /// Whether it takes times itself.
    pub timestamps: bool,
    /// Largest buffer that a kernel binds \[bytes\].
    pub largest_binding: u64,
    /// Most workgroups along one side of a dispatch.
    pub workgroups_per_dimension: u32,
    /// Logical processors of the host.
    pub host_threads: usize,
    /// A large buffer copied in the same run.
    pub copy: CopyRate,
}

/// How fast a large buffer is copied.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CopyRate {
    /// What copied: the device's `command`, a `kernel`, or the `host`.
    pub by: &'static str,
    /// Bytes read and written by one copy, both counted.
    pub bytes: u64,
    /// Time of one copy \[s\].
    pub time_s: Spread,
    /// Bytes per second of the median.
    pub bytes_per_s: f64,
    /// Whose clock it was.
    pub clock: Clock,
}

/// Whose clock a time was taken by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// The device's own.
    Device,
    /// The host's.
    Wall,
}

/// One case.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Which.
    pub case: Case,
    /// Sessions in it.
    pub sessions: u32,
    /// Columns along x and z and slots of each session.
    pub grid: [u32; 3],
    /// Whose clock the times were taken by.
    pub clock: Clock,
    /// Time of one sample \[s\].
    pub time_s: Spread,
    /// What the time of a whole frame was made of \[s\].
    pub parts: Option<Parts>,
    /// Cycles in one sample.
    pub cycles: u64,
    /// Cells with snow, or all cells where the layout stores empty ones too.
    pub cells: u64,
    /// Cells that give way in every counted cycle.
    pub moving_cells: u64,
    /// Bytes of cells that one sample has to move, as the layout has it.
    pub bytes: Option<u64>,
    /// These bytes over the bandwidth of the copy \[s\]: no version is much faster.
    pub floor_s: Option<f64>,
    /// Their rate over that of the copy.
    pub copy_share: Option<f64>,
    /// `moving_cells` times cycles per second.
    pub cell_cycles_per_s: Option<f64>,
    /// Times as long as Firn's own layout takes.
    pub times_slower: Option<f64>,
    /// What is to be reached at full size, where this is that.
    pub target: Option<Target>,
}

impl DeviceFacts {
    pub(super) fn new(device: Option<&Device>, copy: CopyRate) -> DeviceFacts {
        let host_threads = std::thread::available_parallelism().map_or(1, usize::from);
        match device {
            None => DeviceFacts {
                adapter: "cpu".to_owned(),
                backend: "cpu".to_owned(),
                kind: "Cpu".to_owned(),
                driver: String::new(),
                driver_version: String::new(),
                timestamps: false,
                largest_binding: 0,
                workgroups_per_dimension: 0,
                host_threads,
                copy,
            },
            Some(device) => DeviceFacts {
                adapter: device.info.adapter.clone(),
                backend: device.info.backend.clone(),
                kind: format!("{:?}", device.adapter.device_type),
                driver: device.adapter.driver.clone(),
                driver_version: device.adapter.driver_info.clone(),
                timestamps: device.device.features().contains(STOPWATCH_FEATURES),
                largest_binding: device.largest_binding(),
                workgroups_per_dimension: device
                    .device
                    .limits()
                    .max_compute_workgroups_per_dimension,
                host_threads,
                copy,
            },
        }
    }
}

impl Measured {
    /// A case in which no cells are counted.
    pub(super) fn new(
        case: Case,
        sessions: u32,
        grid: [u32; 3],
        clock: Clock,
        time: Spread,
    ) -> Measured {
        Measured {
            case,
            sessions,
            grid,
            clock,
            time_s: time,
            parts: None,
            cycles: 0,
            cells: 0,
            moving_cells: 0,
            bytes: None,
            floor_s: None,
            copy_share: None,
            cell_cycles_per_s: None,
            times_slower: None,
            target: None,
        }
    }

    /// With what one sample worked on. The bytes are those of one pass over the cells.
    pub(super) fn with_work(
        self,
        cells: u64,
        moving_cells: u64,
        cycles: u64,
        bytes: u64,
    ) -> Measured {
        Measured { cells, moving_cells, cycles, bytes: Some(bytes), ..self }
    }
}

/// Bytes of one pass of `compact` over cells, some of which change.
pub(super) fn pass_bytes(cells: u64, moving: u64) -> u64 {
    moving * CELL_BYTES + (cells - moving) * UNCHANGED_CELL_BYTES
}

impl Report {
    pub(super) fn new(plan: &Plan, device: DeviceFacts) -> Report {
        let firn = env!("CARGO_PKG_VERSION");
        Report { firn, device, scale: plan.scale, cases: Vec::new() }
    }

    /// Derives rates, and what is compared, from the times.
    pub(super) fn compare(&mut self) {
        self.cases.sort_by_key(|measured| measured.case);
        let copy = self.device.copy.bytes_per_s;
        let medians: Vec<(Case, f64)> =
            self.cases.iter().map(|measured| (measured.case, measured.time_s.median)).collect();
        for measured in &mut self.cases {
            let median = measured.time_s.median;
            let rate = |bytes: u64| bytes as f64 / median;
            measured.floor_s = measured.bytes.map(|bytes| bytes as f64 / copy);
            measured.copy_share = measured.bytes.map(|bytes| rate(bytes) / copy);
            let cell_cycles = measured.moving_cells * measured.cycles;
            measured.cell_cycles_per_s = (cell_cycles > 0).then(|| rate(cell_cycles));
            let ours = measured.case.ours();
            let ours = medians.iter().find(|(case, _)| Some(*case) == ours);
            measured.times_slower = ours.map(|(_, ours)| median / ours);
            if self.scale < 1.0 {
                continue;
            }
            let goal = measured.case.goal();
            let reached = match goal.0 {
                Quantity::Seconds => Some(median),
                Quantity::CellCyclesPerSecond => measured.cell_cycles_per_s,
                Quantity::CopyShare => Some(rate(measured.cells * CELL_BYTES) / copy),
                Quantity::TimesSlower => measured.times_slower,
            };
            measured.target = reached.map(|reached| Target::new(goal, reached));
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let device = &self.device;
        writeln!(f, "{} ({}, {})", device.adapter, device.backend, device.kind)?;
        if !device.driver.is_empty() {
            writeln!(f, "driver {} {}", device.driver, device.driver_version)?;
        }
        let copy = &device.copy;
        writeln!(
            f,
            "copy {:.1} GB/s by {} ({}, {} bytes moved), {} host threads, scale {}",
            copy.bytes_per_s / 1e9,
            copy.by,
            time(copy.time_s.median),
            copy.bytes,
            device.host_threads,
            self.scale
        )?;
        writeln!(
            f,
            "\n{:<16} {:>10} {:>23} {:>6} {:>10} {:>6} {:>10} {:>9}  target",
            "case", "median", "quartiles", "clock", "floor", "copy", "Gcell-c/s", "slower"
        )?;
        self.cases.iter().try_for_each(|measured| writeln!(f, "{measured}"))
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let spread = &self.time_s;
        let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        let quartiles =
            format!("{} - {}", time(spread.lower_quartile), time(spread.upper_quartile));
        write!(
            f,
            "{:<16} {:>10} {:>23} {:>6} {:>10} {:>6} {:>10} {:>9}",
            self.case.name(),
            time(spread.median),
            quartiles,
            if self.clock == Clock::Device { "device" } else { "wall" },
            or_none(self.floor_s.map(time)),
            or_none(self.copy_share.map(|share| format!("{:.0} %", 100.0 * share))),
            or_none(self.cell_cycles_per_s.map(|rate| format!("{:.2}", rate / 1e9))),
            or_none(self.times_slower.map(|times| format!("{times:.0} x"))),
        )?;
        if let Some(target) = &self.target {
            write!(f, "  {target}")?;
        }
        match &self.parts {
            Some(parts) => write!(f, "\n{:<16} {parts}", ""),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bound = match self.quantity {
            Quantity::Seconds => format!("at most {}", time(self.bound)),
            Quantity::CellCyclesPerSecond => format!("at least {} G/s", self.bound / 1e9),
            Quantity::CopyShare => format!("at least {} % at 20 B a cell", 100.0 * self.bound),
            Quantity::TimesSlower => format!("at least {} x", self.bound),
        };
        write!(f, "{bound}: {}", if self.met { "met" } else { "missed" })
    }
}

/// A time with three digits or so.
pub(super) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{:.1} us", s * 1e6),
        s if s < 1.0 => format!("{:.2} ms", s * 1e3),
        s => format!("{s:.2} s"),
    }
}
