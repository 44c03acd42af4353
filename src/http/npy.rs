//! NumPy array files, version 1.0.

/// Their media type.
pub const MEDIA_TYPE: &str = "application/x-npy";

/// A header, with what stands before it, is a multiple of this long \[bytes\].
const ALIGNMENT: usize = 64;

/// What stands before 32-bit floats, little-endian, of a number of rows and columns, row by row.
pub fn header(rows: usize, columns: usize) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
    let mut text =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // The magic bytes, the text's length in two bytes, the text, a line feed.
    let length = (MAGIC.len() + 2 + text.len() + 1).next_multiple_of(ALIGNMENT);
    let padding = length - MAGIC.len() - 2 - text.len() - 1;
    text.extend(std::iter::repeat_n(' ', padding));
    text.push('\n');
    let stated = u16::try_from(text.len()).expect("two numbers don't fill 64 KiB");
    [MAGIC, &stated.to_le_bytes(), text.as_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_aligned_and_ends_its_line() {
        for (rows, columns) in [(1, 1), (7, 10), (160, 100_000), (1, 4_294_967_295)] {
            let header = header(rows, columns);
            let length = usize::from(u16::from_le_bytes([header[8], header[9]]));
            assert_eq!((header.len() % ALIGNMENT, header.len()), (0, 10 + length));
            assert_eq!(header.last(), Some(&b'\n'));
        }
    }
}
