//! The thickness at which a cell carries what is on it, found with few looks at its hardness.
//!
//! Hardness is close to a power of density, so a few secants lead next to the thickness. Near it rounding makes
//! the answers of neighbouring thicknesses uneven. The search therefore ends with the very halvings that
//! [`thickest`] makes, and asks only for those next to the thickness: it finds the same to the quantum.

use super::press::thickest;

/// Secants at the most.
const SECANTS: u32 = 8;

/// Quanta on each side of what the secants find within which thicknesses are looked at.
const AROUND: u32 = 32;

/// Quanta at the ends of those in which the thickness must not lie: so far rounding may reach.
const MARGIN: u32 = 12;

/// The largest thickness from `least` up to below `present` at which a cell carries what is on it; `least` if it
/// never does. `strength` says how many times over it does, at a thickness; at `present`, `before` times, less than
/// once. A `root` of it is about proportional to density. Any `guess` leads to the same.
pub(super) fn thickest_near(
    least: u32,
    present: u32,
    before: f32,
    guess: Option<u32>,
    root: fn(f32) -> f32,
    strength: impl Fn(u32) -> f32,
) -> u32 {
    let holds = |thickness| strength(thickness) >= 1.0;
    let found = |thickness| root(strength(thickness));
    let Some(near) = secants(least, present, root(before), guess, found) else {
        return thickest(least, present, holds);
    };
    halvings(least, present, near, holds).unwrap_or_else(|| thickest(least, present, holds))
}

/// About the thickness at which a root of the strength is 1, if secants find it.
fn secants(
    least: u32,
    present: u32,
    before: f32,
    guess: Option<u32>,
    root: impl Fn(u32) -> f32,
) -> Option<u32> {
    let (low, high) = (least as f32, present.saturating_sub(1).max(least) as f32);
    // The root is nearly a line over 1/d.
    let (mut last, mut root_there) = (present as f32, before);
    let mut next = guess.map_or(last * before, |guess| guess as f32);
    for _ in 0..SECANTS {
        let here = next.clamp(low, high).floor();
        let found = root(here as u32);
        if here == low && found < 1.0 {
            return Some(least);
        }
        let slope = (found - root_there) / (1.0 / here - 1.0 / last);
        next = 1.0 / (1.0 / here + (1.0 - found) / slope);
        // A flat or broken line leads nowhere.
        if !(slope * (1.0 / here) > 0.25 && next > 0.0) {
            return None;
        }
        // What is left of the error is about the product of the last two.
        let steps = (next - here).abs() * ((here - last).abs() / here);
        if steps < 0.25 * AROUND as f32 {
            return Some(next.clamp(low, high) as u32);
        }
        (last, root_there) = (here, found);
    }
    None
}

/// What halvings find, if that is next to a thickness; other thicknesses are not looked at.
fn halvings(least: u32, present: u32, near: u32, holds: impl Fn(u32) -> bool) -> Option<u32> {
    let (from, to) = (near.saturating_sub(AROUND), near + AROUND);
    if least >= from && !holds(least) {
        return Some(least);
    }
    let (mut low, mut high) = (least, present);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        let thin = middle <= from || (middle < to && holds(middle));
        (low, high) = if thin { (middle, high) } else { (low, middle) };
    }
    let is_inside =
        (least >= from || low >= from + MARGIN) && (present <= to || low + MARGIN <= to);
    is_inside.then_some(low)
}
