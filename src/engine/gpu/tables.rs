//! Buffers beside the arena: snowpacks and objects, and what a frame brings and leaves.

use std::collections::HashMap;

use crate::engine::frame::Slot;
use crate::snow::{Sample, TILE_COLUMNS};

use super::arena::Arena;
use super::buffer::{Mail, Table, Upload};
use super::device::Device;
use super::kernels::{KERNELS, KernelId, Pipeline, Resource};
use super::layout::{self, Pass};
use super::ranges::Ranges;
use super::resident::Body;
use super::survey::Totals;

/// Bytes from one row of the uniform table to the next; a dynamic offset has to be a multiple.
pub const PASS_STRIDE: u32 = 256;

/// Bytes of a packed tile's heights.
pub const PACKED_BYTES: u64 = 4 * TILE_COLUMNS as u64;

/// A row of the uniform table, as far apart as the device asks for.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PassRow {
    pass: Pass,
    padding: [u32; 56],
}

/// The buffers.
#[derive(Debug)]
pub struct Tables {
    sessions: Table,
    /// What each snowpack does in this frame, by its slot.
    pub runs: Vec<layout::Run>,
    runs_buffer: Table,
    /// Sums over each snowpack.
    pub tallies: Table,
    /// How each object touches the snow.
    pub contacts: Table,
    contact_rows: Ranges,
    page_starts: Table,
    due: Table,
    /// Arguments of the indirect dispatches.
    pub arguments: Table,
    /// First word of the lists in `due` that the host writes.
    pub host_lists: u32,
    /// Lists of tiles, each led by its length.
    pub lists: Vec<u32>,
    /// Rows of the arena's table of tiles that have changed.
    pub tile_rows: Vec<(u32, layout::Tile)>,
    /// What each dispatch works on.
    pub passes: Upload<PassRow>,
    /// Objects.
    pub colliders: Upload<layout::Collider>,
    /// Spans of columns under objects.
    pub spans: Upload<[u32; 2]>,
    /// Tiles whose stress is to be evaluated.
    pub load_jobs: Upload<layout::LoadJob>,
    /// Objects on those tiles.
    pub loads: Upload<u32>,
    /// Tiles on which snow falls or is cleared.
    pub edit_jobs: Upload<layout::EditJob>,
    /// What falls or is cleared.
    pub operations: Upload<layout::Operation>,
    /// Which of it touches each of those tiles.
    pub operation_lists: Upload<u32>,
    /// What was refused or cleared.
    pub operation_results: Table,
    /// Boxes of the fixed grid that are asked for.
    pub sample_jobs: Upload<layout::SampleJob>,
    /// Cells of the fixed grid.
    pub samples: Table,
    /// Number of packed tiles.
    pub packed_count: Table,
    /// Which tiles are packed.
    pub packed_groups: Table,
    /// Packed tiles.
    pub packed: Table,
    /// What the host says in the next submit.
    pub mail: Mail,
    bindings: HashMap<(KernelId, u32), wgpu::BindGroup>,
    arena_generation: u64,
}

impl Tables {
    /// Empty tables.
    pub fn new(device: &Device) -> Tables {
        use wgpu::BufferUsages as Usage;
        let device = &device.device;
        let table = |label, usage| {
            let usage = usage | Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
            Table::new(device, label, usage, 0)
        };
        Tables {
            sessions: table("sessions", Usage::empty()),
            runs: Vec::new(),
            runs_buffer: table("runs", Usage::empty()),
            tallies: table("tallies", Usage::empty()),
            contacts: table("contacts", Usage::empty()),
            contact_rows: Ranges::default(),
            page_starts: table("page starts", Usage::empty()),
            due: table("due", Usage::empty()),
            arguments: table("arguments", Usage::INDIRECT),
            host_lists: 0,
            lists: Vec::new(),
            tile_rows: Vec::new(),
            passes: Upload::new(device, "passes", Usage::UNIFORM),
            colliders: Upload::new(device, "colliders", Usage::STORAGE),
            spans: Upload::new(device, "spans", Usage::STORAGE),
            load_jobs: Upload::new(device, "load jobs", Usage::STORAGE),
            loads: Upload::new(device, "loads", Usage::STORAGE),
            edit_jobs: Upload::new(device, "edit jobs", Usage::STORAGE),
            operations: Upload::new(device, "operations", Usage::STORAGE),
            operation_lists: Upload::new(device, "operation lists", Usage::STORAGE),
            sample_jobs: Upload::new(device, "sample jobs", Usage::STORAGE),
            samples: table("samples", Usage::empty()),
            operation_results: table("operation results", Usage::empty()),
            packed_count: table("packed count", Usage::empty()),
            packed_groups: table("packed groups", Usage::empty()),
            packed: table("packed", Usage::empty()),
            mail: Mail::new(device),
            bindings: HashMap::new(),
            arena_generation: u64::MAX,
        }
    }

