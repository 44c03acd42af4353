//! The ground as a resource of its own: told, read and replaced under living snow.

use std::io::Cursor;

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Reply, Server, numbers, small};

on_each_backend!(
    ground_is_read_as_it_was_told,
    ground_of_any_kind_lies_under_the_snow,
    objects_stand_on_new_ground,
    a_relief_of_many_cells_carries_objects_to_the_quantum,
    cells_are_counted_from_each_columns_ground,
    new_ground_is_in_snapshots_and_gone_with_a_reset,
    what_is_no_ground_is_refused,
);

/// As many elevations as a small session has columns, from a function of their number.
fn elevations(height: impl Fn(u32) -> f64) -> Vec<f64> {
    (0..70).map(height).collect()
}

async fn put(server: &Server, path: &str, kind: &str, query: &str, body: Vec<u8>) -> Reply {
    let url = format!("{path}/terrain{query}");
    server.send(Method::PUT, &url, &[("content-type", kind)], body).await
}

fn floats(heights: &[f64]) -> Vec<u8> {
    heights.iter().flat_map(|&height| (height as f32).to_le_bytes()).collect()
}

fn image(width: u32, height: u32, depth: png::BitDepth, pixels: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(Cursor::new(&mut file), width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(pixels).unwrap();
    file
}

async fn ground(server: &Server, path: &str) -> Vec<f64> {
    numbers(&server.get(&format!("{path}/terrain")).await.expect(200)["heights"])
}

async fn ground_is_read_as_it_was_told(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let told = elevations(|i| 500.0 + f64::from(i % 10) * 0.3);
    let mut spec = small();
    spec["terrain"] = json!({ "heights": told });
    let path = server.create(spec).await;
    let url = format!("{path}/terrain");
    let view = server.get(&url).await;
    assert_eq!(numbers(&view.expect(200)["heights"]), told);
    let part = server.get(&format!("{url}?column_x=1&column_z=2&width=3&stride=2")).await;
    let part = numbers(&part.expect(200)["heights"]);
    assert_eq!(part[..3], [told[21], told[23], told[25]]);
    let image = server.get_as(&url, "image/png").await;
    let metres = |header| image.header(header).parse::<f64>().unwrap();
    assert_eq!(metres("firn-height-offset"), 500.0);
    assert!((metres("firn-height-scale") * 65535.0 - 2.7).abs() < 1e-9);
    let held = [("if-none-match", view.header("etag"))];
    assert_eq!(server.send(Method::GET, &url, &held, Vec::new()).await.status, 304);
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.2})).await.expect(200);
    let held_still = server.send(Method::GET, &url, &held, Vec::new()).await;
    assert_eq!(held_still.status, 304, "snow is no ground");
    server.put(&url, json!({ "heights": told })).await.expect(200);
    assert_eq!(server.send(Method::GET, &url, &held, Vec::new()).await.status, 200);
    // A session is told in few words, whatever it lies on.
    let patched = server.patch(&path, json!({"time_scale": 2.0})).await;
    assert_eq!((&patched.expect(200)["terrain"], patched.body.len() < 4096), (&json!(true), true));
    let level = server.create(small()).await;
    assert_eq!(ground(&server, &level).await, [0.0; 70]);
    server.stop().await;
}

async fn ground_of_any_kind_lies_under_the_snow(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let depths = server.heights(&path).await;
    let told = elevations(|i| f64::from(i) * 0.25 - 3.0);
    let npy = |kind: &str, data: Vec<u8>| {
        let shape = "'fortran_order': False, 'shape': (7, 10), }\n";
        let header = format!("{{'descr': '{kind}', {shape}");
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes(), &data].concat()
    };
    let doubles = told.iter().flat_map(|height| height.to_le_bytes()).collect();
    let grey: Vec<u8> = (0..70_u16).flat_map(|i| (i * 100).to_be_bytes()).collect();
    let small_grey: Vec<u8> = (0..70).collect();
    let kinds = [
        ("application/json", "", json!({ "heights": told }).to_string().into_bytes()),
        ("application/octet-stream", "", floats(&told)),
        ("application/x-npy", "", npy("<f4", floats(&told))),
        ("application/x-npy", "", npy("<f8", doubles)),
        ("image/png", "?scale=0.0025&offset=-3", image(10, 7, png::BitDepth::Sixteen, &grey)),
        ("image/png", "?scale=0.25&offset=-3", image(10, 7, png::BitDepth::Eight, &small_grey)),
    ];
    for (kind, query, body) in kinds {
        let flat = json!({"heights": elevations(|_| 0.0)});
        server.put(&format!("{path}/terrain"), flat).await.expect(200);
        let before = server.get(&path).await.expect(200)["seq"].as_u64();
        let stamp = put(&server, &path, kind, query, body).await.expect(200);
        assert!(stamp["seq"].as_u64() > before, "{stamp}");
        let read = ground(&server, &path).await;
        assert!(read.iter().zip(&told).all(|(a, b)| (a - b).abs() < 1e-9), "{kind}: {read:?}");
        let surface = server.get(&format!("{path}/heights?surface=true")).await.expect(200);
        for (surface, (ground, depth)) in
            numbers(&surface["heights"]).iter().zip(read.iter().zip(&depths))
        {
            assert!((surface - ground - depth).abs() < 1e-9);
        }
        assert_eq!(server.heights(&path).await, depths, "snow keeps its depth");
    }
    server.stop().await;
}

