//! Diagrams of columns over HTTP: read as XML, and their lines compared with the layers.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(a_column_is_drawn_with_its_weak_layer, a_column_that_is_not_there_is_named);

async fn a_column_is_drawn_with_its_weak_layer(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let snow = json!([{"depth": 0.6, "density": 60}, {"depth": 0.4, "density": 30,
        "temperature": -12}, {"depth": 0.6, "density": 50}]);
    let path = server.create(json!({"paused": true, "initial_snow": snow})).await;
    let column = server.get(&format!("{path}/columns/3/4")).await.expect(200);
    assert_eq!(column["weak_layers"].as_array().unwrap().len(), 1);
    let reply = server.get(&format!("{path}/profile.svg?column_x=3&column_z=4")).await;
    assert_eq!((reply.status, reply.header("content-type")), (200, "image/svg+xml"));
    assert_eq!(reply.header("firn-seq"), column["seq"].to_string());
    let svg = String::from_utf8(reply.body).unwrap();
    let document = roxmltree::Document::parse(&svg).expect("it is XML");
    let texts: Vec<&str> =
        document.descendants().filter_map(|node| node.text()).map(str::trim).collect();
    for text in [
        "density [kg/m³]",
        "depth below the surface [m]",
        "hardness, stress [Pa]",
        "weak layer",
        "law at −3 °C",
        "law at −12 °C",
        "hardness of a cell",
        "stress on it",
    ] {
        assert!(texts.contains(&text), "no '{text}' in {texts:?}");
    }
    // Each cell has a dot for its hardness and one for its stress, and each kind one in the legend.
    let layers = column["layers"].as_array().unwrap().len();
    let dots = document.descendants().filter(|node| node.has_tag_name("circle")).count();
    assert_eq!(dots, 2 * layers + 2);
    check_density(&document, &column);
    // A column without snow has axes as well.
    let empty = server.create(json!({"paused": true})).await;
    let reply = server.get(&format!("{empty}/profile.svg?column_x=0&column_z=0")).await;
    assert!(roxmltree::Document::parse(std::str::from_utf8(&reply.body).unwrap()).is_ok());
    server.stop().await;
}

async fn a_column_that_is_not_there_is_named(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(crate::support::small()).await;
    for (query, pointers) in [
        ("", &["column_x", "column_z"][..]),
        ("column_x=10&column_z=7", &["column_x", "column_z"]),
        ("column_x=a&column_z=0", &["column_x"]),
        ("column_x=0&column_z=0&width=100", &["width"]),
    ] {
        let reply = server.get(&format!("{path}/profile.svg?{query}")).await;
        assert_eq!(reply.pointers(422), pointers, "{query}");
    }
    server.get("/v1/sessions/none/profile.svg?column_x=0&column_z=0").await.problem(404);
    server.stop().await;
}

/// The line of densities goes through each layer's density from its top to its bottom, once pixels
/// are turned into values by two places that are known.
#[track_caller]
fn check_density(document: &roxmltree::Document<'_>, column: &Value) {
    let layers = column["layers"].as_array().unwrap();
    let points = document
        .descendants()
        .filter(|node| node.has_tag_name("polyline"))
        .filter_map(|node| node.attribute("points"))
        .map(points)
        .find(|points| points.len() == 2 * layers.len())
        .expect("there is a line with two points for each layer");
    let number = |layer: &Value, name: &str| layer[name].as_f64().unwrap();
    let height = column["height"].as_f64().unwrap();
    // From the surface down: density, depth of the top, depth of the bottom.
    let expected: Vec<(f64, f64)> = layers
        .iter()
        .rev()
        .flat_map(|layer| {
            let (density, bottom) = (number(layer, "density"), number(layer, "bottom"));
            let top = bottom + number(layer, "thickness");
            [(density, height - top), (density, height - bottom)]
        })
        .collect();
    let span = |of: fn(&(f64, f64)) -> f64, points: &[(f64, f64)]| {
        let low = points.iter().map(of).fold(f64::INFINITY, f64::min);
        (low, points.iter().map(of).fold(f64::NEG_INFINITY, f64::max))
    };
    for of in [(|p| p.0) as fn(&(f64, f64)) -> f64, |p| p.1] {
        let (pixels, values) = (span(of, &points), span(of, &expected));
        for (point, value) in points.iter().zip(&expected) {
            let part = (of(point) - pixels.0) / (pixels.1 - pixels.0);
            let expected = (of(value) - values.0) / (values.1 - values.0);
            assert!((part - expected).abs() < 0.003, "{part} and {expected}");
        }
    }
}

/// Points of a line, in pixels.
fn points(line: &str) -> Vec<(f64, f64)> {
    let number = |text: &str| text.parse().expect("a number");
    let points = line.split_whitespace().filter_map(|point| point.split_once(','));
    points.map(|(x, y)| (number(x), number(y))).collect()
}
