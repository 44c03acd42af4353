use super::*;

fn polygon(corners: &[[f64; 2]]) -> Shape {
    Shape::Polygon { corners: corners.to_vec() }
}

fn all() -> Vec<Shape> {
    vec![
        Shape::Box { width: 0.4, depth: 1.2 },
        Shape::Disk { radius: 0.5 },
        Shape::Capsule { length: 1.8, radius: 0.3 },
        polygon(&[[-0.5, -0.4], [0.7, -0.3], [0.4, 0.6], [-0.2, 0.5]]),
        Shape::Wheel { width: 0.3, radius: 0.4 },
    ]
}

/// Area by chords of a fine comb.
fn combed(shape: &Shape, turn: Turn) -> f64 {
    let step = 1e-4;
    let chords = (-20_000..20_000).map(|i| shape.chord(turn, (f64::from(i) + 0.5) * step));
    chords.flatten().map(|(low, high)| (high - low) * step).sum()
}

#[test]
fn chords_fill_the_area_however_a_shape_is_turned() {
    for shape in all() {
        for degrees in [0.0, 17.0, 45.0, 90.0, 200.0] {
            let filled = combed(&shape, Turn::new(degrees));
            assert!((filled - shape.area()).abs() < 2e-4, "{shape:?} at {degrees}°: {filled}");
        }
    }
}

#[test]
fn no_chord_leaves_the_reach() {
    for shape in all() {
        for degrees in [0.0, 30.0, 123.0] {
            let (turn, slack) = (Turn::new(degrees), 1e-5);
            let reach = shape.reach(turn);
            for i in -200..200 {
                let z = f64::from(i) * 0.01;
                let Some((low, high)) = shape.chord(turn, z) else { continue };
                assert!(z >= reach.z0 - slack && z <= reach.z1 + slack, "{shape:?} {degrees} {z}");
                assert!(low >= reach.x0 - slack && high <= reach.x1 + slack, "{shape:?} {z}");
            }
        }
    }
}

#[test]
fn corners_may_be_told_either_way_round() {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut backwards = corners;
    backwards.reverse();
    for corners in [corners, backwards] {
        assert_eq!(polygon(&corners).flaw(), None);
        assert_eq!(polygon(&corners).area(), 1.0);
        let (low, high) = polygon(&corners).chord(Turn::NONE, 0.5).expect("it goes through");
        assert!(low.abs() < 2e-6 && (high - 1.0).abs() < 2e-6);
    }
}

#[test]
fn what_is_no_convex_polygon_is_told() {
    let star: Vec<[f64; 2]> = (0..5)
        .map(|i| f64::from(2 * i) * std::f64::consts::TAU / 5.0)
        .map(|angle| [angle.sin(), angle.cos()])
        .collect();
    for corners in [
        &[[0.0, 0.0], [1.0, 0.0]][..],
        &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],
        &[[0.0, 0.0], [1.0, 0.0], [0.2, 0.2], [0.0, 1.0]],
        &[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
        &star,
        &[[0.0, 0.0]; 17],
    ] {
        assert!(polygon(corners).flaw().is_some(), "{corners:?}");
    }
    let with_a_straight_corner = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0]];
    assert_eq!(polygon(&with_a_straight_corner).flaw(), None);
    assert!(Shape::Capsule { length: 0.5, radius: 0.3 }.flaw().is_some());
    assert!(all().iter().all(|shape| shape.flaw().is_none()));
}

#[test]
fn a_rim_rises_from_the_lowest_line() {
    let wheel = Shape::Wheel { width: 0.2, radius: 0.5 };
    let east = Turn::new(90.0);
    assert_eq!(wheel.lift(east, 0.0, 0.7), Some(0.0), "along its axle");
    let lift = wheel.lift(east, 0.3, 0.0).expect("wheels are round");
    assert!((lift - 0.1).abs() < 1e-12);
    assert_eq!(wheel.lift(east, 0.5, 0.0), Some(0.5));
    assert_eq!(Shape::Disk { radius: 1.0 }.lift(east, 0.3, 0.0), None);
}

#[test]
fn chords_along_both_axes_are_of_the_same_shape() {
    for shape in all() {
        for degrees in [0.0, 40.0, 90.0, 155.0] {
            let turn = Turn::new(degrees);
            for i in -30..30 {
                let (x, z) = (f64::from(i) * 0.05, f64::from(i % 7) * 0.11);
                let along_x = shape.chord(turn, z).is_some_and(|(a, b)| (a..=b).contains(&x));
                let along_z =
                    shape.chord_along_z(turn, x).is_some_and(|(a, b)| (a..=b).contains(&z));
                assert_eq!(along_x, along_z, "{shape:?} at {degrees}°, ({x}, {z})");
            }
        }
    }
}
