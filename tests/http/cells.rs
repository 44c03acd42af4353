//! The fixed grid over HTTP.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(
    the_grid_shows_ground_snow_and_air,
    a_part_of_the_grid_is_that_part_of_the_whole,
    masses_of_the_grid_add_up,
    what_is_not_in_the_grid_is_refused,
    many_may_read_the_grid_at_once,
);

async fn sloping(server: &Server) -> String {
    let heights: Vec<f64> = (0..12 * 10).map(|i| 0.1 * f64::from(i % 12) - 7.0).collect();
    let grid = json!({"width": 12, "depth": 10, "height": 8, "cell_size": 0.2});
    let snow = json!([{"depth": 0.5}, {"depth": 0.4, "temperature": -12, "density": 50}]);
    let body = json!({"grid": grid, "paused": true, "terrain": {"heights": heights},
        "initial_snow": snow});
    server.create(body).await
}

fn count(content: &Value, name: &str) -> usize {
    content.as_array().unwrap().iter().filter(|found| *found == name).count()
}

async fn the_grid_shows_ground_snow_and_air(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server).await;
    let all =
        server.get(&format!("{path}/cells?fields=density,fill,temperature")).await.expect(200);
    // 8 slots on ground up to 1.1 m above the lowest: 6 cells more.
    assert_eq!(
        (&all["width"], &all["depth"], &all["height"]),
        (&json!(12), &json!(10), &json!(14))
    );
    let content = &all["content"];
    assert_eq!(content.as_array().unwrap().len(), 12 * 10 * 14);
    assert!(
        count(content, "ground") > 0 && count(content, "snow") > 0 && count(content, "air") > 0
    );
    let density = all["fields"]["density"].as_array().unwrap();
    for (name, density) in content.as_array().unwrap().iter().zip(density) {
        assert_eq!(name == "snow", density.is_number(), "{name} {density}");
    }
    // Column (0, 0) on the lowest ground: 0.2 m, 0.2 m, half a cell of each layer, 0.2 m, half.
    let column = |field: &str, y: usize| all["fields"][field][y * 12].as_f64().unwrap();
    assert!((column("density", 0) - 20.0).abs() < 1e-3);
    assert!((column("density", 2) - 35.0).abs() < 1e-3);
    assert!((column("density", 3) - 50.0).abs() < 1e-3);
    assert!((column("fill", 4) - 0.5).abs() < 1e-4);
    assert!((column("temperature", 2) - (20.0 * -3.0 + 50.0 * -12.0) / 70.0).abs() < 1e-3);
    assert_eq!(content[5 * 12], "air");
    server.stop().await;
}

async fn a_part_of_the_grid_is_that_part_of_the_whole(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server).await;
    let fields = "fields=hardness,stress";
    let all = server.get(&format!("{path}/cells?{fields}")).await.expect(200);
    let query = format!("column_x=3&column_z=2&cell_y=1&width=7&depth=8&height=5&{fields}");
    let part = server.get(&format!("{path}/cells?{query}")).await.expect(200);
    assert_eq!(part["origin"], json!({"column_x": 3, "column_z": 2, "cell_y": 1}));
    for (i, content) in part["content"].as_array().unwrap().iter().enumerate() {
        let (x, y, z) = (3 + i % 7, 1 + i / 7 % 5, 2 + i / 35);
        let whole = (z * 14 + y) * 12 + x;
        assert_eq!(*content, all["content"][whole], "({x}, {y}, {z})");
        for field in ["hardness", "stress"] {
            assert_eq!(part["fields"][field][i], all["fields"][field][whole], "({x}, {y}, {z})");
        }
    }
    server.stop().await;
}

async fn masses_of_the_grid_add_up(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server).await;
    let plate = json!({"mass": 100, "shape": {"type": "box", "width": 1, "depth": 1},
        "position": {"x": 1.2, "z": 1}});
    server.post(&format!("{path}/colliders"), plate).await.expect(201);
    server.post(&format!("{path}/step"), json!({"ticks": 200})).await.expect(200);
    let names = "mass,external_stress,indent,stiffness";
    let all = server.get(&format!("{path}/cells?fields={names}")).await.expect(200);
    let sum: f64 = all["fields"]["mass"].as_array().unwrap().iter().filter_map(Value::as_f64).sum();
    let present =
        server.get(&format!("{path}/mass")).await.expect(200)["present"].as_f64().unwrap();
    assert!((sum * 0.04 / present - 1.0).abs() < 1e-5, "{} kg of {present} kg", sum * 0.04);
    let loads = all["fields"]["external_stress"].as_array().unwrap();
    assert!(loads.iter().filter_map(Value::as_f64).any(|stress| stress > 100.0));
    server.stop().await;
}

async fn what_is_not_in_the_grid_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server).await;
    for (query, pointer) in [
        ("column_x=12", "column_x"),
        ("column_z=9&depth=2", "depth"),
        ("cell_y=14", "cell_y"),
        ("height=15", "height"),
        ("width=0", "width"),
        ("fields=density,colour", "fields"),
        ("layers=3", "layers"),
    ] {
        let reply = server.get(&format!("{path}/cells?{query}")).await;
        assert_eq!(reply.pointers(422), [pointer], "{query}");
    }
    let grid = json!({"width": 200, "depth": 200, "height": 50, "cell_size": 0.2});
    let large = server.create(json!({"grid": grid, "paused": true})).await;
    let refused = server.get(&format!("{large}/cells")).await.problem(413);
    assert!(refused["detail"].as_str().unwrap().contains("1048576"), "{refused}");
    server.get(&format!("{large}/cells?height=20")).await.expect(200);
    server.stop().await;
}

async fn many_may_read_the_grid_at_once(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let grid = json!({"width": 128, "depth": 128, "height": 64, "cell_size": 0.2});
    let path = server.create(json!({"grid": grid, "paused": true})).await;
    let read = format!("{path}/cells?fields=fill");
    // Together far more than a frame samples, and than one buffer of a small device holds.
    let replies = futures_util::future::join_all((0..10).map(|_| server.get(&read))).await;
    for reply in replies {
        assert_eq!(reply.status, 200);
    }
    server.get("/readyz").await.expect(200);
    server.stop().await;
}
