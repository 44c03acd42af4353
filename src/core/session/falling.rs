//! Continuous snowfall, kept to the fraction of a quantum until there is enough to deposit, and then laid on
//! one band of a large grid after another.

use firn_protocol::SessionSpec;
use firn_snow::{CELL, ColumnRect, Grid, MASS_QUANTA, TILE_SIDE};
use serde::{Deserialize, Serialize};

use crate::core::session::{Command, densest};

/// Least depth that is deposited, h/256, in quanta.
const LEAST: f64 = (CELL / 256) as f64;

/// Fewest columns of a band: less takes no time worth speaking of, on any device.
const LEAST_COLUMNS: u64 = 1 << 12;

/// Snow of one tick, in quanta of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Snowing {
    depth: f64,
    mass: f64,
}

impl Snowing {
    /// Snow of a rate \[m/h\] and density \[kg/m³\] in a tick of some length \[s\].
    pub fn new(rate: f64, density: f64, dt: f64, grid: &Grid) -> Snowing {
        let depth = rate / 3600.0 * dt;
        Snowing {
            depth: depth / grid.cell_size * f64::from(CELL),
            mass: depth * density * MASS_QUANTA,
        }
    }
}

/// Snow that has not been deposited yet.
///
/// It is derived from ticks, so that the portions in which ticks are taken make no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Falling {
    /// Tick at which `depth` and `mass` were in the air.
    tick: u64,
    depth: f64,
    mass: f64,
    /// What has fallen before that, where some bands are still without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    spreading: Option<Spreading>,
}

/// Snow that lies on the first bands of a grid, and is still to be laid on the others. It is as it was when
/// it fell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Spreading {
    /// In quanta of one column.
    depth: u64,
    mass: u64,
    celsius: f32,
    /// Bands on which it lies.
    bands: u32,
}

/// Columns that get their snow at the same tick: whole rows of tiles, as many in each band as make up
/// [`LEAST_COLUMNS`]. A small grid is one band.
struct Bands<'a> {
    grid: &'a Grid,
    count: u32,
}

impl Bands<'_> {
    fn of(grid: &Grid) -> Bands<'_> {
        let row = u64::from(grid.width) * u64::from(TILE_SIDE);
        let rows_of_band = LEAST_COLUMNS.div_ceil(row);
        let count = (u64::from(grid.tiles_z()) / rows_of_band).max(1) as u32;
        Bands { grid, count }
    }

    /// Columns of the bands from one to another.
    fn columns(&self, first: u32, end: u32) -> ColumnRect {
        let rows = u64::from(self.grid.tiles_z());
        let edge = |band: u32| {
            let row = (rows * u64::from(band) / u64::from(self.count)) as u32;
            (row * TILE_SIDE).min(self.grid.depth)
        };
        ColumnRect { z0: edge(first), z1: edge(end), ..self.grid.all() }
    }

    /// Depth that is in the air when snow is laid on the next band, with it on the first ones already. Where
    /// it lies on all of them, that is enough to begin anew.
    fn due(&self, laid: u32) -> f64 {
        LEAST * f64::from(laid) / f64::from(self.count)
    }
}

impl Spreading {
    /// Lays it on bands up to one, if there are any.
    fn lay_up_to(&mut self, end: u32, bands: &Bands) -> Option<Command> {
        let Spreading { depth, mass, celsius, bands: first } = *self;
        self.bands = end;
        let columns = bands.columns(first, end);
        (first < end).then_some(Command::Deposit { columns, depth, mass, celsius })
    }
}

impl Falling {
    /// Whether it is not impossible at a tick, while snow falls or does not.
    pub fn is_sound(&self, tick: u64, snows: bool, spec: &SessionSpec) -> bool {
        // A tick may bring much, but no more than all slots of a column hold.
        let most = f64::from(spec.grid.height) * f64::from(CELL);
        let heaviest = |depth: f64| {
            depth * spec.grid.cell_size * densest(&spec.material, spec.physics) / 64.0 * 1.001 + 2.0
        };
        let spreads = |spreading: Spreading| {
            let depth = spreading.depth as f64;
            snows
                && (LEAST..=(1u64 << 53) as f64).contains(&depth)
                && (1.0..=heaviest(depth)).contains(&(spreading.mass as f64))
                && (-60.0..=0.0).contains(&spreading.celsius)
                && (1..Bands::of(&spec.grid).count).contains(&spreading.bands)
        };
        self.tick <= tick
            && (0.0..=most).contains(&self.depth)
            && (0.0..=heaviest(self.depth)).contains(&self.mass)
            && self.spreading.is_none_or(spreads)
    }

