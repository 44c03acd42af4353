//! What is in a picture, and what `cells` says should be.

use firn::render::{Area, Field};
use serde_json::Value;

use crate::support::{Reply, Server};

use super::{COLUMNS, SIDE};

/// Fields that `cells` tells and that the pictures' fields are made of.
const FIELDS: &str = "density,temperature,hardness,stress";

/// The pixels of a picture.
pub struct Image {
    pub width: usize,
    pub height: usize,
    /// Bytes of a pixel.
    pub depth: usize,
    pub pixels: Vec<u8>,
}

impl Image {
    pub fn decode(reply: &Reply) -> Image {
        let text = String::from_utf8_lossy(&reply.body[..reply.body.len().min(400)]);
        assert_eq!((reply.status, reply.header("content-type")), (200, "image/png"), "{text}");
        let mut reader = png::Decoder::new(std::io::Cursor::new(&reply.body)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!(info.bit_depth, png::BitDepth::Eight);
        let depth = info.color_type.samples();
        Image { width: info.width as usize, height: info.height as usize, depth, pixels }
    }

    pub fn at(&self, x: usize, y: usize) -> [u8; 3] {
        let first = (y * self.width + x) * self.depth;
        self.pixels[first..first + 3].try_into().unwrap()
    }

    /// The smallest rectangle around all pixels of an area that are not white.
    pub fn drawn(&self, area: Area) -> Area {
        let (x0, y0) = (area.x as usize, area.y as usize);
        let inside = (y0..y0 + area.height as usize)
            .flat_map(|y| (x0..x0 + area.width as usize).map(move |x| (x, y)))
            .filter(|&(x, y)| self.at(x, y) != [255; 3]);
        let (mut low, mut high) = ((usize::MAX, usize::MAX), (0, 0));
        for (x, y) in inside {
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
        }
        assert!(low.0 <= high.0, "nothing is drawn");
        let (width, height) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
        Area { x: low.0 as u32, y: low.1 as u32, width: width as u32, height: height as u32 }
    }

    /// The colour at parts of an area's extent.
    pub fn part(&self, area: Area, x: f64, y: f64) -> [u8; 3] {
        let place = |first: u32, extent: u32, part: f64| {
            (f64::from(first) + f64::from(extent) * part) as usize
        };
        self.at(place(area.x, area.width, x), place(area.y, area.height, y))
    }
}

/// What `cells` tells about the snow, and the pictures' values made of it.
pub struct Cells(Value);

impl Cells {
    pub async fn read(server: &Server, path: &str) -> Cells {
        Cells(server.get(&format!("{path}/cells?fields={FIELDS}")).await.expect(200))
    }

    pub fn height(&self) -> usize {
        self.0["height"].as_u64().unwrap() as usize
    }

    /// A field of a cell; nothing outside the snow.
    pub fn value(&self, field: Field, x: usize, y: usize, z: usize) -> Option<f32> {
        let index = (z * self.height() + y) * COLUMNS.0 + x;
        let of = |name: &str| self.0["fields"][name][index].as_f64().map(|value| value as f32);
        match field {
            Field::Overpressure => Some(of("stress")? - of("hardness")?),
            Field::Position => of("density").map(|_| (y as f32 + 0.5) * SIDE as f32),
            _ => of(field.name()),
        }
    }

    pub fn top(&self, x: usize, z: usize) -> usize {
        (0..self.height()).rev().find(|&y| self.value(Field::Density, x, y, z).is_some()).unwrap()
    }
}
