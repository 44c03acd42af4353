//! Columns of alpine snow as snow profiles: read as XML, and compared with what JSON tells.

use firn::config::BackendChoice;
use roxmltree::{Document, Node};
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Server, small};

const CAAML: &str = "http://caaml.org/Schemas/SnowProfileIACS/v6.0.3";

on_each_backend!(
    a_profile_tells_what_json_tells,
    a_profile_is_of_alpine_snow_and_of_columns_that_exist,
);

/// Elements of a name, in their order.
fn all<'a, 'b>(document: &'a Document<'b>, name: &str) -> Vec<Node<'a, 'b>> {
    document.descendants().filter(|node| node.has_tag_name((CAAML, name))).collect()
}

/// A number in an element.
fn number(node: &Node<'_, '_>, name: &str) -> f64 {
    let found = node.descendants().find(|inner| inner.has_tag_name((CAAML, name)));
    let text = found.and_then(|inner| inner.text()).unwrap_or_else(|| panic!("no {name}"));
    text.parse().unwrap_or_else(|_| panic!("{name} is {text}"))
}

/// Wet and frozen snow of Davos, paused.
async fn davos(server: &Server) -> String {
    let spec = json!({
        "id": "davos", "physics": "alpine", "paused": true, "time_scale": 3600,
        "grid": {"width": 4, "depth": 4, "height": 40, "cell_size": 0.1},
        "initial_snow": [{"depth": 0.6, "density": 320, "temperature": -2},
            {"depth": 0.4, "density": 140, "temperature": -1}],
        "site": {"latitude": 46.8, "longitude": 9.8, "start": "2026-03-20T12:00:00+01:00"},
        "weather": {"air_temperature": 8, "relative_humidity": 90, "wind_speed": 3, "rainfall": 4}
    });
    server.create(spec).await
}

async fn a_profile_tells_what_json_tells(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = davos(&server).await;
    server.step(&path, 120).await;
    let column = server.get(&format!("{path}/columns/1/2")).await.expect(200);
    assert_eq!(server.get(&format!("{path}/columns/1/2?format=json")).await.expect(200), column);
    let reply = server.get(&format!("{path}/columns/1/2?format=caaml")).await;
    assert_eq!((reply.status, reply.header("content-type")), (200, "application/xml"));
    assert_eq!(reply.header("firn-seq"), column["seq"].to_string());
    let text = String::from_utf8(reply.body).unwrap();
    let document = Document::parse(&text).expect("it is XML");

    // 120 ticks at 60 Hz, an hour a second.
    let times = all(&document, "timePosition");
    assert_eq!(times[0].text(), Some("2026-03-20T13:00:00Z"));
    let position = document.descendants().find(|node| node.tag_name().name() == "pos");
    assert_eq!(position.and_then(|node| node.text()), Some("9.8 46.8"));
    check(&document, &column);
    server.stop().await;
}

fn check(document: &Document<'_>, column: &Value) {
    let told = |value: &Value| value.as_f64().unwrap();
    let close = |found: f64, told: f64| assert!((found - told).abs() < 1e-3, "{found}, not {told}");
    let (height, layers) = (told(&column["height"]), column["layers"].as_array().unwrap());
    assert!(layers.len() > 5, "{column}");
    let components = all(document, "Components")[0];
    close(number(&components, "height"), 100.0 * height);
    close(number(&components, "waterEquivalent"), told(&column["snow_water_equivalent"]));
    let part = |name: &str, element: &str| -> Vec<Node<'_, '_>> {
        let profile = all(document, name)[0];
        profile.children().filter(|node| node.has_tag_name((CAAML, element))).collect()
    };
    let (strata, densities) = (part("stratProfile", "Layer"), part("densityProfile", "Layer"));
    let (waters, temperatures) = (part("lwcProfile", "Layer"), part("tempProfile", "Obs"));
    let counts = [strata.len(), densities.len(), waters.len(), temperatures.len() - 1];
    assert_eq!(counts, [layers.len(); 4]);
    close(number(&temperatures[0], "snowTemp"), told(&column["skin_temperature"]));
    for (i, layer) in layers.iter().rev().enumerate() {
        let (bottom, thickness) = (told(&layer["bottom"]), told(&layer["thickness"]));
        for found in [strata[i], densities[i], waters[i]] {
            close(number(&found, "depthTop"), 100.0 * (height - bottom - thickness));
            close(number(&found, "thickness"), 100.0 * thickness);
        }
        let code = strata[i].children().find(|node| node.has_tag_name((CAAML, "hardness")));
        assert_eq!(code.and_then(|node| node.text()), layer["hand_hardness"].as_str());
        close(number(&densities[i], "density"), told(&layer["density"]));
        let water = told(&layer["liquid_water"]) / (10.0 * thickness);
        close(number(&waters[i], "lwc"), water);
        let wetness = strata[i].children().find(|node| node.has_tag_name((CAAML, "wetness")));
        assert_eq!(wetness.and_then(|node| node.text()) == Some("D"), water == 0.0);
        let depth = 100.0 * (height - bottom - thickness / 2.0);
        close(number(&temperatures[i + 1], "depth"), depth);
        close(number(&temperatures[i + 1], "snowTemp"), told(&layer["temperature"]));
    }
    assert!(layers.iter().any(|layer| told(&layer["liquid_water"]) > 0.0), "nothing has melted");
}

async fn a_profile_is_of_alpine_snow_and_of_columns_that_exist(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let thesis = server.create(small()).await;
    server.get(&format!("{thesis}/columns/0/0?format=caaml")).await.problem(409);
    let path = davos(&server).await;
    server.get(&format!("{path}/columns/4/0?format=caaml")).await.problem(404);
    for (query, pointers) in
        [("format=xml", &["format"][..]), ("format=", &["format"]), ("width=1", &["width"])]
    {
        let reply = server.get(&format!("{path}/columns/0/0?{query}")).await;
        assert_eq!(reply.pointers(422), pointers, "{query}");
    }
    server.stop().await;
}
