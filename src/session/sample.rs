//! Samples: the snow at many points.

use std::collections::HashMap;
use std::sync::Arc;

use firn_protocol::{SampleBatch, SampleField, SampleFields, SampleReply};
use firn_snow::{Cell, Column, Grid};
use rayon::prelude::*;

use crate::core::session::{Check, SessionError, gather};
use crate::session::handle::Session;
use crate::session::reading::{Cycles, Found, Reading, sink};

/// Most points of one request.
const MOST_POINTS: usize = 1 << 16;

/// Points outside the grid that are told; more would only repeat it.
const MOST_TOLD: usize = 16;

/// Characters of a number in JSON, with what parts it from the next; few are longer.
const LONGEST_NUMBER: usize = 22;

impl Session {
    /// The snow at some points. What the host knows is not asked of the device.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range; [`SessionError::TooManyWaiting`].
    pub fn sample(
        self: &Arc<Session>,
        batch: SampleBatch,
    ) -> Result<Reading<SampleReply>, SessionError> {
        check(&batch, &self.spec.grid, self.steady_cycle())?;
        let batch = Arc::new(batch);
        let SampleBatch { points, fields, .. } = &*batch;
        let cells = match fields {
            _ if fields.contains(&SampleField::Sink) => self.spec.grid.height,
            _ if fields.iter().any(|field| field.is_of_cells()) => 1,
            _ => 0,
        };
        let (asked, grid) = (batch.clone(), self.spec.grid);
        let evaluate = move |found: Found| SampleReply {
            stamp: found.gathered.stamp,
            fields: said(&asked, found, &grid),
        };
        let answer = points.len() * columns(fields) * LONGEST_NUMBER;
        let reading = Reading::new(self, size_of_val(&points[..]), answer, evaluate)?;
        let reading = reading.with_surface(batch.clone());
        Ok(if cells > 0 { reading.with_cells(points.iter().copied(), cells) } else { reading })
    }
}

/// Numbers that some fields have for each point.
pub fn columns(fields: &[SampleField]) -> usize {
    fields.iter().map(|field| if *field == SampleField::Normal { 3 } else { 1 }).sum()
}

/// Checks a batch, in cycles of `dt` seconds.
fn check(batch: &SampleBatch, grid: &Grid, dt: f64) -> Result<(), SessionError> {
    let SampleBatch { points, fields, load } = batch;
    let mut check = Check::default();
    let count = points.len();
    if !(1..=MOST_POINTS).contains(&count) {
        check.reject("/points", format!("{count} points; 1 to {MOST_POINTS} are answered"));
    }
    let edges = [grid.width, grid.depth].map(|columns| f64::from(columns) * grid.cell_size);
    let inside =
        |point: &[f64; 2]| point.iter().zip(edges).all(|(at, edge)| (0.0..=edge).contains(at));
    let outside = points.iter().enumerate().filter(|(_, point)| !inside(point));
    for (i, [x, z]) in outside.take(MOST_TOLD) {
        let [width, depth] = edges;
        check.reject(
            format!("/points/{i}"),
            format!("[{x}, {z}] is outside the grid, which is from 0 to {width} m along x and 0 to {depth} m along z"),
        );
    }
    if fields.is_empty() {
        check.reject("/fields", "names nothing; leave it out for what is known of the surface");
    }
    for (i, field) in fields.iter().enumerate() {
        if fields[..i].contains(field) {
            check.reject(format!("/fields/{i}"), "is wanted twice");
        }
    }
    match load {
        Some(load) => {
            let at = |field: &str| format!("/load/{field}");
            Cycles::default().check(&mut check, load, count, dt, at);
        }
        None if fields.contains(&SampleField::Sink) => {
            check.reject("/load", "is missing; `sink` is the depth that it would sink");
        }
        None => {}
    }
    check.finish()
}

/// What was found of the surface, and beside it what the cells say.
fn said(batch: &SampleBatch, found: Found, grid: &Grid) -> SampleFields {
    let gathered = &found.gathered;
    let wants = |field| batch.fields.contains(&field);
    let kinds = Kinds::new(&gathered.columns);
    let places: Vec<usize> = match gathered.columns.len() {
        0 => Vec::new(),
        _ => batch.points.iter().map(|&point| kinds.of[found.place(point, grid)]).collect(),
    };
    let density = |column: &Column| column.cells.last().map(|top| gather::density(top, grid));
    let hardness =
        |column: &Column| column.surface_hardness(grid, &gathered.material).map(f64::from);
    let load = batch.load.filter(|_| wants(SampleField::Sink));
    SampleFields {
        density: wants(SampleField::Density).then(|| kinds.values(&places, density)),
        hardness: wants(SampleField::Hardness).then(|| kinds.values(&places, hardness)),
        sink: load.map(|load| kinds.values(&places, |column| sink(column, &load, gathered, grid))),
        ..gathered.surface.clone()
    }
}

/// Columns, each kind once: where snow fell evenly and nobody has been since, they are alike to the last bit.
struct Kinds<'a> {
    columns: Vec<&'a Column>,
    /// The kind of each column.
    of: Vec<usize>,
}

impl<'a> Kinds<'a> {
    fn new(columns: &'a [Column]) -> Kinds<'a> {
        // Stress is evaluated under the load that is tried.
        let bits = |cell: &Cell| (cell.mass, cell.thickness, cell.temperature.to_bits());
        let mut known = HashMap::new();
        let mut kinds = Kinds { columns: Vec::new(), of: Vec::with_capacity(columns.len()) };
        for column in columns {
            let key: Vec<_> = column.cells.iter().map(bits).collect();
            let kind = *known.entry(key).or_insert_with(|| {
                kinds.columns.push(column);
                kinds.columns.len() - 1
            });
            kinds.of.push(kind);
        }
        kinds
    }

    /// A value at places of some kinds.
    fn values<T: Copy + Send>(
        &self,
        places: &[usize],
        value: impl Fn(&Column) -> T + Send + Sync,
    ) -> Vec<T> {
        let values: Vec<T> = self.columns.par_iter().map(|column| value(column)).collect();
        places.iter().map(|&kind| values[kind]).collect()
    }
}
