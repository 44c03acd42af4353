//! Bytes into heights. Takes any bytes: what is no message is an error, and costs no more memory
//! than a small multiple of its length.

use super::bits::Reader;
use super::*;

/// What is wrong with a message, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("byte {at}: {what}")]
pub struct DecodeError {
    /// Offset of the byte in the message.
    pub at: usize,
    /// What is wrong.
    pub what: &'static str,
}

/// Reads a message.
///
/// # Errors
/// Where the bytes are not a message of this version. The colliders are checked to be UTF-8, not
/// to be JSON.
pub fn decode(bytes: &[u8]) -> Result<HeightMessage, DecodeError> {
    let mut reader = Reader::new(bytes);
    let (head, flags) = head(&mut reader)?;
    let told = runs(&mut reader, head.stride)?;
    let tells_ground = flags & TERRAIN != 0;
    let terrain = if tells_ground { runs(&mut reader, head.stride)? } else { Vec::new() };
    let rest = reader.rest();
    let colliders = match (flags & COLLIDERS != 0, std::str::from_utf8(rest)) {
        (true, Ok(text)) => Some(text.to_owned()),
        (true, Err(_)) => return Err(reader.wrong("the colliders are not UTF-8")),
        (false, _) if rest.is_empty() => None,
        (false, _) => return Err(reader.wrong("there are bytes after the last tile")),
    };
    Ok(HeightMessage { head, runs: told, terrain, colliders })
}

/// Reads what begins a message, and its flags.
fn head(reader: &mut Reader) -> Result<(Head, u8), DecodeError> {
    let snapshot = match reader.byte()? {
        SNAPSHOT => true,
        DELTA => false,
        _ => return Err(reader.wrong("neither 1, a snapshot, nor 2, a delta")),
    };
    let flags = reader.byte()?;
    let is = |flag| flags & flag != 0;
    if is(RECOVERED) && !is(RESUMED) {
        return Err(reader.wrong("these flags have no meaning"));
    }
    let id = reader.varint()?;
    let head = Head {
        snapshot,
        id: (id >> 1) as i64 ^ -((id & 1) as i64),
        seq: reader.varint()?,
        tick: reader.varint()?,
        recovered: is(RESUMED).then_some(is(RECOVERED)),
        more: is(MORE),
        level: is(LEVEL),
        stride: 1 << ((flags & STRIDE_BITS) >> STRIDE_SHIFT),
        tiles_x: reader.varint_u32()?,
    };
    if head.tiles_x == 0 {
        return Err(reader.wrong("a grid has at least one tile in a row"));
    }
    Ok((head, flags))
}

/// Reads tiles, of snow or of ground.
fn runs(reader: &mut Reader, stride: u32) -> Result<Vec<Run>, DecodeError> {
    let count = reader.varint()?;
    let mut runs = Vec::new();
    let mut next = 0;
    for _ in 0..count {
        next = run(reader, stride, next, &mut runs)?;
    }
    Ok(runs)
}

/// Reads tiles of neighbouring places; returns the place after them.
fn run(
    reader: &mut Reader,
    stride: u32,
    next: u32,
    runs: &mut Vec<Run>,
) -> Result<u32, DecodeError> {
    let beyond = "a tile's place has more than 32 bits";
    let skipped = reader.varint_u32()?;
    let first = next.checked_add(skipped).ok_or_else(|| reader.wrong(beyond))?;
    let code = reader.varint()?;
    let count = u32::try_from(code >> 1).map_err(|_| reader.wrong(beyond))?;
    let end = first.checked_add(count).ok_or_else(|| reader.wrong(beyond))?;
    if count == 0 {
        return Err(reader.wrong("a run has at least one tile"));
    }
    if code & 1 != 0 {
        runs.push(Run { first, count, tile: tile(reader, stride)? });
    } else {
        for place in first..end {
            runs.push(Run { first: place, count: 1, tile: tile(reader, stride)? });
        }
    }
    Ok(end)
}

fn tile(reader: &mut Reader, stride: u32) -> Result<Tile, DecodeError> {
    let flags = reader.byte()?;
    if flags & !(ROWS | CLIPPED) != 0 {
        return Err(reader.wrong("these flags of a tile have no meaning"));
    }
    let (width, depth) = if flags & CLIPPED != 0 {
        let size = u32::from(reader.byte()?);
        if size >= SIDE * SIDE {
            return Err(reader.wrong("a tile has at most 8 samples along a side"));
        }
        (size % SIDE + 1, size / SIDE + 1)
    } else {
        (SIDE / stride, SIDE / stride)
    };
    let base = reader.varint_u32()?;
    let mut heights = vec![base; (width * depth) as usize];
    if flags & ROWS == 0 {
        return Ok(Tile { width, depth, heights });
    }
    let coded = reader.byte()?;
    if u32::from(coded) >> depth != 0 {
        return Err(reader.wrong("a row is beyond the tile"));
    }
    let flat = [base; SIDE as usize];
    let width_here = width as usize;
    for z in 0..depth as usize {
        let (before, rest) = heights.split_at_mut(z * width_here);
        let above = if z == 0 { &flat[..width_here] } else { &before[(z - 1) * width_here..] };
        let row = &mut rest[..width_here];
        if coded & 1 << z == 0 {
            row.copy_from_slice(above);
        } else {
            read_row(reader, above, row)?;
        }
    }
    Ok(Tile { width, depth, heights })
}

fn read_row(reader: &mut Reader, above: &[u32], row: &mut [u32]) -> Result<(), DecodeError> {
    let code = reader.byte()?;
    let width = match code & WIDTH_BITS {
        WIDEST => 32,
        width => u32::from(width),
    };
    let predictor = Predictor::ALL
        .get(usize::from((code & !SPARSE) >> PREDICTOR_SHIFT))
        .ok_or_else(|| reader.wrong("there is no such predictor"))?;
    let all = (1u32 << row.len()) - 1;
    let there = if code & SPARSE != 0 { u32::from(reader.byte()?) } else { all };
    if there & !all != 0 {
        return Err(reader.wrong("a residual is beyond the row"));
    }
    let mut residuals = reader.bits(width, there.count_ones() as usize)?;
    for x in 0..row.len() {
        let residual = if there & 1 << x == 0 { 0 } else { residuals.next().expect("counted") };
        row[x] = predictor.guess(row, above, x).wrapping_add_signed(unzigzag(residual));
    }
    Ok(())
}
