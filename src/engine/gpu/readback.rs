//! What a frame left on the device, copied out without ever blocking the frame itself.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use bytemuck::Pod;
use rayon::prelude::*;

use crate::engine::frame::{EngineError, Outcome, SampleBox, Slot, TileCells, Work, WorkOutcome};
use crate::engine::published::{Group, Published};
use crate::snow::{Sample, TILE_COLUMNS};

use super::arena::{Arena, Place};
use super::buffer::Table;
use super::device::Device;
use super::layout::{self, join};
use super::mapped::Mapped;
use super::resident::Residents;
use super::tables::{PACKED_BYTES, Tables};

/// Packed tiles that are copied before it is known how many there are, at the least.
const FEWEST_PACKED: u64 = 256;

/// Outcomes that one thread takes at the least.
const FEWEST_AT_A_TIME: usize = 256;

/// Bytes of cells that are copied out at a time.
const CELLS_AT_ONCE: u64 = 64 << 20;

/// Time for which a quick device is asked again and again, before the host goes to sleep.
const WATCHFUL: Duration = Duration::from_millis(1);

/// What is copied out, in order.
#[derive(Debug, Default)]
pub struct Copies {
    work: Vec<WorkCopies>,
    edits: u64,
    tallies: u64,
    contacts: u64,
    /// Most tiles that may be packed, and how many are copied at once.
    packable: u64,
    packed: u64,
    /// Groups of tiles that publish.
    groups: Range<u32>,
    cells: Vec<(Place, u32)>,
    samples: u64,
}

/// One snowpack's part of what is copied out.
#[derive(Debug)]
struct WorkCopies {
    slot: Slot,
    /// Its edits, by their numbers in the frame.
    edits: Range<u32>,
    /// Its tiles, where it publishes.
    tiles: Range<u32>,
    contacts: Vec<(Arc<str>, u32)>,
    gathered: usize,
    samples: Vec<Range<u64>>,
}

impl Copies {
    /// What the work of a frame reports; `edits` counts each one's edits, `packable` tiles of some
    /// groups may have changed.
    pub fn new(
        work: &[Work],
        edits: &[u32],
        residents: &Residents,
        tables: &Tables,
        packable: u64,
        groups: Range<u32>,
    ) -> Copies {
        let mut copies = Copies {
            work: Vec::with_capacity(work.len()),
            edits: edits.iter().map(|&count| u64::from(count)).sum(),
            tallies: tables.runs.len() as u64,
            packable,
            groups,
            ..Copies::default()
        };
        let mut number = 0;
        for (work, &edits) in work.iter().zip(edits) {
            let mut contacts = Vec::new();
            let mut tiles = 0..0;
            let reports = work.publish || !work.gather.is_empty();
            if let Some(resident) = residents.get(work.slot).filter(|_| reports) {
                if work.publish {
                    tiles = resident.lot.tiles.clone();
                    contacts.extend(resident.bodies.iter().map(|(id, b)| (id.clone(), b.contact)));
                }
                if !contacts.is_empty() {
                    copies.contacts = u64::from(tables.contact_end());
                }
                let places = work.gather.iter().map(|&tile| resident.lot.places[tile as usize]);
                copies.cells.extend(places.map(|place| (place, resident.lot.height)));
            }
            let mut sample = |wanted: &SampleBox| {
                let first = copies.samples;
                copies.samples += wanted.cells();
                first..copies.samples
            };
            let samples = work.samples.iter().map(&mut sample).collect();
            number += edits;
            copies.work.push(WorkCopies {
                slot: work.slot,
                edits: number - edits..number,
                tiles,
                contacts,
                gathered: work.gather.len(),
                samples,
            });
        }
        copies
    }
}

/// How a mapping stands.
const WAITING: u8 = 0;
const MAPPED: u8 = 1;
const FAILED: u8 = 2;

/// A frame on its way back.
#[derive(Debug)]
struct Flight {
    copies: Copies,
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

