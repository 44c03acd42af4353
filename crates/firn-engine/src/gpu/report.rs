//! What a frame reports: what is copied out of its results, and what each snowpack finds there.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::Pod;
use firn_snow::alpine::Surface;
use firn_snow::{Column, ColumnRect, Exchanged, Sample, TILE_COLUMNS};

use crate::frame::{ColumnRead, Outcome, SampleBox, Slot, TileCells, Work, WorkOutcome};
use crate::parallel;
use crate::published::Group;

use super::layout::{self, SURFACE_ROWS, join, surface_of};
use super::pages::Place;
use super::plan::FEW_TILES;
use super::resident::Residents;
use super::results::{Extent, Section};
use super::survey::{Part, Totals};
use super::tables::Tables;

/// Part of a snowpack's tiles that are listed at the most.
const MOST_LISTED: usize = 8;

/// What is copied out, in order.
#[derive(Debug)]
pub struct Copies {
    /// Which results.
    pub results: Extent,
    contacts: u64,
    /// Most tiles that may be packed.
    pub packable: u64,
    /// How many of them are copied at once.
    pub packed: u64,
    /// Groups of tiles that publish.
    pub groups: Range<u32>,
    column_cells: u64,
    samples: u64,
    columns: u64,
}

/// What the snowpacks of a frame find in its results.
#[derive(Debug, Default)]
pub struct Reports {
    /// That of each.
    pub work: Vec<Report>,
    /// Tiles whose cells are wanted.
    pub cells: Vec<WantedTile>,
}

/// A tile whose cells are wanted.
#[derive(Clone, Copy, Debug)]
pub struct WantedTile {
    /// Where it is.
    pub place: Place,
    /// Slots of its columns.
    pub slots: u32,
    /// What a column has beside its cells before its first step, where the snow is alpine.
    pub beginning: Option<Surface>,
}

impl WantedTile {
    /// Rows that are read of it: its slots, and what its columns have beside their cells.
    pub fn rows(&self) -> u32 {
        self.slots + if self.beginning.is_some() { SURFACE_ROWS } else { 0 }
    }

    /// Takes its cells off the front of bytes.
    pub fn read(&self, reader: &mut Reader<'_>) -> TileCells {
        const COLUMNS: usize = TILE_COLUMNS as usize;
        let cells = self.slots as usize * COLUMNS;
        let planes: [&[u32]; 4] =
            std::array::from_fn(|_| reader.slice(u64::from(self.rows() * TILE_COLUMNS)));
        let surface = |beginning: Surface| {
            let word = |column: usize, i: usize| planes[i % 4][cells + i / 4 * COLUMNS + column];
            let words = |column: usize| std::array::from_fn(|i| word(column, i));
            (0..COLUMNS).map(|column| surface_of(words(column)).unwrap_or(beginning)).collect()
        };
        TileCells {
            mass: planes[0][..cells].to_vec(),
            thickness: planes[1][..cells].to_vec(),
            temperature: bytemuck::cast_slice(&planes[2][..cells]).to_vec(),
            stress: bytemuck::cast_slice(&planes[3][..cells]).to_vec(),
            surfaces: self.beginning.map(surface).unwrap_or_default(),
        }
    }
}

/// What one snowpack finds in the results.
#[derive(Debug)]
pub struct Report {
    slot: Slot,
    /// Its edits, by their numbers in the frame.
    edits: Range<u32>,
    /// Its tiles, where it publishes.
    tiles: Range<u32>,
    contacts: Vec<(Arc<str>, u32)>,
    /// Tiles whose cells are wanted.
    pub gathered: usize,
    /// Cells of the columns that are read, and how many of them each column has.
    columns: Vec<(Range<u64>, u32)>,
    samples: Vec<Range<u64>>,
    /// Columns that are summed up, and what one has before its first step.
    totals: Vec<Range<u64>>,
    beginning: Option<Surface>,
}

