//! Which sessions live, so that none that was deleted comes back from a damaged file.
//!
//! Removed rows lie about in the file until something is written over them, perhaps for as long as
//! the file lives. So a deleted session leaves a tombstone, which salvage honours. No age makes one
//! needless, but keys are never used twice: once there are many, a roster takes their place: the list
//! of all sessions that live. A session is deleted if its key is below the roster's end and not in the roster.

use std::collections::{BTreeMap, BTreeSet};

use super::secret::{self, Secret};
use super::{Content, Kind, Row, Write};

/// Tombstones that a roster replaces.
const MOST_TOMBSTONES: usize = 1024;

/// Key of the rows that are not a session's. The keys of sessions count from 0.
pub(super) const NOBODY: u64 = u64::MAX;

/// The row of the roster.
const ROSTER: Row = Row { session: NOBODY, kind: Kind::Roster, number: 0 };

/// All sessions that live.
#[derive(Debug, Default, PartialEq)]
struct Roster {
    /// The lowest key that none has had.
    next: u64,
    living: BTreeSet<u64>,
}

impl Roster {
    /// The next key, then those that live, little-endian.
    fn encode(&self) -> Vec<u8> {
        let keys = [self.next].into_iter().chain(self.living.iter().copied());
        keys.flat_map(u64::to_le_bytes).collect()
    }

    fn decode(bytes: &[u8]) -> Option<Roster> {
        let (keys, rest) = bytes.as_chunks::<8>();
        let (next, living) = keys.split_first().filter(|_| rest.is_empty())?;
        let living = living.iter().map(|key| u64::from_le_bytes(*key)).collect();
        Some(Roster { next: u64::from_le_bytes(*next), living })
    }
}

/// Who lives, and what the store says of it.
#[derive(Debug, Default)]
pub(super) struct Population {
    roster: Roster,
    /// Who died since the roster was written.
    tombstones: BTreeSet<u64>,
    /// Whether a roster is written.
    listed: bool,
    /// What each tombstone holds.
    secret: Secret,
}

/// What a batch does to it.
#[derive(Debug, Default)]
pub(super) struct Turn {
    /// Whether each session that is born or dies lives after the batch.
    fates: BTreeMap<u64, bool>,
    lists: bool,
}

impl Population {
    /// Who lives by the rows of a store. Takes those out that tell of nothing else.
    ///
    /// # Errors
    /// Where a secret is needed and there are no random numbers.
    pub fn of(rows: &mut BTreeMap<Row, Content>) -> Result<Population, getrandom::Error> {
        let roster = rows.remove(&ROSTER).and_then(|content| Roster::decode(&content.bytes));
        let known = secret::of(rows);
        rows.remove(&secret::ROW);
        // A roster and the secret are written together.
        let listed = roster.is_some() && known.is_some();
        let mut population = Population {
            roster: roster.unwrap_or_default(),
            listed,
            secret: known.map_or_else(secret::new, Ok)?,
            ..Self::default()
        };
        let mut living = BTreeSet::new();
        rows.retain(|row, _| {
            let somebody = row.session != NOBODY;
            if somebody {
                population.roster.next = population.roster.next.max(row.session + 1);
            }
            let dead = row.kind == Kind::Tombstone;
            if dead {
                population.tombstones.insert(row.session);
            } else if somebody {
                living.insert(row.session);
            }
            !dead
        });
        population.roster.living = living;
        Ok(population)
    }

    /// What tells of it in a file in which nothing of the dead lies about.
    pub fn rows(&mut self) -> [(Row, Vec<u8>); 2] {
        self.tombstones.clear();
        self.listed = true;
        [(ROSTER, self.roster.encode()), (secret::ROW, self.secret.to_vec())]
    }

    /// The lowest key that no session has had.
    pub fn next_key(&self) -> u64 {
        self.roster.next
    }

