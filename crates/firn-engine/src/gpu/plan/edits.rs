//! Snow that falls, is laid, cleared or pressed, and stresses that follow from edits.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;

use firn_snow::{ColumnRect, SurfaceLoad, TILE_SIDE};

use crate::frame::{Deposit, Edit, Slot};
use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{
    AFTER_EDITS, CLEAR, DEPOSIT, EditJob, LAY, LoadJob, Operation, Pass, STRIP, Stamp,
};
use crate::gpu::resident::{Resident, Residents};

use super::weather::WeatherPart;
use super::{Planner, Round, tiles_in};

/// What edits leave to be done in one round.
#[derive(Default)]
struct Edited {
    /// Tiles with operations, by page.
    edit_jobs: Vec<(u32, EditJob)>,
    /// Tiles with stamps, by page.
    stamp_jobs: Vec<(u32, EditJob)>,
    /// Tiles whose stress is to be evaluated, by page.
    load_jobs: Vec<(u32, LoadJob)>,
    colliders: u32,
    /// Steps of weather: the first of each snowpack, then the second, and so on.
    weather: Vec<Vec<WeatherPart>>,
}

/// Tiles whose snow is changed, each with the row of what changes it, in the order of the rows.
#[derive(Default)]
pub(super) struct Changed {
    /// By snow that falls or is cleared.
    pub(super) snowed: Vec<(u32, u32)>,
    /// By stamps.
    pub(super) stamped: Vec<(u32, u32)>,
}

impl Changed {
    /// Sorts them by tiles. Notes that these may wake, and that their stress is to be evaluated.
    fn noted(mut self, resident: &mut Resident) -> Changed {
        for changes in [&mut self.snowed, &mut self.stamped] {
            changes.sort_unstable();
            let mut tiles: Vec<u32> = changes.iter().map(|&(tile, _)| tile).collect();
            tiles.dedup();
            resident.unweighed.extend(tiles.iter().copied());
            resident.wake(tiles.into_iter());
        }
        self
    }
}

/// All rows of tiles.
pub(super) const ALL_ROWS: Range<u32> = 0..u32::MAX;