/// A box of 1 m in the middle.
async fn stand(server: &Server, path: &str) -> Value {
    let shape = json!({"type": "box", "width": 1.0, "depth": 1.0});
    let body = json!({"mass": 20.0, "shape": shape, "position": {"x": 1.0, "z": 0.7}});
    server.put(&format!("{path}/colliders/box"), body).await.expect(201)
}

async fn objects_stand_on_new_ground(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let before = stand(&server, &path).await["bottom"].as_f64().unwrap();
    let lifted = json!({"heights": elevations(|_| 100.25)});
    server.put(&format!("{path}/terrain"), lifted).await.expect(200);
    let collider = server.get(&format!("{path}/colliders/box")).await.expect(200);
    assert_eq!(collider["bottom"].as_f64().unwrap(), before + 100.25);
    assert_eq!(collider["sink_depth"].as_f64().unwrap(), -100.25);
    // On a ridge under its middle it touches less of the snow, and presses more.
    let ridge = json!({"heights": elevations(|i| if i % 10 == 4 { 1.0 } else { 0.0 })});
    server.put(&format!("{path}/terrain"), ridge).await.expect(200);
    let ridden = server.get(&format!("{path}/colliders/box")).await.expect(200);
    let number = |view: &Value, field: &str| view[field].as_f64().unwrap();
    assert!(number(&ridden, "pressure") > 2.0 * number(&collider, "pressure"), "{ridden}");
    assert_eq!(number(&ridden, "bottom"), before + 1.0);
    server.stop().await;
}

async fn a_relief_of_many_cells_carries_objects_to_the_quantum(backend: BackendChoice) {
    let server = Server::start(backend).await;
    // 65 536 cells of 2 cm; quarters of cells, so that every sum is exact.
    let grid = json!({"width": 24, "depth": 8, "height": 60, "cell_size": 0.03125});
    let terrace = |x: u32| [-1024.0, 0.0078125, 1024.0][x as usize / 8];
    let heights: Vec<f64> = (0..192).map(|i| terrace(i % 24)).collect();
    let spec = json!({"grid": grid, "paused": true, "terrain": {"heights": heights},
        "initial_snow": [{"depth": 0.5}]});
    let path = server.create(spec).await;
    for (id, x) in [("valley", 0.125), ("slope", 0.375), ("peak", 0.625)] {
        let shape = json!({"type": "box", "width": 0.125, "depth": 0.125});
        let body = json!({"mass": 1.0, "shape": shape, "position": {"x": x, "z": 0.125}});
        let view = server.put(&format!("{path}/colliders/{id}"), body).await.expect(201);
        let column = (x / 0.03125) as u32;
        assert_eq!(view["bottom"].as_f64().unwrap(), terrace(column) + 0.5, "{id}");
        assert_eq!(view["contact_area"].as_f64().unwrap(), 0.015625, "{id}");
    }
    // What hangs over the edge of a cliff stands on the upper part alone.
    let shape = json!({"type": "box", "width": 0.125, "depth": 0.125});
    let body = json!({"mass": 1.0, "shape": shape, "position": {"x": 0.25, "z": 0.125}});
    let view = server.put(&format!("{path}/colliders/cliff"), body).await.expect(201);
    assert_eq!(view["bottom"].as_f64().unwrap(), 0.0078125 + 0.5);
    assert_eq!(view["contact_area"].as_f64().unwrap(), 0.0078125);
    server.stop().await;
}

