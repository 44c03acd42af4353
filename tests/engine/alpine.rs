//! Alpine snow: the kernels of weather beside their twins.

use std::sync::Arc;

use firn::season::{Forcing, Stamps};
use firn_engine::frame::{
    Backend, Contents, Edit, Layout, Run, Slot, Stamp, TileCells, Weathering, Work,
};
use firn_snow::alpine::{Gathering, Surface, WeatherStep};
use firn_snow::weather::Site;
use firn_snow::{
    ColumnRect, Coverage, Exchanged, Grid, HardnessLaw, MASS_QUANTA, Material, Position, Pressing,
    Shape, SurfaceLoad, Turn,
};

use crate::support::*;
use crate::winter::{STEP, Winter};

fn layout(grid: Grid, ground: Vec<f64>) -> Layout {
    let material = Material { hardness_law: HardnessLaw::Alpine, ..Material::default() };
    let surface = Some(Surface::new([3.0, 4.0, 5.0, 6.0], -2.0));
    Layout { grid, material, ground: ground.into(), surface }
}

/// Carries work out in parts of some units; returns what was exchanged.
fn weather(
    backend: &mut dyn Backend,
    slot: Slot,
    grid: &Grid,
    steps: &[WeatherStep],
    limit: Option<u64>,
) -> Exchanged {
    let edits = Weathering::edits(grid, steps).collect();
    let mut outcome = work(backend, Work { slot, edits, limit, ..Work::default() });
    while outcome.unfinished {
        outcome = work(backend, Work::resume(slot, false, limit));
    }
    outcome.exchanged
}

/// Depth [m] and snow water equivalent [kg/m²] of each column.
fn columns(tiles: &[TileCells], grid: &Grid) -> Vec<(f64, f64)> {
    let rect = grid.all();
    let columns = (rect.z0..rect.z1).flat_map(|z| (rect.x0..rect.x1).map(move |x| (x, z)));
    let column = |(x, z)| {
        let (tile, column) = grid.locate(x, z);
        let cells = tiles[tile as usize].column(column);
        cells.fold((0.0, 0.0), |(depth, mass), cell| {
            let metres = grid.metres(cell.thickness.into());
            (depth + metres, mass + f64::from(cell.mass) / MASS_QUANTA)
        })
    };
    columns.map(column).collect()
}

fn assert_alike(ours: &[TileCells], theirs: &[TileCells], grid: &Grid, when: &str) {
    for (i, ((depth, mass), (other_depth, other_mass))) in
        columns(ours, grid).into_iter().zip(columns(theirs, grid)).enumerate()
    {
        assert!(
            (depth - other_depth).abs() <= 0.005,
            "{when}, column {i}: {depth} {other_depth} m"
        );
        assert!((mass - other_mass).abs() <= 1.0, "{when}, column {i}: {mass} {other_mass} kg/m²");
    }
}

fn mass(tiles: &[TileCells]) -> u64 {
    tiles.iter().flat_map(|tile| &tile.mass).map(|&mass| u64::from(mass)).sum()
}

#[test]
fn forty_days_of_winter_are_those_of_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let (mut cpu, grid) = (cpu(), Grid { width: 11, depth: 9, height: 60, cell_size: 0.05 });
    gpu.poison();
    let made = layout(grid, Vec::new());
    gpu.create(2, &made).unwrap();
    cpu.create(2, &made).unwrap();
    let mut winter = Winter::new(7, grid, false);
    let mut sums = [Exchanged::default(); 2];
    let mut deepest = 0.0_f64;
    for day in 0..40 {
        let steps = winter.steps(96);
        sums[0].add(weather(&mut gpu, 2, &grid, &steps, None));
        sums[1].add(weather(&mut cpu, 2, &grid, &steps, None));
        let (ours, theirs) = (cells(&mut gpu, 2, &grid), cells(&mut cpu, 2, &grid));
        assert_alike(&ours, &theirs, &grid, &format!("day {day}"));
        deepest = deepest.max(columns(&theirs, &grid)[0].0);
        for (tiles, sum) in [(&ours, &sums[0]), (&theirs, &sums[1])] {
            let came = winter.fallen * grid.columns() + sum.deposited;
            assert_eq!(came, mass(tiles) + sum.refused + sum.sublimated + sum.runoff);
        }
        for (tile, (ours, theirs)) in ours.iter().zip(&theirs).enumerate() {
            let rect = grid.tile_rect(tile as u32);
            for (i, (a, b)) in ours.surfaces.iter().zip(&theirs.surfaces).enumerate() {
                let (x, z) = (i as u32 % 8, i as u32 / 8);
                if rect.x0 + x < rect.x1 && rect.z0 + z < rect.z1 {
                    assert!((a.skin - b.skin).abs() < 0.3, "day {day}: {a:?} {b:?}");
                    assert!((a.soil[0] - b.soil[0]).abs() < 0.05, "day {day}: {a:?} {b:?}");
                    assert!((a.albedo - b.albedo).abs() < 0.02, "day {day}: {a:?} {b:?}");
                }
            }
        }
    }
    assert!(deepest > 0.3, "{deepest}");
    assert!(sums[1].runoff > 0 && sums[1].sublimated > 0 && sums[1].deposited > 0, "{sums:?}");
}