impl Planner<'_> {
    /// Plans the edits of one round of all snowpacks: snow falls, then contacts are evaluated, and
    /// stresses where loads or constants may have changed.
    pub fn edits(&mut self, residents: &mut Residents, rounds: Vec<Round>) {
        let first_collider = self.tables.orders.colliders.len();
        let mut edited = Edited::default();
        for round in rounds {
            if let Some(resident) = residents.get_mut(round.slot) {
                self.edit(resident, round, &mut edited);
            }
        }
        self.change_snow(KernelId::Snowfall, edited.edit_jobs);
        self.change_snow(KernelId::Stamp, edited.stamp_jobs);
        for parts in &edited.weather {
            self.weather(|slot| residents.get(slot), parts);
        }
        if edited.colliders > 0 {
            let count = edited.colliders;
            let pass = Pass { first: first_collider, count, ..edit_pass() };
            self.dispatch(KernelId::Contact, 0, pass, count);
        }
        self.stresses(edited.load_jobs);
    }

    /// Plans that stresses are evaluated that edits have left for when something needs them.
    pub fn weigh(&mut self, residents: &mut Residents, slots: impl Iterator<Item = Slot>) {
        let mut jobs = Vec::new();
        for slot in slots {
            let Some(resident) = residents.get_mut(slot) else { continue };
            jobs.extend(unweighed(resident, u32::MAX));
        }
        self.stresses(jobs);
    }

    /// Plans that stresses of some tiles are evaluated that edits have left.
    pub(super) fn weigh_some(&mut self, resident: &mut Resident, count: u32) {
        let jobs = unweighed(resident, count).collect();
        self.stresses(jobs);
    }

    pub(super) fn stresses(&mut self, jobs: Vec<(u32, LoadJob)>) {
        for (page, jobs) in by_page(jobs) {
            let (first, count) = (self.tables.orders.load_jobs.len(), jobs.len() as u32);
            self.tables.orders.load_jobs.extend(jobs);
            self.dispatch(KernelId::Stress, page, Pass { first, count, ..edit_pass() }, count);
        }
    }

    fn edit(&mut self, resident: &mut Resident, round: Round, edited: &mut Edited) {
        let Round { slot, place, edits, runs } = round;
        // Tiles with the operations that touch them.
        let mut changed = Changed::default();
        let mut stressed = BTreeSet::new();
        let mut moved = false;
        let evaluates = edits.iter().any(|(_, edit)| !matches!(edit, Edit::Restore(_)));
        let mut weathered = 0;
        for (result, edit) in edits {
            match edit {
                Edit::Weather(weathering) => {
                    if edited.weather.len() <= weathered {
                        edited.weather.push(Vec::new());
                    }
                    let part = WeatherPart { slot, place, rows: ALL_ROWS, weathering };
                    edited.weather[weathered].push(part);
                    weathered += 1;
                }
                edit if edit.columns().is_some() => {
                    self.operate(resident, &edit, result, ALL_ROWS, &mut changed);
                }
                other => {
                    self.write(resident, &other, 0..resident.lot.places.len() as u32);
                    moved |= self.alter(slot, resident, other, &mut stressed);
                }
            }
        }
        // Snow falls before objects are put: those cover it that were there before.
        let Changed { snowed, stamped } = changed.noted(resident);
        self.edit_jobs(resident, snowed, &mut edited.edit_jobs);
        self.edit_jobs(resident, stamped, &mut edited.stamp_jobs);
        if weathered > 0 {
            resident.note_weather();
        }
        if moved {
            self.mark_loaded(slot, resident);
        }
        if !evaluates {
            // What is restored is left as it was saved; the next cycle evaluates it.
            return;
        }
        if runs {
            self.evaluated.insert(slot);
        }
        stressed.extend(resident.loads.keys().copied());
        resident.wake(stressed.iter().copied());
        for tile in &stressed {
            resident.unweighed.remove(tile);
        }
        edited.colliders += resident.body_rows() as u32;
        let first = self.collider_rows(slot, resident, runs);
        self.load_jobs(first, resident, stressed.into_iter(), &mut edited.load_jobs);
        resident.bodies.values_mut().for_each(|body| body.placed = false);
    }

    /// Writes what the host writes of an edit, for some tiles.
    pub(super) fn write(&self, resident: &Resident, edit: &Edit, tiles: Range<u32>) {
        let (lot, grid) = (&resident.lot, &resident.layout.grid);
        match edit {
            Edit::Restore(contents) => {
                self.arena.restore(self.device, lot, grid.height, tiles, &contents.tiles);
            }
            Edit::SetGround(ground) => {
                self.arena.write_ground(self.device, lot, tiles, grid, ground);
            }
            _ => {}
        }
    }

    /// Adds a change of the snow on some rows of tiles, the result of which has a number, and lists it for their
    /// tiles.
    pub(super) fn operate(
        &mut self,
        resident: &Resident,
        edit: &Edit,
        result: u32,
        rows: Range<u32>,
        changed: &mut Changed,
    ) {
        let Some(whole) = edit.columns() else { return };
        let (first, end) = (rows.start * TILE_SIDE, rows.end.saturating_mul(TILE_SIDE));
        let part = ColumnRect { z0: whole.z0.max(first), z1: whole.z1.min(end), ..whole };
        if part.z0 >= part.z1 {
            return;
        }
        let columns = [part.x0, part.z0, part.x1, part.z1];
        let operation = |kind, snow| Operation { columns, snow, kind, result, padding: [0; 2] };
        let orders = &mut self.tables.orders;
        let (row, tiles) = match edit {
            Edit::Deposit(fall) => {
                (orders.operations.push(operation(DEPOSIT, deposited(fall))), &mut changed.snowed)
            }
            Edit::Lay(fall) => {
                (orders.operations.push(operation(LAY, deposited(fall))), &mut changed.snowed)
            }
            Edit::Clear { depth, .. } => {
                (orders.operations.push(operation(CLEAR, [0, *depth, 0, 0])), &mut changed.snowed)
            }
            Edit::Strip { depth, .. } => {
                (orders.operations.push(operation(STRIP, [0, *depth, 0, 0])), &mut changed.snowed)
            }
            Edit::Stamp(stamp) => {
                let first_share = orders.shares.len();
                let width = (part.x1 - part.x0) as usize;
                let from = (part.z0 - whole.z0) as usize * width;
                let shares = &stamp.coverage.shares[from..];
                let shares = &shares[..(part.z1 - part.z0) as usize * width];
                orders.shares.extend(shares.iter().map(|&share| share.into()));
                let SurfaceLoad { pressure, width } = stamp.load;
                let row = Stamp { columns, first_share, result, pressure, width };
                (orders.stamps.push(row), &mut changed.stamped)
            }
            _ => return,
        };
        tiles.extend(tiles_in(part, resident.row.tiles_x).map(|tile| (tile, row)));
    }

    /// Has the snow changed on some rows of tiles, by edits each with the number of its result.
    pub(super) fn snow_on(
        &mut self,
        resident: &mut Resident,
        edits: &[(u32, Edit)],
        rows: Range<u32>,
    ) {
        let mut changed = Changed::default();
        for (result, edit) in edits {
            self.operate(resident, edit, *result, rows.clone(), &mut changed);
        }
        let Changed { snowed, stamped } = changed.noted(resident);
        for (kernel, tiles) in [(KernelId::Snowfall, snowed), (KernelId::Stamp, stamped)] {
            let mut jobs = Vec::new();
            self.edit_jobs(resident, tiles, &mut jobs);
            self.change_snow(kernel, jobs);
        }
    }

    pub(super) fn change_snow(&mut self, kernel: KernelId, jobs: Vec<(u32, EditJob)>) {
        for (page, jobs) in by_page(jobs) {
            let (first, count) = (self.tables.orders.edit_jobs.len(), jobs.len() as u32);
            self.tables.orders.edit_jobs.extend(jobs);
            self.dispatch(kernel, page, Pass { first, count, ..edit_pass() }, count);
        }
    }

    /// Adds jobs for tiles with the operations that touch them. Tiles that the same operations touch
    /// share a list of them.
    pub(super) fn edit_jobs(
        &mut self,
        resident: &Resident,
        changes: Vec<(u32, u32)>,
        jobs: &mut Vec<(u32, EditJob)>,
    ) {
        let rows = &mut self.tables.orders.operation_lists;
        let all: Vec<u32> = changes.iter().map(|&(_, row)| row).collect();
        let mut left = &all[..];
        let mut lists: HashMap<&[u32], u32> = HashMap::new();
        for changes in changes.chunk_by(|a, b| a.0 == b.0) {
            let (tile, operations) = (changes[0].0, changes.len() as u32);
            let (list, others) = left.split_at(changes.len());
            left = others;
            let first_operation = *lists.entry(list).or_insert_with_key(|list| {
                rows.extend(list.iter().copied());
                rows.len() - operations
            });
            let tile_row = resident.lot.tiles.start + tile;
            let [sheltered, stood_on] = resident.covered.get(&tile).copied().unwrap_or_default();
            let job = EditJob {
                tile: tile_row,
                first_operation,
                operations,
                sheltered_low: sheltered as u32,
                sheltered_high: (sheltered >> 32) as u32,
                stood_on_low: stood_on as u32,
                stood_on_high: (stood_on >> 32) as u32,
                padding: 0,
            };
            jobs.push((resident.page(tile), job));
        }
    }
}

