//! Heights as bytes of one format or another.

use axum::http::{HeaderName, HeaderValue};

use crate::session::Terrain;
use crate::snow::Grid;

/// A NumPy header, with what stands before it, is a multiple of this long \[bytes\].
const NPY_ALIGNMENT: usize = 64;

/// 32-bit floats, little-endian.
pub fn floats(heights: &[f64]) -> Vec<u8> {
    heights.iter().flat_map(|&height| (height as f32).to_le_bytes()).collect()
}

/// A NumPy array file of version 1.0.
pub fn npy(heights: &[f64], width: u32, depth: u32) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({depth}, {width}), }}");
    // The magic bytes, the header's length in two bytes, the header, a line feed.
    let length = (MAGIC.len() + 2 + header.len() + 1).next_multiple_of(NPY_ALIGNMENT);
    let padding = length - MAGIC.len() - 2 - header.len() - 1;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let mut file = Vec::with_capacity(length + 4 * heights.len());
    file.extend_from_slice(MAGIC);
    let stated = u16::try_from(header.len()).expect("two numbers don't fill 64 KiB");
    file.extend_from_slice(&stated.to_le_bytes());
    file.extend_from_slice(header.as_bytes());
    file.extend(heights.iter().flat_map(|&height| (height as f32).to_le_bytes()));
    file
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
    /// Covers all that a session's columns can hold, on its ground where there is one, so that
    /// images taken at different times compare.
    pub fn new(grid: &Grid, terrain: Option<&Terrain>) -> Grey {
        let ground = terrain.map_or(&[0.0][..], |terrain| &terrain.heights);
        let lowest = ground.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = ground.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let deepest = f64::from(grid.height) * grid.cell_size;
        Grey { scale: (highest - lowest + deepest) / f64::from(u16::MAX), offset: lowest }
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
    heights: &[f64],
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
    let pixels: Vec<u8> =
        heights.iter().flat_map(|&height| grey.of(height).to_be_bytes()).collect();
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_npy_header_is_aligned_and_ends_its_line() {
        for (width, depth) in [(1, 1), (10, 7), (100_000, 160), (4_294_967_295, 1)] {
            let file = npy(&[1.5], width, depth);
            let length = usize::from(u16::from_le_bytes([file[8], file[9]]));
            assert_eq!((10 + length) % NPY_ALIGNMENT, 0);
            assert_eq!(file[10 + length - 1], b'\n');
            assert_eq!(file[10 + length..], 1.5f32.to_le_bytes());
        }
    }

    #[test]
    fn greys_cover_every_height_and_no_more() {
        let grid = Grid { width: 2, depth: 2, height: 10, cell_size: 0.5 };
        let grey = Grey::new(&grid, None);
        assert_eq!((grey.of(0.0), grey.of(5.0), grey.of(6.0)), (0, 65535, 65535));
        let terrain = Terrain { heights: vec![-3.0, 0.0, 2.0, 1.0] };
        let grey = Grey::new(&grid, Some(&terrain));
        assert_eq!((grey.of(-3.0), grey.of(7.0), grey.of(2.0)), (0, 65535, 32768));
    }
}
