//! Pictures over HTTP: decoded, and their colours compared with the values that `cells` tells.

mod image;

use firn::config::BackendChoice;
use firn::render::{Area, Field, Layout, Picture, Scale, View};
use serde_json::{Value, json};

use crate::support::Server;

use image::{Cells, Image};

/// Makes a test of each function that needs an adapter to draw with, whatever the snow lives on.
macro_rules! drawn {
    ($($name:ident on $backend:ident),+ $(,)?) => {
        mod drawn {
            $(
                #[tokio::test(flavor = "multi_thread")]
                async fn $name() {
                    if crate::support::skips_gpu() {
                        eprintln!("SKIPPED: FIRN_SKIP_GPU_TESTS=1");
                        return;
                    }
                    super::$name(firn::config::BackendChoice::$backend).await;
                }
            )+
        }
    };
}

drawn!(
    level_cells_have_the_legends_colour_in_every_field on Gpu,
    walls_have_it_without_shading on Gpu,
    the_surface_has_the_colour_of_its_highest_cells on Gpu,
    a_section_shows_the_layers_of_its_columns on Cpu,
    the_legend_stands_beside_the_picture on Cpu,
    objects_are_in_every_view on Gpu,
    a_picture_is_not_sent_twice on Cpu,
    what_is_wrong_with_a_picture_is_named on Cpu,
);

/// Side of a column in the sessions below \[m\], and their columns along x and z.
const SIDE: f64 = 0.5;
const COLUMNS: (usize, usize) = (6, 4);

/// A session that stands still, with other snow in each quarter, 2 m deep.
async fn quarters(server: &Server) -> String {
    let grid = json!({"width": 6, "depth": 4, "height": 20, "cell_size": SIDE});
    let path = server.create(json!({"grid": grid, "paused": true})).await;
    for (x, z, density, temperature) in
        [(0.0, 0.0, 20, -3), (1.5, 0.0, 40, -8), (0.0, 1.0, 60, -12), (1.5, 1.0, 80, -20)]
    {
        let region = json!({"x": x, "z": z, "width": 1.5, "depth": 1.0});
        let fall = json!({"depth": 2, "density": density, "temperature": temperature,
            "region": region});
        server.post(&format!("{path}/snowfalls"), fall).await.expect(200);
    }
    path
}

/// Within what rounding between the host and a device can differ by.
#[track_caller]
fn assert_like(found: [u8; 3], expected: [u8; 3], what: &str) {
    let far = found.iter().zip(expected).any(|(a, b)| a.abs_diff(b) > 3);
    assert!(!far, "{what}: {found:?}, not {expected:?}");
}

/// A scale with given ends, as the pictures below have it.
fn scale(field: Field) -> (Scale, String) {
    let (min, max) = match field {
        Field::Density => (10.0, 90.0),
        Field::Temperature => (-25.0, 0.0),
        Field::Overpressure => (-3000.0, 3000.0),
        Field::Hardness => (0.0, 8000.0),
        Field::Position => (0.0, 2.5),
    };
    let scale = Scale::new(field, std::iter::empty(), Some(min), Some(max));
    (scale, format!("field={}&min={min}&max={max}", field.name()))
}

fn scene(view: View) -> Area {
    Layout::new(&Picture { view, ..Picture::default() }).scene
}

async fn level_cells_have_the_legends_colour_in_every_field(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    let cells = Cells::read(&server, &path).await;
    for (name, field) in Field::ALL {
        let (scale, query) = scale(field);
        let reply = server.get(&format!("{path}/render.png?yaw=0&pitch=90&{query}")).await;
        assert!(!reply.header("firn-tick").is_empty() && !reply.header("firn-seq").is_empty());
        let image = Image::decode(&reply);
        assert_eq!((image.width, image.height), (800, 600));
        let drawn = image.drawn(scene(View::Grid));
        for z in 0..COLUMNS.1 {
            for x in 0..COLUMNS.0 {
                let value = cells.value(field, x, cells.top(x, z), z).unwrap();
                let part = |i: usize, count: usize| (i as f64 + 0.5) / count as f64;
                let found = image.part(drawn, part(x, COLUMNS.0), part(z, COLUMNS.1));
                assert_like(found, scale.colour(value), &format!("{name} of ({x}, {z})"));
            }
        }
    }
    server.stop().await;
}