impl Reports {
    /// What the work of a frame reports, the parts of which have been surveyed.
    pub fn new(work: &[Work], parts: Vec<Part>, residents: &Residents) -> Reports {
        let mut reports = Reports { work: Vec::with_capacity(work.len()), cells: Vec::new() };
        let (mut cells, mut samples, mut columns) = (0, 0, 0);
        for (work, part) in work.iter().zip(parts) {
            let mut sample = |wanted: &SampleBox| {
                let first = samples;
                samples += wanted.cells();
                first..samples
            };
            let mut sum_up = |wanted: &ColumnRect| {
                let first = columns;
                columns += wanted.columns();
                first..columns
            };
            let mut read = |wanted: &ColumnRead| {
                let first = cells;
                cells += wanted.cells();
                (first..cells, wanted.cells)
            };
            let mut report = Report {
                slot: work.slot,
                edits: part.edits,
                tiles: if work.publish { part.tiles } else { 0..0 },
                contacts: Vec::new(),
                gathered: work.gather.len(),
                columns: work.columns.iter().map(&mut read).collect(),
                samples: work.samples.iter().map(&mut sample).collect(),
                totals: work.totals.iter().map(&mut sum_up).collect(),
                beginning: None,
            };
            // Of thousands that only tick or publish, none is looked at.
            let touched = (work.publish && part.may_be_loaded)
                || !work.gather.is_empty()
                || !work.totals.is_empty();
            if touched && let Some(resident) = residents.get(work.slot) {
                if work.publish {
                    let bodies = resident.bodies.iter();
                    report.contacts = bodies.map(|(id, body)| (id.clone(), body.contact)).collect();
                }
                report.beginning = resident.layout.surface;
                let wanted = |&tile: &u32| WantedTile {
                    place: resident.lot.places[tile as usize],
                    slots: resident.row.height,
                    beginning: resident.layout.surface,
                };
                reports.cells.extend(work.gather.iter().map(wanted));
            }
            reports.work.push(report);
        }
        reports
    }
}

/// Tiles of a snowpack that are awake, none where they are too many to be listed.
pub type Awake = (Slot, Option<BTreeSet<u32>>);

/// Finds those of a snowpack among groups, the first of which has a number.
fn awake(groups: &[layout::PackedGroup], first: u32, tiles: &Range<u32>) -> Option<BTreeSet<u32>> {
    let own = tiles.start / 64 - first..tiles.end.div_ceil(64) - first;
    let masks = groups[own.start as usize..own.end as usize].iter();
    let masks = masks.map(|group| join(group.awake_low, group.awake_high));
    let count: u32 = masks.clone().map(u64::count_ones).sum();
    let listed = || {
        let bits = |mask: u64| (0..64).filter(move |bit| mask >> bit & 1 != 0);
        let all = masks.zip(tiles.start / 64..).filter(|(mask, _)| *mask != 0);
        let all = all.flat_map(|(mask, group)| bits(mask).map(move |bit| 64 * group + bit));
        all.filter(|tile| tiles.contains(tile)).map(|tile| tile - tiles.start).collect()
    };
    (count as usize <= tiles.len() / MOST_LISTED).then(listed)
}

/// Takes rows off the front of bytes.
pub struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    /// A number of rows, where they lie.
    fn slice<T: Pod>(&mut self, count: u64) -> &'a [T] {
        let (rows, rest) = self.0.split_at(count as usize * std::mem::size_of::<T>());
        self.0 = rest;
        bytemuck::cast_slice(rows)
    }
}

impl Copies {
    /// What is copied out of a frame's results, `most_packed` of the tiles that may be packed at the
    /// most.
    pub fn new(totals: Totals, tables: &Tables, most_packed: u64) -> Copies {
        let packed = totals.tiles.min(most_packed);
        Copies {
            results: tables.results.extent(&totals, packed),
            contacts: if totals.contacts { u64::from(tables.contact_end()) } else { 0 },
            packable: totals.tiles,
            packed,
            groups: totals.groups,
            column_cells: totals.column_cells,
            samples: totals.samples,
            columns: totals.columns,
        }
    }

