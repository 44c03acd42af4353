//! Heights into bytes.

use super::bits::{push_bits, push_varint};
use super::*;

/// The bytes of a tile of `width` × `depth` samples, row by row: depths of snow in quanta, or elevations of
/// ground in tenths of a millimetre, modulo 2³².
///
/// # Panics
/// Where width or depth is not within 1 to 8, or `heights` has not as many samples as they say.
pub fn encode_tile(width: u32, depth: u32, stride: u32, heights: &[u32]) -> Vec<u8> {
    assert!((1..=SIDE).contains(&width) && (1..=SIDE).contains(&depth), "{width} × {depth}");
    assert_eq!(heights.len(), (width * depth) as usize, "samples of {width} × {depth}");
    let base = heights[0];
    let flat = [base; SIDE as usize];
    let mut rows = Vec::new();
    let mut coded = 0u8;
    let mut above = &flat[..width as usize];
    for (z, row) in heights.chunks_exact(width as usize).enumerate() {
        if row != above {
            coded |= 1 << z;
            push_row(row, above, &mut rows);
        }
        above = row;
    }
    let whole = SIDE / stride;
    let clipped = (width, depth) != (whole, whole);
    let mut out = Vec::with_capacity(rows.len() + 8);
    out.push(flags_of(&[(coded != 0, ROWS), (clipped, CLIPPED)]));
    if clipped {
        out.push((width - 1) as u8 | ((depth - 1) << 3) as u8);
    }
    push_varint(u64::from(base), &mut out);
    if coded != 0 {
        out.push(coded);
        out.extend_from_slice(&rows);
    }
    out
}

/// A row in the shortest of the ways there are.
fn push_row(row: &[u32], above: &[u32], out: &mut Vec<u8>) {
    let (mut best, mut least) = (None, usize::MAX);
    for (code, predictor) in (0u8..).zip(Predictor::ALL) {
        let mut residuals = [0; SIDE as usize];
        for (x, &height) in row.iter().enumerate() {
            let guess = predictor.guess(row, above, x);
            residuals[x] = zigzag(height.wrapping_sub(guess) as i32);
        }
        let residuals_there = &residuals[..row.len()];
        let all = residuals_there.iter().fold(0, |all, residual| all | residual);
        let width = match u32::BITS - all.leading_zeros() {
            31.. => 32,
            width => width,
        };
        let bytes = |count: usize| (count * width as usize).div_ceil(8);
        let some = residuals_there.iter().filter(|&&residual| residual != 0).count();
        for (sparse, cost) in [(false, bytes(row.len())), (true, 1 + bytes(some))] {
            if cost < least {
                least = cost;
                best = Some((code, width, sparse, residuals));
            }
        }
    }
    let (predictor, width, sparse, residuals) = best.expect("some way is the shortest");
    let residuals = &residuals[..row.len()];
    let code = (width as u8).min(WIDEST) | predictor << PREDICTOR_SHIFT;
    out.push(code | flags_of(&[(sparse, SPARSE)]));
    if sparse {
        let there = (0..residuals.len()).filter(|&x| residuals[x] != 0);
        out.push(there.fold(0, |mask, x| mask | 1 << x));
        push_bits(residuals.iter().copied().filter(|&residual| residual != 0), width, out);
    } else {
        push_bits(residuals.iter().copied(), width, out);
    }
}

/// The bytes of a message: tiles in ascending order of their places, each with its bytes from
/// [`encode_tile`] for the head's stride; tiles of ground, if any, in the same way; and the colliders as a
/// JSON array.
///
/// # Panics
/// Where the stride is not 1, 2, 4 or 8, or the places do not ascend.
pub fn encode<T: AsRef<[u8]>>(
    head: &Head,
    tiles: &[(u32, T)],
    ground: &[(u32, T)],
    colliders: Option<&[u8]>,
) -> Vec<u8> {
    assert!([1, 2, 4, 8].contains(&head.stride), "stride {}", head.stride);
    let mut out = Vec::new();
    out.push(if head.snapshot { SNAPSHOT } else { DELTA });
    let flags = [
        (head.more, MORE),
        (head.recovered.is_some(), RESUMED),
        (head.recovered == Some(true), RECOVERED),
        (colliders.is_some(), COLLIDERS),
        (!ground.is_empty(), TERRAIN),
        (head.level, LEVEL),
    ];
    let stride = (head.stride.trailing_zeros() << STRIDE_SHIFT) as u8;
    out.push(flags_of(&flags) | stride);
    push_varint(((head.id << 1) ^ (head.id >> 63)) as u64, &mut out);
    push_varint(head.seq, &mut out);
    push_varint(head.tick, &mut out);
    push_varint(u64::from(head.tiles_x), &mut out);
    push_runs(tiles, &mut out);
    if !ground.is_empty() {
        push_runs(ground, &mut out);
    }
    out.extend_from_slice(colliders.unwrap_or_default());
    out
}

fn push_runs<T: AsRef<[u8]>>(tiles: &[(u32, T)], out: &mut Vec<u8>) {
    let runs = runs(tiles);
    push_varint(runs.len() as u64, out);
    let mut next = 0;
    for run in runs {
        let (first, bytes) = &run[0];
        let skipped = first.checked_sub(next).expect("places ascend");
        push_varint(u64::from(skipped), out);
        let same = run.len() > 1 && run[1].1.as_ref() == bytes.as_ref();
        push_varint((run.len() as u64) << 1 | u64::from(same), out);
        let payloads = if same { 1 } else { run.len() };
        for (_, bytes) in &run[..payloads] {
            out.extend_from_slice(bytes.as_ref());
        }
        next = first + run.len() as u32;
    }
}

/// The flags that are set.
fn flags_of(flags: &[(bool, u8)]) -> u8 {
    flags.iter().filter(|(set, _)| *set).fold(0, |all, (_, flag)| all | flag)
}

/// Cuts tiles into runs of neighbouring places that are all equal, or each unlike the one before.
fn runs<T: AsRef<[u8]>>(tiles: &[(u32, T)]) -> Vec<&[(u32, T)]> {
    let follows = |i: usize| tiles[i].0.checked_sub(1) == Some(tiles[i - 1].0);
    let equal = |i: usize| follows(i) && tiles[i].1.as_ref() == tiles[i - 1].1.as_ref();
    let mut runs = Vec::new();
    let mut begin = 0;
    while begin < tiles.len() {
        let mut end = begin + 1;
        if end < tiles.len() && equal(end) {
            while end < tiles.len() && equal(end) {
                end += 1;
            }
        } else {
            // A tile that begins a stretch of equal ones is left to that stretch.
            let begins_equal = |i: usize| i + 1 < tiles.len() && equal(i + 1);
            while end < tiles.len() && follows(end) && !begins_equal(end) {
                end += 1;
            }
        }
        runs.push(&tiles[begin..end]);
        begin = end;
    }
    runs
}
