//! Prints that loads press into the snow.

use firn_protocol::{StampBatch, StampSpec};
use firn_snow::{Coverage, GRAVITY, Grid, Shape, Turn};

use crate::core::session::{
    Check, Command, Decision, Invalid, SessionError, SessionState, Stamping, Told, prints,
};

/// Most stamps of a batch.
const LARGEST_BATCH: usize = 4096;

/// Columns that the stamps of a batch may cover together.
const MOST_COLUMNS: u64 = 1 << 22;

impl SessionState {
    pub(crate) fn decide_stamps(&self, batch: &StampBatch) -> Result<Decision, SessionError> {
        let mut check = Check::default();
        let count = batch.stamps.len();
        if !(1..=LARGEST_BATCH).contains(&count) {
            let detail = format!("{count} stamps; a request has 1 to {LARGEST_BATCH}");
            return Err(SessionError::Invalid(vec![Invalid::new("/stamps", detail)]));
        }
        let stamps = (0..).zip(&batch.stamps);
        let stamps = stamps.filter_map(|(i, spec)| check.stamp(&format!("/stamps/{i}"), spec));
        let stamps: Vec<Stamping> = stamps.collect();
        let most = |stamp: &Stamping| {
            Coverage::most_columns(&self.grid, &stamp.shape, Turn::new(stamp.heading))
        };
        let columns = stamps.iter().map(most).fold(0, u64::saturating_add);
        if columns > MOST_COLUMNS {
            let detail = format!("they may cover {columns} columns; {MOST_COLUMNS} are allowed");
            check.reject("/stamps", detail);
        }
        check.finish()?;
        let mut check = Check::default();
        let prints = (0..).zip(prints(&stamps, &self.grid)).filter_map(|(i, print)| {
            if print.is_none() {
                check.reject(format!("/stamps/{i}/position"), outside(&self.grid));
            }
            print
        });
        let prints = prints.collect();
        check.finish()?;
        Ok(Decision { command: Command::Stamps(stamps), told: Told::Stamps(prints) })
    }
}

/// Says that something covers nothing of the grid.
fn outside(grid: &Grid) -> String {
    let (width, depth) = (f64::from(grid.width), f64::from(grid.depth));
    format!(
        "it covers nothing of the grid, which is 0 to {} m along x and 0 to {} m along z",
        width * grid.cell_size,
        depth * grid.cell_size
    )
}

impl Check {
    /// Notes what is wrong with a stamp; returns it where that is nothing.
    fn stamp(&mut self, at: &str, spec: &StampSpec) -> Option<Stamping> {
        let before = self.errors().len();
        self.shape(&format!("{at}/shape"), &spec.shape);
        self.range(format!("{at}/heading"), spec.heading, -36_000.0, 36_000.0, "°");
        if matches!(spec.shape, Shape::Wheel { .. }) {
            self.reject(format!("{at}/shape/type"), "a wheel has no print of its own; stamp a box");
        }
        let pressure = match (spec.mass, spec.pressure) {
            (Some(mass), None) => {
                self.range(format!("{at}/mass"), mass, f64::MIN_POSITIVE, 1e9, "kg");
                mass * GRAVITY / spec.shape.area()
            }
            (None, Some(pressure)) => {
                self.range(format!("{at}/pressure"), pressure, f64::MIN_POSITIVE, 1e9, "Pa");
                pressure
            }
            (Some(_), Some(_)) => {
                self.reject(
                    format!("{at}/pressure"),
                    "is there beside a mass; a stamp has one or the other",
                );
                0.0
            }
            (None, None) => {
                self.reject(format!("{at}/mass"), "is missing; a stamp has a mass or a pressure");
                0.0
            }
        };
        (self.errors().len() == before).then(|| Stamping {
            shape: spec.shape.clone(),
            position: spec.position,
            heading: spec.heading,
            pressure,
        })
    }
}
