//! Sets of columns, row by row.

use std::collections::BTreeMap;

use super::footprint::Footprint;
use super::grid::ColumnRect;

/// Columns `[x0, x1)` of a row.
type Span = (u32, u32);

/// A set of columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnSet {
    /// Spans of each row along z, in order, with gaps between them.
    rows: BTreeMap<u32, Vec<Span>>,
}

impl ColumnSet {
    /// The columns under some footprints.
    pub fn under(footprints: &[Footprint]) -> ColumnSet {
        let mut set = ColumnSet::default();
        for footprint in footprints {
            (footprint.z0..).zip(&footprint.spans).for_each(|(z, &span)| set.add(z, span));
        }
        set
    }

    /// Adds a span of a row.
    pub fn add(&mut self, z: u32, span: Span) {
        let (mut x0, mut x1) = span;
        if x0 >= x1 {
            return;
        }
        let row = self.rows.entry(z).or_default();
        // Those that touch it become one with it.
        let first = row.partition_point(|old| old.1 < x0);
        let end = row.partition_point(|old| old.0 <= x1);
        for old in row.drain(first..end) {
            (x0, x1) = (x0.min(old.0), x1.max(old.1));
        }
        row.insert(first, (x0, x1));
    }

    /// Adds the columns of another set.
    pub fn join(&mut self, other: &ColumnSet) {
        other.spans().for_each(|(z, span)| self.add(z, span));
    }

    /// The columns that are not in another set.
    pub fn without(&self, other: &ColumnSet) -> ColumnSet {
        let mut left = ColumnSet::default();
        for (z, (mut x0, x1)) in self.spans() {
            for &(from, to) in other.rows.get(&z).into_iter().flatten() {
                if to > x0 && from < x1 {
                    left.add(z, (x0, from));
                    x0 = to;
                }
            }
            left.add(z, (x0, x1));
        }
        left
    }

    /// The columns that lie in a rectangle.
    pub fn within(&self, rect: &ColumnRect) -> ColumnSet {
        let mut inside = ColumnSet::default();
        for (&z, spans) in self.rows.range(rect.z0..rect.z1.max(rect.z0)) {
            for &(x0, x1) in spans {
                inside.add(z, (x0.max(rect.x0), x1.min(rect.x1)));
            }
        }
        inside
    }

    /// How many they are.
    pub fn count(&self) -> u64 {
        self.spans().map(|(_, (x0, x1))| u64::from(x1 - x0)).sum()
    }

    /// The columns as rectangles that do not overlap: rows that are alike are in one.
    pub fn rects(&self) -> Vec<ColumnRect> {
        let mut done: Vec<ColumnRect> = Vec::new();
        // Rectangles that may go on in the next row, by their columns.
        let mut open: BTreeMap<Span, ColumnRect> = BTreeMap::new();
        for (&z, spans) in &self.rows {
            let mut next = BTreeMap::new();
            for &(x0, x1) in spans {
                let z0 = match open.remove(&(x0, x1)) {
                    Some(below) if below.z1 == z => below.z0,
                    other => {
                        done.extend(other);
                        z
                    }
                };
                next.insert((x0, x1), ColumnRect { x0, z0, x1, z1: z + 1 });
            }
            done.extend(open.into_values());
            open = next;
        }
        done.extend(open.into_values());
        done
    }

    fn spans(&self) -> impl Iterator<Item = (u32, Span)> + '_ {
        self.rows.iter().flat_map(|(&z, spans)| spans.iter().map(move |&span| (z, span)))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    type Columns = BTreeSet<(u32, u32)>;

    fn columns(set: &ColumnSet) -> Columns {
        let spans = set.rects().into_iter();
        let all: Vec<(u32, u32)> = spans
            .flat_map(|it| (it.z0..it.z1).flat_map(move |z| (it.x0..it.x1).map(move |x| (x, z))))
            .collect();
        assert_eq!(all.len() as u64, set.count(), "no column is in two rectangles");
        all.into_iter().collect()
    }

    /// Pseudo-random numbers below a bound.
    fn dice() -> impl FnMut(u32) -> u32 {
        let mut state = 7u64;
        move |below| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as u32 % below
        }
    }

    #[test]
    fn it_is_the_set_of_its_columns() {
        let mut dice = dice();
        for _ in 0..300 {
            let mut sets = [ColumnSet::default(), ColumnSet::default()];
            let mut models = [Columns::new(), Columns::new()];
            for (set, model) in sets.iter_mut().zip(&mut models) {
                for _ in 0..dice(12) {
                    let (z, x0) = (dice(4), dice(12));
                    let x1 = x0 + dice(5);
                    set.add(z, (x0, x1));
                    model.extend((x0..x1).map(|x| (x, z)));
                }
                assert_eq!(columns(set), *model);
            }
            let [mut one, other] = sets;
            let (x0, z0) = (dice(12), dice(4));
            let rect = ColumnRect { x0, z0, x1: x0 + dice(6), z1: z0 + dice(3) };
            let inside = models[0].iter().filter(|(x, z)| rect.contains(*x, *z)).copied();
            assert_eq!(columns(&one.within(&rect)), inside.collect());
            assert_eq!(columns(&one.without(&other)), &models[0] - &models[1]);
            one.join(&other);
            assert_eq!(columns(&one), &models[0] | &models[1]);
        }
    }
}
