//! The snow's surface between the columns, as the mirror has it.

use firn_protocol::{SampleBatch, SampleField, SampleFields};
use firn_snow::Coverage;

use crate::core::session::Mirror;

/// The surface of a snowpack on its ground.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a>(&'a Mirror);

/// The two columns along an axis between whose centres a point lies, and its part of the way.
struct Between {
    low: u32,
    high: u32,
    part: f64,
}

impl Between {
    /// Beyond the outermost centres there is only the nearest.
    fn new(metres: f64, cell_size: f64, columns: u32) -> Between {
        let last = columns - 1;
        let at = (metres / cell_size - 0.5).clamp(0.0, f64::from(last));
        let low = at.floor();
        Between { low: low as u32, high: (low as u32 + 1).min(last), part: at - low }
    }

    fn mix(&self, value: impl Fn(u32) -> f64) -> f64 {
        let (low, high) = (value(self.low), value(self.high));
        low + (high - low) * self.part
    }
}

impl<'a> Surface<'a> {
    /// The surface that a mirror shows.
    pub fn new(mirror: &'a Mirror) -> Surface<'a> {
        Surface(mirror)
    }

    /// Snow depth at a point in metres \[m\].
    pub fn depth(&self, x: f64, z: f64) -> f64 {
        self.between(x, z, |x, z| self.column_depth(x, z))
    }

    /// Elevation of the ground there \[m\].
    pub fn ground(&self, x: f64, z: f64) -> f64 {
        self.between(x, z, |x, z| self.column_ground(x, z))
    }

    /// Unit vector (x, y, z) that stands on the surface there. Slopes are those between the neighbours of
    /// each column, bilinear between the centres: so it turns smoothly along the way.
    pub fn normal(&self, x: f64, z: f64) -> [f64; 3] {
        let grid = &self.0.grid;
        let along_x = self.between(x, z, |x, z| self.slope(x, grid.width, |x| (x, z)));
        let along_z = self.between(x, z, |x, z| self.slope(z, grid.depth, |z| (x, z)));
        let length = (along_x * along_x + 1.0 + along_z * along_z).sqrt();
        [(0.0 - along_x) / length, 1.0 / length, (0.0 - along_z) / length]
    }

    /// The lowest elevation of the columns that something covers \[m\].
    pub fn lowest(&self, coverage: &Coverage) -> f64 {
        let covered = coverage.iter();
        let elevations = covered.map(|(x, z)| self.column_ground(x, z) + self.column_depth(x, z));
        elevations.fold(f64::INFINITY, f64::min)
    }

    /// What the surface says of a batch's fields at its points.
    pub fn sample(&self, batch: &SampleBatch) -> SampleFields {
        fn of<T>(
            batch: &SampleBatch,
            field: SampleField,
            value: impl Fn(f64, f64) -> T,
        ) -> Option<Vec<T>> {
            let values = || batch.points.iter().map(|&[x, z]| value(x, z)).collect();
            batch.fields.contains(&field).then(values)
        }
        SampleFields {
            depth: of(batch, SampleField::Depth, |x, z| self.depth(x, z)),
            ground: of(batch, SampleField::Ground, |x, z| self.ground(x, z)),
            elevation: of(batch, SampleField::Elevation, |x, z| {
                self.ground(x, z) + self.depth(x, z)
            }),
            normal: of(batch, SampleField::Normal, |x, z| self.normal(x, z)),
            ..SampleFields::default()
        }
    }

    /// A value of columns, bilinear between their centres.
    fn between(&self, x: f64, z: f64, value: impl Fn(u32, u32) -> f64) -> f64 {
        let grid = &self.0.grid;
        let along_x = Between::new(x, grid.cell_size, grid.width);
        let along_z = Between::new(z, grid.cell_size, grid.depth);
        along_z.mix(|z| along_x.mix(|x| value(x, z)))
    }

    /// Slope at a column's centre along an axis, between its neighbours; at an edge it is one of them.
    fn slope(&self, at: u32, columns: u32, column: impl Fn(u32) -> (u32, u32)) -> f64 {
        let (low, high) = (at.saturating_sub(1), (at + 1).min(columns - 1));
        let elevation = |at| {
            let (x, z) = column(at);
            self.column_ground(x, z) + self.column_depth(x, z)
        };
        let run = f64::from(high - low) * self.0.grid.cell_size;
        if run > 0.0 { (elevation(high) - elevation(low)) / run } else { 0.0 }
    }

    fn column_depth(&self, x: u32, z: u32) -> f64 {
        self.0.grid.metres(u64::from(self.0.height(x, z)))
    }

    fn column_ground(&self, x: u32, z: u32) -> f64 {
        self.0.ground.height(&self.0.grid, x, z)
    }
}
