//! A depth that a client watches, and what it was told of it.

use firn::session::Mirror;
use firn_protocol::{ColumnRegion, DepthWatch, Event};
use firn_snow::Grid;
use rand::Rng;
use rand::rngs::SmallRng;

/// A watch, and how it stood when its client was last told.
pub struct Watched {
    /// What the client asks for.
    pub wish: DepthWatch,
    told: Option<bool>,
}

impl Watched {
    /// Of some columns and some depth.
    pub fn new(grid: &Grid, dice: &mut SmallRng) -> Watched {
        let mut span = |columns: u32| {
            let first = dice.random_range(0..columns);
            (i64::from(first), u64::from(dice.random_range(first..columns) - first + 1))
        };
        let ((column_x, width), (column_z, depth)) = (span(grid.width), span(grid.depth));
        let highest = f64::from(grid.height) * grid.cell_size;
        let wish = DepthWatch {
            id: "depth".to_owned(),
            region: Some(ColumnRegion { column_x, column_z, width, depth }),
            above: Some(dice.random_range(0.0..highest / 2.0)),
            below: None,
        };
        Watched { wish, told: None }
    }

    /// Takes an event in.
    ///
    /// # Errors
    /// Where it is no news.
    pub fn hear(&mut self, event: Event) -> Result<(), String> {
        match event {
            Event::Watch { holds, mean_depth, .. } if self.told != Some(holds) => {
                self.told = Some(holds);
                if holds == (self.wish.above < Some(mean_depth)) {
                    return Ok(());
                }
                Err(format!(
                    "a mean depth of {mean_depth} m is taken for another side of {:?}",
                    self.wish
                ))
            }
            other => Err(format!("{:?} is told again as {other:?}", self.wish)),
        }
    }

    /// Compares what was told with what is there.
    ///
    /// # Errors
    /// Where a crossing was missed.
    pub fn check(&self, mirror: &Mirror) -> Result<(), String> {
        let Some(region) = self.wish.region else { return Ok(()) };
        let (x0, z0) = (region.column_x as u32, region.column_z as u32);
        let (x1, z1) = (x0 + region.width as u32, z0 + region.depth as u32);
        let columns = (z0..z1).flat_map(|z| (x0..x1).map(move |x| (x, z)));
        let sum: u64 = columns.map(|(x, z)| u64::from(mirror.height(x, z))).sum();
        let mean_depth = mirror.grid.metres(sum) / (region.width * region.depth) as f64;
        let holds = self.wish.above < Some(mean_depth);
        if self.told == Some(holds) {
            return Ok(());
        }
        Err(format!(
            "{:?} was told as {:?}, at a mean depth of {mean_depth} m",
            self.wish, self.told
        ))
    }
}
