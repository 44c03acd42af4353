// Unsigned 64-bit integers as (low, high) pairs of 32 bits.

fn wide_multiply(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let middle = a1 * b0 + (low >> 16u);
    let cross = a0 * b1 + (middle & 0xffffu);
    return vec2((cross << 16u) | (low & 0xffffu), a1 * b1 + (middle >> 16u) + (cross >> 16u));
}

fn wide_add(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn wide_less(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

// a - b, for b <= a.
fn wide_subtract(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2(a.x - b.x, a.y - b.y - select(0u, 1u, a.x < b.x));
}

// a * b, where the product fits.
fn wide_scale(a: vec2<u32>, b: u32) -> vec2<u32> {
    let low = wide_multiply(a.x, b);
    return vec2(low.x, low.y + a.y * b);
}

// a >> 24, where the result fits 32 bits.
fn wide_shift_24(a: vec2<u32>) -> u32 {
    return (a.y << 8u) | (a.x >> 24u);
}

// a / b rounded down, where the result fits 32 bits and b is below 2^31.
fn wide_divide(a: vec2<u32>, b: u32) -> u32 {
    var remainder = a.y % b;
    var quotient = 0u;
    for (var bit = 32u; bit > 0u; bit--) {
        remainder = (remainder << 1u) | ((a.x >> (bit - 1u)) & 1u);
        quotient = quotient << 1u;
        if remainder >= b {
            remainder -= b;
            quotient |= 1u;
        }
    }
    return quotient;
}
