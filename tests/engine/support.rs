//! Backends driven frame by frame.

use std::sync::Arc;
use std::time::Duration;

use firn_engine::cpu::CpuBackend;
use firn_engine::frame::{
    Backend, Deposit, Edit, Frame, Layout, Outcome, Placement, Run, Slot, Stamp, TileCells, Work,
    WorkOutcome,
};
use firn_engine::gpu::GpuBackend;
use firn_snow::{
    Body, CELL, ColumnRect, Coverage, Grid, MASS_QUANTA, Material, Part, Position, Shape,
    SurfaceLoad, TILE_COLUMNS, Turn,
};

/// The GPU, or `None` where the environment says that there is none to test.
pub fn gpu(always_awake: bool) -> Option<GpuBackend> {
    if std::env::var_os("FIRN_SKIP_GPU_TESTS").is_some_and(|value| value == "1") {
        eprintln!("IGNORED: FIRN_SKIP_GPU_TESTS=1, the GPU is not tested");
        return None;
    }
    Some(GpuBackend::new(None, always_awake).expect("a graphics adapter to test"))
}

/// The reference.
pub fn cpu() -> CpuBackend {
    CpuBackend::new(None, false)
}

/// Carries a frame out.
pub fn carry_out(backend: &mut dyn Backend, work: Vec<Work>) -> Outcome {
    backend.submit(Frame { work }).expect("submitted");
    loop {
        if let Some(outcome) = backend.poll(Duration::from_secs(10)).expect("polled") {
            return outcome;
        }
    }
}

/// Carries out one snowpack's part of a frame.
pub fn work(backend: &mut dyn Backend, work: Work) -> WorkOutcome {
    carry_out(backend, vec![work]).work.remove(0)
}

/// Applies edits.
pub fn edit(backend: &mut dyn Backend, slot: Slot, edits: Vec<Edit>) -> WorkOutcome {
    work(backend, Work { slot, edits, publish: true, ..Work::default() })
}

/// Runs cycles of a length.
pub fn run(backend: &mut dyn Backend, slot: Slot, cycles: u32, dt: f64) -> WorkOutcome {
    work(backend, Work { slot, run: Run { cycles, dt }, publish: true, ..Work::default() })
}

/// All cells of a snowpack.
pub fn cells(backend: &mut dyn Backend, slot: Slot, grid: &Grid) -> Vec<TileCells> {
    let gather = (0..grid.tiles()).collect();
    work(backend, Work { slot, gather, ..Work::default() }).gathered
}

/// A layout on level ground.
pub fn level(grid: Grid, material: Material) -> Layout {
    Layout { grid, material, ground: Default::default(), surface: None }
}

/// Snow of a depth [m], density [kg/m³] and temperature [°C].
pub fn snow(grid: &Grid, columns: ColumnRect, depth: f64, density: f64, celsius: f64) -> Edit {
    Edit::Deposit(Deposit {
        columns,
        depth: grid.thickness_quanta(depth) as u32,
        mass: (depth * density * MASS_QUANTA).round() as u32,
        temperature: celsius as f32,
    })
}

/// An object of one shape put somewhere.
pub fn put(grid: &Grid, id: &str, mass: f64, shape: Shape, x: f64, z: f64) -> Edit {
    let position = Position { x, z };
    put_object(grid, id, &Body { mass, shape: Some(shape), position, ..Body::default() })
}

/// An object put on the snow.
pub fn put_object(grid: &Grid, id: &str, object: &Body) -> Edit {
    let footprints = object.on(grid).expect("it stands in the grid");
    let collider = Arc::new(Placement { mass: object.load(), cover: object.cover(), footprints });
    Edit::PutCollider { id: Arc::from(id), collider, placed: true }
}

/// Heights of all columns [m], row by row.
pub fn heights(tiles: &[TileCells], grid: &Grid) -> Vec<f64> {
    let mut heights = Vec::new();
    for z in 0..grid.depth {
        for x in 0..grid.width {
            let (tile, column) = grid.locate(x, z);
            let height: u64 =
                tiles[tile as usize].column(column).map(|cell| u64::from(cell.thickness)).sum();
            heights.push(grid.metres(height));
        }
    }
    heights
}

/// Largest difference in thickness and in mass between cells, in quanta, the largest in
/// temperature, and the largest in stress relative to it.
#[derive(Debug, Default)]
pub struct Difference {
    pub mass: u32,
    pub thickness: u32,
    pub temperature: f32,
    pub stress: f32,
}