    /// What is copied out: buffers, and the bytes of each.
    pub fn sources<'a>(
        &'a self,
        tables: &'a Tables,
    ) -> impl Iterator<Item = (&'a wgpu::Buffer, Range<u64>)> {
        fn rows<T>(count: u64) -> Range<u64> {
            0..count * std::mem::size_of::<T>() as u64
        }
        let others = [
            (tables.contacts.buffer(), rows::<layout::Contact>(self.contacts)),
            (tables.column_cells.buffer(), rows::<layout::ColumnCell>(self.column_cells)),
            (tables.samples.buffer(), rows::<Sample>(self.samples)),
            (tables.column_totals.buffer(), rows::<layout::ColumnTotals>(self.columns)),
        ];
        let results = self.results.pieces().map(|piece| (tables.results.buffer(), piece));
        results.chain(others).filter(|(_, bytes)| !bytes.is_empty())
    }

    /// The outcome without heights, the groups of packed tiles, how many were packed in all, and which tiles are
    /// awake of large snowpacks that publish.
    pub fn outcome(
        &self,
        reports: &Reports,
        bytes: &[u8],
    ) -> (Outcome, Vec<Group>, u64, Vec<Awake>) {
        let mut reader = Reader(bytes);
        let results: &[u8] = reader.slice(self.results.pieces().map(|p| p.end - p.start).sum());
        let section = |section| &results[self.results.place(section)];
        let groups: &[layout::PackedGroup] = bytemuck::cast_slice(section(Section::PackedGroups));
        let count: &[u32] = bytemuck::cast_slice(section(Section::PackedCount));
        let tallies: &[layout::Tally] = bytemuck::cast_slice(section(Section::Tallies));
        let operations: &[layout::OperationResult] =
            bytemuck::cast_slice(section(Section::Operations));
        let contacts: &[layout::Contact] = reader.slice(self.contacts);
        let cells: &[layout::ColumnCell] = reader.slice(self.column_cells);
        let samples: &[Sample] = reader.slice(self.samples);
        let totals: &[layout::ColumnTotals] = reader.slice(self.columns);
        let exchanges: &[layout::ExchangeResult] =
            bytemuck::cast_slice(section(Section::Exchanges));
        let of = |((work, tally), place): ((&Report, &layout::Tally), usize)| {
            let contact =
                |(id, row): &(Arc<str>, u32)| (id.clone(), contacts[*row as usize].into());
            let edits = &operations[work.edits.start as usize..work.edits.end as usize];
            let sample =
                |range: &Range<u64>| samples[range.start as usize..range.end as usize].to_vec();
            let sum_up = |range: &Range<u64>| {
                let rows = totals[range.start as usize..range.end as usize].iter();
                rows.filter_map(|row| Some(row.told(work.beginning?))).collect()
            };
            let read = |(range, each): &(Range<u64>, u32)| {
                let cells = &cells[range.start as usize..range.end as usize];
                cells.chunks_exact(*each as usize).map(column).collect()
            };
            WorkOutcome {
                slot: work.slot,
                unfinished: false,
                units: 0,
                edits: edits.iter().map(|row| join(row.low, row.high)).collect(),
                last_change: tally.last_change,
                tiles: work.tiles.clone(),
                active_tiles: tally.active_tiles,
                mass: join(tally.mass_low, tally.mass_high),
                contacts: work.contacts.iter().map(contact).collect(),
                gathered: Vec::new(),
                columns: work.columns.iter().map(read).collect(),
                samples: work.samples.iter().map(sample).collect(),
                totals: work.totals.iter().map(sum_up).collect(),
                exchanged: exchanges.get(place).map(Exchanged::from).unwrap_or_default(),
            }
        };
        let work = parallel::each(reports.work.iter().zip(tallies).zip(0..).collect(), of);
        let outcome = Outcome { work, ..Outcome::default() };
        let group = |row: &layout::PackedGroup| Group {
            changed: join(row.changed_low, row.changed_high),
            first: row.first,
        };
        let packed = count.first().map_or(0, |&count| count.into());
        let large = reports.work.iter().filter(|work| work.tiles.len() > FEW_TILES);
        let awake = large.map(|work| (work.slot, awake(groups, self.groups.start, &work.tiles)));
        let awake = awake.collect();
        (outcome, groups.iter().map(group).collect(), packed, awake)
    }
}

/// A column whose cells were read.
fn column(cells: &[layout::ColumnCell]) -> Column {
    let cells = cells.iter().take_while(|cell| cell.mass > 0);
    Column { cells: cells.map(|&cell| cell.into()).collect() }
}
