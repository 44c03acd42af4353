//! What a frame left on the device, copied out without ever blocking the frame itself.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use firn_snow::TILE_COLUMNS;

use crate::frame::{EngineError, Outcome, TileCells};
use crate::published::Published;

use super::arena::Arena;
use super::buffer::Table;
use super::device::Device;
use super::mapped::Mapped;
use super::report::{Awake, Copies, Reader, Reports, WantedTile};
use super::results::Section;
use super::survey::Totals;
use super::tables::{PACKED_BYTES, Tables};

/// Packed tiles that are copied before it is known how many there are, at the least.
const FEWEST_PACKED: u64 = 256;

/// Bytes of cells that are copied out at a time.
const CELLS_AT_ONCE: u64 = 64 << 20;

/// Time for which a quick device is asked again and again, before the host goes to sleep.
const WATCHFUL: Duration = Duration::from_millis(1);

/// How a mapping stands.
const WAITING: u8 = 0;
const MAPPED: u8 = 1;
const FAILED: u8 = 2;

/// A frame on its way back.
#[derive(Debug)]
struct Flight {
    copies: Copies,
    reports: Reports,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    mapping: Arc<AtomicU8>,
}

/// The buffer that results are read from, one frame at a time.
#[derive(Debug)]
pub struct Readback {
    table: Table,
    /// Alive while an outcome still reads the buffer.
    reader: Arc<()>,
    planned: Option<(Copies, u64)>,
    flight: Option<Flight>,
    /// Packed tiles that the last publication had.
    last_packed: u64,
}

impl Readback {
    /// Nothing on its way.
    pub fn new(device: &Device) -> Readback {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Readback {
            table: Table::new(&device.device, "readback", usage, 0),
            reader: Arc::default(),
            planned: None,
            flight: None,
            last_packed: 0,
        }
    }

    /// Whether no frame is on its way.
    pub fn is_idle(&self) -> bool {
        self.flight.is_none()
    }

    /// Makes room for bytes in a buffer that nobody reads.
    fn reserve(&mut self, device: &Device, bytes: u64) {
        if Arc::strong_count(&self.reader) > 1 {
            self.table.replace(&device.device);
            self.reader = Arc::default();
        }
        self.table.reserve(&device.device, bytes);
    }

    /// Encodes the copies out of a frame's results, after which those are cleared.
    pub fn copy(
        &mut self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        tables: &Tables,
        totals: Totals,
    ) {
        // Publications are much alike: what the last one needed is mostly enough.
        let copies = Copies::new(totals, tables, (2 * self.last_packed).max(FEWEST_PACKED));
        let bytes = copies.sources(tables).map(|(_, bytes)| bytes.end - bytes.start).sum();
        self.reserve(device, bytes);
        let target = self.table.buffer();
        let mut offset = 0;
        for (source, Range { start, end }) in copies.sources(tables) {
            encoder.copy_buffer_to_buffer(source, start, target, offset, end - start);
            offset += end - start;
        }
        tables.results.clear(encoder, &copies.results);
        self.planned = Some((copies, bytes));
    }

    /// Maps the results of a frame that has been submitted.
    pub fn begin(&mut self, submission: wgpu::SubmissionIndex, reports: Reports) {
        let Some((copies, bytes)) = self.planned.take() else { return };
        let mapping = map(self.table.buffer(), bytes);
        self.flight = Some(Flight { copies, reports, bytes, submission, mapping });
    }