#[test]
fn steps_in_any_parts_give_the_same_bits() {
    let Some(mut gpu) = gpu(false) else { return };
    let grid = Grid { width: 19, depth: 34, height: 30, cell_size: 0.1 };
    let ground: Vec<f64> = (0..grid.columns()).map(|i| (i % 19) as f64 * 0.03).collect();
    for sun in [false, true] {
        let steps = Winter::new(3, grid, sun).steps(200);
        let mut backends: [&mut dyn Backend; 2] = [&mut gpu, &mut cpu()];
        for backend in &mut backends {
            let mut all = Vec::new();
            for (slot, (each, limit)) in
                [(200, None), (1, None), (37, Some(1000)), (80, Some(1 << 18))]
                    .into_iter()
                    .enumerate()
            {
                let slot = slot as Slot;
                backend.create(slot, &layout(grid, ground.clone())).unwrap();
                let mut sum = Exchanged::default();
                for steps in steps.chunks(each) {
                    sum.add(weather(*backend, slot, &grid, steps, limit));
                }
                let gather = (0..grid.tiles()).collect();
                let read = Work { slot, gather, publish: true, ..Work::default() };
                all.push((sum, work(*backend, read).gathered));
                backend.release(slot);
            }
            let (first, others) = all.split_first().unwrap();
            assert!(first.0.runoff + first.0.sublimated > 0);
            for other in others {
                assert_eq!(other.0, first.0);
                assert!(other.1 == first.1, "not the same bits");
            }
        }
    }
}

#[test]
fn light_falls_on_hills_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let (mut cpu, grid) = (cpu(), Grid { width: 21, depth: 26, height: 40, cell_size: 0.5 });
    let ridge = |z: u32| 6.0 - 0.6 * (f64::from(z) - 12.0).abs();
    let ground: Vec<f64> =
        (0..grid.depth).flat_map(|z| (0..grid.width).map(move |_| ridge(z) + 80.0)).collect();
    let made = layout(grid, ground);
    gpu.create(0, &made).unwrap();
    cpu.create(0, &made).unwrap();
    let fall = snow(&grid, grid.all(), 0.6, 250.0, -3.0);
    edit(&mut gpu, 0, vec![fall.clone()]);
    edit(&mut cpu, 0, vec![fall]);
    let mut winter = Winter::new(11, grid, true);
    for day in 0..30 {
        let steps = winter.steps(96);
        weather(&mut gpu, 0, &grid, &steps, None);
        weather(&mut cpu, 0, &grid, &steps, None);
        let (ours, theirs) = (cells(&mut gpu, 0, &grid), cells(&mut cpu, 0, &grid));
        assert_alike(&ours, &theirs, &grid, &format!("day {day}"));
    }
    let found = columns(&cells(&mut gpu, 0, &grid), &grid);
    let side = |z: u32| found[(z * grid.width + 10) as usize].1;
    assert!(side(6) + 20.0 < side(18), "south {} north {}", side(6), side(18));
}

