//! What objects stand on: turned outlines, several feet, wheels, the edge of the grid, nothing at all.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use super::colliders::{feet, foot, plate};
use crate::on_each_backend;
use crate::support::{Server, small};

on_each_backend!(
    a_turned_box_leaves_the_print_of_the_turned_box,
    a_body_stands_on_all_of_its_feet,
    what_hangs_over_the_edge_is_carried_there,
    what_is_held_up_presses_nothing,
    a_wheel_rides_on_its_rim,
);

async fn a_turned_box_leaves_the_print_of_the_turned_box(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let print = async |shape: Value, heading: f64| {
        let path = server.create(small()).await;
        let ski = json!({"mass": 40, "shape": shape, "position": {"x": 1.0, "z": 0.7},
            "heading": heading});
        let put = server.put(&format!("{path}/colliders/ski"), ski).await.expect(201);
        assert_eq!(put["heading"], heading);
        server.step(&path, 300).await;
        (server.heights(&path).await, put["pressure"].clone())
    };
    let long = json!({"type": "box", "width": 0.3, "depth": 1.1});
    let wide = json!({"type": "box", "width": 1.1, "depth": 0.3});
    let east = print(long.clone(), 90.0).await;
    assert_eq!(east, print(wide, 0.0).await);
    assert_eq!(east, print(long.clone(), -90.0).await);
    assert_ne!(east.0, print(long, 45.0).await.0);
    server.stop().await;
}

async fn a_body_stands_on_all_of_its_feet(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let one = format!("{path}/colliders/walker");
    let walker = feet(json!([foot(-0.3), foot(0.3)]));
    let put = server.put(&one, walker).await.expect(201);
    assert!(put.get("shape").is_none(), "{put}");
    assert_eq!(put["footprints"][1]["offset"], json!({"x": 0.3, "z": 0.0}));
    let near = |value: &Value, wanted: f64| (value.as_f64().unwrap() / wanted - 1.0).abs() < 1e-4;
    assert!(near(&put["contact_area"], 0.16), "{put}");
    assert!(near(&put["pressure"], 80.0 * 9.81 / 0.16), "{put}");
    server.step(&path, 600).await;
    let heights = server.heights(&path).await;
    let at = |x: usize, z: usize| heights[z * 10 + x];
    assert!(at(4, 3) < at(0, 0) - 0.05 && at(7, 3) < at(0, 0) - 0.05, "{heights:?}");
    assert_eq!(at(5, 0), at(0, 0), "snow between and beside the feet stands");

    // On one leg it presses harder.
    let hop = server.patch(&one, json!({"footprints": [foot(0.3)]})).await.expect(200);
    assert!(near(&hop["contact_area"], 0.08), "{hop}");
    let disk = json!({"type": "disk", "radius": 0.3});
    let rolled = server.patch(&one, json!({ "shape": disk })).await.expect(200);
    assert!(rolled.get("footprints").is_none() && rolled["shape"] == disk, "{rolled}");
    let both = json!({"shape": disk, "footprints": [foot(0.0)]});
    assert_eq!(server.patch(&one, both).await.pointers(422), ["/footprints"]);
    server.stop().await;
}

async fn what_hangs_over_the_edge_is_carried_there(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let put = server.put(&format!("{path}/colliders/a"), plate(0.8, 0.0, 0.7)).await.expect(201);
    let near = |value: &Value, wanted: f64| (value.as_f64().unwrap() / wanted - 1.0).abs() < 1e-4;
    assert!(near(&put["contact_area"], 0.64), "{put}");
    assert!(near(&put["pressure"], 981.0 / 0.64), "{put}");
    server.stop().await;
}

async fn what_is_held_up_presses_nothing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let still = server.create(small()).await;
    let path = server.create(small()).await;
    let one = format!("{path}/colliders/jumper");
    let mut jumper = plate(0.4, 1.0, 0.7);
    jumper["airborne"] = json!(true);
    let put = server.put(&one, jumper).await.expect(201);
    for field in ["pressure", "contact_area", "sink_depth"] {
        assert_eq!(put[field], 0.0, "{put}");
    }
    server.step(&still, 300).await;
    server.step(&path, 300).await;
    assert_eq!(server.heights(&path).await, server.heights(&still).await);
    let landed = server.patch(&one, json!({"airborne": false})).await.expect(200);
    assert!(landed["pressure"].as_f64().unwrap() > 6000.0, "{landed}");
    assert_eq!(landed["sink_depth"], 0.0, "it sinks from where it has landed");
    let saved = server.get(&format!("{path}/colliders/jumper")).await.expect(200);
    assert_eq!(saved["airborne"], false);
    server.stop().await;
}

async fn a_wheel_rides_on_its_rim(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut world = small();
    world["grid"] = json!({"width": 40, "depth": 40, "height": 20, "cell_size": 0.05});
    let path = server.create(world).await;
    let one = format!("{path}/colliders/wheel");
    let wheel = json!({"mass": 60, "shape": {"type": "wheel", "width": 0.2, "radius": 0.3},
        "position": {"x": 1.0, "z": 1.0}, "heading": 90});
    let put = server.put(&one, wheel).await.expect(201);
    let area = put["contact_area"].as_f64().unwrap();
    assert!((0.2 * 0.05..0.2 * 0.2).contains(&area), "it touches with its lowest line: {put}");
    server.step(&path, 600).await;
    let sunk = server.get(&one).await.expect(200);
    let (depth, wider) =
        (sunk["sink_depth"].as_f64().unwrap(), sunk["contact_area"].as_f64().unwrap());
    assert!(depth > 0.03 && wider > area, "the deeper, the more of its rim: {sunk}");
    let chord = 2.0 * (2.0 * 0.3 * depth - depth * depth).sqrt();
    assert!(wider <= 0.2 * (chord + 2.0 * 0.05), "{sunk}");
    server.stop().await;
}