    /// Encodes the copies out of a frame's results.
    pub fn copy(
        &mut self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        tables: &Tables,
        mut copies: Copies,
    ) {
        // Publications are much alike: what the last one needed is mostly enough.
        copies.packed = copies.packable.min((2 * self.last_packed).max(FEWEST_PACKED));
        let sources = copies.sources(tables);
        let bytes = sources.iter().map(|(_, bytes)| bytes).sum::<u64>();
        self.reserve(device, bytes);
        let target = self.table.buffer();
        let mut offset = 0;
        for (source, bytes) in sources {
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(source, 0, target, offset, bytes);
                offset += bytes;
            }
        }
        self.planned = Some((copies, bytes));
    }

    /// Maps the results of a frame that has been submitted.
    pub fn begin(&mut self, submission: wgpu::SubmissionIndex) {
        let Some((copies, bytes)) = self.planned.take() else { return };
        let mapping = map(self.table.buffer(), bytes);
        self.flight = Some(Flight { copies, bytes, submission, mapping });
    }

    /// The outcome of the frame on its way, if it arrives within `patience`.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    pub fn fetch(
        &mut self,
        device: &Device,
        arena: &Arena,
        tables: &Tables,
        patience: Duration,
    ) -> Result<Option<Outcome>, EngineError> {
        let Some(flight) = &self.flight else { return Ok(None) };
        wait(device, &flight.submission, &flight.mapping, patience)?;
        match flight.mapping.load(Ordering::Acquire) {
            WAITING => return Ok(None),
            MAPPED => {}
            _ => return Err(unreadable()),
        }
        let Some(flight) = self.flight.take() else { return Ok(None) };
        let copies = &flight.copies;
        let mut mapped = self.mapped(flight.bytes)?;
        let (mut outcome, groups, packed) = copies.outcome(mapped.bytes());
        if copies.packable > 0 {
            self.last_packed = packed;
        }
        if packed > copies.packed {
            drop(mapped);
            mapped = self.fetch_packed(device, tables, packed)?;
        }
        if packed > 0 {
            mapped.keep(packed * PACKED_BYTES);
            outcome.published = Published::new(copies.groups.start, groups, Box::new(mapped));
        } else {
            drop(mapped);
        }
        let mut cells = self.fetch_cells(device, arena, &copies.cells)?.into_iter();
        for (work, wanted) in outcome.work.iter_mut().zip(&copies.work) {
            work.gathered = cells.by_ref().take(wanted.gathered).collect();
        }
        Ok(Some(outcome))
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
        wanted: &[(Place, u32)],
    ) -> Result<Vec<TileCells>, EngineError> {
        let mut found = Vec::with_capacity(wanted.len());
        let mut left = wanted;
        while let Some((_, height)) = left.first() {
            let most = (CELLS_AT_ONCE / (4 * cells_bytes(*height))).max(1) as usize;
            // Tiles of one snowpack are equally high; another's may be higher.
            let alike = left.iter().take(most).take_while(|(_, h)| h == height).count();
            let (portion, rest) = left.split_at(alike);
            left = rest;
            let plane = cells_bytes(*height);
            let bytes = plane * 4 * portion.len() as u64;
            self.reserve(device, bytes);
            let mut encoder = device.device.create_command_encoder(&Default::default());
            let mut offset = 0;
            for (place, _) in portion {
                let Some(page) = &arena.pages[place.page as usize] else { continue };
                let first = u64::from(place.row) * u64::from(TILE_COLUMNS) * 4;
                for cells in &page.cells {
                    let target = self.table.buffer();
                    encoder.copy_buffer_to_buffer(cells, first, target, offset, plane);
                    offset += plane;
                }
            }
            let mapped = self.fetch_now(device, encoder, bytes)?;
            let mut reader = Reader(mapped.bytes());
            found.extend(portion.iter().map(|_| TileCells {
                mass: reader.rows(plane / 4),
                thickness: reader.rows(plane / 4),
                temperature: reader.rows(plane / 4),
                stress: reader.rows(plane / 4),
            }));
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
        let submission = device.queue.submit([encoder.finish()]);
        let mapping = map(self.table.buffer(), bytes);
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
        encoder.copy_buffer_to_buffer(tables.packed.buffer(), 0, target, 0, bytes);
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

/// Takes rows off the front of bytes.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    /// A number of rows, where they lie.
    fn slice<T: Pod>(&mut self, count: u64) -> &'a [T] {
        let (rows, rest) = self.0.split_at(count as usize * std::mem::size_of::<T>());
        self.0 = rest;
        bytemuck::cast_slice(rows)
    }

    fn rows<T: Pod>(&mut self, count: u64) -> Vec<T> {
        self.slice(count).to_vec()
    }
}