#[test]
fn objects_keep_snow_off_and_columns_are_summed_up() {
    let Some(mut gpu) = gpu(false) else { return };
    let (mut cpu, grid) = (cpu(), Grid { width: 20, depth: 20, height: 40, cell_size: 0.1 });
    let made = layout(grid, Vec::new());
    let backends: [&mut dyn Backend; 2] = [&mut gpu, &mut cpu];
    let steps = Winter::new(5, grid, false).steps(400);
    let rect = ColumnRect { x0: 3, z0: 2, x1: 17, z1: 19 };
    let totals = backends.map(|backend| {
        backend.create(1, &made).unwrap();
        let shape = Shape::Box { width: 0.6, depth: 0.6 };
        let mut edits = vec![put(&grid, "roof", 1.0, shape, 1.0, 1.0)];
        edits.extend(Weathering::edits(&grid, &steps));
        let done = work(backend, Work { slot: 1, edits, totals: vec![rect], ..Work::default() });
        done.totals[0].clone()
    });
    assert_eq!(totals[0].len(), 14 * 17);
    for (ours, theirs) in totals[0].iter().zip(&totals[1]) {
        assert!((f64::from(ours.mass) - f64::from(theirs.mass)).abs() < MASS_QUANTA);
        assert!(ours.water <= ours.mass);
        assert!((ours.surface.skin - theirs.surface.skin).abs() < 0.3, "{ours:?} {theirs:?}");
    }
    let at = |x: u32, z: u32| totals[0][((z - 2) * 14 + x - 3) as usize];
    assert_eq!(at(10, 10).mass, 0, "the roof keeps snow off");
    assert!(f64::from(at(4, 10).mass) > 5.0 * MASS_QUANTA);
}

#[test]
fn what_is_saved_goes_on_alike() {
    let Some(mut gpu) = gpu(false) else { return };
    let grid = Grid { width: 9, depth: 9, height: 30, cell_size: 0.1 };
    let made = layout(grid, Vec::new());
    gpu.create(0, &made).unwrap();
    let mut winter = Winter::new(9, grid, false);
    weather(&mut gpu, 0, &grid, &winter.steps(700), None);
    let saved = cells(&mut gpu, 0, &grid);
    let rest = winter.steps(100);
    weather(&mut gpu, 0, &grid, &rest, None);
    let expected = cells(&mut gpu, 0, &grid);
    gpu.create(5, &made).unwrap();
    let contents = Contents { tiles: Arc::new(saved), colliders: Vec::new() };
    edit(&mut gpu, 5, vec![Edit::Restore(Arc::new(contents))]);
    weather(&mut gpu, 5, &grid, &rest, None);
    let found = cells(&mut gpu, 5, &grid);
    assert!(found.iter().zip(&expected).all(|(a, b)| a.mass == b.mass
        && a.thickness == b.thickness
        && a.temperature.iter().map(|t| t.to_bits()).eq(b.temperature.iter().map(|t| t.to_bits()))
        && a.surfaces == b.surfaces));
}

/// A load that presses a disk of columns.
fn print(grid: &Grid) -> Edit {
    let (shape, position) = (Shape::Disk { radius: 0.3 }, Position { x: 1.5, z: 0.4 });
    let coverage = Coverage::new(grid, &shape, position, Turn::new(0.0)).unwrap();
    let load = SurfaceLoad { pressure: 4000.0, width: 0.5 };
    Edit::Stamp(Arc::new(Stamp { coverage, load }))
}

/// Snow as it lies after some weeks of winter, on both backends to the bit.
fn same_snow(backends: &mut [&mut dyn Backend; 2], grid: &Grid, seed: u64) {
    let made = layout(*grid, Vec::new());
    let steps = Winter::new(seed, *grid, false).steps(1000 + 600 * seed as usize);
    backends[1].create(9, &made).unwrap();
    weather(backends[1], 9, grid, &steps, None);
    let tiles = Arc::new(cells(backends[1], 9, grid));
    for backend in backends {
        backend.release(0);
        backend.create(0, &made).unwrap();
        let contents = Contents { tiles: tiles.clone(), colliders: Vec::new() };
        edit(*backend, 0, vec![Edit::Restore(Arc::new(contents))]);
    }
}

#[test]
fn objects_and_prints_press_it_as_in_the_reference_and_are_at_rest_then() {
    let Some(mut gpu) = gpu(false) else { return };
    let (mut cpu, grid) = (cpu(), Grid { width: 20, depth: 20, height: 60, cell_size: 0.1 });
    let mut dice = Dice::new(17);
    for seed in 1..4 {
        let mut backends: [&mut dyn Backend; 2] = [&mut gpu, &mut cpu];
        same_snow(&mut backends, &grid, seed);
        let side = dice.range(0.2, 0.6);
        let shape = Shape::Box { width: side, depth: side };
        let (heavy, light) = (dice.range(40.0, 400.0), dice.range(5.0, 20.0));
        let edits = vec![
            print(&grid),
            put(&grid, "heavy", heavy, shape.clone(), 0.7, 1.2),
            put(&grid, "light", light, shape, 1.4, 1.3),
        ];
        let found = backends.map(|backend| {
            edit(backend, 0, edits.clone());
            let pressing = Pressing::Within(0.25);
            let run = Run { cycles: 40, dt: 0.1 };
            let first = work(backend, Work { run, pressing, publish: true, ..Work::default() });
            assert!(first.last_change > 0 && first.last_change < 40, "{}", first.last_change);
            let again = work(backend, Work { run, pressing, publish: true, ..Work::default() });
            assert_eq!(again.last_change, 0, "it rests");
            (cells(backend, 0, &grid), again.contacts)
        });
        let difference = compare(&found[0].0, &found[1].0);
        assert_eq!(difference.mass, 0);
        assert!(grid.metres(difference.thickness.into()) < 1e-4, "{difference:?}");
        for ((id, ours), (_, theirs)) in found[0].1.iter().zip(&found[1].1) {
            let (ours, theirs) = (ours.bottom.metres(&grid), theirs.bottom.metres(&grid));
            assert!((ours - theirs).abs() < 1e-4, "{id}: {ours} {theirs}");
        }
    }
}

