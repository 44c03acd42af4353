//! The published OpenAPI document is the one that the handlers describe.

use std::collections::BTreeSet;

use serde_json::Value;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/api/openapi.json");

fn document() -> Value {
    serde_json::to_value(firn::server::document()).expect("the document is plain data")
}

fn operations(document: &Value) -> Vec<(String, &Value)> {
    let paths = document["paths"].as_object().expect("there are paths");
    paths
        .iter()
        .flat_map(|(path, item)| {
            let item = item.as_object().expect("a path has operations");
            item.iter().map(move |(method, operation)| (format!("{method} {path}"), operation))
        })
        .collect()
}

#[test]
fn the_published_document_is_up_to_date() {
    let published = std::fs::read_to_string(FILE).expect("api/openapi.json is there");
    let mut generated = firn::server::document().to_pretty_json().expect("it can be written");
    generated.push('\n');
    assert!(published == generated, "run `cargo run -- openapi > api/openapi.json`");
}

#[test]
fn it_lists_every_call() {
    let document = document();
    assert_eq!(document["openapi"], "3.1.0");
    assert_eq!(document["info"]["license"]["identifier"], "MIT OR Apache-2.0");
    let found: BTreeSet<String> = operations(&document).into_iter().map(|(name, _)| name).collect();
    let session = "/v1/sessions/{id}";
    let mut expected = BTreeSet::from([
        "post /v1/sessions".to_owned(),
        "get /v1/sessions".to_owned(),
        "get /livez".to_owned(),
        "get /metrics".to_owned(),
        "get /readyz".to_owned(),
        "get /openapi.json".to_owned(),
        "get /v1/store/backup".to_owned(),
        "post /v1/store/verify".to_owned(),
        "post /v1/store/compact".to_owned(),
    ]);
    for call in [
        "get ",
        "patch ",
        "delete ",
        "post /step",
        "delete /step",
        "get /checkpoints",
        "get /checkpoints/{name}",
        "put /checkpoints/{name}",
        "delete /checkpoints/{name}",
        "post /reset",
        "post /tokens",
        "post /unlock",
        "post /snowfalls",
        "post /clearings",
        "put /air-temperature",
        "get /weather",
        "put /weather",
        "get /colliders",
        "post /colliders",
        "post /colliders:batch",
        "get /colliders/{cid}",
        "put /colliders/{cid}",
        "patch /colliders/{cid}",
        "delete /colliders/{cid}",
        "get /heights",
        "get /terrain",
        "put /terrain",
        "get /height",
        "get /columns/{column_x}/{column_z}",
        "get /mass",
        "get /usage",
        "get /cells",
        "get /render.png",
        "get /profile.svg",
        "get /snapshot",
        "get /digest",
        "post /probes",
        "post /samples",
        "post /stamps",
        "get /stream",
    ] {
        let (method, path) = call.split_once(' ').expect("a method and a path");
        expected.insert(format!("{method} {session}{path}"));
    }
    assert_eq!(found, expected);
}

#[test]
fn every_call_is_described() {
    let document = document();
    let mut names = BTreeSet::new();
    for (name, operation) in operations(&document) {
        let id = operation["operationId"].as_str().unwrap_or_default();
        assert!(!id.is_empty() && names.insert(id.to_owned()), "{name}: operation id '{id}'");
        assert!(operation["summary"].is_string(), "{name} has no summary");
        assert!(operation["tags"].as_array().is_some_and(|tags| tags.len() == 1), "{name}: tag");
        let responses = operation["responses"].as_object().expect("it has responses");
        for (status, response) in responses {
            let problem = response["content"].get("application/problem+json");
            assert_eq!(
                problem.is_some(),
                status.as_str() >= "400" && !name.ends_with("readyz"),
                "{name} {status}"
            );
            if let Some(problem) = problem {
                assert_eq!(problem["schema"]["$ref"], "#/components/schemas/Problem");
            }
        }
        if name.contains("{id}") {
            assert!(responses.contains_key("404"), "{name} may not find its session");
        }
        if operation.get("requestBody").is_some() {
            for status in ["400", "413", "415", "422"] {
                assert!(responses.contains_key(status), "{name} has no {status}");
            }
        }
        let parameters = operation["parameters"].as_array().map_or(&[][..], Vec::as_slice);
        let in_path = parameters.iter().filter(|parameter| parameter["in"] == "path").count();
        assert_eq!(in_path, name.matches('{').count(), "{name}: path parameters");
        for parameter in parameters {
            assert!(parameter["description"].is_string(), "{name}: {parameter}");
        }
    }
}

#[test]
fn every_reference_leads_somewhere() {
    fn references(value: &Value, found: &mut BTreeSet<String>) {
        match value {
            Value::Object(fields) => fields.iter().for_each(|(key, value)| match value {
                Value::String(target) if key == "$ref" => drop(found.insert(target.clone())),
                _ => references(value, found),
            }),
            Value::Array(items) => items.iter().for_each(|item| references(item, found)),
            _ => {}
        }
    }
    let document = document();
    let mut found = BTreeSet::new();
    references(&document, &mut found);
    assert!(found.len() > 10, "{found:?}");
    for reference in found {
        let pointer = reference.strip_prefix('#').expect("references are local");
        assert!(document.pointer(pointer).is_some(), "{reference}");
    }
}

#[test]
fn nullable_and_flattened_fields_come_out_as_they_are_sent() {
    let document = document();
    let schema = |name: &str| document["components"]["schemas"][name].clone();
    let patch = schema("SettingsPatch");
    assert_eq!(
        patch["properties"]["idle_timeout_s"]["type"],
        serde_json::json!(["number", "null"])
    );
    assert!(patch.get("required").is_none(), "every setting may be left out: {patch}");
    let text = schema("SessionView").to_string();
    for part in ["#/components/schemas/Settings", "stream_url", "created_at"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let collider = schema("ColliderSpec");
    assert_eq!(collider["required"], serde_json::json!(["mass", "position"]));
}
