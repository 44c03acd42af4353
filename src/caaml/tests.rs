use firn_protocol::Stamp;
use firn_snow::weather::Start;
use roxmltree::{Document, Node};

use super::*;

const CAAML: &str = NAMESPACES[0].1;
const GML: &str = NAMESPACES[1].1;

fn layer(bottom: f64, water: f64, hand_hardness: HandHardness) -> LayerView {
    LayerView {
        bottom,
        thickness: 0.2,
        density: 310.0,
        temperature: if water > 0.0 { 0.0 } else { -4.25 },
        hardness: 1000.0,
        stress: 100.0,
        mass: 62.0,
        liquid_water: Some(water),
        hand_hardness: Some(hand_hardness),
    }
}

fn column(layers: Vec<LayerView>) -> ColumnView {
    ColumnView {
        stamp: Stamp { tick: 7, seq: 9 },
        height: 0.2 * layers.len() as f64,
        mass: 62.0 * layers.len() as f64,
        mean_density: 310.0,
        layers,
        weak_layers: Vec::new(),
        alpine: None,
    }
}

fn written(column: &ColumnView, site: &Site) -> String {
    let alpine = AlpineColumn {
        snow_water_equivalent: 310.0 * column.height,
        liquid_water: 0.0,
        skin_temperature: -6.5,
        albedo: 0.8,
        runoff: 0.0,
    };
    let profile =
        Profile { session: "1<&", place: [3, 4], column, alpine, site, time: 3600.5, asked: 60.9 };
    profile.write()
}

/// Names of the elements inside one, in their order.
fn inside<'a>(node: Node<'a, '_>) -> Vec<&'a str> {
    node.children().filter(Node::is_element).map(|child| child.tag_name().name()).collect()
}

/// The texts of all elements of a name, in their order.
fn texts<'a>(document: &'a Document<'_>, name: &str) -> Vec<&'a str> {
    let found = document.descendants().filter(|node| node.has_tag_name((CAAML, name)));
    found.filter_map(|node| node.text()).collect()
}

#[test]
fn elements_come_in_the_order_of_the_schema() {
    let column = column(vec![
        layer(0.0, 0.0, HandHardness::Knife),
        layer(0.2, 7.0, HandHardness::Fist),
        layer(0.4, 0.0, HandHardness::OneFinger),
    ]);
    let start = Start::parse("2026-03-20T00:00:00Z");
    let site = Site { latitude: Some(46.8), longitude: Some(-9.8), start, ..Site::default() };
    let text = written(&column, &site);
    let document = Document::parse(&text).unwrap();
    let root = document.root_element();
    assert!(root.has_tag_name((CAAML, "SnowProfile")));
    assert_eq!(root.attribute((GML, "id")), Some("firn-1<&-3-4"));
    let parts = ["metaData", "timeRef", "srcRef", "locRef", "snowProfileResultsOf"];
    assert_eq!(inside(root), parts);
    let find =
        |name: &str| document.descendants().find(|node| node.has_tag_name((CAAML, name))).unwrap();
    assert_eq!(inside(find("timeRef")), ["recordTime", "dateTimeReport"]);
    assert_eq!(inside(find("locRef")), ["name", "obsPointSubType", "pointLocation"]);
    let measured = find("SnowProfileMeasurements");
    assert_eq!(measured.attribute("dir"), Some("top down"));
    let parts = [
        "profileDepth",
        "snowPackCond",
        "stratProfile",
        "tempProfile",
        "densityProfile",
        "lwcProfile",
    ];
    assert_eq!(inside(measured), parts);
    assert_eq!(inside(find("Components")), ["height", "waterEquivalent"]);
    assert_eq!(inside(find("Layer")), ["depthTop", "thickness", "hardness", "wetness"]);
    assert_eq!(inside(find("Obs")), ["depth", "snowTemp"]);

    assert_eq!(texts(&document, "timePosition"), ["2026-03-20T01:00:00.500Z"]);
    assert_eq!(texts(&document, "dateTimeReport"), ["1970-01-01T00:01:00Z"]);
    let position = document.descendants().find(|node| node.has_tag_name((GML, "pos"))).unwrap();
    assert_eq!(position.text(), Some("-9.8 46.8"));
    assert_eq!(texts(&document, "hardness"), ["1F", "F", "K"]);
    assert_eq!(texts(&document, "wetness"), ["D", "W", "D"]);
    assert_eq!(texts(&document, "depthTop")[..3], ["0", "20", "40"]);
    assert_eq!(texts(&document, "depth"), ["0", "10", "30", "50"]);
    assert_eq!(texts(&document, "snowTemp"), ["-6.5", "-4.25", "0", "-4.25"]);
    assert_eq!(texts(&document, "lwc"), ["0", "3.5", "0"]);
    assert_eq!(texts(&document, "height"), ["60"]);
    assert_eq!(texts(&document, "waterEquivalent"), ["186"]);
}

#[test]
fn without_a_start_the_simulated_clock_is_told() {
    let text = written(&column(Vec::new()), &Site::default());
    let document = Document::parse(&text).unwrap();
    assert_eq!(texts(&document, "timePosition"), ["1970-01-01T01:00:00.500Z"]);
    assert!(texts(&document, "comment")[0].contains("no start"), "{text}");
    assert!(!text.contains("pointLocation"), "{text}");
    // Bare ground has a depth and no profiles.
    assert_eq!(texts(&document, "profileDepth"), ["0"]);
    assert!(!text.contains("stratProfile"), "{text}");
}

#[test]
fn wetness_follows_the_water_in_the_volume() {
    for (water, code) in
        [(0.0, "D"), (0.001, "M"), (5.9, "M"), (6.1, "W"), (16.1, "V"), (30.1, "S")]
    {
        assert_eq!(wetness(&layer(0.0, water, HandHardness::Fist)), code, "{water}");
    }
}
