//! Changes over a socket, and what they do to the objects that clients are told of.

use firn::config::BackendChoice;
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;

use crate::client::Client;
use crate::support::{Server, numbers, slow, small};
use crate::{on_each_backend, rounded, settling};

on_each_backend!(
    changes_are_acknowledged_in_order,
    many_objects_move_over_one_socket,
    colliders_and_heights_are_told_together,
    a_long_step_is_told_and_a_short_one_is_not,
);

async fn changes_are_acknowledged_in_order(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let object = |id: &str, x: f64| {
        json!({"id": id, "mass": 5, "shape": {"type": "disk", "radius": 0.2},
               "position": {"x": x, "z": 0.5}})
    };
    let requests = [
        json!({"op": "snowfall", "depth": 0.5}),
        json!({"op": "clearing", "depth": 0.2}),
        json!({"op": "air_temperature", "celsius": -10}),
        json!({"op": "set", "time_scale": 2, "pressing": 0.5}),
        json!({"op": "collider.put", "collider": object("a", 0.5)}),
        json!({"op": "colliders.batch", "put": [object("b", 0.7), object("c", 0.9)]}),
        json!({"op": "collider.delete", "collider": "b"}),
        json!({"op": "collider.patch", "collider": "a", "patch": {"velocity": {"x": 1, "z": 0}}}),
        json!({"op": "snowfall", "depth": -1}),
        json!({"op": "collider.put", "collider": object("d", 50.0)}),
        json!({"op": "collider.delete", "collider": "nobody"}),
        json!({"op": "collider.patch", "collider": "a", "patch": {"turn_rate": 721}}),
        json!({"op": "collider.patch", "collider": "nobody", "patch": {"mass": 1}}),
        json!({"op": "melt"}),
        json!({"op": "ping"}),
    ];
    let mut client = Client::open(&server, &session).await;
    for (id, request) in requests.iter().enumerate() {
        let mut request = request.clone();
        request["id"] = json!(id);
        client.send(request).await;
    }
    let mut answers = Vec::new();
    for _ in &requests {
        answers.push(client.answer().await);
    }
    let ids: Vec<_> = answers.iter().map(|answer| answer["id"].as_u64().unwrap()).collect();
    assert_eq!(ids, (0..requests.len() as u64).collect::<Vec<_>>());
    let ops: Vec<_> = answers.iter().map(|answer| answer["op"].as_str().unwrap()).collect();
    assert_eq!(ops[..8], ["ack"; 8]);
    assert_eq!(ops[8..14], ["error"; 6]);
    assert_eq!(ops[14], "pong");

    // 0.5 m of 20 kg/m³ on 2 m × 1.4 m.
    assert!((answers[0]["fallen_mass"].as_f64().unwrap() - 28.0).abs() < 1e-3);
    // Of 1.5 m, 0.2 m stay.
    assert!((answers[1]["cleared_mass"].as_f64().unwrap() - 72.8).abs() < 1e-2);
    assert_eq!(answers[2]["celsius"], -10.0);
    assert_eq!(answers[4]["collider"]["id"], "a");
    assert_eq!(answers[7]["collider"]["velocity"], json!({"x": 1.0, "z": 0.0}));
    let wrong = |i: usize| {
        let problem = &answers[i]["problem"];
        (problem["status"].as_u64().unwrap(), problem["errors"][0]["pointer"].clone())
    };
    assert_eq!(wrong(8), (422, json!("/depth")));
    assert_eq!(wrong(9), (422, json!("/collider/position")));
    assert_eq!(wrong(10), (404, Value::Null));
    assert_eq!(wrong(11), (422, json!("/patch/turn_rate")));
    assert_eq!(wrong(12), (404, Value::Null));
    assert_eq!(wrong(13), (422, json!("/op")));

    let view = server.get(&session).await.expect(200);
    assert!(view["seq"].as_u64() >= answers[7]["seq"].as_u64());
    assert_eq!((&view["air_temperature"], &view["time_scale"]), (&json!(-10.0), &json!(2.0)));
    assert_eq!(view["pressing"], 0.5);
    let colliders = server.get(&format!("{session}/colliders")).await.expect(200);
    let left: Vec<_> = colliders["items"].as_array().unwrap().iter().map(|c| &c["id"]).collect();
    assert_eq!(left, ["a", "c"]);
    server.stop().await;
}

