//! What a frame left on the device, copied out without ever blocking the frame itself.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use bytemuck::Pod;

use crate::engine::frame::{
    EngineError, Outcome, SampleBox, Slot, TileCells, TileHeights, Work, WorkOutcome,
};
use crate::snow::{Sample, TILE_COLUMNS};

use super::arena::{Arena, Place};
use super::buffer::Table;
use super::device::Device;
use super::layout::{self, join};
use super::resident::Resident;
use super::tables::{PACKED_WORDS, Tables};

/// Packed tiles that are copied before it is known how many there are, at the least.
const FEWEST_PACKED: u64 = 256;

/// Bytes of cells that are copied out at a time.
const CELLS_AT_ONCE: u64 = 64 << 20;

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
    cells: Vec<(Place, u32)>,
    samples: u64,
    /// First tile of each snowpack that publishes, with its slot: what packed tiles belong to.
    tiles: BTreeMap<u32, Slot>,
}

/// One snowpack's part of what is copied out.
#[derive(Debug)]
struct WorkCopies {
    slot: Slot,
    edits: u32,
    contacts: Vec<(Arc<str>, u32)>,
    gathered: usize,
    samples: Vec<u64>,
}

impl Copies {
    /// What the work of a frame reports; `edits` counts each one's edits.
    pub fn new(
        work: &[Work],
        edits: &[u32],
        residents: &BTreeMap<Slot, Resident>,
        tables: &Tables,
        packable: u64,
    ) -> Copies {
        let mut copies = Copies {
            edits: edits.iter().map(|&count| u64::from(count)).sum(),
            tallies: tables.runs.len() as u64,
            packable,
            ..Copies::default()
        };
        for (work, &edits) in work.iter().zip(edits) {
            let resident = &residents[&work.slot];
            let mut contacts = Vec::new();
            if work.publish {
                copies.tiles.insert(resident.lot.tiles.start, work.slot);
                contacts.extend(resident.bodies.iter().map(|(id, b)| (id.clone(), b.contact)));
            }
            if !contacts.is_empty() {
                copies.contacts = u64::from(tables.contact_end());
            }
            let places = work.gather.iter().map(|&tile| resident.lot.places[tile as usize]);
            copies.cells.extend(places.map(|place| (place, resident.lot.height)));
            copies.work.push(WorkCopies {
                slot: work.slot,
                edits,
                contacts,
                gathered: work.gather.len(),
                samples: work.samples.iter().map(SampleBox::cells).collect(),
            });
            copies.samples += work.samples.iter().map(SampleBox::cells).sum::<u64>();
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
            planned: None,
            flight: None,
            last_packed: 0,
        }
    }

    /// Whether no frame is on its way.
    pub fn is_idle(&self) -> bool {
        self.flight.is_none()
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
        let tally = std::mem::size_of::<layout::Tally>() as u64;
        let contact = std::mem::size_of::<layout::Contact>() as u64;
        let sources = [
            (tables.tallies.buffer(), copies.tallies * tally),
            (tables.operation_results.buffer(), copies.edits * 8),
            (tables.contacts.buffer(), copies.contacts * contact),
            (tables.packed_count.buffer(), 4),
            (tables.packed.buffer(), copies.packed * PACKED_WORDS * 4),
            (tables.samples.buffer(), copies.samples * std::mem::size_of::<Sample>() as u64),
        ];
        let bytes = sources.iter().map(|(_, bytes)| bytes).sum::<u64>();
        self.table.reserve(&device.device, bytes);
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
        wait(device, &flight.submission, patience)?;
        match flight.mapping.load(Ordering::Acquire) {
            WAITING => return Ok(None),
            MAPPED => {}
            _ => return Err(unreadable()),
        }
        let Some(flight) = self.flight.take() else { return Ok(None) };
        let bytes = read(self.table.buffer(), flight.bytes)?;
        let (mut outcome, packed) = flight.copies.outcome(&bytes);
        if flight.copies.packable > 0 {
            self.last_packed = packed;
        }
        if packed > flight.copies.packed {
            let rest = self.fetch_packed(device, tables, flight.copies.packed, packed)?;
            flight.copies.add_tiles(&rest, &mut outcome);
        }
        let mut cells = self.fetch_cells(device, arena, &flight.copies.cells)?.into_iter();
        for (work, wanted) in outcome.work.iter_mut().zip(&flight.copies.work) {
            work.gathered = cells.by_ref().take(wanted.gathered).collect();
        }
        Ok(Some(outcome))
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
            self.table.reserve(&device.device, bytes);
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
            let bytes = self.fetch_now(device, encoder, bytes)?;
            let mut reader = Reader(&bytes);
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
    ) -> Result<Vec<u8>, EngineError> {
        let submission = device.queue.submit([encoder.finish()]);
        let mapping = map(self.table.buffer(), bytes);
        while mapping.load(Ordering::Acquire) == WAITING {
            wait(device, &submission, Duration::from_millis(100))?;
            device.check()?;
        }
        if mapping.load(Ordering::Acquire) == FAILED {
            return Err(unreadable());
        }
        read(self.table.buffer(), bytes)
    }