/// Compares all cells of a snowpack.
pub fn compare(ours: &[TileCells], theirs: &[TileCells]) -> Difference {
    let mut difference = Difference::default();
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        assert_eq!(a.mass.len(), b.mass.len());
        assert_eq!(a.mass.len() % TILE_COLUMNS as usize, 0);
        for i in 0..a.mass.len() {
            difference.mass = difference.mass.max(a.mass[i].abs_diff(b.mass[i]));
            let thickness = a.thickness[i].abs_diff(b.thickness[i]);
            difference.thickness = difference.thickness.max(thickness);
            let temperature = (a.temperature[i] - b.temperature[i]).abs();
            difference.temperature = difference.temperature.max(temperature);
            let stress = (a.stress[i] - b.stress[i]).abs() / b.stress[i].abs().max(1.0);
            difference.stress = difference.stress.max(stress);
        }
    }
    difference
}

/// A repeatable source of numbers.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Dice {
        Dice(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        // xorshift64*
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number between two.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A whole number below another.
    pub fn below(&mut self, end: u32) -> u32 {
        (self.unit() * f64::from(end)) as u32
    }

    /// Columns somewhere in a grid.
    pub fn rect(&mut self, grid: &Grid) -> ColumnRect {
        let (x0, z0) = (self.below(grid.width), self.below(grid.depth));
        let x1 = x0 + 1 + self.below(grid.width - x0);
        let z1 = z0 + 1 + self.below(grid.depth - z0);
        ColumnRect { x0, z0, x1, z1 }
    }

    /// A snowfall or, seldom, a clearing.
    pub fn weather(&mut self, grid: &Grid, material: &Material) -> Edit {
        let columns = self.rect(grid);
        if self.unit() < 0.2 {
            let depth = self.range(0.0, f64::from(grid.height) * f64::from(CELL) * 0.7) as u32;
            return Edit::Clear { columns, depth };
        }
        let depth = grid.cell_size * self.range(0.004, 0.4 * f64::from(grid.height));
        // Now and then much like what lies on top, so that it is topped up.
        let density = if self.unit() < 0.5 { 20.0 } else { self.range(10.0, material.max_density) };
        let celsius = if self.unit() < 0.5 { -3.0 } else { self.range(-40.0, 0.0) };
        snow(grid, columns, depth, density, celsius)
    }
}

/// Any outline, of at most so many metres.
fn any_shape(dice: &mut Dice, most: f64) -> Shape {
    let (a, b) = (dice.range(0.01, most), dice.range(0.01, most));
    match dice.below(5) {
        0 => Shape::Box { width: a, depth: b },
        1 => Shape::Disk { radius: a / 2.0 },
        2 => Shape::Capsule { length: a.max(b), radius: a.min(b) / 2.0 },
        3 => {
            // A triangle around the centre.
            let mut corner = |angle: f64| {
                let angle = angle + dice.range(0.0, 1.5);
                [a * 0.6 * angle.cos(), b * 0.6 * angle.sin()]
            };
            Shape::Polygon { corners: vec![corner(0.0), corner(2.1), corner(4.2)] }
        }
        _ => Shape::Wheel { width: a / 2.0, radius: b / 2.0 },
    }
}

/// A load that presses a print somewhere in the grid.
pub fn any_stamp(dice: &mut Dice, grid: &Grid) -> Edit {
    let metres = |columns: u32| f64::from(columns) * grid.cell_size;
    let (x, z) = (dice.range(0.0, metres(grid.width)), dice.range(0.0, metres(grid.depth)));
    let (shape, turn) = (any_shape(dice, 2.0), Turn::new(dice.range(0.0, 360.0)));
    let width = shape.area().sqrt() as f32;
    let pressure = 10_f64.powf(dice.range(2.0, 6.0)) as f32;
    let load = SurfaceLoad { pressure, width };
    match Coverage::new(grid, &shape, Position { x, z }, turn) {
        Some(coverage) => Edit::Stamp(Arc::new(Stamp { coverage, load })),
        // It missed the grid.
        None => any_stamp(dice, grid),
    }
}

/// Any object around a place: of one shape or of several, turned, and now and then held up.
pub fn any_object(dice: &mut Dice, position: Position) -> Body {
    let mut object = Body {
        mass: dice.range(1.0, 300.0),
        position,
        heading: if dice.unit() < 0.3 { 0.0 } else { dice.range(-180.0, 540.0) },
        airborne: dice.unit() < 0.1,
        ..Body::default()
    };
    if dice.unit() < 0.6 {
        object.shape = Some(any_shape(dice, 2.0));
    } else {
        let part = |dice: &mut Dice, reach: f64| Part {
            shape: any_shape(dice, 0.8),
            offset: Position { x: dice.range(-reach, reach), z: dice.range(-reach, reach) },
            heading: dice.range(0.0, 360.0),
        };
        // The first is where the object is: that one has a column in the grid.
        let others = 0..dice.below(4);
        object.footprints = vec![part(dice, 0.0)];
        object.footprints.extend(others.map(|_| part(dice, 0.8)));
    }
    object
}
