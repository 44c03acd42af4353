//! Events that a client has still to be told: one of each kind, however many there were. No I/O.

use firn_protocol::{Event, EventKind};

use crate::session::Happening;

/// Events that a client has still to be told, in the order of their seqs.
#[derive(Debug, Default)]
pub struct Waiting(Vec<Happening>);

impl Waiting {
    /// Adds the newest, which takes the place of one of its kind; masses add up.
    pub fn add(&mut self, mut newest: Happening) {
        let kind = newest.event.kind();
        if kind == Some(EventKind::Reset) {
            // What fell and settled before is gone.
            self.keep(|before| before.event.kind() == Some(EventKind::Settings));
        }
        if let Some(place) = self.0.iter().position(|before| before.event.kind() == kind) {
            join(&self.0.remove(place), &mut newest);
        }
        self.0.push(newest);
    }

    /// Drops all but some.
    pub fn keep(&mut self, wanted: impl Fn(&Happening) -> bool) {
        self.0.retain(wanted);
    }

    /// Takes some out.
    pub fn take(&mut self, wanted: impl Fn(&Happening) -> bool) -> Vec<Event> {
        let taken = self.0.extract_if(.., |happening| wanted(happening));
        taken.map(|happening| happening.event).collect()
    }
}

/// Makes the newer of two events of a kind stand for both.
fn join(before: &Happening, newest: &mut Happening) {
    match (&before.event, &mut newest.event) {
        (
            Event::Snowfall { fallen_mass: fallen, refused_mass: refused, .. },
            Event::Snowfall { fallen_mass, refused_mass, .. },
        ) => {
            *fallen_mass += fallen;
            *refused_mass += refused;
        }
        (Event::Clearing { cleared_mass: cleared, .. }, Event::Clearing { cleared_mass, .. }) => {
            *cleared_mass += cleared;
        }
        _ => {}
    }
    newest.columns = newest.columns.zip(before.columns).map(|(a, b)| a.hull(&b));
}

#[cfg(test)]
mod tests {
    use firn_protocol::Stamp;
    use firn_snow::ColumnRect;

    use super::*;

    fn stamp(seq: u64) -> Stamp {
        Stamp { tick: 0, seq }
    }

    fn settled(seq: u64) -> Happening {
        Event::Settled { stamp: stamp(seq) }.into()
    }

    fn reset(seq: u64) -> Happening {
        Event::Reset { stamp: stamp(seq) }.into()
    }

    fn snowfall(seq: u64, fallen_mass: f64, x0: u32) -> Happening {
        let event = Event::Snowfall { stamp: stamp(seq), fallen_mass, refused_mass: 0.5 };
        Happening { event, columns: Some(ColumnRect { x0, z0: x0, x1: x0 + 4, z1: x0 + 4 }) }
    }

    fn clearing(seq: u64, cleared_mass: f64) -> Happening {
        Event::Clearing { stamp: stamp(seq), cleared_mass }.into()
    }

    fn waiting(happened: &[Happening]) -> Waiting {
        let mut waiting = Waiting::default();
        happened.iter().cloned().for_each(|happening| waiting.add(happening));
        waiting
    }

    fn all(happened: &[Happening]) -> Vec<Event> {
        waiting(happened).take(|_| true)
    }

    #[test]
    fn one_of_each_kind_waits_with_the_sum_of_its_masses() {
        let happened =
            [snowfall(3, 1.0, 0), clearing(4, 8.0), snowfall(5, 2.0, 0), clearing(6, 2.0)];
        let fallen = Event::Snowfall { stamp: stamp(5), fallen_mass: 3.0, refused_mass: 1.0 };
        let cleared = Event::Clearing { stamp: stamp(6), cleared_mass: 10.0 };
        assert_eq!(all(&happened), [fallen, cleared]);
    }

    #[test]
    fn the_last_of_what_happened_is_the_last_that_is_told() {
        let settles = all(&[settled(3), snowfall(4, 1.0, 0), settled(5)]);
        let seqs: Vec<_> = settles.iter().map(|event| event.stamp().seq).collect();
        assert_eq!(seqs, [4, 5]);
        assert_eq!(settles[1].kind(), Some(EventKind::Settled));
        let moves = all(&[snowfall(3, 1.0, 0), settled(4), snowfall(5, 1.0, 0)]);
        assert_eq!(moves[1].kind(), Some(EventKind::Snowfall));
    }

    #[test]
    fn a_reset_ends_what_was_before_it() {
        let told = all(&[snowfall(3, 9.0, 0), settled(4), reset(5), snowfall(6, 1.0, 0)]);
        let fallen = Event::Snowfall { stamp: stamp(6), fallen_mass: 1.0, refused_mass: 0.5 };
        assert_eq!(told, [Event::Reset { stamp: stamp(5) }, fallen]);
    }

    #[test]
    fn what_is_joined_happened_in_both_places() {
        let mut waiting = waiting(&[snowfall(3, 1.0, 0), snowfall(4, 1.0, 16)]);
        let meets = |x, z| move |happening: &Happening| happening.columns.unwrap().contains(x, z);
        assert_eq!(waiting.take(meets(20, 0)), []);
        waiting.keep(meets(19, 19));
        assert_eq!(waiting.take(meets(0, 0)).len(), 1);
        assert_eq!(waiting.take(|_| true), []);
    }
}
