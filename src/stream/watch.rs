//! Depths that a subscription watches. No I/O, and no history: a watch knows how it stood when its client
//! was last told.

use firn_protocol::{DepthWatch, Event, Stamp};
use firn_snow::{ColumnRect, Grid};

use crate::session::{Check, Mirror};

use super::region::columns_in;

/// A watched depth.
#[derive(Debug)]
pub struct Watch {
    id: String,
    columns: ColumnRect,
    holds_while: Condition,
    /// Whether it held when the client was last told.
    told: Option<bool>,
}

/// What the mean depth is held against \[m\].
#[derive(Clone, Copy, Debug)]
enum Condition {
    Above(f64),
    Below(f64),
}

/// The watches that a client asks for; what is wrong with them is noted.
pub fn watches(wishes: &[DepthWatch], grid: &Grid, check: &mut Check) -> Vec<Watch> {
    let new = |(number, wish): (usize, &DepthWatch)| {
        let at = format!("/watch/{number}");
        if wishes[..number].iter().any(|before| before.id == wish.id) {
            check.reject(format!("{at}/id"), "another watch of the subscription has this id");
        }
        Watch::new(wish, &at, grid, check)
    };
    wishes.iter().enumerate().filter_map(new).collect()
}

impl Watch {
    fn new(wish: &DepthWatch, at: &str, grid: &Grid, check: &mut Check) -> Option<Watch> {
        check.id(format!("{at}/id"), &wish.id);
        let highest = f64::from(grid.height) * grid.cell_size;
        for (field, depth) in [("above", wish.above), ("below", wish.below)] {
            if let Some(depth) = depth {
                check.range(format!("{at}/{field}"), depth, 0.0, highest, "m");
            }
        }
        let columns = check.take(columns_in(wish.region, grid, &format!("{at}/region")));
        let holds_while = match (wish.above, wish.below) {
            (Some(depth), None) => Condition::Above(depth),
            (None, Some(depth)) => Condition::Below(depth),
            _ => {
                check.reject(at, "exactly one of 'above' and 'below' is expected");
                return None;
            }
        };
        Some(Watch { id: wish.id.clone(), columns: columns?, holds_while, told: None })
    }

    /// How it stands, where the client of a subscription that has seen the state at a seq was told
    /// otherwise, or nothing yet. It counts as told from here on.
    pub fn news(
        &mut self,
        mirror: &Mirror,
        stamp: Stamp,
        subscription: i64,
        seen: u64,
    ) -> Option<Event> {
        if self.told.is_some() && !mirror.has_changed_since(seen, &self.columns) {
            return None;
        }
        let mean_depth = mirror.mean_depth(&self.columns);
        let holds = match self.holds_while {
            Condition::Above(depth) => mean_depth > depth,
            Condition::Below(depth) => mean_depth < depth,
        };
        let is_news = self.told.replace(holds) != Some(holds);
        let id = self.id.clone();
        is_news.then_some(Event::Watch { stamp, subscription, id, holds, mean_depth })
    }
}
