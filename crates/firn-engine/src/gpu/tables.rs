//! Buffers beside the arena: snowpacks and objects, and what a frame brings and leaves.

use std::collections::HashMap;

use firn_snow::{Sample, TILE_COLUMNS};

use crate::frame::Slot;

use super::arena::Arena;
use super::buffer::{Mail, Table};
use super::device::Device;
use super::due::Due;
use super::kernels::{KERNELS, KernelId, Pipeline, Resource};
use super::layout;
use super::orders::Orders;
use super::ranges::Ranges;
use super::resident::Body;
use super::results::Results;
use super::runs::Runs;
use super::survey::Totals;

/// Bytes of a packed tile's heights.
pub const PACKED_BYTES: u64 = 4 * TILE_COLUMNS as u64;

/// The buffers.
#[derive(Debug)]
pub struct Tables {
    sessions: Table,
    /// What each snowpack does in this frame.
    pub runs: Runs,
    /// How each object touches the snow.
    pub contacts: Table,
    contact_rows: Ranges,
    /// Lists of tiles.
    pub due: Due,
    /// Rows of the arena's table of tiles that have changed.
    pub tile_rows: Vec<(u32, layout::Tile)>,
    /// Rows of this submit.
    pub orders: Orders,
    /// Cells of the columns that are read.
    pub column_cells: Table,
    /// Cells of the fixed grid.
    pub samples: Table,
    /// Part of the short wave that falls on each column of the snowpacks that shade.
    shine: Table,
    /// Columns that are summed up.
    pub column_totals: Table,
    /// What frames leave for the host.
    pub results: Results,
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
            runs: Runs::new(table("runs", Usage::empty())),
            contacts: table("contacts", Usage::empty()),
            contact_rows: Ranges::default(),
            due: Due::new(table("due", Usage::INDIRECT), table("page starts", Usage::empty())),
            tile_rows: Vec::new(),
            orders: Orders::new(table("orders", Usage::empty())),
            column_cells: table("column cells", Usage::empty()),
            samples: table("samples", Usage::empty()),
            shine: table("shine", Usage::empty()),
            column_totals: table("column totals", Usage::empty()),
            results: Results::new(table("results", Usage::empty())),
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
        self.runs.reserve(slot);
        let offset = u64::from(slot) * bytes;
        device.queue.write_buffer(self.sessions.buffer(), offset, bytemuck::bytes_of(row));
    }

    /// Takes rows of the table of contacts for an object, one for each footprint. Returns the first.
    pub fn take_contacts(&mut self, device: &Device, rows: u32) -> u32 {
        let bytes = std::mem::size_of::<layout::Contact>() as u64;
        loop {
            if let Some(taken) = self.contact_rows.take(rows) {
                return taken.start;
            }
            let capacity = (self.contact_rows.capacity() * 2).max(64);
            self.contacts.grow(&device.device, &device.queue, u64::from(capacity) * bytes);
            self.contact_rows.grow(capacity);
            self.bindings.clear();
        }
    }

    /// Writes how an object touches the snow.
    pub fn set_contact(&self, device: &Device, row: u32, contact: &firn_snow::Contact) {
        let contact = layout::Contact::from(contact);
        let offset = u64::from(row) * std::mem::size_of::<layout::Contact>() as u64;
        device.queue.write_buffer(self.contacts.buffer(), offset, bytemuck::bytes_of(&contact));
    }

    /// Gives the rows of objects back.
    pub fn forget_bodies<'a>(&mut self, bodies: impl Iterator<Item = &'a Body>) {
        for body in bodies {
            self.contact_rows.give_back(body.contact..body.contact + body.rows());
        }
    }

    /// End of the last row of the table of contacts in use.
    pub fn contact_end(&self) -> u32 {
        self.contact_rows.end()
    }

    /// Lays the list of due tiles out for the pages there are.
    pub fn fit_to(&mut self, device: &Device, arena: &Arena) {
        if self.arena_generation == arena.generation() {
            return;
        }
        self.arena_generation = arena.generation();
        self.bindings.clear();
        self.due.fit_to(device, arena);
    }

    /// Makes room for a frame's results.
    pub fn reserve_results(&mut self, device: &Device, totals: &Totals) {
        let samples = totals.samples * std::mem::size_of::<Sample>() as u64;
        let cells = totals.column_cells * std::mem::size_of::<layout::ColumnCell>() as u64;
        let columns = totals.columns * std::mem::size_of::<layout::ColumnTotals>() as u64;
        let grew = [
            self.results.reserve(device, totals),
            self.samples.reserve(&device.device, samples),
            self.column_cells.reserve(&device.device, cells),
            self.column_totals.reserve(&device.device, columns),
        ];
        if grew.contains(&true) {
            self.bindings.clear();
        }
    }

    /// Makes room for the parts of the short wave that fall on so many columns.
    pub fn reserve_shine(&mut self, device: &Device, columns: u32) {
        if self.shine.reserve(&device.device, u64::from(columns) * 4) {
            self.bindings.clear();
        }
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
        let grew =
            [self.orders.flush(device, mail), self.due.flush(d, mail), self.runs.flush(d, mail)]
                .contains(&true);
        if grew {
            self.bindings.clear();
        }
        mail.send(&device.queue, encoder);
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
            let page = arena.pages.get(page);
            &page.expect("only pages with tiles in them are dispatched").cells[index]
        };
        let buffer = match resource {
            Resource::Sessions => self.sessions.buffer(),
            Resource::Runs => self.runs.buffer(),
            Resource::PageStarts => self.due.starts(),
            Resource::Due => self.due.buffer(),
            Resource::Contacts => self.contacts.buffer(),
            Resource::ColumnCells => self.column_cells.buffer(),
            Resource::Samples => self.samples.buffer(),
            Resource::ColumnTotals => self.column_totals.buffer(),
            Resource::Shine => self.shine.buffer(),
            Resource::Mass => cells(0),
            Resource::Thickness => cells(1),
            Resource::Temperature => cells(2),
            Resource::Stress => cells(3),
            _ => {
                let table = || Some(arena.table(resource)?.as_entire_binding());
                let rows = self.orders.binding(resource);
                return rows.or_else(|| self.results.binding(resource)).or_else(table).expect(
                    "every other resource is one of the orders, results or arena's tables",
                );
            }
        };
        buffer.as_entire_binding()
    }
}