    /// Writes a snowpack's row of constants.
    pub fn set_session(&mut self, device: &Device, slot: Slot, row: &layout::Session) {
        let bytes = std::mem::size_of::<layout::Session>() as u64;
        let needed = (u64::from(slot) + 1) * bytes;
        if needed > self.sessions.size() {
            self.sessions.grow(&device.device, &device.queue, needed.next_power_of_two());
            self.bindings.clear();
        }
        if self.runs.len() <= slot as usize {
            self.runs.resize(slot as usize + 1, layout::Run::default());
        }
        let offset = u64::from(slot) * bytes;
        device.queue.write_buffer(self.sessions.buffer(), offset, bytemuck::bytes_of(row));
    }

    /// Takes a row of the table of contacts for an object.
    pub fn take_contact(&mut self, device: &Device) -> u32 {
        let bytes = std::mem::size_of::<layout::Contact>() as u64;
        loop {
            if let Some(row) = self.contact_rows.take(1) {
                return row.start;
            }
            let capacity = (self.contact_rows.capacity() * 2).max(64);
            self.contacts.grow(&device.device, &device.queue, u64::from(capacity) * bytes);
            self.contact_rows.grow(capacity);
            self.bindings.clear();
        }
    }

    /// Writes how an object touches the snow.
    pub fn set_contact(&self, device: &Device, row: u32, contact: &crate::snow::Contact) {
        let contact = layout::Contact::from(contact);
        let offset = u64::from(row) * std::mem::size_of::<layout::Contact>() as u64;
        device.queue.write_buffer(self.contacts.buffer(), offset, bytemuck::bytes_of(&contact));
    }