    /// Counts what has fallen up to a tick, before it snows otherwise.
    pub fn mark(&mut self, tick: u64, snowing: Snowing) {
        self.mass += (tick - self.tick) as f64 * snowing.mass;
        self.depth = self.depth_at(tick, snowing);
        self.tick = tick;
    }

    /// Depth that is in the air at a tick, if nothing is laid before.
    fn depth_at(&self, tick: u64, snowing: Snowing) -> f64 {
        self.depth + (tick - self.tick) as f64 * snowing.depth
    }

    /// Ticks after a tick until there is snow to be laid, at least one; none where it doesn't snow.
    pub fn ticks_until_due(&self, tick: u64, snowing: Snowing, grid: &Grid) -> Option<u64> {
        if snowing.depth <= 0.0 {
            return None;
        }
        let bands = Bands::of(grid);
        let due = bands.due(self.spreading.map_or(bands.count, |spreading| spreading.bands));
        let ticks = ((due - self.depth) / snowing.depth).ceil().max(0.0) as u64;
        let mut at = self.tick.saturating_add(ticks);
        // The quotient is rounded; the sum decides.
        if ticks > 0 && self.depth_at(at - 1, snowing) >= due {
            at -= 1;
        }
        Some(at.saturating_sub(tick).max(1))
    }

    /// What is laid at a tick, in order. Once h/256 has fallen it is laid on the first band, and while as much
    /// falls again, on all others one after another: so every column gets all of it, and no tick has to do
    /// much. Fractions of quanta stay in the air.
    pub fn lay(&mut self, tick: u64, snowing: Snowing, celsius: f32, grid: &Grid) -> Vec<Command> {
        let bands = Bands::of(grid);
        let mut laid = Vec::new();
        let mut air = *self;
        air.mark(tick, snowing);
        if air.depth >= LEAST && air.mass >= 1.0 {
            laid.extend(self.lay_rest(grid));
            let (depth, mass) = (air.depth.floor(), air.mass.floor());
            (air.depth, air.mass) = (air.depth - depth, air.mass - mass);
            let (depth, mass) = (depth as u64, mass as u64);
            air.spreading = Some(Spreading { depth, mass, celsius, bands: 0 });
            *self = air;
        }
        if let Some(spreading) = &mut self.spreading {
            // Where each tick brings as much, each has as much to do.
            let at_once = snowing.depth >= LEAST;
            let mut end = if at_once { bands.count } else { spreading.bands.max(1) };
            while end < bands.count && air.depth >= bands.due(end) {
                end += 1;
            }
            laid.extend(spreading.lay_up_to(end, &bands));
        }
        self.spreading = self.spreading.filter(|spreading| spreading.bands < bands.count);
        laid
    }

