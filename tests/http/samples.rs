//! Samples over HTTP: they tell what other reads tell, of one moment, and name what can't be answered.

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Reply, Server, numbers};

on_each_backend!(
    samples_tell_what_other_reads_tell,
    points_between_columns_have_heights_and_normals_of_their_own,
    a_numpy_table_holds_what_json_tells,
    what_is_told_is_of_one_moment,
    many_points_are_read_in_parts,
    bad_samples_are_refused_by_name,
);

const FIELDS: [&str; 7] = ["depth", "ground", "elevation", "normal", "density", "hardness", "sink"];

/// 12 × 10 columns of 0.5 m on a slope, with two layers, bare in the first two columns along x.
async fn sloping(server: &Server) -> String {
    let ground: Vec<f64> =
        (0..120).map(|i| 0.25 * f64::from(i % 12) - 0.125 * f64::from(i / 12)).collect();
    let spec = json!({
        "grid": {"width": 12, "depth": 10, "height": 12, "cell_size": 0.5},
        "paused": true,
        "time_scale": 15,
        "terrain": {"heights": ground},
        "initial_snow": [{"depth": 1.5, "temperature": -3}, {"depth": 0.75, "temperature": -9, "density": 45}]
    });
    let session = server.create(spec).await;
    let region = json!({"x": 0, "z": 0, "width": 1, "depth": 5});
    let bare = json!({"depth": 0, "region": region});
    server.post(&format!("{session}/clearings"), bare).await.expect(200);
    let region = json!({"x": 3, "z": 1, "width": 2, "depth": 3});
    let more = json!({"depth": 0.4, "density": 30, "region": region});
    server.post(&format!("{session}/snowfalls"), more).await.expect(200);
    server.step(&session, 40).await;
    session
}

async fn sample(server: &Server, session: &str, body: Value) -> Value {
    server.post(&format!("{session}/samples"), body).await.expect(200)
}

/// Centres of some columns.
const COLUMNS: [(u32, u32); 6] = [(0, 0), (11, 9), (7, 3), (2, 5), (8, 8), (1, 7)];

fn centre((x, z): (u32, u32)) -> [f64; 2] {
    [0.5 * f64::from(x) + 0.25, 0.5 * f64::from(z) + 0.25]
}

async fn samples_tell_what_other_reads_tell(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = sloping(&server).await;
    let depths = server.heights(&session).await;
    let surface = server.get(&format!("{session}/heights?surface=true")).await.expect(200);
    let surface = numbers(&surface["heights"]);
    for duration in [Value::Null, json!(0.4), json!(20)] {
        let load = json!({"mass": 80, "area": 0.05, "duration": duration});
        let points = COLUMNS.map(centre);
        let told =
            sample(&server, &session, json!({"points": points, "fields": FIELDS, "load": load}))
                .await;
        let shown = server.get(&session).await.expect(200);
        assert_eq!((&told["tick"], &told["seq"]), (&shown["tick"], &shown["seq"]));
        let probes = points.map(|[x, z]| {
            let mut probe = load.clone();
            (probe["x"], probe["z"]) = (json!(x), json!(z));
            probe
        });
        let probes = server.post(&format!("{session}/probes"), json!({"probes": probes})).await;
        let probes = probes.expect(200);
        let told = &told["fields"];
        for (i, (x, z)) in COLUMNS.into_iter().enumerate() {
            let index = (z * 12 + x) as usize;
            assert_eq!(told["depth"][i], depths[index]);
            assert_eq!(told["elevation"][i], surface[index]);
            assert_eq!(told["ground"][i], 0.25 * f64::from(x) - 0.125 * f64::from(z));
            let column = server.get(&format!("{session}/columns/{x}/{z}")).await.expect(200);
            let top = column["layers"].as_array().and_then(|layers| layers.last());
            let top = |field: &str| top.map_or(Value::Null, |top| top[field].clone());
            assert_eq!(told["density"][i], top("density"));
            assert_eq!(told["hardness"][i], top("hardness"));
            assert_eq!(told["sink"][i], probes["probes"][i]["sink_depth"]);
            let sinks = told["sink"][i].as_f64() > Some(0.01);
            assert_eq!(sinks, x > 1, "{x} {z}: {}", told["sink"][i]);
        }
        assert_eq!((&told["density"][0], &told["hardness"][5]), (&Value::Null, &Value::Null));
    }
    server.stop().await;
}