async fn walls_have_it_without_shading(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    let cells = Cells::read(&server, &path).await;
    let level = "pitch=0&projection=parallel&shading=false";
    for (name, field) in Field::ALL {
        let (scale, query) = scale(field);
        // From the sides of the highest z and of the highest x.
        for (yaw, across, column) in [
            (0, COLUMNS.0, (|i| (i, COLUMNS.1 - 1)) as fn(usize) -> (usize, usize)),
            (90, COLUMNS.1, |i| (COLUMNS.0 - 1, COLUMNS.1 - 1 - i)),
        ] {
            let reply = server.get(&format!("{path}/render.png?{level}&yaw={yaw}&{query}")).await;
            let image = Image::decode(&reply);
            let drawn = image.drawn(scene(View::Grid));
            // Below the snow there is a thin slab of ground.
            let snow = 0.99;
            for i in 0..across {
                let (x, z) = column(i);
                let layers = cells.top(x, z) + 1;
                for y in 0..layers {
                    let part = (i as f64 + 0.5) / across as f64;
                    let down = snow * (1.0 - (y as f64 + 0.5) / layers as f64);
                    let value = cells.value(field, x, y, z).unwrap();
                    let what = format!("{name} of ({x}, {y}, {z}) from {yaw}");
                    assert_like(image.part(drawn, part, down), scale.colour(value), &what);
                }
            }
        }
        // With shading, walls are darker.
        let shaded = Image::decode(&server.get(&format!("{path}/render.png?yaw=0&{query}")).await);
        let flat = format!("{path}/render.png?yaw=0&shading=false&{query}");
        let flat = Image::decode(&server.get(&flat).await);
        assert_ne!(shaded.pixels, flat.pixels);
    }
    server.stop().await;
}

async fn the_surface_has_the_colour_of_its_highest_cells(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    let cells = Cells::read(&server, &path).await;
    for (name, field) in Field::ALL {
        let (scale, query) = scale(field);
        let query = format!("view=surface&yaw=0&pitch=90&{query}");
        let image = Image::decode(&server.get(&format!("{path}/render.png?{query}")).await);
        let drawn = image.drawn(scene(View::Surface));
        for z in 0..COLUMNS.1 {
            for x in 0..COLUMNS.0 {
                let value = match field {
                    Field::Position => 2.0,
                    _ => cells.value(field, x, cells.top(x, z), z).unwrap(),
                };
                // The middle of a column: between middles, colours run from one to the other.
                let part = |i: usize, count: usize| (i as f64 + 0.5) / count as f64;
                let found = image.part(drawn, part(x, COLUMNS.0), part(z, COLUMNS.1));
                assert_like(found, scale.colour(value), &format!("{name} of ({x}, {z})"));
            }
        }
    }
    server.stop().await;
}

async fn a_section_shows_the_layers_of_its_columns(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    let cells = Cells::read(&server, &path).await;
    for (name, field) in Field::ALL {
        let (scale, query) = scale(field);
        for (along, at, count) in [("x", 1, COLUMNS.0), ("z", 4, COLUMNS.1)] {
            let query = format!("view=section&along={along}&at={at}&{query}");
            let image = Image::decode(&server.get(&format!("{path}/render.png?{query}")).await);
            let drawn = image.drawn(scene(View::Section));
            for i in 0..count {
                let (x, z) = if along == "x" { (i, at) } else { (at, i) };
                let layers = cells.top(x, z) + 1;
                for y in 0..layers {
                    let down = 0.99 * (1.0 - (y as f64 + 0.5) / layers as f64);
                    let found = image.part(drawn, (i as f64 + 0.5) / count as f64, down);
                    let value = cells.value(field, x, y, z).unwrap();
                    let what = format!("{name} of ({x}, {y}, {z}) along {along}");
                    assert_like(found, scale.colour(value), &what);
                }
            }
        }
    }
    server.stop().await;
}

async fn the_legend_stands_beside_the_picture(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    for (name, field) in Field::ALL {
        let (scale, query) = scale(field);
        let image = Image::decode(&server.get(&format!("{path}/render.png?{query}")).await);
        let bar = Layout::new(&Picture::default()).legend.expect("there is room");
        for row in 0..bar.height {
            let part = (f64::from(row) + 0.5) / f64::from(bar.height);
            let value = f64::from(scale.to) + f64::from(scale.from - scale.to) * part;
            let found = image.part(bar, 0.5, part);
            assert_like(found, scale.colour(value as f32), &format!("{name} in row {row}"));
        }
        // Something is written above it and to its right.
        let above = Area { y: bar.y - 40, height: 36, ..bar };
        let beside = Area { x: bar.x + bar.width + 8, width: 40, ..bar };
        assert!(image.drawn(above).width > 8 && image.drawn(beside).height > bar.height / 2);
    }
    let bare = Image::decode(&server.get(&format!("{path}/render.png?legend=false")).await);
    assert_eq!(bare.at(795, 300), [255; 3]);
    // Pixels of pictures that are small or of odd sizes come back as well.
    for (width, height) in [(16, 16), (33, 4096), (161, 121)] {
        let query = format!("width={width}&height={height}&background=transparent");
        for view in ["grid", "surface", "section"] {
            let reply = server.get(&format!("{path}/render.png?view={view}&{query}")).await;
            let image = Image::decode(&reply);
            assert_eq!((image.width, image.height, image.depth), (width, height, 4), "{view}");
            assert_eq!(image.pixels[3], 0, "the corner of {view} is empty");
        }
    }
    server.stop().await;
}

