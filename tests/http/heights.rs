//! Heights as images and arrays, and reads that cost nothing where nothing has changed.

use std::io::Cursor;
use std::time::Duration;

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Reply, Server, numbers};

on_each_backend!(
    an_image_shows_the_heights,
    an_image_of_the_surface_has_its_own_zero,
    a_numpy_array_holds_the_heights,
    an_etag_changes_with_the_tiles_of_its_region_alone,
    what_the_client_holds_is_not_sent_again,
    each_representation_has_its_own_etag,
    what_is_held_is_known_while_the_engine_is_busy,
);

/// A paused session of 20 × 12 columns, deeper by 0.1 m from column to column; 3 × 2 tiles.
async fn sloping(server: &Server, terrain: Value) -> String {
    let grid = json!({"width": 20, "depth": 12, "height": 40, "cell_size": 0.2});
    let path = server.create(json!({"grid": grid, "paused": true, "terrain": terrain})).await;
    for x in 0..20 {
        fall(server, &path, x, 0, 12, 0.1 * f64::from(1 + x)).await;
    }
    path
}

/// Lets snow fall on some columns of one column_x.
async fn fall(server: &Server, path: &str, x: u32, z: u32, depth: u32, snow: f64) {
    let metres = |columns: u32| 0.2 * f64::from(columns);
    let region = json!({"x": metres(x), "z": metres(z), "width": 0.2, "depth": metres(depth)});
    let body = json!({"depth": snow, "region": region});
    server.post(&format!("{path}/snowfalls"), body).await.expect(200);
}

async fn held(server: &Server, url: &str, accept: &str, tags: &str) -> Reply {
    let headers = [("accept", accept), ("if-none-match", tags)];
    server.send(Method::GET, url, &headers, Vec::new()).await
}

/// Size and grey values of a 16-bit image.
fn greys(reply: &Reply) -> ((u32, u32), Vec<u16>) {
    let mut reader = png::Decoder::new(Cursor::new(&reply.body)).read_info().expect("a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("it is small")];
    let info = reader.next_frame(&mut pixels).expect("it is whole");
    assert_eq!(
        (info.color_type, info.bit_depth),
        (png::ColorType::Grayscale, png::BitDepth::Sixteen)
    );
    let values = pixels.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
    ((info.width, info.height), values)
}

#[track_caller]
fn number(reply: &Reply, header: &str) -> f64 {
    reply.header(header).parse().expect("a number")
}

/// Compares an image with the JSON of the same read.
async fn compare_image(server: &Server, url: &str) -> (f64, f64) {
    let json = server.get(url).await.expect(200);
    let image = server.get_as(url, "image/png").await;
    assert_eq!((image.status, image.header("content-type")), (200, "image/png"));
    assert_eq!(image.header("firn-seq"), json["seq"].to_string());
    let (size, greys) = greys(&image);
    assert_eq!((json!(size.0), json!(size.1)), (json["width"].clone(), json["depth"].clone()));
    let (scale, offset) =
        (number(&image, "firn-height-scale"), number(&image, "firn-height-offset"));
    let heights = numbers(&json["heights"]);
    assert_eq!(greys.len(), heights.len());
    for (i, (grey, height)) in greys.iter().zip(heights).enumerate() {
        let shown = f64::from(*grey) * scale + offset;
        assert!((shown - height).abs() <= scale * 0.501, "pixel {i}: {shown} m, not {height} m");
    }
    (scale, offset)
}

async fn an_image_shows_the_heights(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server, Value::Null).await;
    for query in ["", "?column_x=3&column_z=5&width=9&depth=4", "?stride=4&column_x=1"] {
        let found = compare_image(&server, &format!("{path}/heights{query}")).await;
        // The same for all images of the session: 40 cells of 0.2 m are white.
        assert_eq!(found, (8.0 / 65535.0, 0.0), "{query}");
    }
    server.stop().await;
}

async fn an_image_of_the_surface_has_its_own_zero(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let ground: Vec<f64> = (0..240).map(|i| f64::from(i % 20) * 0.5 - 4.0).collect();
    let path = sloping(&server, json!({ "heights": ground })).await;
    let (scale, offset) =
        compare_image(&server, &format!("{path}/heights?surface=true&column_x=5")).await;
    assert_eq!(offset, -4.0);
    assert!((scale * 65535.0 - 17.5).abs() < 1e-9, "9.5 m of ground and 8 m of snow");
    assert_eq!(compare_image(&server, &format!("{path}/heights")).await, (8.0 / 65535.0, 0.0));
    server.stop().await;
}

async fn a_numpy_array_holds_the_heights(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server, Value::Null).await;
    for query in ["", "?column_x=3&column_z=5&width=9&depth=4", "?stride=8"] {
        let url = format!("{path}/heights{query}");
        let json = server.get(&url).await.expect(200);
        let file = server.get_as(&url, "application/x-npy").await;
        assert_eq!((file.status, file.header("content-type")), (200, "application/x-npy"));
        assert_eq!(&file.body[..8], b"\x93NUMPY\x01\x00");
        let start = 10 + usize::from(u16::from_le_bytes([file.body[8], file.body[9]]));
        assert_eq!(start % 64, 0);
        let header = std::str::from_utf8(&file.body[10..start]).expect("a header is text");
        let shape = format!("({}, {})", json["depth"], json["width"]);
        assert_eq!(
            header.trim_end(),
            format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}")
        );
        let floats: Vec<f32> = file.body[start..]
            .chunks_exact(4)
            .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
            .collect();
        let exact: Vec<f32> = numbers(&json["heights"]).iter().map(|&h| h as f32).collect();
        assert_eq!(floats, exact);
    }
    server.stop().await;
}