    /// Fetches packed tiles that were more than expected; they are still there.
    fn fetch_packed(
        &mut self,
        device: &Device,
        tables: &Tables,
        first: u64,
        end: u64,
    ) -> Result<Vec<u32>, EngineError> {
        let bytes = (end - first) * PACKED_WORDS * 4;
        self.table.reserve(&device.device, bytes);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let offset = first * PACKED_WORDS * 4;
        let target = self.table.buffer();
        encoder.copy_buffer_to_buffer(tables.packed.buffer(), offset, target, 0, bytes);
        let bytes = self.fetch_now(device, encoder, bytes)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
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

/// Lets the device call back, for no longer than `patience`.
fn wait(
    device: &Device,
    submission: &wgpu::SubmissionIndex,
    patience: Duration,
) -> Result<(), EngineError> {
    let poll = wgpu::PollType::Wait {
        submission_index: Some(submission.clone()),
        timeout: Some(patience),
    };
    match device.device.poll(poll) {
        Ok(_) | Err(wgpu::PollError::Timeout) => Ok(()),
        Err(error) => Err(EngineError::DeviceFailed(error.to_string())),
    }
}

/// Copies a mapped buffer out and unmaps it.
fn read(buffer: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>, EngineError> {
    let view = buffer
        .get_mapped_range(..bytes)
        .map_err(|error| EngineError::DeviceFailed(error.to_string()))?;
    let copy = view.to_vec();
    drop(view);
    buffer.unmap();
    Ok(copy)
}

/// Takes rows off the front of bytes.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn rows<T: Pod>(&mut self, count: u64) -> Vec<T> {
        let (rows, rest) = self.0.split_at(count as usize * std::mem::size_of::<T>());
        self.0 = rest;
        bytemuck::pod_collect_to_vec(rows)
    }
}

impl Copies {
    /// The outcome, and how many tiles were packed in all.
    fn outcome(&self, bytes: &[u8]) -> (Outcome, u64) {
        let mut reader = Reader(bytes);
        let tallies: Vec<layout::Tally> = reader.rows(self.tallies);
        let results: Vec<layout::OperationResult> = reader.rows(self.edits);
        let contacts: Vec<layout::Contact> = reader.rows(self.contacts);
        let count = u64::from(reader.rows::<u32>(1)[0]);
        let packed: Vec<u32> = reader.rows(self.packed * PACKED_WORDS);
        let samples: Vec<Sample> = reader.rows(self.samples);
        let mut samples = samples.into_iter();
        let mut outcome = Outcome::default();
        let mut results = results.into_iter().map(|row| join(row.low, row.high));
        for work in &self.work {
            let tally = tallies[work.slot as usize];
            let contact =
                |(id, row): &(Arc<str>, u32)| (id.clone(), contacts[*row as usize].into());
            outcome.work.push(WorkOutcome {
                slot: work.slot,
                edits: results.by_ref().take(work.edits as usize).collect(),
                last_change: tally.last_change,
                active_tiles: tally.active_tiles,
                mass: join(tally.mass_low, tally.mass_high),
                contacts: work.contacts.iter().map(contact).collect(),
                gathered: Vec::new(),
                samples: work
                    .samples
                    .iter()
                    .map(|&count| samples.by_ref().take(count as usize).collect())
                    .collect(),
            });
        }
        let copied = count.min(self.packed) * PACKED_WORDS;
        self.add_tiles(&packed[..copied as usize], &mut outcome);
        (outcome, count)
    }

    /// Adds packed tiles to an outcome.
    fn add_tiles(&self, packed: &[u32], outcome: &mut Outcome) {
        for entry in packed.chunks_exact(PACKED_WORDS as usize) {
            let Some((&first, &slot)) = self.tiles.range(..=entry[0]).next_back() else { continue };
            let mut heights = [0; TILE_COLUMNS as usize];
            heights.copy_from_slice(&entry[1..]);
            outcome.tiles.push(TileHeights { slot, tile: entry[0] - first, heights });
        }
    }
}
