//! A snowpack that lives through snowfalls, objects and runs, in frames of any kind.

use std::collections::HashMap;
use std::sync::Arc;

use firn_engine::frame::{
    Backend, ColumnRead, Contents, Edit, Moves, Placement, Run, SampleBox, TileCells, Work,
    WorkOutcome,
};
use firn_snow::{
    Body, Column, ColumnRect, Contact, Elevation, Floor, Grid, Material, Motion, Position,
    Pressing, Sample,
};

use crate::support::*;

/// How a story is told to a backend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frames {
    /// One frame for all edits and the run after them.
    Whole,
    /// A frame for each edit, and two for each run, with another between them that has nothing to do but
    /// to evaluate.
    Cut,
    /// As `Whole`, each of them in parts of any size.
    Parted,
}

/// What a snowpack lives through.
#[derive(Clone, Copy, Debug)]
pub struct Plot {
    /// The same numbers make the same story.
    pub seed: u64,
    /// Whether it is brought back to what was saved now and then, and there are frames without cycles.
    pub restores: bool,
}

/// What came of a story, bit for bit.
#[derive(Debug, Default)]
pub struct Story {
    /// All cells in the end.
    pub cells: Vec<TileCells>,
    /// What was told after each run.
    pub told: Vec<Told>,
    /// How many tiles slept.
    pub slept: u32,
    /// Frames that left something for the next.
    pub unfinished: u32,
}

/// What a run told.
#[derive(Debug, PartialEq)]
pub struct Told {
    /// Mass that each edit has refused or removed, but for those before a restore.
    pub edits: Vec<u64>,
    pub last_change: u32,
    pub mass: u64,
    pub contacts: Vec<(Arc<str>, Contact)>,
    pub gathered: Vec<TileCells>,
    pub columns: Vec<Vec<Column>>,
    pub samples: Vec<Vec<Sample>>,
}

impl Story {
    /// How objects touched the snow after each run.
    pub fn contacts(&self) -> impl Iterator<Item = &(Arc<str>, Contact)> {
        self.told.iter().flat_map(|told| &told.contacts)
    }
}

/// Objects that stand somewhere.
type Standing = HashMap<&'static str, (Body, Arc<Placement>)>;

/// What a snowpack may be brought back to.
struct Saved {
    contents: Arc<Contents>,
    standing: Standing,
}

const GRID: Grid = Grid { width: 42, depth: 30, height: 30, cell_size: 0.2 };

fn any_edit(dice: &mut Dice, standing: &mut Standing) -> Edit {
    let columns = dice.rect(&GRID);
    let id = ["a", "b"][dice.below(2) as usize];
    match dice.below(16) {
        0..4 => snow(&GRID, columns, dice.range(0.01, 0.5), 25.0, -8.0),
        4 | 5 => Edit::Clear { columns, depth: GRID.thickness_quanta(dice.range(1.5, 2.5)) as u32 },
        6 => Edit::SetMaterial(Material {
            stiffness_exponent: dice.range(3.2, 3.6),
            ..Material::default()
        }),
        7 | 8 => {
            standing.remove(id);
            Edit::RemoveCollider { id: id.into() }
        }
        9 => any_stamp(dice, &GRID),
        kind => {
            let position = Position { x: dice.range(0.0, 8.4), z: dice.range(0.0, 6.0) };
            let other = any_object(dice, position);
            // Or another mass is put where it stands.
            let stays = standing.get(id).filter(|_| kind < 12);
            let stays = stays.map(|(object, _)| Body { mass: other.mass, ..object.clone() });
            let moves = stays.is_none();
            let object = stays.unwrap_or(other);
            let mut put = put_object(&GRID, id, &object);
            if let Edit::PutCollider { placed, collider, .. } = &mut put {
                *placed = moves;
                standing.insert(id, (object, collider.clone()));
            }
            put
        }
    }
}