    /// What a batch does, and what has to be written with it.
    pub fn turn(&self, writes: &[Write]) -> (Turn, Vec<Write>) {
        let mut turn = Turn::default();
        for write in writes {
            match write {
                Write::Put(Row { session, kind: Kind::Identity, .. }, _) => {
                    turn.fates.insert(*session, true);
                }
                Write::RemoveSession(session) => drop(turn.fates.insert(*session, false)),
                _ => {}
            }
        }
        let dead = turn.fates.iter().filter(|(_, lives)| !**lives).map(|(key, _)| *key);
        let dead: Vec<u64> = dead.collect();
        turn.lists = !self.listed || self.tombstones.len() + dead.len() > MOST_TOMBSTONES;
        let mut more = Vec::new();
        if turn.lists {
            let Roster { next, living } = &self.roster;
            let mut roster = Roster { next: *next, living: living.clone() };
            roster.enter(&turn.fates);
            more.push(Write::Put(ROSTER, roster.encode()));
            more.push(Write::Put(secret::ROW, self.secret.to_vec()));
            more.extend(self.tombstones.iter().map(|key| Write::Remove(tombstone(*key))));
        }
        more.extend(dead.iter().map(|key| Write::Put(tombstone(*key), self.secret.to_vec())));
        (turn, more)
    }

    /// Enters what a batch did, once it is written.
    pub fn enter(&mut self, turn: &Turn) {
        self.roster.enter(&turn.fates);
        if turn.lists {
            self.listed = true;
            self.tombstones.clear();
        }
        for (key, lives) in &turn.fates {
            if *lives {
                self.tombstones.remove(key);
            } else {
                self.tombstones.insert(*key);
            }
        }
    }
}

impl Roster {
    fn enter(&mut self, fates: &BTreeMap<u64, bool>) {
        for (key, lives) in fates {
            // A key may come from a damaged file.
            self.next = self.next.max(key.saturating_add(1));
            if *lives {
                self.living.insert(*key);
            } else {
                self.living.remove(key);
            }
        }
    }
}

fn tombstone(session: u64) -> Row {
    Row { session, kind: Kind::Tombstone, number: 0 }
}

/// Whether a row is kept twice, on different pages: in place of one that is damaged, an older one may
/// be found, or none, and nothing would tell that something is missing.
pub(super) fn is_kept_twice(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::Anchor
            | Kind::Epochs
            | Kind::Head
            | Kind::Heartbeat
            | Kind::Tombstone
            | Kind::Roster
            | Kind::Secret
            | Kind::Points
    )
}

