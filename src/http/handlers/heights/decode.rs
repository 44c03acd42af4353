//! Heights of all columns, read from bytes of one format or another.

use firn_snow::Grid;

use crate::problem::{FieldError, Problem};

/// Metres of a grey value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GreyScale {
    /// Metres per step.
    pub scale: f64,
    /// Metres at 0.
    pub offset: f64,
}

/// 32-bit floats, little-endian, row by row.
///
/// # Errors
/// 422 where the bytes are not so many floats.
pub fn floats(bytes: &[u8], grid: &Grid) -> Result<Vec<f64>, Problem> {
    let (floats, rest) = bytes.as_chunks::<4>();
    if floats.len() as u64 != grid.columns() || !rest.is_empty() {
        let Grid { width, depth, .. } = grid;
        let wanted = 4 * grid.columns();
        return Err(refused(format!(
            "{} bytes; {width} × {depth} columns take {wanted}, a 32-bit float for each",
            bytes.len()
        )));
    }
    Ok(floats.iter().map(|float| f32::from_le_bytes(*float).into()).collect())
}

/// A NumPy array file of 32-bit or 64-bit floats, little-endian, in C order.
///
/// # Errors
/// 422 where it is another file, or another array.
pub fn npy(bytes: &[u8], grid: &Grid) -> Result<Vec<f64>, Problem> {
    let (header, data) = npy_header(bytes)
        .ok_or_else(|| refused("it is not a NumPy array file of version 1 or 2".to_owned()))?;
    let spaceless: String = header.chars().filter(|c| !c.is_whitespace()).collect();
    let shape = format!("'shape':({},{})", grid.depth, grid.width);
    if !spaceless.contains(&shape) || !spaceless.contains("'fortran_order':False") {
        let (width, depth) = (grid.width, grid.depth);
        let detail =
            format!("expected an array of shape ({depth}, {width}) in C order, found {header}");
        return Err(refused(detail));
    }
    if spaceless.contains("'descr':'<f4'") {
        return floats(data, grid);
    }
    if !spaceless.contains("'descr':'<f8'") {
        return Err(refused(format!("expected elements '<f4' or '<f8', found {header}")));
    }
    let (floats, rest) = data.as_chunks::<8>();
    if floats.len() as u64 != grid.columns() || !rest.is_empty() {
        return Err(refused(format!("the array has {} bytes of data", data.len())));
    }
    Ok(floats.iter().map(|float| f64::from_le_bytes(*float)).collect())
}

/// What stands before the numbers of a NumPy file, and the numbers.
fn npy_header(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let ([major, _minor], rest) = rest.split_first_chunk()?;
    let (length, rest) = match major {
        1 => {
            let (length, rest) = rest.split_first_chunk()?;
            (u16::from_le_bytes(*length).into(), rest)
        }
        2 => {
            let (length, rest) = rest.split_first_chunk()?;
            (u32::from_le_bytes(*length), rest)
        }
        _ => return None,
    };
    let (header, data) = rest.split_at_checked(length as usize)?;
    Some((str::from_utf8(header).ok()?.trim_end(), data))
}

/// A grey image of 8 or 16 bits, a pixel for each column.
///
/// # Errors
/// 422 where it is another image, or of another size.
pub fn png(bytes: &[u8], grid: &Grid, grey: GreyScale) -> Result<Vec<f64>, Problem> {
    let unreadable =
        |error: png::DecodingError| refused(format!("the image can't be read: {error}"));
    let mut reader =
        png::Decoder::new(std::io::Cursor::new(bytes)).read_info().map_err(unreadable)?;
    let (width, height) = (reader.info().width, reader.info().height);
    let (color, depth) = (reader.info().color_type, reader.info().bit_depth);
    if (width, height) != (grid.width, grid.depth) {
        return Err(refused(format!(
            "the image has {width} × {height} pixels; the grid has {} × {} columns",
            grid.width, grid.depth
        )));
    }
    let step = match (color, depth) {
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => 2,
        (png::ColorType::Grayscale, png::BitDepth::Eight) => 1,
        _ => {
            return Err(refused(format!(
                "expected a grey image of 8 or 16 bits without transparency, found {color:?}, {depth:?}"
            )));
        }
    };
    let mut heights = Vec::with_capacity(grid.columns() as usize);
    while let Some(row) = reader.next_row().map_err(unreadable)? {
        heights.extend(row.data().chunks_exact(step).map(|pixel| {
            let value = pixel.iter().fold(0u16, |value, byte| value << 8 | u16::from(*byte));
            f64::from(value) * grey.scale + grey.offset
        }));
    }
    Ok(heights)
}

fn refused(detail: String) -> Problem {
    Problem::invalid(vec![FieldError { pointer: String::new(), detail }])
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { width: 3, depth: 2, height: 1, cell_size: 1.0 };

    #[test]
    fn arrays_of_another_kind_are_refused() {
        let file = |version: u8, header: &str, data: &[u8]| {
            let length = (header.len() as u16).to_le_bytes();
            [b"\x93NUMPY", &[version, 0][..], &length, header.as_bytes(), data].concat()
        };
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n";
        let data: Vec<u8> = (0..6).flat_map(|i| f64::from(i).to_le_bytes()).collect();
        assert_eq!(npy(&file(1, header, &data), &GRID).unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(npy(&file(3, header, &data), &GRID).is_err());
        assert!(npy(&file(1, header, &data[1..]), &GRID).is_err());
        for (wrong, by) in
            [("<f8", "<i8"), ("False", "True"), ("(2, 3)", "(3, 2)"), ("3)", "3, 1)")]
        {
            assert!(npy(&file(1, &header.replace(wrong, by), &data), &GRID).is_err(), "{by}");
        }
        assert!(npy(b"\x93NUMPY\x01\x00\xff\xff", &GRID).is_err());
    }
}
