//! Objects on the snow, as a snowpack knows them.

use crate::body::Cover;
use crate::contact::Contact;
use crate::footprint::Footprint;
use crate::grid::Grid;

use super::tile::Tile;

/// An object on the snow.
#[derive(Clone, Debug)]
pub(super) struct Collider {
    pub(super) mass: f64,
    pub(super) cover: Cover,
    /// What it stands on.
    pub(super) stands: Vec<Stand>,
    /// Tiles under it, in ascending order.
    pub(super) tiles: Vec<usize>,
    pub(super) contact: Contact,
    /// Contact has never been evaluated since the object was put where it is.
    pub(super) placed: bool,
    /// The object or its contact is not what the stresses below it were evaluated for.
    pub(super) changed: bool,
}

/// One of the footprints that an object stands on.
#[derive(Clone, Debug)]
pub(super) struct Stand {
    pub(super) footprint: Footprint,
    /// Tile of each column, the column's index in it, and how high the underside is over it in quanta.
    pub(super) columns: Vec<(usize, usize, u32)>,
    /// How wide its load spreads \[m\].
    pub(super) width: f32,
}

impl Stand {
    pub(super) fn new(footprint: Footprint, grid: &Grid) -> Stand {
        let columns = footprint.iter().map(|(x, z)| {
            let (tile, column) = grid.locate(x, z);
            (tile as usize, column as usize, footprint.lift_over(x, z))
        });
        Stand { columns: columns.collect(), footprint, width: 0.0 }
    }
}

impl Collider {
    /// Evaluates contact with the columns as they are.
    pub(super) fn evaluate(&mut self, tiles: &[Tile]) {
        let footprints = self.stands.iter().map(|stand| {
            let columns = stand.columns.iter();
            let under = columns.map(|&(tile, column, lift)| tiles[tile].surface(column).less(lift));
            (&stand.footprint, under)
        });
        let mut widths = vec![0.0; self.stands.len()];
        let old = self.contact;
        let mut new = Contact::evaluate(self.mass, footprints, &mut widths);
        if !self.placed {
            (new.reference, new.last_cycle) = (old.reference, old.last_cycle);
        }
        self.stands.iter_mut().zip(widths).for_each(|(stand, width)| stand.width = width);
        self.placed = false;
        self.changed |= new.footing() != old.footing();
        self.contact = new;
    }

    /// Columns that its footprints stand for.
    pub(super) fn columns(&self) -> u64 {
        self.stands.iter().map(|stand| stand.columns.len() as u64).sum()
    }
}
