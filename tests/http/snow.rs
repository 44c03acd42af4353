//! Snowfalls and reads of the snow over HTTP.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Reply, Server, numbers, small};

on_each_backend!(
    the_ledger_holds_however_much_is_refused,
    you_read_your_own_snowfall,
    a_snowfall_in_a_region_keeps_to_it,
    what_finds_no_room_is_refused_and_told,
    a_clearing_leaves_a_depth_standing,
    a_plough_clears_its_way_in_one_call,
    air_gets_another_temperature,
    heights_come_as_json_and_as_floats,
    heights_come_of_a_region_and_with_a_stride,
    heights_outside_the_grid_are_refused,
    terrain_is_added_to_the_surface,
    a_height_is_interpolated,
    a_column_shows_its_cells,
);

/// An uneven snowpack: column (x, z) of 20 × 12 is 0.2 m · (1 + x + z/3) deep, row by row.
async fn uneven(server: &Server) -> (String, Vec<f64>) {
    let grid = json!({"width": 20, "depth": 12, "height": 40, "cell_size": 0.2});
    let path = server.create(json!({"grid": grid, "paused": true})).await;
    let mut expected = vec![0.0; 240];
    for x in 0..20 {
        let region = json!({"x": 0.2 * f64::from(x), "z": 0, "width": 0.2, "depth": 2.4});
        let depth = 0.2 * f64::from(1 + x);
        fall(server, &path, json!({"depth": depth, "region": region})).await;
    }
    for z in 0..4 {
        let region = json!({"x": 0, "z": 0.6 * f64::from(z), "width": 4, "depth": 0.6});
        let depth = 0.2 * f64::from(1 + z);
        fall(server, &path, json!({"depth": depth, "region": region})).await;
    }
    for (i, depth) in expected.iter_mut().enumerate() {
        *depth = 0.2 * (2 + i % 20 + i / 60) as f64;
    }
    (path, expected)
}

async fn fall(server: &Server, path: &str, body: Value) -> Value {
    server.post(&format!("{path}/snowfalls"), body).await.expect(200)
}

fn floats(reply: &Reply) -> Vec<f32> {
    reply.body.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

#[track_caller]
fn near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() < 1e-6, "sample {i}: {a} instead of {b}");
    }
}

async fn you_read_your_own_snowfall(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for paused in [true, false] {
        let grid = json!({"width": 16, "depth": 16, "height": 30, "cell_size": 0.2});
        let path = server.create(json!({"grid": grid, "paused": paused, "time_scale": 0})).await;
        for i in 1..=10 {
            let reply = fall(&server, &path, json!({"depth": 0.2})).await;
            let fallen = reply["fallen_mass"].as_f64().unwrap();
            assert!((fallen - 0.2 * 20.0 * 10.24).abs() < 1e-3, "{reply}");
            assert_eq!(reply["refused_mass"], 0.0);
            let read = server.get(&format!("{path}/heights")).await.expect(200);
            assert!(read["seq"].as_u64() >= reply["seq"].as_u64());
            near(&numbers(&read["heights"]), &[0.2 * f64::from(i); 256]);
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            assert_eq!(mass["imbalance_quanta"], 0);
            assert!((mass["present"].as_f64().unwrap() - f64::from(i) * fallen).abs() < 1e-2);
        }
    }
    server.stop().await;
}

async fn a_snowfall_in_a_region_keeps_to_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    // Centres at 0.3 (column 1) to 0.9 (column 4) and 0.5 (row 2); 1.1 is the upper edge: not in.
    let region = json!({"x": 0.3, "z": 0.5, "width": 0.8, "depth": 0.2});
    let reply = fall(&server, &path, json!({"depth": 0.4, "density": 50, "region": region})).await;
    let fallen = reply["fallen_mass"].as_f64().unwrap();
    assert!((fallen - 0.4 * 50.0 * 4.0 * 0.04).abs() < 1e-4, "{reply}");
    let mut expected = vec![1.0; 70];
    expected[21..25].fill(1.4);
    near(&server.heights(&path).await, &expected);
    // A region that reaches beyond the grid is clipped; one that misses it is invalid.
    let wide = json!({"x": -5, "z": -5, "width": 50, "depth": 50});
    fall(&server, &path, json!({"depth": 0.2, "region": wide})).await;
    let snowfalls = format!("{path}/snowfalls");
    for region in [
        json!({"x": 2, "z": 0, "width": 1, "depth": 1}),
        json!({"x": 0.11, "z": 0.11, "width": 0.1, "depth": 0.1}),
    ] {
        let reply = server.post(&snowfalls, json!({"depth": 1, "region": region})).await;
        assert_eq!(reply.pointers(422), ["/region"]);
    }
    server.stop().await;
}

