//! `docs/operations.md` and `deploy/` speak of the options and metrics that there are.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use firn::cli::configuration;
use firn::config::BackendChoice;

use crate::support::Server;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(ROOT).join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Every word of a text that begins like a metric's name.
fn metrics_in(text: &str) -> BTreeSet<&str> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    words.filter(|word| word.starts_with("firn_")).collect()
}

/// The names under which the server gives its metrics out.
async fn metrics_of_a_server() -> BTreeSet<String> {
    let server = Server::start(BackendChoice::Cpu).await;
    server.get("/readyz").await.expect(200);
    let text = String::from_utf8(server.get("/metrics").await.body).unwrap();
    server.stop().await;
    let types = text.lines().filter_map(|line| line.strip_prefix("# TYPE "));
    let names = types.flat_map(|line| match line.split_once(' ').expect("a name and a type") {
        (name, "counter") => vec![format!("{name}_total")],
        (name, "histogram") => ["_bucket", "_count", "_sum"].map(|s| format!("{name}{s}")).into(),
        (name, _) => vec![name.to_owned()],
    });
    names.collect()
}

#[test]
fn the_table_of_options_is_up_to_date() {
    let page = read("docs/operations.md");
    let (_, rest) = page.split_once("<!-- configuration -->\n").expect("the table begins");
    let (table, _) = rest.split_once("<!-- end -->").expect("the table ends");
    assert!(table == configuration::table(), "run `make configuration`");
}

/// The environment variables that the files of `deploy/` and its neighbours set are options.
#[test]
fn variables_that_are_set_exist() {
    let table = configuration::table();
    for path in ["Dockerfile", "compose.yaml", "deploy/kubernetes/firn.yaml"] {
        let text = read(path);
        let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        let named: BTreeSet<&str> = words.filter(|word| word.starts_with("FIRN_")).collect();
        assert!(!named.is_empty(), "{path}");
        for name in named {
            assert!(table.contains(&format!("| `{name}` |")), "{path} sets {name}, no option");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_that_are_spoken_of_exist_and_all_are_explained() {
    let metrics = metrics_of_a_server().await;
    assert!(metrics.len() > 10, "{metrics:?}");
    let page = read("docs/operations.md");
    for path in [
        "docs/operations.md",
        "deploy/grafana/firn.json",
        "deploy/prometheus/rules.yml",
        "deploy/prometheus/rules_test.yml",
    ] {
        let text = read(path);
        for named in metrics_in(&text) {
            let exists = metrics.iter().any(|name| {
                name == named || name.strip_prefix(named).is_some_and(|rest| rest == "_bucket")
            });
            assert!(exists, "{path} speaks of {named}, which the server does not have");
        }
    }
    let explained = metrics_in(&page);
    for name in &metrics {
        let base = ["_bucket", "_count", "_sum"].iter().find_map(|end| name.strip_suffix(end));
        assert!(explained.contains(base.unwrap_or(name)), "docs/operations.md leaves {name} out");
    }
}
