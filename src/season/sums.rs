//! A day of one column, and of several: sums that means are made of.

use firn_snow::alpine::{Scratch, Surface, WeatherStep};
use firn_snow::{Column, Grid, MASS_QUANTA};
use time::Date;

use super::daily::Day;
use super::ledger::Ledger;

/// A step of weather, and what is known of it beside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub weather: WeatherStep,
    /// Whether a full hour ends with it.
    pub ends_hour: bool,
    /// Mass that is gathered over every column after it, in quanta.
    pub gathered: u64,
}

/// A column of snow and its surface.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub column: Column,
    pub surface: Surface,
}

/// Sums over the steps and the hours of a day, and over columns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    steps: f64,
    hours: f64,
    columns: f64,
    depth: f64,
    water: f64,
    liquid: f64,
    skin: f64,
    albedo: f64,
    cells: f64,
    /// What the columns exchanged; what fell is not entered.
    pub ledger: Ledger,
}

impl Place {
    /// Takes a day's steps.
    pub fn pass(&mut self, steps: &[Step], grid: &Grid, scratch: &mut Scratch) -> Sums {
        let mut sums = Sums { columns: 1.0, ..Sums::default() };
        for step in steps {
            let stepped =
                self.column.weather(&mut self.surface, &step.weather, grid, 1.0, false, scratch);
            sums.ledger.enter(&stepped.exchange);
            sums.steps += 1.0;
            sums.skin += f64::from(self.surface.skin);
            if step.ends_hour {
                sums.albedo += f64::from(stepped.albedo);
                sums.see(&self.column, grid, step.gathered);
            }
        }
        sums.ledger.present = u64::from(self.column.mass());
        sums
    }
}

impl Sums {
    /// Takes in a column as it is at a full hour.
    fn see(&mut self, column: &Column, grid: &Grid, gathered: u64) {
        let liquid: u64 = column.cells.iter().map(|cell| u64::from(cell.water())).sum();
        self.hours += 1.0;
        self.depth += grid.metres(u64::from(column.height()));
        self.water += (u64::from(column.mass()) + gathered) as f64 / MASS_QUANTA;
        self.liquid += liquid as f64 / MASS_QUANTA;
        self.cells += column.cells.len() as f64;
    }

    /// Adds those of other columns.
    pub fn add(&mut self, other: &Sums) {
        self.steps += other.steps;
        self.hours += other.hours;
        self.columns += other.columns;
        self.depth += other.depth;
        self.water += other.water;
        self.liquid += other.liquid;
        self.skin += other.skin;
        self.albedo += other.albedo;
        self.cells += other.cells;
        self.ledger.add(&other.ledger);
    }

    /// The day that they make; none where no hour of it was seen.
    pub fn day(&self, date: Date) -> Option<Day> {
        if self.hours == 0.0 {
            return None;
        }
        Some(Day {
            date,
            hours: (self.hours / self.columns) as u32,
            depth: self.depth / self.hours,
            water: self.water / self.hours,
            liquid: self.liquid / self.hours,
            skin: self.skin / self.steps,
            albedo: self.albedo / self.hours,
            runoff: self.ledger.runoff as f64 / MASS_QUANTA / self.columns,
            cells: self.cells / self.hours,
        })
    }
}