async fn what_finds_no_room_is_refused_and_told(backend: BackendChoice) {
    let server = Server::start(backend).await;
    // 20 slots of 0.2 m hold 4 m; 1 m is there.
    let path = server.create(small()).await;
    let reply = fall(&server, &path, json!({"depth": 10})).await;
    let (fallen, refused) =
        (reply["fallen_mass"].as_f64().unwrap(), reply["refused_mass"].as_f64().unwrap());
    assert!((fallen - 10.0 * 20.0 * 2.8).abs() < 1e-2, "{reply}");
    assert!((refused - 7.0 * 20.0 * 2.8).abs() < 1e-2, "{reply}");
    near(&server.heights(&path).await, &[4.0; 70]);
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);
    assert!((mass["refused"].as_f64().unwrap() - refused).abs() < 1e-6);
    assert!((mass["present"].as_f64().unwrap() - 4.0 * 20.0 * 2.8).abs() < 1e-2);
    server.stop().await;
}

async fn a_plough_clears_its_way_in_one_call(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let clearings = format!("{path}/clearings");
    // Along the third row of columns, and up the last but one.
    let way = json!({"depth": 0.25, "path": [[-1, 0.5], [1.7, 0.5], [1.7, 9]], "width": 0.2});
    let reply = server.post(&clearings, way.clone()).await.expect(200);
    let heights = server.heights(&path).await;
    for z in 0..7 {
        for x in 0..10 {
            let cleared = (z == 2 && x <= 8) || (x == 8 && z >= 2);
            assert_eq!(heights[z * 10 + x] < 0.5, cleared, "({x}, {z}): {heights:?}");
        }
    }
    let cleared = reply["cleared_mass"].as_f64().unwrap();
    assert!((cleared - 13.0 * 0.75 * 20.0 * 0.04).abs() < 1e-3, "{reply}");
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);
    assert!((mass["cleared"].as_f64().unwrap() - cleared).abs() < 1e-6, "{mass}");

    let with = |field: &str, value: Value| {
        let mut way = way.clone();
        way[field] = value;
        way
    };
    for (body, pointer) in [
        (with("path", json!([])), "/path"),
        (with("path", json!([[1, 1]])), "/path"),
        (with("path", json!(vec![[1, 1]; 4097])), "/path"),
        (with("path", json!([[1, 1], [1e9, 1]])), "/path/1/0"),
        (with("path", json!([[1, 1], [1]])), "/path/1"),
        (with("path", json!([[-9, -9], [-8, -9]])), "/path"),
        (with("path", Value::Null), "/width"),
        (with("width", Value::Null), "/width"),
        (with("width", json!(0)), "/width"),
        (with("region", json!({"x": 0, "z": 0, "width": 1, "depth": 1})), "/region"),
    ] {
        let reply = server.post(&clearings, body.clone()).await;
        assert_eq!(reply.pointers(422), [pointer], "{body}");
    }
    server.stop().await;
}

async fn a_clearing_leaves_a_depth_standing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let region = json!({"x": 0, "z": 0, "width": 0.4, "depth": 1.4});
    let clearings = format!("{path}/clearings");
    let reply = server.post(&clearings, json!({"depth": 0.3, "region": region})).await.expect(200);
    assert!((reply["cleared_mass"].as_f64().unwrap() - 0.7 * 20.0 * 0.56).abs() < 1e-3, "{reply}");
    let expected: Vec<f64> = (0..70).map(|i| if i % 10 < 2 { 0.3 } else { 1.0 }).collect();
    near(&server.heights(&path).await, &expected);
    let reply = server.post(&clearings, json!({"depth": 0})).await.expect(200);
    near(&server.heights(&path).await, &[0.0; 70]);
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!((&mass["present"], &mass["imbalance_quanta"]), (&json!(0.0), &json!(0)));
    assert!((mass["cleared"].as_f64().unwrap() - 56.0).abs() < 1e-2, "{mass} {reply}");
    server.stop().await;
}

async fn air_gets_another_temperature(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let air = format!("{path}/air-temperature");
    let reply = server.put(&air, json!({"celsius": -10})).await.expect(200);
    assert_eq!(reply["celsius"], -10.0);
    assert!(reply["tick"].is_u64() && reply["seq"].is_u64());
    assert_eq!(server.get(&path).await.expect(200)["air_temperature"], -10.0);
    fall(&server, &path, json!({"depth": 0.2})).await;
    let column = server.get(&format!("{path}/columns/3/3")).await.expect(200);
    let layers = column["layers"].as_array().unwrap();
    assert_eq!(layers.last().unwrap()["temperature"], -10.0, "fresh snow is as cold as the air");
    assert_eq!(layers[0]["temperature"], -3.0, "snow that lies keeps its temperature");
    server.stop().await;
}

