//! A snowpack on the device, as the host knows it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use firn_snow::{Cover, Elevation, GRAVITY, Grid};

use crate::frame::{Edit, Layout, Placement, Slot};

use super::arena::Lot;
use super::furnish::Unfurnished;
use super::job::Job;
use super::layout::{self, NONE};
use super::orders::Orders;

/// Snowpacks on the device, by their slots.
#[derive(Debug, Default)]
pub struct Residents(Vec<Option<Resident>>);

impl Residents {
    /// The snowpack in a slot.
    pub fn get(&self, slot: Slot) -> Option<&Resident> {
        self.0.get(slot as usize)?.as_ref()
    }

    /// The snowpack in a slot.
    pub fn get_mut(&mut self, slot: Slot) -> Option<&mut Resident> {
        self.0.get_mut(slot as usize)?.as_mut()
    }

    /// Puts a snowpack into a slot.
    pub fn insert(&mut self, slot: Slot, resident: Resident) {
        if self.0.len() <= slot as usize {
            self.0.resize_with(slot as usize + 1, || None);
        }
        self.0[slot as usize] = Some(resident);
    }

    /// Takes the snowpack out of a slot.
    pub fn remove(&mut self, slot: Slot) -> Option<Resident> {
        self.0.get_mut(slot as usize)?.take()
    }
}

/// A snowpack on the device.
#[derive(Debug)]
pub struct Resident {
    /// Its part of the arena.
    pub lot: Lot,
    /// What it was made with, material and ground as they are now.
    pub layout: Layout,
    /// The lowest ground.
    pub lowest: Elevation,
    /// Its row of constants.
    pub row: layout::Session,
    /// Objects on it; loads add up in the order of their ids.
    pub bodies: BTreeMap<Arc<str>, Body>,
    /// For each tile under an object the footprints on it, by the rank of their rows.
    pub loads: BTreeMap<u32, Vec<u32>>,
    /// For each of those tiles the columns, bit by bit, on which no snow falls because of objects, and those on which
    /// objects stand.
    pub covered: BTreeMap<u32, [u64; 2]>,
    /// Tiles under no object whose snow was edited, and whose stress has not been evaluated since:
    /// nothing has needed it.
    pub unweighed: BTreeSet<u32>,
    /// Tiles under no object that may be awake; none where all of them may be.
    pub awake: Option<BTreeSet<u32>>,
    /// What is left to be done before anything else.
    pub unfurnished: Option<Unfurnished>,
    /// Work of it that has begun and not ended.
    pub job: Option<Box<Job>>,
}

/// An object on the device.
#[derive(Debug)]
pub struct Body {
    /// Its load and where it stands.
    pub placement: Arc<Placement>,
    /// Its first row in the table of contacts; each of its footprints has one.
    pub contact: u32,
    /// Tiles under each of its footprints, by their index in the snowpack, with their columns, bit by bit.
    footprint_tiles: Vec<Vec<(u32, u64)>>,
    /// Whether the next evaluation begins to count the depth it sinks.
    pub placed: bool,
}

impl Body {
    /// An object whose rows in the table of contacts begin at `contact`.
    pub fn new(placement: Arc<Placement>, contact: u32, placed: bool, grid: &Grid) -> Body {
        let footprint_tiles =
            placement.footprints.iter().map(|it| it.columns_of_tiles(grid)).collect();
        Body { placement, contact, footprint_tiles, placed }
    }

    /// Rows that it has in the tables of colliders and contacts: one for each footprint.
    pub fn rows(&self) -> u32 {
        self.placement.footprints.len() as u32
    }

    /// Tiles under it. A tile may be told for several footprints.
    pub fn tiles(&self) -> impl Iterator<Item = u32> + '_ {
        self.footprint_tiles.iter().flatten().map(|(tile, _)| *tile)
    }
}

impl Resident {
    /// A snowpack without objects.
    pub fn new(lot: Lot, layout: Layout, unfurnished: Unfurnished) -> Resident {
        let row = layout::Session::new(&layout, lot.tiles.start);
        Resident {
            lot,
            lowest: lowest(&layout.grid, &layout.ground),
            layout,
            row,
            bodies: BTreeMap::new(),
            loads: BTreeMap::new(),
            covered: BTreeMap::new(),
            unweighed: BTreeSet::new(),
            awake: Some(BTreeSet::new()),
            unfurnished: Some(unfurnished),
            job: None,
        }
    }

    /// Whether its snow is alpine: it does not creep under its weight from cycle to cycle.
    pub fn is_alpine(&self) -> bool {
        self.layout.surface.is_some()
    }

    /// Notes that some tiles may wake.
    pub fn wake(&mut self, tiles: impl ExactSizeIterator<Item = u32>) {
        if tiles.len() == self.lot.places.len() {
            self.awake = None;
        } else if let Some(awake) = &mut self.awake {
            awake.extend(tiles);
        }
    }

    /// Notes that the stress of all its snow is another, and that no cycle changes what is under no object.
    pub fn note_weather(&mut self) {
        let tiles = self.lot.places.len();
        if self.unweighed.len() < tiles {
            self.unweighed = (0..tiles as u32).collect();
        }
    }