impl Copies {
    /// What is copied out and how many bytes of it, the packed heights first.
    fn sources<'a>(&self, tables: &'a Tables) -> [(&'a wgpu::Buffer, u64); 7] {
        fn bytes<T>(count: u64) -> u64 {
            count * std::mem::size_of::<T>() as u64
        }
        let groups = self.groups.len() as u64;
        [
            (tables.packed.buffer(), self.packed * PACKED_BYTES),
            (tables.packed_groups.buffer(), bytes::<layout::PackedGroup>(groups)),
            (tables.packed_count.buffer(), bytes::<u32>(self.count_words())),
            (tables.tallies.buffer(), bytes::<layout::Tally>(self.tallies)),
            (tables.operation_results.buffer(), bytes::<layout::OperationResult>(self.edits)),
            (tables.contacts.buffer(), bytes::<layout::Contact>(self.contacts)),
            (tables.samples.buffer(), bytes::<Sample>(self.samples)),
        ]
    }

    /// Words of the number of packed tiles: none where nothing publishes.
    fn count_words(&self) -> u64 {
        u64::from(!self.groups.is_empty())
    }

    /// The outcome without heights, the groups of packed tiles, and how many were packed in all.
    fn outcome(&self, bytes: &[u8]) -> (Outcome, Vec<Group>, u64) {
        let mut reader = Reader(&bytes[(self.packed * PACKED_BYTES) as usize..]);
        let groups: &[layout::PackedGroup] = reader.slice(self.groups.len() as u64);
        let count = reader.slice::<u32>(self.count_words()).first().copied().unwrap_or(0);
        let tallies: &[layout::Tally] = reader.slice(self.tallies);
        let results: &[layout::OperationResult] = reader.slice(self.edits);
        let contacts: &[layout::Contact] = reader.slice(self.contacts);
        let samples: &[Sample] = reader.slice(self.samples);
        let of = |work: &WorkCopies| {
            let tally = tallies[work.slot as usize];
            let contact =
                |(id, row): &(Arc<str>, u32)| (id.clone(), contacts[*row as usize].into());
            let edits = &results[work.edits.start as usize..work.edits.end as usize];
            let sample =
                |range: &Range<u64>| samples[range.start as usize..range.end as usize].to_vec();
            WorkOutcome {
                slot: work.slot,
                edits: edits.iter().map(|row| join(row.low, row.high)).collect(),
                last_change: tally.last_change,
                tiles: work.tiles.clone(),
                active_tiles: tally.active_tiles,
                mass: join(tally.mass_low, tally.mass_high),
                contacts: work.contacts.iter().map(contact).collect(),
                gathered: Vec::new(),
                samples: work.samples.iter().map(sample).collect(),
            }
        };
        let work = if self.work.len() < 2 * FEWEST_AT_A_TIME {
            self.work.iter().map(of).collect()
        } else {
            self.work.par_iter().with_min_len(FEWEST_AT_A_TIME).map(of).collect()
        };
        let outcome = Outcome { work, ..Outcome::default() };
        let group = |row: &layout::PackedGroup| Group {
            changed: join(row.changed_low, row.changed_high),
            first: row.first,
        };
        (outcome, groups.iter().map(group).collect(), count.into())
    }
}