async fn points_between_columns_have_heights_and_normals_of_their_own(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = sloping(&server).await;
    let points = [[0.0, 0.0], [6.0, 5.0], [3.1, 2.7], [0.9, 4.99], [5.37, 0.01]];
    let told = sample(&server, &session, json!({ "points": points })).await["fields"].clone();
    let told_of = |field: &&str| !told[*field].is_null();
    let fields: Vec<&str> = FIELDS.into_iter().filter(told_of).collect();
    assert_eq!(fields, FIELDS[..4], "the fields of the surface");
    for (i, [x, z]) in points.into_iter().enumerate() {
        let height = server.get(&format!("{session}/height?x={x}&z={z}")).await.expect(200);
        assert_eq!(told["depth"][i], height["height"]);
        let sum = told["ground"][i].as_f64().unwrap() + told["depth"][i].as_f64().unwrap();
        assert_eq!(told["elevation"][i], sum);
        let normal = numbers(&told["normal"][i]);
        let length = normal.iter().map(|part| part * part).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-12 && normal[1] > 0.0, "{normal:?}");
    }

    // Where the snow is equally deep it slopes as the ground does: up by a half along x, down by a quarter along z.
    let level = sample(
        &server,
        &session,
        json!({"points": [[2.3, 0.4], [5.8, 4.6]], "fields": ["normal"]}),
    )
    .await;
    assert_eq!(level["fields"]["depth"], Value::Null);
    let length = (0.25_f64 + 1.0 + 0.0625).sqrt();
    for normal in level["fields"]["normal"].as_array().unwrap() {
        let slopes = numbers(normal).into_iter().zip([-0.5, 1.0, 0.25]);
        let off = slopes.map(|(told, wanted)| (told - wanted / length).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{normal}");
    }
    let flat = server.create(crate::support::small()).await;
    let flat =
        sample(&server, &flat, json!({"points": [[1, 0.7]], "fields": ["normal", "ground"]})).await;
    let flat = &flat["fields"];
    assert_eq!((&flat["ground"], &flat["normal"]), (&json!([0.0]), &json!([[0.0, 1.0, 0.0]])));
    server.stop().await;
}

async fn numpy(server: &Server, session: &str, body: &Value) -> Reply {
    let headers = [("accept", "application/x-npy"), ("content-type", "application/json")];
    let path = format!("{session}/samples");
    server.send(Method::POST, &path, &headers, body.to_string().into_bytes()).await
}

async fn a_numpy_table_holds_what_json_tells(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = sloping(&server).await;
    let fields = ["sink", "normal", "hardness", "depth"];
    let load = json!({"mass": 5, "area": 0.1});
    let body = json!({"points": COLUMNS.map(centre), "fields": fields, "load": load});
    let told = sample(&server, &session, body.clone()).await;
    let table = numpy(&server, &session, &body).await;
    assert_eq!((table.status, table.header("content-type")), (200, "application/x-npy"));
    assert_eq!(table.header("firn-tick"), told["tick"].to_string());
    assert_eq!(table.header("firn-seq"), told["seq"].to_string());
    let header = String::from_utf8_lossy(&table.body[..128]).into_owned();
    assert!(header.contains("'<f4'") && header.contains("(6, 6)"), "{header}");
    let end = table.body.len() - 6 * 6 * 4;
    assert_eq!(end % 64, 0);
    let floats: Vec<f32> = table.body[end..]
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        .collect();
    let told = &told["fields"];
    let number = |value: &Value| value.as_f64().map_or(f32::NAN, |value| value as f32);
    let expected: Vec<f32> = (0..6)
        .flat_map(|i| {
            let normal = &told["normal"][i];
            [
                &told["sink"][i],
                &normal[0],
                &normal[1],
                &normal[2],
                &told["hardness"][i],
                &told["depth"][i],
            ]
            .map(number)
        })
        .collect();
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&floats), bits(&expected));
    assert!(floats[4].is_nan() && !floats[10].is_nan(), "no snow, and snow");
    let headers = [("accept", "image/png"), ("content-type", "application/json")];
    let path = format!("{session}/samples");
    server.send(Method::POST, &path, &headers, body.to_string().into_bytes()).await.problem(406);
    server.stop().await;
}

async fn what_is_told_is_of_one_moment(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server
        .create(json!({
            "grid": {"width": 8, "depth": 8, "height": 20, "cell_size": 0.2},
            "time_scale": 10,
            "initial_snow": [{"depth": 3}]
        }))
        .await;
    // Pressed as densely as it can be, snow is equally thick whenever that is.
    let load = json!({"mass": 1e9, "area": 1});
    let body = json!({"points": [[0.9, 0.9]], "fields": ["depth", "sink"], "load": load});
    let mut depths = Vec::new();
    for _ in 0..20 {
        let told = sample(&server, &session, body.clone()).await["fields"].clone();
        let (depth, sink) = (told["depth"][0].as_f64().unwrap(), told["sink"][0].as_f64().unwrap());
        assert!((depth - sink - 0.6).abs() < 1e-5, "{depth} {sink}");
        depths.push(depth);
        server.beats(1).await;
    }
    assert!(depths[0] > depths[19], "the snow moved: {depths:?}");
    server.stop().await;
}