async fn many_objects_move_over_one_socket(backend: BackendChoice) {
    const OBJECTS: usize = 200;
    const ROUNDS: usize = 15;
    let server = Server::start(backend).await;
    let session = server.create(settling()).await;
    let (mut write, mut read) = Client::open(&server, &session).await.split();
    let position = |object: usize, round: usize| json!({"x": 0.5 + 0.01 * object as f64, "z": 0.5 + 0.05 * round as f64});
    let moving = async {
        for round in 0..ROUNDS {
            for object in 0..OBJECTS {
                let request = json!({"op": "collider.put", "id": round * OBJECTS + object,
                    "collider": {"id": format!("o{object}"), "mass": 1,
                                 "shape": {"type": "disk", "radius": 0.2},
                                 "position": position(object, round)}});
                write.send(Message::text(request.to_string())).await.unwrap();
            }
        }
    };
    let acknowledged = async {
        let mut expected = 0;
        while expected < ROUNDS * OBJECTS {
            let Some(Ok(message)) = read.next().await else { panic!("the stream ended") };
            let Message::Text(text) = message else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["op"] == "ack" {
                assert_eq!(answer["id"], expected);
                expected += 1;
            } else {
                assert_ne!(answer["op"], "error", "{answer}");
            }
        }
    };
    tokio::join!(moving, acknowledged);
    for object in [0, OBJECTS - 1] {
        let collider = server.get(&format!("{session}/colliders/o{object}")).await.expect(200);
        assert_eq!(collider["position"], position(object, ROUNDS - 1));
    }
    server.stop().await;
}

async fn colliders_and_heights_are_told_together(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let mut client = Client::open(&server, &session).await;
    let near = json!({"column_x": 0, "column_z": 0, "width": 8, "depth": 7});
    let wish = json!({"op": "subscribe", "id": 1, "colliders": true, "region": near});
    client.send(wish).await;
    client.heights_of(1).await;
    assert_eq!(client.colliders(1), json!([]));

    let object = json!({"mass": 20, "shape": {"type": "box", "width": 0.4, "depth": 0.4},
                        "position": {"x": 0.6, "z": 0.6}});
    server.put(&format!("{session}/colliders/near"), object).await.expect(201);
    let far = json!({"mass": 20, "shape": {"type": "disk", "radius": 0.1},
                     "position": {"x": 1.85, "z": 0.6}});
    server.put(&format!("{session}/colliders/far"), far).await.expect(201);
    server.step(&session, 600).await;
    let told = server.get(&format!("{session}/colliders/near")).await.expect(200);
    let read = server.get(&format!("{session}/heights?width=8")).await.expect(200);
    let heights = rounded(&numbers(&read["heights"]), 0.001);
    client
        .until(1, |view| {
            view.colliders.as_array().is_some_and(|list| list.len() == 1)
                && told.as_object().unwrap().iter().all(|(key, value)| {
                    ["tick", "seq"].contains(&key.as_str()) || view.colliders[0][key] == *value
                })
                && view.samples_equal(&heights)
        })
        .await;
    assert!(told["sink_depth"].as_f64().unwrap() > 0.05, "{told}");
    server.delete(&format!("{session}/colliders/near")).await.expect(204);
    client.until(1, |view| view.colliders == json!([])).await;
    server.stop().await;
}

async fn a_long_step_is_told_and_a_short_one_is_not(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(slow()).await;
    let mut client = Client::open(&server, &session).await;
    server.step(&session, 1).await;
    let step = format!("{session}/step");
    let watched = async {
        let mut done = 0;
        for _ in 0..2 {
            let event = client.event("step_progress").await;
            assert_eq!(event["progress"]["of"], 1_000_000);
            // It began at tick 1.
            assert_eq!(
                event["progress"]["done"].as_u64().map(|done| done + 1),
                event["tick"].as_u64()
            );
            assert!(event["tick"].as_u64() > Some(done), "{event}");
            done = event["tick"].as_u64().unwrap();
        }
        server.delete(&step).await.expect(204);
        loop {
            let event = client.event("step_progress").await;
            if event["progress"] == Value::Null {
                break event;
            }
        }
    };
    let (stepped, ended) = tokio::join!(server.post(&step, json!({"ticks": 1_000_000})), watched);
    let stepped = stepped.expect(200);
    assert_eq!((&ended["tick"], &ended["seq"]), (&stepped["tick"], &stepped["seq"]));
    server.stop().await;
}