#[test]
fn snow_that_finds_no_slot_is_refused_and_wet_snow_is_cut_with_its_water() {
    let Some(mut gpu) = gpu(false) else { return };
    let (mut cpu, grid) = (cpu(), Grid { width: 9, depth: 9, height: 12, cell_size: 0.1 });
    let mut backends: [&mut dyn Backend; 2] = [&mut gpu, &mut cpu];
    same_snow(&mut backends, &grid, 2);
    let depth = grid.thickness_quanta(0.234) as u32;
    let edits = vec![
        snow(&grid, grid.all(), 0.9, 120.0, -4.0),
        Edit::Clear { columns: grid.all(), depth: depth * 2 },
        snow(&grid, grid.all(), 3.0, 90.0, -4.0),
        Edit::Clear { columns: ColumnRect { x0: 2, z0: 1, x1: 7, z1: 8 }, depth: depth / 3 },
    ];
    let found = backends.map(|backend| {
        let done = edit(backend, 0, edits.clone());
        (done.edits, cells(backend, 0, &grid))
    });
    assert_eq!(found[0].0, found[1].0);
    assert!(found[0].0[2] > 0, "some is refused");
    let words = |tiles: &[TileCells]| -> Vec<u32> {
        tiles.iter().flat_map(|tile| tile.temperature.iter().map(|word| word.to_bits())).collect()
    };
    let [(_, ours), (_, theirs)] = &found;
    assert!(ours.iter().zip(theirs).all(|(a, b)| a.mass == b.mass && a.thickness == b.thickness));
    assert!(words(ours) == words(theirs));
    assert!(ours.iter().any(|tile| tile.column(0).any(|cell| cell.water() > 0)));
}

/// The field data beside the checkout, where it is.
const COL_DE_PORTE: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/cdp_0506/forcing.csv");

#[test]
fn a_season_at_col_de_porte_is_that_of_the_reference_every_day() {
    let Some(mut gpu) = gpu(false) else { return };
    let file = std::path::Path::new(COL_DE_PORTE);
    if !file.exists() {
        eprintln!("NOT TESTED: there is no {COL_DE_PORTE}");
        return;
    }
    let forcing = Forcing::read(file, Stamps::default()).unwrap();
    let grid = Grid { width: 2, depth: 1, height: 255, cell_size: 0.05 };
    let site = Site { temperature_height: 1.5, wind_height: 10.0, ..Site::default() };
    let (mut cpu, mut gathering) = (cpu(), Gathering::default());
    let surface = Some(Surface::new([10.0, 11.0, 11.5, 11.5], 4.65));
    let made = Layout { surface, ..layout(grid, Vec::new()) };
    gpu.create(0, &made).unwrap();
    cpu.create(0, &made).unwrap();
    let (mut deepest, mut time) = (0.0_f64, 0.0);
    while time + 86_400.0 <= forcing.seconds() {
        let mut step = || {
            let felt = forcing.mean(time, time + STEP);
            time += STEP;
            WeatherStep::new(&felt, &site, STEP, gathering.fall(&felt, STEP, &grid))
        };
        let steps: Vec<WeatherStep> = (0..96).map(|_| step()).collect();
        weather(&mut gpu, 0, &grid, &steps, None);
        weather(&mut cpu, 0, &grid, &steps, None);
        let (ours, theirs) = (cells(&mut gpu, 0, &grid), cells(&mut cpu, 0, &grid));
        assert_alike(&ours, &theirs, &grid, &format!("day {}", time / 86_400.0));
        deepest = deepest.max(columns(&ours, &grid)[0].0);
    }
    assert!(deepest > 1.2, "{deepest}");
}