async fn objects_are_in_every_view(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    for (id, shape) in [
        ("box", json!({"type": "box", "width": 1, "depth": 1})),
        ("disk", json!({"type": "disk", "radius": 0.6})),
    ] {
        let body = json!({"mass": 20, "shape": shape, "position": {"x": 1.25, "z": 0.75}});
        server.put(&format!("{path}/colliders/{id}"), body).await.expect(201);
        for view in ["grid", "surface", "section&at=1"] {
            let with = format!("{path}/render.png?shading=false&view={view}");
            let without = format!("{with}&colliders=false");
            let count = async |query: &str| {
                let image = Image::decode(&server.get(query).await);
                image.pixels.chunks(3).filter(|pixel| *pixel == [178, 102, 68]).count()
            };
            let (with, without) = (count(&with).await, count(&without).await);
            assert!(with > without + 1000, "{id} in {view}: {with} and {without} pixels");
        }
        server.delete(&format!("{path}/colliders/{id}")).await.expect(204);
    }
    server.stop().await;
}

async fn a_picture_is_not_sent_twice(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    let picture = format!("{path}/render.png?view=surface&width=64&height=64");
    let first = server.get(&picture).await;
    let tag = first.header("etag").to_owned();
    let again = async |query: &str| {
        server.send(reqwest::Method::GET, query, &[("if-none-match", &tag)], Vec::new()).await
    };
    let held = again(&picture).await;
    assert_eq!((held.status, held.body.len(), held.header("etag")), (304, 0, &*tag));
    assert_eq!(again(&format!("{picture}&field=hardness")).await.status, 200);
    server.post(&format!("{path}/clearings"), json!({"depth": 1})).await.expect(200);
    let changed = again(&picture).await;
    assert_eq!(changed.status, 200);
    assert_ne!(changed.header("etag"), tag);
    server.stop().await;
}

async fn what_is_wrong_with_a_picture_is_named(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = quarters(&server).await;
    for (query, pointers) in [
        ("view=map", &["view"][..]),
        ("field=stress", &["field"]),
        ("width=15", &["width"]),
        ("height=4097", &["height"]),
        ("width=4096&height=4096", &["width"]),
        ("yaw=361&pitch=-1&zoom=0", &["yaw", "pitch", "zoom"]),
        ("pitch=NaN", &["pitch"]),
        ("projection=fisheye", &["projection"]),
        ("along=y", &["along"]),
        ("view=section&at=4", &["at"]),
        ("view=section&along=z&at=6", &["at"]),
        ("view=section&column_z=2&at=1", &["at"]),
        ("column_x=6", &["column_x"]),
        ("column_z=2&columns_z=3", &["columns_z"]),
        ("min=5&max=5", &["max"]),
        ("background=green", &["background"]),
        ("shading=1&legend=no&colliders=2", &["shading", "legend", "colliders"]),
        ("colour=red", &["colour"]),
    ] {
        let reply = server.get(&format!("{path}/render.png?{query}")).await;
        assert_eq!(reply.pointers(422), pointers, "{query}");
    }
    server.get("/v1/sessions/none/render.png").await.problem(404);
    let grid = json!({"width": 1000, "depth": 1000, "height": 2});
    let wide = server.create(json!({"grid": grid, "paused": true})).await;
    let problem = server.get(&format!("{wide}/render.png")).await.problem(413);
    assert!(problem["detail"].as_str().unwrap().contains("columns_x"), "{problem}");
    let part = format!("{wide}/render.png?column_x=900&columns_x=10&columns_z=10");
    assert_eq!(server.get(&part).await.status, 200);
    server.stop().await;
}

/// The server as a program of its own, ended with the test.
#[cfg(target_os = "linux")]
struct Program(std::process::Child);

#[cfg(target_os = "linux")]
impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn without_any_adapter_the_answer_says_what_is_missing() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let mut program = Program(
        Command::new(env!("CARGO_BIN_EXE_firn"))
            .args(["serve", "--demo", "--ephemeral", "--backend", "cpu"])
            .args(["--listen", "127.0.0.1:0"])
            // No driver is found in a file that is no driver's.
            .envs([("VK_DRIVER_FILES", "/dev/null"), ("VK_ICD_FILENAMES", "/dev/null")])
            .env_remove("VK_ADD_DRIVER_FILES")
            .stderr(Stdio::piped())
            .spawn()
            .expect("the server starts"),
    );
    let log = BufReader::new(program.0.stderr.take().expect("it is piped"));
    let mut lines = log.lines().map_while(Result::ok);
    let demo = lines
        .find_map(|line| line.split_once("'demo' is at ").map(|(_, url)| url.to_owned()))
        .expect("the log says where the session is");
    let reply = reqwest::get(format!("{demo}/render.png")).await.expect("it answers");
    assert_eq!(reply.status(), 501);
    let problem: Value = reply.json().await.expect("a problem");
    assert_eq!(problem["type"], "urn:firn:problem:not-implemented");
    assert!(problem["detail"].as_str().unwrap().contains("mesa-vulkan-drivers"), "{problem}");
    // Everything else works.
    let profile = reqwest::get(format!("{demo}/profile.svg?column_x=0&column_z=0")).await;
    assert_eq!(profile.expect("it answers").status(), 200);
}