async fn heights_come_as_json_and_as_floats(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (path, expected) = uneven(&server).await;
    let url = format!("{path}/heights");
    let reply = server.get(&url).await;
    let json = reply.expect(200);
    assert_eq!(reply.header("content-type"), "application/json");
    assert_eq!(json["origin"], json!({"column_x": 0, "column_z": 0}));
    assert_eq!(
        (&json["width"], &json["depth"], &json["stride"], &json["cell_size"]),
        (&json!(20), &json!(12), &json!(1), &json!(0.2))
    );
    near(&numbers(&json["heights"]), &expected);
    assert_eq!(reply.header("firn-tick"), json["tick"].to_string());
    assert_eq!(reply.header("firn-seq"), json["seq"].to_string());

    let binary = server.get_as(&url, "application/octet-stream").await;
    assert_eq!(binary.status, 200);
    assert_eq!(binary.header("content-type"), "application/octet-stream");
    assert_eq!(binary.header("firn-seq"), json["seq"].to_string());
    assert!(binary.varies("accept"));
    let exact: Vec<f32> = numbers(&json["heights"]).iter().map(|&h| h as f32).collect();
    assert_eq!(floats(&binary), exact);

    for accept in ["*/*", "application/*, text/html;q=0.9", "application/json"] {
        let reply = server.get_as(&url, accept).await;
        assert_eq!(reply.header("content-type"), "application/json", "{accept}");
    }
    for accept in ["text/html", "application/json;q=0"] {
        server.get_as(&url, accept).await.problem(406);
    }
    server.stop().await;
}

async fn heights_come_of_a_region_and_with_a_stride(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (path, all) = uneven(&server).await;
    for (x0, z0, width, depth, stride) in
        [(0, 0, 20, 12, 1), (3, 5, 9, 4, 1), (1, 2, 10, 5, 2), (5, 3, 4, 3, 4), (2, 1, 3, 2, 8)]
    {
        let query =
            format!("column_x={x0}&column_z={z0}&width={width}&depth={depth}&stride={stride}");
        let url = format!("{path}/heights?{query}");
        let view = server.get(&url).await.expect(200);
        let expected: Vec<f64> = (0..depth)
            .flat_map(|z| (0..width).map(move |x| (x, z)))
            .map(|(x, z)| all[(z0 + z * stride) * 20 + x0 + x * stride])
            .collect();
        near(&numbers(&view["heights"]), &expected);
        assert_eq!((&view["width"], &view["depth"]), (&json!(width), &json!(depth)), "{query}");
        assert_eq!(view["origin"], json!({"column_x": x0, "column_z": z0}));
        assert_eq!(view["stride"], stride);
        let binary = server.get_as(&url, "application/octet-stream").await;
        assert_eq!(floats(&binary).len(), width * depth);
    }
    // Left out, width and depth reach as far as the grid does.
    let view = server.get(&format!("{path}/heights?column_x=3&stride=8")).await.expect(200);
    assert_eq!((&view["width"], &view["depth"]), (&json!(3), &json!(2)));
    server.stop().await;
}

async fn heights_outside_the_grid_are_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    for (query, pointers) in [
        ("column_x=10", vec!["column_x"]),
        ("column_z=7", vec!["column_z"]),
        ("column_x=-1", vec!["column_x"]),
        ("width=11", vec!["width"]),
        ("column_z=3&depth=5", vec!["depth"]),
        ("width=6&stride=2", vec!["width"]),
        ("width=0&depth=0", vec!["width", "depth"]),
        ("stride=3", vec!["stride"]),
        ("stride=16", vec!["stride"]),
        ("surface=maybe", vec!["surface"]),
        ("column_x=1&column_x=2", vec!["column_x"]),
        ("column_y=1", vec!["column_y"]),
        ("column_x=99999999999", vec!["column_x"]),
    ] {
        let reply = server.get(&format!("{path}/heights?{query}")).await;
        assert_eq!(reply.pointers(422), pointers, "{query}");
    }
    for (query, pointers) in [
        ("x=1", vec!["z"]),
        ("", vec!["x", "z"]),
        ("x=2.01&z=0", vec!["x"]),
        ("x=0&z=-0.1", vec!["z"]),
        ("x=nan&z=0", vec!["x"]),
        ("x=0&z=inf", vec!["z"]),
        ("x=0&z=0&y=0", vec!["y"]),
    ] {
        let reply = server.get(&format!("{path}/height?{query}")).await;
        assert_eq!(reply.pointers(422), pointers, "{query}");
    }
    for column in ["10/0", "0/7", "4000000000/0"] {
        server.get(&format!("{path}/columns/{column}")).await.problem(404);
    }
    for (column, pointers) in [
        ("a/0", vec!["column_x"]),
        ("0/-1", vec!["column_z"]),
        ("1.5/b", vec!["column_x", "column_z"]),
    ] {
        let reply = server.get(&format!("{path}/columns/{column}")).await;
        assert_eq!(reply.pointers(422), pointers, "{column}");
    }
    server.stop().await;
}