    /// Tiles that may be awake, and perhaps some of those under objects.
    pub fn may_move(&self) -> impl Iterator<Item = u32> + '_ {
        let all = if self.awake.is_none() { self.lot.places.len() as u32 } else { 0 };
        self.awake.iter().flatten().copied().chain(0..all)
    }

    /// Tiles under no object that a cycle may change.
    pub fn free(&self) -> impl Iterator<Item = u32> + '_ {
        self.may_move().filter(|tile| !self.loads.contains_key(tile))
    }

    /// How many they are at the most.
    pub fn most_free(&self) -> usize {
        self.awake.as_ref().map_or(self.lot.places.len(), BTreeSet::len)
    }

    /// Page of one of its tiles.
    pub fn page(&self, tile: u32) -> u32 {
        self.lot.places[tile as usize].page
    }

    /// Rows of its objects in the table of colliders.
    pub fn body_rows(&self) -> usize {
        self.bodies.values().map(|body| body.rows() as usize).sum()
    }

    /// Adds the rows of its objects, in ascending order of ids. `runs` says whether a cycle follows the
    /// evaluation that they are for.
    pub fn collider_rows(&self, slot: Slot, runs: bool, orders: &mut Orders) {
        for body in self.bodies.values() {
            for (i, footprint) in (0..).zip(&body.placement.footprints) {
                let (x0, x1) = footprint.extent();
                orders.colliders.push(layout::Collider {
                    session: slot,
                    contact: body.contact + i,
                    z0: footprint.z0,
                    first_span: orders.spans.len(),
                    rows: footprint.spans.len() as u32,
                    columns: footprint.columns,
                    x0,
                    x1,
                    area: footprint.area as f32,
                    weight: (body.placement.mass * GRAVITY) as f32,
                    placed: u32::from(body.placed),
                    runs: u32::from(runs),
                    footprints: if i == 0 { body.rows() } else { 0 },
                    overhang: footprint.overhang,
                    first_lift: if footprint.lifts.is_empty() { NONE } else { orders.lifts.len() },
                });
                orders.spans.extend(footprint.spans.iter().map(|&(x0, x1)| [x0, x1]));
                orders.lifts.extend(footprint.lifts.iter().copied());
            }
        }
    }

    /// Lists the objects on each tile anew. Returns the tiles that have come under an object, or
    /// are under none any more.
    pub fn list_loads(&mut self) -> Vec<u32> {
        let old: BTreeSet<u32> = std::mem::take(&mut self.loads).into_keys().collect();
        let footprints = self.bodies.values().flat_map(|body| &body.footprint_tiles);
        for (rank, tiles) in (0..).zip(footprints) {
            for &(tile, _) in tiles {
                self.loads.entry(tile).or_default().push(rank);
            }
        }
        self.covered.clear();
        for body in self.bodies.values() {
            let Cover { snow, clearings } = body.placement.cover;
            for (tile, columns) in body.footprint_tiles.iter().flatten() {
                let covered = self.covered.entry(*tile).or_default();
                covered[0] |= if snow { *columns } else { 0 };
                covered[1] |= if clearings { *columns } else { 0 };
            }
        }
        let new: BTreeSet<u32> = self.loads.keys().copied().collect();
        old.symmetric_difference(&new).copied().collect()
    }
}

/// The lowest of some elevations \[m\]; level ground is at 0.
pub fn lowest(grid: &Grid, ground: &[f64]) -> Elevation {
    let lowest = ground.iter().copied().reduce(f64::min).unwrap_or(0.0);
    Elevation::new(grid, lowest)
}

/// Most rows that one round may fill in the table of lists, for all snowpacks together. The table has to fit
/// into one binding.
pub const LARGEST_ROUND: u64 = 1 << 22;

/// Splits numbered edits into rounds: in a round all snow falls before any is pressed, and that before any object
/// is put, so that each can be one dispatch for all snowpacks. Later puts of an object in a round replace earlier
/// ones. What the host writes begins a round, because it is written ahead of the round's submit. Each comes with
/// the rows of the table of lists that it fills at the most.
pub fn rounds(edits: Vec<(u32, Edit)>) -> Vec<(Vec<(u32, Edit)>, u64)> {
    let mut rounds: Vec<(Vec<(u32, Edit)>, u64)> = Vec::new();
    let mut last = 0;
    for (number, edit) in edits {
        let listed = edit.columns().filter(|_| !matches!(edit, Edit::Weather(_)));
        let rows = listed.map_or(0, |columns| columns.tiles().columns());
        let phase = match &edit {
            Edit::Deposit(_) | Edit::Lay(_) | Edit::Clear { .. } | Edit::Strip { .. } => 0,
            Edit::Stamp(_) => 1,
            Edit::Weather(_) => 2,
            _ => 3,
        };
        let written = matches!(edit, Edit::Restore(_) | Edit::SetGround(_));
        // Steps of weather have rounds of their own.
        let changes = (phase == 2) != (last == 2);
        let begins = rounds.last().is_none_or(|(_, filled)| {
            phase < last || changes || written || filled + rows > LARGEST_ROUND
        });
        last = phase;
        if begins {
            rounds.push((Vec::new(), 0));
        }
        if let Some((round, filled)) = rounds.last_mut() {
            round.push((number, edit));
            *filled += rows;
        }
    }
    rounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Deposit;
    use firn_snow::ColumnRect;

    #[test]
    fn a_round_fills_no_more_rows_than_can_be_bound() {
        let columns = ColumnRect { x0: 0, z0: 0, x1: 2048, z1: 2048 };
        let tiles = 256 * 256;
        let fall = Edit::Deposit(Deposit { columns, depth: 1, mass: 1, temperature: -3.0 });
        let falls = LARGEST_ROUND / tiles * 2 + 1;
        let rounds = rounds((0..falls as u32).map(|number| (number, fall.clone())).collect());
        let sizes: Vec<_> =
            rounds.iter().map(|(round, rows)| (round.len() as u64, *rows)).collect();
        let full = (falls / 2, LARGEST_ROUND);
        assert_eq!(sizes, [full, full, (1, tiles)]);
        let numbers = rounds.iter().flat_map(|(round, _)| round.iter().map(|(number, _)| *number));
        assert!(numbers.eq(0..falls as u32), "they stay in order");
    }
}