    /// The outcome of the frame on its way, and which tiles are awake of large snowpacks that publish, if it
    /// arrives within `patience`.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    pub fn fetch(
        &mut self,
        device: &Device,
        arena: &Arena,
        tables: &Tables,
        patience: Duration,
    ) -> Result<Option<(Outcome, Vec<Awake>)>, EngineError> {
        let Some(flight) = &self.flight else { return Ok(None) };
        wait(device, &flight.submission, &flight.mapping, patience)?;
        match flight.mapping.load(Ordering::Acquire) {
            WAITING => return Ok(None),
            MAPPED => {}
            _ => return Err(unreadable()),
        }
        let Some(flight) = self.flight.take() else { return Ok(None) };
        let Flight { copies, reports, .. } = &flight;
        let mut mapped = self.mapped(flight.bytes)?;
        let (mut outcome, groups, packed, awake) = copies.outcome(reports, mapped.bytes());
        if copies.packable > 0 {
            self.last_packed = packed;
        }
        let mut first = copies.results.place(Section::Packed).start;
        if packed > copies.packed {
            drop(mapped);
            mapped = self.fetch_packed(device, tables, packed)?;
            first = 0;
        }
        if packed > 0 {
            mapped.keep(first..first + (packed * PACKED_BYTES) as usize);
            outcome.published = Published::new(copies.groups.start, groups, Box::new(mapped));
        } else {
            drop(mapped);
        }
        let mut cells = self.fetch_cells(device, arena, &reports.cells)?.into_iter();
        for (work, wanted) in outcome.work.iter_mut().zip(&reports.work) {
            work.gathered = cells.by_ref().take(wanted.gathered).collect();
        }
        Ok(Some((outcome, awake)))
    }

    /// The bytes that have been mapped.
    fn mapped(&self, bytes: u64) -> Result<Mapped, EngineError> {
        Mapped::new(self.table.buffer(), bytes, self.reader.clone())
    }

    /// Fetches the cells of tiles, in portions; nothing has changed them since the frame.
    fn fetch_cells(
        &mut self,
        device: &Device,
        arena: &Arena,
        wanted: &[WantedTile],
    ) -> Result<Vec<TileCells>, EngineError> {
        let mut found = Vec::with_capacity(wanted.len());
        let mut left = wanted;
        while let Some(first) = left.first() {
            let (rows, plane) = (first.rows(), cells_bytes(first.rows()));
            let most = (CELLS_AT_ONCE / (4 * plane)).max(1) as usize;
            // Tiles of one snowpack are equally high; another's may be higher.
            let alike = left.iter().take(most).take_while(|tile| tile.rows() == rows).count();
            let (portion, rest) = left.split_at(alike);
            left = rest;
            let bytes = plane * 4 * portion.len() as u64;
            self.reserve(device, bytes);
            let mut encoder = device.device.create_command_encoder(&Default::default());
            let mut offset = 0;
            for WantedTile { place, .. } in portion {
                let page = arena.pages.get(place.page).ok_or_else(unreadable)?;
                let first = u64::from(place.row) * u64::from(TILE_COLUMNS) * 4;
                for cells in &page.cells {
                    let target = self.table.buffer();
                    encoder.copy_buffer_to_buffer(cells, first, target, offset, plane);
                    offset += plane;
                }
            }
            let mapped = self.fetch_now(device, encoder, bytes)?;
            let mut reader = Reader(mapped.bytes());
            found.extend(portion.iter().map(|tile| tile.read(&mut reader)));
        }
        Ok(found)
    }

    /// Submits copies into the buffer, and waits for them.
    fn fetch_now(
        &self,
        device: &Device,
        encoder: wgpu::CommandEncoder,
        bytes: u64,
    ) -> Result<Mapped, EngineError> {
        let scope = device.scope();
        let submission = device.queue.submit([encoder.finish()]);
        let mapping = map(self.table.buffer(), bytes);
        drop(scope);
        while mapping.load(Ordering::Acquire) == WAITING {
            wait(device, &submission, &mapping, Duration::from_millis(100))?;
            device.check()?;
        }
        if mapping.load(Ordering::Acquire) == FAILED {
            return Err(unreadable());
        }
        self.mapped(bytes)
    }

    /// Fetches packed tiles that were more than expected; they are still there.
    fn fetch_packed(
        &mut self,
        device: &Device,
        tables: &Tables,
        count: u64,
    ) -> Result<Mapped, EngineError> {
        let bytes = count * PACKED_BYTES;
        self.reserve(device, bytes);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let target = self.table.buffer();
        let (source, first) = (tables.results.buffer(), tables.results.start(Section::Packed));
        encoder.copy_buffer_to_buffer(source, first, target, 0, bytes);
        self.fetch_now(device, encoder, bytes)
    }
}

/// Bytes of one of the four arrays of a tile's cells.
fn cells_bytes(height: u32) -> u64 {
    u64::from(height) * u64::from(TILE_COLUMNS) * 4
}

fn unreadable() -> EngineError {
    EngineError::DeviceFailed("results could not be read back".to_owned())
}

fn map(buffer: &wgpu::Buffer, bytes: u64) -> Arc<AtomicU8> {
    let mapping = Arc::new(AtomicU8::new(WAITING));
    let done = mapping.clone();
    buffer.slice(..bytes).map_async(wgpu::MapMode::Read, move |result| {
        done.store(if result.is_ok() { MAPPED } else { FAILED }, Ordering::Release);
    });
    mapping
}

/// Lets the device call back until the mapping stands, for no longer than `patience`.
fn wait(
    device: &Device,
    submission: &wgpu::SubmissionIndex,
    mapping: &AtomicU8,
    patience: Duration,
) -> Result<(), EngineError> {
    let failed = |error: wgpu::PollError| EngineError::DeviceFailed(error.to_string());
    if device.is_quick() {
        // Waking up takes longer than a short frame.
        let begun = Instant::now();
        while begun.elapsed() < WATCHFUL.min(patience) {
            device.device.poll(wgpu::PollType::Poll).map_err(failed)?;
            if mapping.load(Ordering::Acquire) != WAITING {
                return Ok(());
            }
            std::thread::yield_now();
        }
    }
    let poll = wgpu::PollType::Wait {
        submission_index: Some(submission.clone()),
        timeout: Some(patience),
    };
    match device.device.poll(poll) {
        Ok(_) | Err(wgpu::PollError::Timeout) => Ok(()),
        Err(error) => Err(failed(error)),
    }
}