async fn terrain_is_added_to_the_surface(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let ground: Vec<f64> = (0..70).map(|i| 500.0 + f64::from(i % 10) * 0.5).collect();
    let mut spec = small();
    spec["terrain"] = json!({ "heights": ground });
    let path = server.create(spec).await;
    assert_eq!(server.get(&path).await.expect(200)["terrain"], true);
    near(&server.heights(&path).await, &[1.0; 70]);
    let url = format!("{path}/heights?surface=true");
    let surface = server.get(&url).await.expect(200);
    let expected: Vec<f64> = ground.iter().map(|ground| ground + 1.0).collect();
    near(&numbers(&surface["heights"]), &expected);
    let part = server.get(&format!("{url}&column_x=1&column_z=2&stride=4")).await.expect(200);
    near(&numbers(&part["heights"]), &[501.5, 503.5, 505.5, 501.5, 503.5, 505.5]);
    server.stop().await;
}

async fn a_height_is_interpolated(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (path, all) = uneven(&server).await;
    let height = async |x: f64, z: f64| {
        let view = server.get(&format!("{path}/height?x={x}&z={z}")).await.expect(200);
        assert!(view["tick"].is_u64() && view["seq"].is_u64());
        view["height"].as_f64().unwrap()
    };
    let column = |x: usize, z: usize| all[z * 20 + x];
    near(&[height(0.7, 0.5).await], &[column(3, 2)]);
    near(&[height(0.8, 0.5).await], &[(column(3, 2) + column(4, 2)) / 2.0]);
    let corner = [column(3, 2), column(4, 2), column(3, 3), column(4, 3)];
    let weights = [0.75 * 0.5, 0.25 * 0.5, 0.75 * 0.5, 0.25 * 0.5];
    let mixed = corner.iter().zip(weights).map(|(height, weight)| height * weight).sum();
    near(&[height(0.75, 0.6).await], &[mixed]);
    near(&[height(0.0, 0.0).await, height(4.0, 2.4).await], &[column(0, 0), column(19, 11)]);
    server.stop().await;
}

async fn a_column_shows_its_cells(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = small();
    spec["initial_snow"] = json!([{"depth": 0.4, "density": 60, "temperature": -5},
        {"depth": 0.2, "density": 20}, {"depth": 0.4, "density": 60}]);
    let path = server.create(spec).await;
    let column = server.get(&format!("{path}/columns/9/6")).await.expect(200);
    let layers = column["layers"].as_array().unwrap();
    assert_eq!(layers.len(), 5);
    let of = |field: &str| -> Vec<f64> {
        layers.iter().map(|layer| layer[field].as_f64().unwrap()).collect()
    };
    near(&of("bottom"), &[0.0, 0.2, 0.4, 0.6, 0.8]);
    near(&of("thickness"), &[0.2; 5]);
    for (found, expected) in of("density").iter().zip([60.0, 60.0, 20.0, 60.0, 60.0]) {
        assert!((found - expected).abs() < 1e-3, "{found}");
    }
    near(&of("temperature"), &[-5.0, -5.0, -3.0, -3.0, -3.0]);
    assert!((column["mass"].as_f64().unwrap() - 52.0 * 0.04).abs() < 1e-5);
    assert!((column["mean_density"].as_f64().unwrap() - 52.0).abs() < 1e-3);
    near(&[column["height"].as_f64().unwrap()], &[1.0]);
    let stress = of("stress");
    assert!(stress.windows(2).all(|pair| pair[0] > pair[1]), "it grows downwards: {stress:?}");
    assert!((stress[0] - 52.0 * 9.81).abs() < 0.1, "its own weight included: {stress:?}");
    let weak = column["weak_layers"].as_array().unwrap();
    assert_eq!(weak.len(), 1, "{column}");
    near(&[weak[0]["bottom"].as_f64().unwrap()], &[0.4]);
    assert!((weak[0]["contrast"].as_f64().unwrap() - (1.0 - 20.0 / 60.0)).abs() < 1e-4);
    server.stop().await;
}

async fn the_ledger_holds_however_much_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let grid = json!({"width": 512, "depth": 512, "height": 1, "cell_size": 0.2});
    let material = json!({"max_density": 917});
    let path = server.create(json!({"grid": grid, "material": material, "paused": true})).await;
    for _ in 0..320 {
        fall(&server, &path, json!({"depth": 1000, "density": 917})).await;
    }
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0, "{mass}");
    let fallen = 320.0 * 1000.0 * 917.0 * 512.0 * 512.0 * 0.04;
    assert!((mass["fallen"].as_f64().unwrap() / fallen - 1.0).abs() < 1e-9, "{mass}");
    server.stop().await;
}
