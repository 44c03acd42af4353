//! Reads over a socket: what REST tells, acknowledged in the order of the commands.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::client::Client;
use crate::on_each_backend;
use crate::support::{Server, small};

on_each_backend!(samples_and_probes_are_answered_as_over_rest);

async fn samples_and_probes_are_answered_as_over_rest(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let load = json!({"mass": 80, "area": 0.1, "duration": 0.5});
    let samples = json!({"points": [[0.3, 0.4], [2, 1.4], [1, 1]], "load": load,
                         "fields": ["depth", "normal", "density", "hardness", "sink"]});
    let probes = json!({"probes": [{"x": 1, "z": 1, "mass": 80, "area": 0.1, "duration": 0.5}]});
    let surface = json!({"points": [[0.3, 0.4]]});
    let wrong = json!({"points": [[0, 0], [3, 0]]});
    let many = json!({"points": vec![[1, 1]; 10_000]});
    let reads = [
        ("samples", &samples),
        ("probes", &probes),
        ("samples", &surface),
        ("samples", &wrong),
        ("probes", &wrong),
        ("samples", &samples),
    ];
    for protocol in ["firn.v1.json", "firn.v1.bin"] {
        let mut client = Client::open_as(&server, &session, protocol).await;
        for (id, (op, body)) in (7..).zip(reads) {
            let mut command = body.clone();
            (command["op"], command["id"]) = (json!(op), json!(id));
            client.send(command).await;
        }
        for (id, (op, body)) in (7..).zip(reads) {
            let mut told = client.answer().await;
            let fields = told.as_object_mut().expect("an object");
            let said = [fields.remove("op"), fields.remove("id")];
            let reply = server.post(&format!("{session}/{op}"), body.clone()).await;
            if reply.status == 200 {
                assert_eq!(said, [Some(json!("ack")), Some(json!(id))]);
                assert_eq!(told, reply.json(), "{op} {body}");
            } else {
                assert_eq!(said, [Some(json!("error")), Some(json!(id))]);
                assert_eq!(told["problem"]["errors"], reply.problem(422)["errors"]);
            }
        }
    }
    let outside = server.post(&format!("{session}/samples"), wrong).await;
    assert_eq!(outside.pointers(422), ["/points/1"]);
    let mut client = Client::open(&server, &session).await;
    let mut command = many.clone();
    (command["op"], command["id"]) = (json!("samples"), json!(1));
    client.send(command).await;
    let refused = client.answer().await;
    assert_eq!(refused["problem"]["errors"][0]["pointer"], "/points", "an answer of one message");
    server.post(&format!("{session}/samples"), many).await.expect(200);
    server.stop().await;
}

/// A client that changes the snow and then reads it finds the change, once that was acknowledged.
#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_is_read() {
    let server = Server::start(BackendChoice::Cpu).await;
    let session = server.create(small()).await;
    let mut client = Client::open(&server, &session).await;
    let read = json!({"op": "samples", "id": 2, "points": [[1, 1]], "fields": ["depth"]});
    let mut depths: Vec<Value> = Vec::new();
    for id in [1, 3] {
        client.send(json!({"op": "snowfall", "id": id, "depth": 0.25})).await;
        assert_eq!(client.answer().await["id"], id);
        client.send(read.clone()).await;
        depths.push(client.answer().await["fields"]["depth"][0].clone());
    }
    assert_eq!(depths, [json!(1.25), json!(1.5)]);
    server.stop().await;
}