async fn cells_are_counted_from_each_columns_ground(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = small();
    spec["terrain"] = json!({"heights": elevations(|i| f64::from(i) * 10.0)});
    let path = server.create(spec).await;
    let level = server.create(small()).await;
    let fields = "fields=density,fill,mass";
    let whole = server.get(&format!("{path}/cells?reference=ground&{fields}")).await.expect(200);
    let plain = server.get(&format!("{level}/cells?{fields}")).await.expect(200);
    for field in ["width", "depth", "height", "content", "fields"] {
        assert_eq!(whole[field], plain[field], "{field}");
    }
    let lowest = server.get(&format!("{path}/cells?width=1&depth=1&{fields}")).await.expect(200);
    assert!(lowest["height"].as_u64() > whole["height"].as_u64(), "up to the highest ground");
    let wrong = server.get(&format!("{path}/cells?reference=sea")).await;
    assert_eq!(wrong.pointers(422), ["reference"]);
    server.stop().await;
}

async fn new_ground_is_in_snapshots_and_gone_with_a_reset(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = small();
    let created = elevations(|i| f64::from(i % 3));
    spec["terrain"] = json!({ "heights": created });
    let path = server.create(spec).await;
    let told = elevations(|i| f64::from(i % 5) * 0.1);
    server.put(&format!("{path}/terrain"), json!({ "heights": told })).await.expect(200);
    stand(&server, &path).await;
    server.step(&path, 30).await;
    let snapshot = server.get(&format!("{path}/snapshot")).await;
    let kind = "application/vnd.firn.snapshot";
    let copy = server.post_bytes("/v1/sessions?id=copy", kind, snapshot.body.to_vec()).await;
    copy.expect(201);
    assert_eq!(ground(&server, "/v1/sessions/copy").await, told);
    let digest = async |path: &str| server.get(&format!("{path}/digest")).await.expect(200);
    server.step(&path, 30).await;
    server.step("/v1/sessions/copy", 30).await;
    assert_eq!(digest(&path).await["digest"], digest("/v1/sessions/copy").await["digest"]);
    // A copy is reset to what it was made of, the original to how it was created.
    for (path, expected) in [(path.as_str(), created), ("/v1/sessions/copy", told)] {
        let other = json!({"heights": elevations(|_| 7.0)});
        server.put(&format!("{path}/terrain"), other).await.expect(200);
        server.post(&format!("{path}/reset"), json!({})).await.expect(200);
        assert_eq!(ground(&server, path).await, expected);
    }
    server.stop().await;
}

async fn what_is_no_ground_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let json = |heights: Value| json!({ "heights": heights }).to_string().into_bytes();
    let mut far = elevations(|_| 0.0);
    far[3] = 20_001.0;
    let wide = image(11, 7, png::BitDepth::Eight, &[0; 77]);
    let good = image(10, 7, png::BitDepth::Eight, &[0; 70]);
    let mut nan = floats(&far);
    nan[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    let cases: [(&str, &str, Vec<u8>, &str); 10] = [
        ("application/json", "", json(json!([1.0])), "/heights"),
        ("application/json", "", json(json!(far)), "/heights/3"),
        ("application/json", "", json(json!("flat")), "/heights"),
        ("application/octet-stream", "", vec![0; 279], ""),
        ("application/octet-stream", "", nan, "/heights/3"),
        ("application/x-npy", "", vec![0; 280], ""),
        ("image/png", "", good.clone(), "scale"),
        ("image/png", "?scale=0", good.clone(), "scale"),
        ("image/png", "?scale=0.1", wide, ""),
        ("application/octet-stream", "?scale=1", vec![0; 280], "scale"),
    ];
    for (kind, query, body, pointer) in cases {
        let reply = put(&server, &path, kind, query, body).await;
        assert_eq!(reply.pointers(422), [pointer], "{kind}{query}");
    }
    let cut = put(&server, &path, "image/png", "?scale=1", good[..good.len() / 2].to_vec()).await;
    assert_eq!(cut.pointers(422), [""]);
    put(&server, &path, "text/plain", "", Vec::new()).await.problem(415);
    assert_eq!(server.get(&path).await.expect(200)["terrain"], false, "nothing has changed");
    server.stop().await;
}