/// Has the objects move in some cycles, with snow that falls between their steps here and there.
fn any_moves(dice: &mut Dice, standing: &mut Standing, run: Run) -> Vec<Moves> {
    let mut moving = Vec::new();
    for id in ["a", "b"] {
        let Some((body, _)) = standing.get(id).filter(|_| dice.unit() < 0.7) else { continue };
        let velocity = Position { x: dice.range(-2.0, 2.0), z: dice.range(-2.0, 2.0) };
        let turn_rate = dice.range(-90.0, 90.0);
        let motion = Motion { velocity, turn_rate, ..Motion::default() };
        moving.push((id, Body { motion, ..body.clone() }));
    }
    let mut cycle = || {
        let count = moving.iter().map(|(_, body)| body.steps(&GRID, run.dt)).max().unwrap_or(1);
        let mut steps = Vec::new();
        for left in (1..=count).rev() {
            let mut edits = Vec::new();
            for (id, body) in &mut moving {
                let Some(footprints) = body.step(&GRID, run.dt / f64::from(count), left) else {
                    continue;
                };
                // As snow that it lays down on the columns under it.
                if let (Some((x, z)), true) = (footprints[0].iter().next(), dice.unit() < 0.2) {
                    let columns = ColumnRect { x0: x, z0: z, x1: x + 1, z1: z + 1 };
                    let Edit::Deposit(laid) = snow(&GRID, columns, 0.01, 30.0, -4.0) else {
                        unreachable!()
                    };
                    edits.push(Edit::Lay(laid));
                }
                let placement =
                    Arc::new(Placement { mass: body.load(), cover: body.cover(), footprints });
                standing.insert(id, (body.clone(), placement.clone()));
                let collider = placement;
                edits.push(Edit::PutCollider { id: Arc::from(*id), collider, placed: true });
            }
            edits.sort_by_key(|edit| !matches!(edit, Edit::Lay(_)));
            steps.push(edits);
        }
        Moves { steps }
    };
    (0..run.cycles).map(|_| cycle()).collect()
}

/// Brings the snowpack back to what was saved, now and then.
fn any_restore(dice: &mut Dice, saved: Option<&Saved>, standing: &mut Standing) -> Vec<Edit> {
    let Some(saved) = saved.filter(|_| dice.unit() < 0.25) else { return Vec::new() };
    *standing = saved.standing.clone();
    let removed = ["a", "b"].map(|id| Edit::RemoveCollider { id: id.into() });
    removed.into_iter().chain([Edit::Restore(saved.contents.clone())]).collect()
}