/// Takes tiles whose stress edits have left, at most so many.
fn unweighed(resident: &mut Resident, count: u32) -> impl Iterator<Item = (u32, LoadJob)> {
    std::iter::from_fn(|| {
        let tile = resident.unweighed.pop_first()?;
        let row = resident.lot.tiles.start + tile;
        Some((resident.page(tile), LoadJob { tile: row, ..LoadJob::default() }))
    })
    .take(count as usize)
}

pub(super) fn edit_pass() -> Pass {
    Pass { flags: AFTER_EDITS, ..Pass::default() }
}

/// Sorts jobs by the page of their tile.
pub(super) fn by_page<T>(jobs: Vec<(u32, T)>) -> BTreeMap<u32, Vec<T>> {
    let mut pages: BTreeMap<u32, Vec<T>> = BTreeMap::new();
    for (page, job) in jobs {
        pages.entry(page).or_default().push(job);
    }
    pages
}

/// What a row says of snow that falls.
fn deposited(deposit: &Deposit) -> [u32; 4] {
    let Deposit { depth, mass, temperature, .. } = *deposit;
    // As in Column::deposit: the mass of a full cell of this snow.
    let share = (u64::from(mass) << 24) / u64::from(depth.max(1));
    let share = share.min(u64::from(u32::MAX)) as u32;
    [mass, depth, share, temperature.to_bits()]
}