async fn an_etag_changes_with_the_tiles_of_its_region_alone(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server, Value::Null).await;
    let tag = async |query: &str| {
        let reply = server.get(&format!("{path}/heights{query}")).await;
        assert_eq!(reply.status, 200);
        reply.header("etag").to_owned()
    };
    // The first two tiles; a column of the third; the first column of the fourth.
    let queries = ["?width=16&depth=8", "?column_x=16&width=1&depth=1", "?column_z=8&width=1", ""];
    let all = async || {
        let mut tags = Vec::new();
        for query in queries {
            tags.push(tag(query).await);
        }
        tags
    };
    let before = all().await;
    assert!(before.iter().all(|tag| tag.starts_with("W/\"") && tag.ends_with('"')), "{before:?}");
    assert_eq!(all().await, before, "nothing has happened");
    // Something that changes the seq, but no tile.
    server.put(&format!("{path}/air-temperature"), json!({"celsius": -9})).await.expect(200);
    assert_eq!(all().await, before);
    for (x, z, changed) in [(8, 7, [true, false, false, true]), (19, 0, [false, true, false, true])]
    {
        let before = all().await;
        fall(&server, &path, x, z, 1, 0.2).await;
        let after = all().await;
        let found: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a != b).collect();
        assert_eq!(found, changed, "snow on column {x}, {z}");
    }
    // Another session has other tags, though the same happened to it.
    let other = sloping(&server, Value::Null).await;
    let reply = server.get(&format!("{other}/heights")).await;
    assert_ne!(reply.header("etag"), before[3]);
    server.stop().await;
}

async fn what_the_client_holds_is_not_sent_again(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server, Value::Null).await;
    for url in [format!("{path}/heights"), format!("{path}/heights?width=5&stride=2&surface=true")]
    {
        for accept in ["*/*", "application/octet-stream", "image/png", "application/x-npy"] {
            let first = server.get_as(&url, accept).await;
            assert_eq!((first.status, first.header("vary")), (200, "accept, accept-encoding"));
            let tag = first.header("etag").to_owned();
            let strong = tag.strip_prefix("W/").expect("it is weak").to_owned();
            for tags in [tag.clone(), strong, format!("\"x\", {tag}"), "*".to_owned()] {
                let reply = held(&server, &url, accept, &tags).await;
                assert_eq!((reply.status, reply.body.len()), (304, 0), "{tags}");
                assert_eq!(reply.header("etag"), tag);
                assert_eq!(reply.header("vary"), "accept, accept-encoding");
                assert_eq!(reply.header("firn-seq"), first.header("firn-seq"));
            }
            for tags in ["\"x\"", "W/\"\"", "nonsense"] {
                let reply = held(&server, &url, accept, tags).await;
                assert_eq!((reply.status, reply.body == first.body), (200, true), "{tags}");
            }
        }
    }
    let url = format!("{path}/heights");
    let tag = server.get(&url).await.header("etag").to_owned();
    fall(&server, &path, 3, 3, 1, 0.2).await;
    let reply = held(&server, &url, "*/*", &tag).await;
    assert_eq!(reply.status, 200);
    assert_ne!(reply.header("etag"), tag);
    // What is wrong stays wrong, whatever the client holds.
    held(&server, &url, "text/html", "*").await.problem(406);
    held(&server, &format!("{url}?width=99"), "*/*", "*").await.problem(422);
    server.delete(&path).await;
    held(&server, &url, "*/*", "*").await.problem(404);
    server.stop().await;
}

async fn each_representation_has_its_own_etag(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server, Value::Null).await;
    let mut tags = Vec::new();
    let accepts =
        ["application/json", "application/octet-stream", "image/png", "application/x-npy"];
    for accept in accepts {
        for query in ["", "?stride=2", "?surface=true", "?width=5", "?depth=5", "?column_x=5"] {
            let url = format!("{path}/heights{query}");
            tags.push(server.get_as(&url, accept).await.header("etag").to_owned());
        }
    }
    let count = tags.len();
    // No tag of one representation passes for another.
    let foreign: Vec<&str> = tags[6..].iter().map(String::as_str).collect();
    let reply = held(&server, &format!("{path}/heights"), "*/*", &foreign.join(", ")).await;
    assert_eq!(reply.status, 200);
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), count);
    server.stop().await;
}

async fn what_is_held_is_known_while_the_engine_is_busy(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = sloping(&server, Value::Null).await;
    let url = format!("{path}/heights");
    let tag = server.get(&url).await.header("etag").to_owned();
    let session = server.sessions.get(path.rsplit('/').next().unwrap()).expect("it is there");
    let (release, wait) = std::sync::mpsc::channel::<()>();
    let (begin, begun) = std::sync::mpsc::channel::<()>();
    let blocked = tokio::spawn(async move {
        let block = move |_: &firn::session::Simulation| {
            begin.send(()).expect("the test waits for it");
            wait.recv_timeout(Duration::from_secs(60)).is_ok()
        };
        session.inspect(block).await
    });
    tokio::task::spawn_blocking(move || begun.recv()).await.unwrap().expect("it has begun");
    // The world's thread stands still until these are answered.
    assert_eq!(held(&server, &url, "*/*", &tag).await.status, 304);
    assert_eq!(server.get(&url).await.status, 200);
    release.send(()).expect("the world still waits");
    assert!(blocked.await.unwrap().expect("it comes to its end"), "reads waited for the engine");
    server.stop().await;
}