async fn many_points_are_read_in_parts(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server
        .create(json!({
            "grid": {"width": 256, "depth": 256, "height": 20, "cell_size": 0.1},
            "paused": true,
            "initial_snow": [{"depth": 0.4}]
        }))
        .await;
    for i in 0..8 {
        let region = json!({"x": 3.2 * f64::from(i), "z": 0, "width": 3.2, "depth": 25.6});
        let more = json!({"depth": 0.1 * f64::from(1 + i), "region": region});
        server.post(&format!("{session}/snowfalls"), more).await.expect(200);
    }
    let points: Vec<[u32; 2]> = (0..65536).map(|i| [i % 256, i / 256]).collect();
    let path = format!("{session}/samples");
    let outside = server.post(&path, json!({ "points": points })).await;
    assert_eq!(outside.pointers(422).len(), 16, "the first of the points outside are told");
    let text: Vec<String> = points
        .iter()
        .map(|[x, z]| {
            format!("[{:.2},{:.2}]", 0.1 * f64::from(*x) + 0.05, 0.1 * f64::from(*z) + 0.05)
        })
        .collect();
    let body = format!(
        r#"{{"points":[{}],"fields":["density","sink"],"load":{{"mass":1e9,"area":1}}}}"#,
        text.join(",")
    );
    let told = server.post_bytes(&path, "application/json", body.into_bytes()).await.expect(200);
    let (density, sink) = (numbers(&told["fields"]["density"]), numbers(&told["fields"]["sink"]));
    assert_eq!((density.len(), sink.len()), (65536, 65536));
    assert!(density.iter().all(|density| (density - 20.0).abs() < 1e-3));
    for (i, sink) in sink.iter().enumerate() {
        let depth = 0.5 + 0.1 * (i % 256 / 32) as f64;
        assert!((sink - 0.8 * depth).abs() < 1e-4, "{i}: {sink} of {depth}");
    }
    server.stop().await;
}

async fn bad_samples_are_refused_by_name(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(crate::support::small()).await;
    let path = format!("{session}/samples");
    let pointers = async |body: Value| server.post(&path, body).await.pointers(422);
    for outside in [json!([2.001, 1]), json!([-0.001, 1]), json!([1, 1.401]), json!([1e300, 0])] {
        assert_eq!(pointers(json!({"points": [[0, 0], [2, 1.4], outside]})).await, ["/points/2"]);
    }
    for odd in [json!([1]), json!([1, 1, 1]), json!({"x": 1, "z": 1}), json!(1), json!(null)] {
        assert_eq!(pointers(json!({"points": [[0, 0], odd]})).await, ["/points/1"]);
    }
    for odd in [json!("far"), json!(null)] {
        assert_eq!(pointers(json!({"points": [[0, odd]]})).await, ["/points/0/1"]);
    }
    for text in ["NaN", "Infinity"] {
        let body = format!(r#"{{"points":[[{text},1]]}}"#).into_bytes();
        server.post_bytes(&path, "application/json", body).await.problem(400);
    }
    let body = br#"{"points":[[1e999,1]]}"#.to_vec();
    let huge = server.post_bytes(&path, "application/json", body).await;
    assert!([400, 422].contains(&huge.status), "{}", huge.status);
    assert_eq!(pointers(json!({"points": []})).await, ["/points"]);
    assert_eq!(pointers(json!({"points": vec![[1, 1]; 65537]})).await, ["/points"]);
    assert_eq!(pointers(json!({})).await, ["/points"]);

    let with = |field: &str, value: Value| {
        let mut body =
            json!({"points": [[1, 1]], "fields": ["sink"], "load": {"mass": 1, "area": 1}});
        body[field] = value;
        body
    };
    assert_eq!(pointers(with("fields", json!([]))).await, ["/fields"]);
    assert_eq!(pointers(with("fields", json!(["depth", "colour"]))).await, ["/fields/1"]);
    assert_eq!(pointers(with("fields", json!(["depth", "ground", "depth"]))).await, ["/fields/2"]);
    assert_eq!(pointers(with("load", Value::Null)).await, ["/load"]);
    assert_eq!(pointers(with("extra", json!(1))).await, ["/extra"]);
    for (field, value) in [
        ("mass", json!(0)),
        ("mass", json!(1.1e9)),
        ("area", json!(0)),
        ("area", json!(1e13)),
        ("duration", json!(-1)),
        ("duration", json!(3601)),
        ("depth", json!(1)),
    ] {
        let mut load = json!({"mass": 1, "area": 1});
        load[field] = value;
        assert_eq!(pointers(with("load", load)).await, [format!("/load/{field}")]);
    }
    let mut much = with("load", json!({"mass": 1, "area": 1, "duration": 100}));
    much["points"] = json!(vec![[1, 1]; 1000]);
    assert_eq!(pointers(much).await, ["/load/duration"], "too many cycles");
    server
        .post("/v1/sessions/none/samples", with("load", json!({"mass": 1, "area": 1})))
        .await
        .problem(404);
    server.stop().await;
}
