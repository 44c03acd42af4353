//! Heights as bytes of one format or another.

use std::io::Write;

use axum::http::{HeaderName, HeaderValue};
use firn_snow::Grid;

use crate::http::handlers::reserved;
use crate::http::npy;
use crate::problem::Problem;
use crate::session::Ground;

use super::{Heights, Shown};

/// Characters of a height in JSON with what parts it from the next; few are longer.
pub const LONGEST_NUMBER: usize = 22;

/// 32-bit floats, little-endian.
pub fn floats(heights: &Heights) -> Result<Vec<u8>, Problem> {
    let mut file = reserved(4 * heights.count())?;
    write_floats(heights, &mut file);
    Ok(file)
}

fn write_floats(heights: &Heights, file: &mut Vec<u8>) {
    file.extend(heights.metres().flat_map(|height| (height as f32).to_le_bytes()));
}

/// A NumPy array file of version 1.0.
pub fn npy(heights: &Heights, width: u32, depth: u32) -> Result<Vec<u8>, Problem> {
    let header = npy::header(depth as usize, width as usize);
    let mut file = reserved(header.len() + 4 * heights.count())?;
    file.extend(header);
    write_floats(heights, &mut file);
    Ok(file)
}

/// What a grey value means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grey {
    /// Metres per step.
    scale: f64,
    /// Metres at 0.
    offset: f64,
}

impl Grey {
    /// Covers all that may be shown of a session's columns on its ground, so that images taken at different
    /// times compare.
    pub fn new(grid: &Grid, ground: &Ground, shown: Shown) -> Grey {
        let deepest = f64::from(grid.height) * grid.cell_size;
        let (lowest, highest) = match shown {
            Shown::Depth => (0.0, deepest),
            Shown::Surface => (ground.lowest(), ground.highest() + deepest),
            Shown::Ground => (ground.lowest(), ground.highest()),
        };
        // Level ground has no step; any will do.
        let range = if highest > lowest { highest - lowest } else { 1.0 };
        Grey { scale: range / f64::from(u16::MAX), offset: lowest }
    }

    /// The headers that say so.
    pub fn headers(self) -> [(HeaderName, HeaderValue); 2] {
        let number =
            |number: f64| HeaderValue::try_from(number.to_string()).expect("a number is ASCII");
        [
            (HeaderName::from_static("firn-height-scale"), number(self.scale)),
            (HeaderName::from_static("firn-height-offset"), number(self.offset)),
        ]
    }

    /// The nearest grey.
    fn of(self, height: f64) -> u16 {
        // A cast from float saturates.
        ((height - self.offset) / self.scale).round() as u16
    }
}

/// A grey image of 16 bits.
///
/// # Errors
/// Those of the encoder; none is known.
pub fn png(
    heights: &Heights,
    width: u32,
    depth: u32,
    grey: Grey,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, depth);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    let mut pixels = writer.stream_writer()?;
    for height in heights.metres() {
        pixels.write_all(&grey.of(height).to_be_bytes())?;
    }
    pixels.finish()?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greys_cover_every_height_and_no_more() {
        let grid = Grid { width: 2, depth: 2, height: 10, cell_size: 0.5 };
        let grey = Grey::new(&grid, &Ground::level(), Shown::Depth);
        assert_eq!((grey.of(0.0), grey.of(5.0), grey.of(6.0)), (0, 65535, 65535));
        let ground = Ground::new([-3.0, 0.0, 2.0, 1.0].into());
        let grey = Grey::new(&grid, &ground, Shown::Surface);
        assert_eq!((grey.of(-3.0), grey.of(7.0), grey.of(2.0)), (0, 65535, 32768));
        let grey = Grey::new(&grid, &ground, Shown::Ground);
        assert_eq!((grey.of(-3.0), grey.of(2.0)), (0, 65535));
    }
}
