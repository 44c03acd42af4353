use super::*;
use crate::Shape;

const GRID: Grid = Grid { width: 100, depth: 40, height: 20, cell_size: 0.1 };

fn ski(motion: Motion) -> Body {
    Body {
        mass: 80.0,
        shape: Some(Shape::Box { width: 0.2, depth: 0.2 }),
        position: Position { x: 1.0, z: 2.0 },
        motion,
        ..Body::default()
    }
}

/// Runs cycles; returns the positions after each step.
fn run(body: &mut Body, cycles: u32, dt: f64) -> Vec<Position> {
    let mut positions = Vec::new();
    for _ in 0..cycles {
        let steps = body.steps(&GRID, dt);
        for left in (1..=steps).rev() {
            body.step(&GRID, dt / f64::from(steps), left);
            positions.push(body.position);
        }
    }
    positions
}

fn near(position: Position, x: f64, z: f64) -> bool {
    (position.x - x).abs() < 1e-9 && (position.z - z).abs() < 1e-9
}

#[test]
fn no_step_is_longer_than_half_a_column() {
    for (speed, dt) in [(10.0, 0.05), (10.0, 1.0 / 60.0), (3.0, 0.25), (0.1, 0.25)] {
        let mut body = ski(Motion { velocity: Position { x: speed, z: 0.0 }, ..Motion::default() });
        let from = body.position.x;
        let positions = run(&mut body, 4, dt);
        assert!(near(body.position, from + 4.0 * speed * dt, 2.0), "{:?}", body.position);
        let mut last = from;
        for position in positions {
            assert!(position.x - last <= 0.05 + 1e-9, "{} to {}", last, position.x);
            last = position.x;
        }
    }
    let fastest = ski(Motion { velocity: Position { x: 60.0, z: 80.0 }, ..Motion::default() });
    assert_eq!(fastest.steps(&GRID, 0.25), MOST_STEPS);
}

#[test]
fn it_turns_as_finely_as_it_reaches_far() {
    let mut body = ski(Motion { turn_rate: 90.0, ..Motion::default() });
    body.shape = Some(Shape::Box { width: 0.2, depth: 4.0 });
    // A quarter of a circle with a radius of about 2 m, in steps of 5 cm.
    assert!((60..=64).contains(&body.steps(&GRID, 1.0)), "{}", body.steps(&GRID, 1.0));
    run(&mut body, 1, 1.0);
    assert!((body.heading - 90.0).abs() < 1e-9);
    body.motion.turn_rate = -720.0;
    run(&mut body, 8, 0.25);
    assert!((body.heading + 270.0).abs() < 1e-9, "round and round, its heading stays small");
}

#[test]
fn it_follows_a_path_and_goes_on_with_its_velocity() {
    let path = vec![[1.0, 3.0], [2.0, 3.0]];
    let velocity = Position { x: 0.0, z: -1.0 };
    let mut body = ski(Motion { path, speed: Some(2.0), velocity, ..Motion::default() });
    run(&mut body, 3, 0.25);
    assert!(near(body.position, 1.5, 3.0), "{:?}", body.position);
    assert_eq!(body.motion.path, [[2.0, 3.0]]);
    run(&mut body, 1, 0.25);
    assert_eq!(body.position, Position { x: 2.0, z: 3.0 });
    assert_eq!(body.motion, Motion { velocity, ..Motion::default() });
    run(&mut body, 2, 0.25);
    assert!(near(body.position, 2.0, 2.5), "{:?}", body.position);
}

#[test]
fn a_sweep_takes_one_cycle_unless_it_is_long() {
    let sweep = |to| Motion { path: vec![to], turn_to: Some(-90.0), ..Motion::default() };
    let mut body = ski(sweep([2.0, 2.5]));
    body.heading = 350.0;
    let positions = run(&mut body, 1, 1.0 / 60.0);
    assert!(positions.len() > 22, "half a column at a time");
    assert_eq!((body.position, body.heading), (Position { x: 2.0, z: 2.5 }, -90.0));
    assert!(body.motion.is_still());

    // 64 steps of 5 cm reach 3.2 m.
    let mut body = ski(Motion { path: vec![[9.0, 2.0]], ..Motion::default() });
    run(&mut body, 1, 1.0 / 60.0);
    assert!(near(body.position, 4.2, 2.0), "{:?}", body.position);
    run(&mut body, 2, 1.0 / 60.0);
    assert_eq!(body.position, Position { x: 9.0, z: 2.0 });
    assert!(body.motion.is_still());
}

#[test]
fn it_stops_at_the_edge_with_its_last_column_inside() {
    let velocity = Position { x: 10.0, z: 0.0 };
    let mut body = ski(Motion { velocity, turn_rate: 5.0, ..Motion::default() });
    run(&mut body, 10, 0.25);
    assert!(body.motion.is_still());
    assert!(body.on(&GRID).is_some());
    assert!(body.position.x > 10.0 && body.position.x < 10.15, "{:?}", body.position);
    assert_eq!(body.step(&GRID, 0.25, 1), None);
}