/// Takes the sessions out of what was found in a damaged file that were deleted. Returns the keys
/// of sessions that should be there and were not found.
///
/// A tombstone or a roster may be of a batch that was never made: then its sessions have newer rows,
/// because each start writes some of every session, and after a failure those of a batch that was not made
/// are written anew.
pub(super) fn bury(rows: &mut BTreeMap<Row, Content>) -> Vec<u64> {
    let mut newest: BTreeMap<u64, u64> = BTreeMap::new();
    let mut graves: BTreeMap<u64, u64> = BTreeMap::new();
    for (row, content) in rows.iter().filter(|(row, _)| row.session != NOBODY) {
        let tells = if row.kind == Kind::Tombstone { &mut graves } else { &mut newest };
        let batch = tells.entry(row.session).or_default();
        *batch = content.batch.max(*batch);
    }
    let roster = rows.get(&ROSTER).map(|content| (content.batch, Roster::decode(&content.bytes)));
    let (listed_in, roster) = match roster {
        Some((batch, Some(roster))) => (batch, roster),
        _ => (0, Roster::default()),
    };
    let is_dead = |key: u64, batch: u64| {
        let unlisted = key < roster.next && !roster.living.contains(&key);
        graves.get(&key).is_some_and(|grave| *grave >= batch) || unlisted && listed_in >= batch
    };
    let dead: BTreeSet<u64> =
        newest.iter().filter(|(key, batch)| is_dead(**key, **batch)).map(|(key, _)| *key).collect();
    rows.retain(|row, _| row.kind == Kind::Tombstone || !dead.contains(&row.session));
    let found = |key: &u64| newest.contains_key(key) || graves.contains_key(key);
    roster.living.into_iter().filter(|key| !found(key)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(session: u64, kind: Kind) -> Row {
        Row { session, kind, number: 0 }
    }

    fn born(session: u64) -> Write {
        Write::Put(row(session, Kind::Identity), Vec::new())
    }

    /// A store as rows: those that it holds, and all that ever were written.
    #[derive(Default)]
    struct Rows {
        batch: u64,
        population: Population,
        held: BTreeMap<Row, Content>,
        written: BTreeMap<Row, Content>,
    }

    impl Rows {
        fn commit(&mut self, writes: &[Write]) {
            self.batch += 1;
            let (turn, more) = self.population.turn(writes);
            for write in writes.iter().chain(&more) {
                match write {
                    Write::Put(row, bytes) => {
                        let content = Content { batch: self.batch, bytes: bytes.clone() };
                        self.held.insert(*row, content.clone());
                        self.written.insert(*row, content);
                    }
                    Write::Remove(row) => drop(self.held.remove(row)),
                    Write::RemoveSession(key) => self.held.retain(|row, _| row.session != *key),
                    Write::RemoveEntries { .. } | Write::RemoveOthers { .. } => {
                        unreachable!("none is written here")
                    }
                }
            }
            self.population.enter(&turn);
        }

        fn salvaged(&self, without: impl Fn(&Row) -> bool) -> (Vec<u64>, Vec<u64>) {
            let mut rows = self.written.clone();
            rows.retain(|row, _| !without(row));
            let missing = bury(&mut rows);
            let living = rows.keys().filter(|row| row.kind == Kind::Identity);
            (living.map(|row| row.session).collect(), missing)
        }
    }

    #[test]
    fn who_was_deleted_stays_dead_however_many_were() {
        let mut rows = Rows::default();
        for key in 0..3000 {
            rows.commit(&[born(key)]);
            if key % 3 != 0 {
                rows.commit(&[Write::RemoveSession(key)]);
            }
            assert!(rows.population.tombstones.len() <= MOST_TOMBSTONES);
        }
        let living: Vec<u64> = (0..3000).step_by(3).collect();
        assert_eq!(rows.salvaged(|_| false), (living.clone(), vec![]));
        // The roster is as good as what it replaced, and the other way round.
        assert_eq!(rows.salvaged(|row| row.kind == Kind::Roster), (living.clone(), vec![]));
        let old = |row: &Row| row.kind == Kind::Tombstone && row.session < 1000;
        assert_eq!(rows.salvaged(old), (living.clone(), vec![]));
        let (_, missing) = rows.salvaged(|row| row.session == 9);
        assert_eq!(missing, [9], "who should be there is missed");
        let held = &mut rows.held.clone();
        assert_eq!(Population::of(held).unwrap().next_key(), 3000, "no key is used twice");
        assert_eq!(held.len(), living.len());
    }

    #[test]
    fn a_deletion_that_was_never_made_buries_nobody() {
        let mut rows = Rows::default();
        rows.commit(&[born(0), born(1)]);
        let grave = Content { batch: rows.batch + 1, bytes: Vec::new() };
        rows.written.insert(tombstone(1), grave);
        assert_eq!(rows.salvaged(|_| false).0, [0], "it may have been made");
        rows.batch += 1;
        rows.commit(&[Write::RemoveSession(1), born(1)]);
        assert_eq!(rows.salvaged(|_| false).0, [0, 1], "it lives: something newer tells of it");
    }

    #[test]
    fn a_roster_is_read_as_it_was_written() {
        let roster = Roster { next: 9, living: BTreeSet::from([1, 8]) };
        assert_eq!(Roster::decode(&roster.encode()), Some(roster));
        assert_eq!(Roster::decode(b""), None);
        assert_eq!(Roster::decode(&[0; 12]), None);
    }
}
