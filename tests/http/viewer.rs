//! The viewer's files: the page is asked for anew, what belongs to it is kept for ever. What the page does is tested in a
//! browser, by `viewer/test`.

use std::path::Path;

use firn::config::BackendChoice;
use reqwest::Method;

use crate::support::{Reply, Server};

async fn fetch(server: &Server, path: &str, headers: &[(&str, &str)]) -> Reply {
    server.send(Method::GET, path, headers, Vec::new()).await
}

fn is_strict(reply: &Reply) -> bool {
    let policy = reply.header("content-security-policy");
    policy.contains("default-src 'none'") && !policy.contains("unsafe")
}

#[tokio::test(flavor = "multi_thread")]
async fn the_page_is_there_and_nothing_inline_may_run_on_it() {
    let server = Server::start(BackendChoice::Cpu).await;
    let page = fetch(&server, "/", &[]).await;
    assert_eq!((page.status, page.header("cache-control")), (200, "no-cache"));
    assert!(page.header("content-type").starts_with("text/html"));
    assert!(is_strict(&page));
    let text = String::from_utf8(page.body.clone()).unwrap();
    assert!(!text.contains("style=") && !text.contains("<style"), "{text}");
    if Path::new("viewer/dist/index.html").exists() {
        assets_are_kept_for_ever(&server, &page, &text).await;
    } else {
        assert!(text.contains("make serve"), "it says how to build the viewer: {text}");
    }
    fetch(&server, "/assets/none.js", &[]).await.problem(404);
    for outside in ["/assets/..%2f..%2f..%2fCargo.toml", "/assets/%2fetc%2fpasswd"] {
        fetch(&server, outside, &[]).await.problem(404);
    }
    server.stop().await;
}

async fn assets_are_kept_for_ever(server: &Server, page: &Reply, text: &str) {
    let tag = page.header("etag");
    assert_eq!(fetch(server, "/", &[("if-none-match", tag)]).await.status, 304);
    let names: Vec<&str> = text.split("./assets/").skip(1).map(up_to_quote).collect();
    assert!(names.iter().any(|name| name.ends_with(".js")), "{text}");
    for name in names {
        let path = format!("/assets/{name}");
        let plain = fetch(server, &path, &[]).await;
        let packed = fetch(server, &path, &[("accept-encoding", "br, gzip;q=0.8")]).await;
        let refused = fetch(server, &path, &[("accept-encoding", "gzip;q=0")]).await;
        for reply in [&plain, &packed, &refused] {
            assert_eq!(reply.status, 200);
            assert_eq!(reply.header("cache-control"), "public, max-age=31536000, immutable");
            assert_eq!(reply.header("vary"), "accept-encoding");
            assert_eq!(reply.header("x-content-type-options"), "nosniff");
            assert!(is_strict(reply));
        }
        assert_eq!(
            (packed.header("content-encoding"), &packed.body[..2]),
            ("gzip", &b"\x1f\x8b"[..])
        );
        assert_eq!((plain.header("content-encoding"), &plain.body), ("", &refused.body));
        assert_ne!(plain.header("etag"), packed.header("etag"));
        let zstd_asked = fetch(server, &path, &[("accept-encoding", "zstd")]).await;
        zstd_is_worth_it_from_a_kibibyte(&plain, &zstd_asked);
        for (coding, reply) in [("gzip", &packed), ("zstd", &zstd_asked)] {
            let held = [("accept-encoding", coding), ("if-none-match", reply.header("etag"))];
            assert_eq!(fetch(server, &path, &held).await.status, 304);
        }
    }
}

fn zstd_is_worth_it_from_a_kibibyte(plain: &Reply, asked: &Reply) {
    if plain.body.len() < 1024 {
        assert_eq!((asked.header("content-encoding"), &asked.body), ("", &plain.body));
        assert_eq!(asked.header("etag"), plain.header("etag"));
    } else {
        assert_eq!(asked.header("content-encoding"), "zstd");
        assert_eq!(zstd::decode_all(&asked.body[..]).unwrap(), plain.body);
        // What is compressed on the way has no strong tag.
        assert_eq!(asked.header("etag"), format!("W/{}", plain.header("etag")));
    }
}

fn up_to_quote(text: &str) -> &str {
    text.split('"').next().unwrap()
}