/// Has a backend live through a story.
pub fn live_through(backend: &mut dyn Backend, plot: Plot, frames: Frames) -> Story {
    let Plot { seed, restores } = plot;
    let (mut dice, mut sizes) = (Dice::new(seed), Dice::new(seed + 1));
    let mut drive = Dice::new(seed + 2);
    let mut story = Story::default();
    backend.create(0, &level(GRID, Material::default())).unwrap();
    edit(backend, 0, vec![snow(&GRID, GRID.all(), 2.5, 20.0, -3.0)]);
    let (mut last_dt, mut standing, mut saved) = (0.0, Standing::new(), None);
    let mut pressing = Pressing::Creep;
    for _ in 0..14 {
        let saved_state = saved.as_ref().filter(|_| restores);
        let mut edits = any_restore(&mut dice, saved_state, &mut standing);
        let restored = edits.len();
        edits.extend((0..dice.below(6)).map(|_| any_edit(&mut dice, &mut standing)));
        let dt = if dice.unit() < 0.7 { 0.25 } else { dice.range(0.02, 0.25) };
        // How contacts were found before is told best by runs of few cycles.
        let most = if dice.unit() < 0.5 { 3 } else { 250 };
        let mut cycles = dice.below(most) + u32::from(!restores || dice.unit() < 0.9);
        let mut moves = if drive.unit() < 0.2 && cycles > 0 {
            cycles = cycles.min(4);
            any_moves(&mut drive, &mut standing, Run { cycles, dt })
        } else {
            Vec::new()
        };
        let alters = |edit: &Edit| matches!(edit, Edit::SetMaterial(_) | Edit::Restore(_));
        let before = (last_dt, pressing);
        if dice.unit() < 0.4 {
            pressing =
                [Pressing::Creep, Pressing::Within(0.0), Pressing::Within(dice.range(0.1, 9.0))]
                    [dice.below(3) as usize];
        }
        let wake = (dt, pressing) != before || edits.iter().any(alters);
        last_dt = dt;
        let mut first = 0;
        if frames == Frames::Cut {
            let idle = || vec![Edit::RemoveCollider { id: "nobody".into() }];
            for one in edits.drain(..) {
                edit(backend, 0, vec![one]);
            }
            first = Dice::new(seed + u64::from(cycles)).below(cycles);
            let run = Run { cycles: first, dt };
            let moves_before = moves.drain(..moves.len().min(first as usize)).collect();
            let work_before = Work {
                slot: 0,
                edits: idle(),
                wake,
                run,
                moves: moves_before,
                pressing,
                ..Work::default()
            };
            work(backend, work_before);
            edit(backend, 0, idle());
        }
        let floor = Floor::Level(Elevation::default());
        let all = Work {
            slot: 0,
            edits,
            wake,
            run: Run { cycles: cycles - first, dt },
            moves,
            pressing,
            publish: true,
            tally: true,
            gather: (0..GRID.tiles()).collect(),
            columns: vec![ColumnRead { columns: vec![70, 3, 70, 190], cells: 2 }, all_columns()],
            samples: vec![SampleBox { columns: dice.rect(&GRID), floor, y0: 2, height: 9, dt }],
            ..Work::default()
        };
        let outcome = match frames {
            Frames::Parted => in_parts(backend, all, &mut sizes, &mut story),
            Frames::Whole | Frames::Cut => work(backend, all),
        };
        story.slept += GRID.tiles() - outcome.active_tiles;
        if restores && dice.unit() < 0.4 {
            saved = Some(save(&outcome, &standing));
        }
        story.told.push(Told {
            edits: outcome.edits.get(restored..).unwrap_or_default().to_vec(),
            last_change: outcome.last_change,
            mass: outcome.mass,
            contacts: outcome.contacts,
            gathered: outcome.gathered,
            columns: outcome.columns,
            samples: outcome.samples,
        });
    }
    story.cells = cells(backend, 0, &GRID);
    story
}

fn all_columns() -> ColumnRead {
    ColumnRead { columns: (0..GRID.tiles() * 64).collect(), cells: GRID.height }
}

fn save(outcome: &WorkOutcome, standing: &Standing) -> Saved {
    let object = |(id, contact): &(Arc<str>, Contact)| {
        let (_, placement) = &standing[&**id];
        (id.clone(), placement.clone(), *contact)
    };
    let colliders = outcome.contacts.iter().map(object).collect();
    let contents = Contents { tiles: Arc::new(outcome.gathered.clone()), colliders };
    Saved { contents: Arc::new(contents), standing: standing.clone() }
}

/// Does some work in parts: some of them small, some large.
fn in_parts(
    backend: &mut dyn Backend,
    all: Work,
    dice: &mut Dice,
    story: &mut Story,
) -> WorkOutcome {
    let whole_cycle = u64::from(GRID.tiles() * GRID.height) * 64;
    let mut limit = || Some((whole_cycle as f64 * 10f64.powf(dice.range(-3.5, 1.0))) as u64);
    let mut outcome = work(backend, Work { limit: limit(), ..all });
    while outcome.unfinished {
        story.unfinished += 1;
        outcome = work(backend, Work::resume(0, true, limit()));
    }
    outcome
}
