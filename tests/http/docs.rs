//! The reference to browse: all of it comes from the server itself.

use firn::config::BackendChoice;

use crate::support::{Reply, Server};

/// Values of an attribute in a page.
fn attributes<'a>(page: &'a str, name: &str) -> Vec<&'a str> {
    let quoted = format!("{name}=\"");
    page.split(&quoted[..]).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

fn check_headers(reply: &Reply) {
    let policy = reply.header("content-security-policy");
    assert!(policy.starts_with("default-src 'none';"), "{policy}");
    assert!(policy.contains("script-src 'self';"), "{policy}");
    assert!(!policy.contains("http") && !policy.contains('*') && !policy.contains("unsafe-eval"));
    assert_eq!(reply.header("x-content-type-options"), "nosniff");
}

#[tokio::test]
async fn the_page_loads_its_own_files_and_nothing_else() {
    let server = Server::start(BackendChoice::Cpu).await;
    // The client follows the way to the page.
    let page = server.get("/docs").await;
    assert_eq!((page.status, page.header("content-type")), (200, "text/html"));
    check_headers(&page);
    let page = String::from_utf8(page.body).unwrap();
    let mut files = attributes(&page, "src");
    files.extend(attributes(&page, "href"));
    assert!(files.len() >= 6, "{files:?}");
    for file in files {
        assert!(!file.contains("//"), "{file} may be on another host");
        let name = file.strip_prefix("./").unwrap_or(file);
        let reply = server.get(&format!("/docs/{name}")).await;
        assert_eq!(reply.status, 200, "{name}");
        assert!(!reply.body.is_empty());
        check_headers(&reply);
        let kind = reply.header("content-type").to_owned();
        let expected = match name.rsplit('.').next() {
            Some("js") => "text/javascript",
            Some("css") => "text/css",
            _ => "image/png",
        };
        assert_eq!(kind, expected, "{name}");
        if expected == "text/css" {
            let css = String::from_utf8(reply.body).unwrap();
            for url in css.split("url(").skip(1) {
                let url = url.trim_start_matches(['"', '\'']);
                assert!(url.starts_with("data:"), "{name} loads {}", &url[..url.len().min(60)]);
            }
            assert!(!css.contains("@import"));
        }
    }
    // No script stands in the page: the policy would not run it.
    assert_eq!(page.matches("<script").count(), attributes(&page, "src").len());
    server.stop().await;
}

#[tokio::test]
async fn it_shows_this_servers_document_and_asks_nobody_about_it() {
    let server = Server::start(BackendChoice::Cpu).await;
    let start = server.get("/docs/swagger-initializer.js").await;
    let start = String::from_utf8(start.body).unwrap();
    assert!(start.contains(r#""url": "/openapi.json""#), "{start}");
    assert!(start.contains(r#""validatorUrl": "none""#), "{start}");
    assert!(!start.contains("http:") && !start.contains("https:"), "{start}");
    assert!(server.get("/openapi.json").await.expect(200)["paths"].is_object());
    server.get("/docs/nothing.js").await.problem(404);
    server.get("/docs/../Cargo.toml").await.problem(404);
    server.stop().await;
}