    /// Gives the rows of objects back.
    pub fn forget_bodies<'a>(&mut self, bodies: impl Iterator<Item = &'a Body>) {
        for body in bodies {
            self.contact_rows.give_back(body.contact..body.contact + 1);
        }
    }

    /// End of the last row of the table of contacts in use.
    pub fn contact_end(&self) -> u32 {
        self.contact_rows.end()
    }

    /// Adds a row to the uniform table and returns its number.
    pub fn pass(&mut self, pass: Pass) -> u32 {
        self.passes.push(PassRow { pass, padding: [0; 56] })
    }

    /// Lays the list of due tiles out for the pages there are.
    pub fn fit_to(&mut self, device: &Device, arena: &Arena) {
        if self.arena_generation == arena.generation {
            return;
        }
        self.arena_generation = arena.generation;
        self.bindings.clear();
        let mut starts = Vec::with_capacity(arena.pages.len());
        // The lengths of the lists come first, so that they are cleared at once.
        self.host_lists = arena.pages.len() as u32;
        for page in 0..arena.pages.len() {
            starts.push(self.host_lists);
            // No tile has less than one row of cells.
            self.host_lists += arena.page_rows(page);
        }
        let bytes: &[u8] = bytemuck::cast_slice(&starts);
        self.page_starts.reserve(&device.device, bytes.len() as u64);
        device.queue.write_buffer(self.page_starts.buffer(), 0, bytes);
        self.arguments.reserve(&device.device, arena.pages.len() as u64 * 12);
    }

    /// Makes room for a frame's results and clears them.
    pub fn begin_frame(&mut self, device: &Device, totals: &Totals) -> wgpu::CommandEncoder {
        let (edits, groups) = (u64::from(totals.edits), totals.groups.len() as u64);
        let d = &device.device;
        let tally = std::mem::size_of::<layout::Tally>() as u64;
        let group = std::mem::size_of::<layout::PackedGroup>() as u64;
        let grew = [
            self.tallies.reserve(d, self.runs.len() as u64 * tally),
            self.operation_results.reserve(d, edits * 8),
            self.packed_groups.reserve(d, groups * group),
            self.packed.reserve(d, totals.tiles * PACKED_BYTES),
            self.samples.reserve(d, totals.samples * std::mem::size_of::<Sample>() as u64),
        ];
        if grew.contains(&true) {
            self.bindings.clear();
        }
        let mut encoder = d.create_command_encoder(&Default::default());
        encoder.clear_buffer(self.tallies.buffer(), 0, None);
        if edits > 0 {
            encoder.clear_buffer(self.operation_results.buffer(), 0, None);
        }
        if groups > 0 {
            encoder.clear_buffer(self.packed_count.buffer(), 0, None);
        }
        encoder
    }

    /// Encodes everything that the host has to say in this submit.
    pub fn flush(&mut self, device: &Device, encoder: &mut wgpu::CommandEncoder, arena: &Arena) {
        let (d, mail) = (&device.device, &mut self.mail);
        if let Some(tiles) = arena.table(Resource::Tiles) {
            for (tile, row) in self.tile_rows.drain(..) {
                let bytes = bytemuck::bytes_of(&row);
                mail.write(tiles, u64::from(tile) * bytes.len() as u64, bytes);
            }
        }
        let lists = u64::from(self.host_lists) * 4;
        let grew = [
            self.passes.flush(d, mail),
            self.colliders.flush(d, mail),
            self.spans.flush(d, mail),
            self.load_jobs.flush(d, mail),
            self.loads.flush(d, mail),
            self.edit_jobs.flush(d, mail),
            self.operations.flush(d, mail),
            self.operation_lists.flush(d, mail),
            self.sample_jobs.flush(d, mail),
            self.due.reserve(d, lists + self.lists.len() as u64 * 4),
            self.runs_buffer.reserve(d, self.runs.len() as u64 * 16),
        ]
        .contains(&true);
        if grew {
            self.bindings.clear();
        }
        mail.write(self.due.buffer(), lists, bytemuck::cast_slice(&self.lists));
        mail.write(self.runs_buffer.buffer(), 0, bytemuck::cast_slice(&self.runs));
        mail.send(encoder);
        self.lists.clear();
    }

    /// Clears the lists of due tiles and the arguments made of their lengths.
    pub fn clear_schedule(&self, encoder: &mut wgpu::CommandEncoder, arena: &Arena) {
        encoder.clear_buffer(self.due.buffer(), 0, Some(arena.pages.len() as u64 * 4));
        encoder.clear_buffer(self.arguments.buffer(), 0, None);
    }

    /// Makes sure that a kernel's bindings for a page are there.
    pub fn bind(
        &mut self,
        device: &Device,
        arena: &Arena,
        pipelines: &[Pipeline],
        kernel: KernelId,
        page: u32,
    ) {
        if self.bindings.contains_key(&(kernel, page)) {
            return;
        }
        let number = kernel as usize;
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(KERNELS[number].bindings)
            .map(|(binding, &(resource, _))| wgpu::BindGroupEntry {
                binding,
                resource: self.resource(arena, resource, page),
            })
            .collect();
        let group = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(KERNELS[number].name),
            layout: &pipelines[number].layout,
            entries: &entries,
        });
        self.bindings.insert((kernel, page), group);
    }

    /// A kernel's bindings for a page, made by [`Tables::bind`].
    pub fn binding(&self, kernel: KernelId, page: u32) -> Option<&wgpu::BindGroup> {
        self.bindings.get(&(kernel, page))
    }

    fn resource<'a>(
        &'a self,
        arena: &'a Arena,
        resource: Resource,
        page: u32,
    ) -> wgpu::BindingResource<'a> {
        let cells = |index: usize| {
            let page = arena.pages[page as usize].as_ref();
            &page.expect("only pages with tiles in them are dispatched").cells[index]
        };
        let buffer = match resource {
            Resource::Work => {
                return wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: self.passes.buffer(),
                    offset: 0,
                    size: wgpu::BufferSize::new(std::mem::size_of::<Pass>() as u64),
                });
            }
            Resource::Sessions => self.sessions.buffer(),
            Resource::Runs => self.runs_buffer.buffer(),
            Resource::Tallies => self.tallies.buffer(),
            Resource::PageStarts => self.page_starts.buffer(),
            Resource::Due => self.due.buffer(),
            Resource::Arguments => self.arguments.buffer(),
            Resource::Colliders => self.colliders.buffer(),
            Resource::Spans => self.spans.buffer(),
            Resource::Contacts => self.contacts.buffer(),
            Resource::LoadJobs => self.load_jobs.buffer(),
            Resource::Loads => self.loads.buffer(),
            Resource::EditJobs => self.edit_jobs.buffer(),
            Resource::Operations => self.operations.buffer(),
            Resource::OperationLists => self.operation_lists.buffer(),
            Resource::OperationResults => self.operation_results.buffer(),
            Resource::SampleJobs => self.sample_jobs.buffer(),
            Resource::Samples => self.samples.buffer(),
            Resource::PackedCount => self.packed_count.buffer(),
            Resource::PackedGroups => self.packed_groups.buffer(),
            Resource::Packed => self.packed.buffer(),
            Resource::Mass => cells(0),
            Resource::Thickness => cells(1),
            Resource::Temperature => cells(2),
            Resource::Stress => cells(3),
            Resource::Tiles
            | Resource::States
            | Resource::Heights
            | Resource::Filled
            | Resource::Ground => {
                arena.table(resource).expect("the arena has a table of each of these")
            }
        };
        buffer.as_entire_binding()
    }
}