    /// What is still to be laid of snow that lies on some bands, all at once.
    pub fn lay_rest(&mut self, grid: &Grid) -> Option<Command> {
        let bands = Bands::of(grid);
        self.spreading.take()?.lay_up_to(bands.count, &bands)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    const TICKS: u64 = 50_000;

    /// A grid of several bands, the last of them thinner.
    const LARGE: Grid = Grid { width: 1000, depth: 1003, height: 10, cell_size: 0.2 };

    fn snowing(rate: f64) -> Snowing {
        Snowing::new(rate, 20.0, 1.0 / 60.0, &Grid::default())
    }

    /// Quanta that are laid on a column.
    type Laid = (u64, u64);

    /// All that is laid when ticks are taken in portions of some length: the tick, the rows of columns, the quanta.
    fn deposits(
        grid: &Grid,
        rate: f64,
        portion: u64,
    ) -> (Vec<(u64, std::ops::Range<u32>, Laid)>, Falling) {
        let snowing = snowing(rate);
        let mut falling = Falling::default();
        let (mut tick, mut deposits) = (0, Vec::new());
        while tick < TICKS {
            let due = falling.ticks_until_due(tick, snowing, grid).unwrap();
            tick += due.min(portion).min(TICKS - tick);
            for command in falling.lay(tick, snowing, -3.0, grid) {
                let Command::Deposit { columns, depth, mass, .. } = command else { panic!() };
                assert_eq!((columns.x0, columns.x1), (0, grid.width));
                deposits.push((tick, columns.z0..columns.z1, (depth, mass)));
            }
        }
        (deposits, falling)
    }

    /// What is laid on each row of columns, in order.
    fn by_row(deposits: &[(u64, std::ops::Range<u32>, Laid)]) -> BTreeMap<u32, Vec<Laid>> {
        let mut rows: BTreeMap<u32, Vec<Laid>> = BTreeMap::new();
        for (_, columns, laid) in deposits {
            columns.clone().for_each(|z| rows.entry(z).or_default().push(*laid));
        }
        rows
    }

    #[test]
    fn snow_falls_alike_in_portions_of_any_length() {
        for (grid, rates) in [(Grid::default(), [0.37, 72.0, 45.0]), (LARGE, [0.37, 72.0, 45.0])] {
            for rate in rates {
                let (one_by_one, rest) = deposits(&grid, rate, 1);
                assert!(one_by_one.len() > 100);
                for portion in [2, 7, 1000, 100_000] {
                    let (deposits, falling) = deposits(&grid, rate, portion);
                    assert!(deposits == one_by_one, "{rate} m/h in portions of {portion}");
                    assert_eq!(falling, rest);
                }
            }
        }
    }

    #[test]
    fn all_but_a_rest_is_laid_of_what_has_fallen() {
        let (deposits, _) = deposits(&Grid::default(), 0.37, 1);
        let depth: u64 = deposits.iter().map(|(_, _, laid)| laid.0).sum();
        let fallen = Grid::default().metres(depth);
        let wanted = 0.37 / 3600.0 * TICKS as f64 / 60.0;
        assert!(wanted - fallen >= 0.0 && wanted - fallen < 0.2 / 255.0, "{fallen} of {wanted} m");
    }

    #[test]
    fn every_column_of_a_large_grid_gets_what_one_of_a_small_grid_gets_one_deposit_later_at_most() {
        for rate in [0.37, 3.0, 72.0] {
            let (small, _) = deposits(&Grid::default(), rate, 1);
            let whole: Vec<Laid> = small.iter().map(|(_, _, laid)| *laid).collect();
            assert!(small.iter().all(|(_, columns, _)| *columns == (0..50)), "in one band");
            let (large, mut falling) = deposits(&LARGE, rate, 1);
            let rows = by_row(&large);
            assert_eq!(rows.len() as u32, LARGE.depth);
            for laid in rows.values() {
                let missing = whole.len() - laid.len();
                assert!(missing <= 1 && *laid == whole[..laid.len()], "{rate} m/h: {missing}");
            }
            // What is left of the last one makes them equal.
            let rest = falling.lay_rest(&LARGE);
            let late = rows.values().filter(|laid| laid.len() < whole.len()).count() as u64;
            let columns = rest.map_or(0, |rest| match rest {
                Command::Deposit { columns, .. } => columns.columns(),
                _ => panic!(),
            });
            assert_eq!(columns, late * u64::from(LARGE.width));
            assert_eq!(falling.lay_rest(&LARGE), None);
        }
    }

    #[test]
    fn a_tick_lays_little_of_a_large_grid() {
        let (deposits, _) = deposits(&LARGE, 1.0, 1);
        let mut ticks: BTreeMap<u64, u32> = BTreeMap::new();
        for (tick, columns, _) in deposits {
            *ticks.entry(tick).or_default() += columns.end - columns.start;
        }
        // It takes 169 ticks until h/256 has fallen, and there are 126 bands, of a row of tiles each.
        assert!(ticks.values().all(|rows| *rows <= 8), "{:?}", ticks.values().max());
    }

    #[test]
    fn where_it_does_not_snow_any_more_what_has_been_laid_stays_so() {
        let (grid, snowing) = (LARGE, snowing(1.0));
        let mut falling = Falling::default();
        assert_eq!(falling.lay(168, snowing, -3.0, &grid), []);
        assert_eq!(falling.lay(169, snowing, -3.0, &grid).len(), 1);
        assert_eq!(falling.lay(169, snowing, -9.0, &grid), [], "once at a tick");
        falling.mark(200, snowing);
        let laid = falling.lay(200, snowing, -9.0, &grid);
        let [Command::Deposit { celsius, .. }] = laid[..] else { panic!("{laid:?}") };
        assert_eq!(celsius, -3.0, "it is as cold as when it fell");
        let still = Snowing::new(0.0, 20.0, 1.0 / 60.0, &grid);
        assert_eq!(falling.lay(100_000, still, -9.0, &grid), []);
        assert_eq!(falling.ticks_until_due(100_000, still, &grid), None);
    }

    #[test]
    fn snow_that_hardly_falls_is_due_in_an_endless_time() {
        let snowing = Snowing::new(93.0, 20.0, 1e-290, &Grid::default());
        let falling = Falling { tick: 7, ..Falling::default() };
        let due = falling.ticks_until_due(9, snowing, &Grid::default());
        assert_eq!(due, Some(u64::MAX - 9));
    }
}
