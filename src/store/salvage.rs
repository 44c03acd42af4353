//! What can be had of a damaged file: every row that is sound, found by its frame.

use std::collections::{BTreeMap, HashSet};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use tracing::warn;

use super::frame::{self, FIRST_MAGIC, HEAD, Head, MAGIC};
use super::secret::{LENGTH, Secret};
use super::{Content, Format, Kind, Row, roster, secret};

/// What a damaged file holds of sessions that live, the keys of those of which it holds nothing, and its
/// format.
///
/// Each session has a lock: whether it really lives nobody knows, as its tombstone may be what was
/// damaged.
pub fn salvage(bytes: &[u8]) -> (BTreeMap<Row, Content>, Vec<u64>, Format) {
    let holds_sessions =
        |rows: &BTreeMap<Row, Content>| rows.keys().any(|row| row.kind == Kind::Identity);
    let [present, first] = scan(bytes);
    let is_first = !holds_sessions(&present) && holds_sessions(&first);
    let (mut rows, format) =
        if is_first { (first, Format::First) } else { (present, Format::Present) };
    let missing = roster::bury(&mut rows);
    let identities = rows.iter().filter(|(row, _)| row.kind == Kind::Identity);
    let locks: Vec<_> = identities.map(|(row, found)| lock(row.session, found.batch)).collect();
    rows.extend(locks);
    (rows, missing, format)
}

/// Locks the sessions of a sound file of which nobody can say whether they were deleted last.
pub fn lock_doubtful(rows: &mut BTreeMap<Row, Content>, format: Format, file: &Path) {
    // An earlier version has written no tombstones.
    let Some(secret) = secret::of(rows) else { return };
    match File::open(file).and_then(|file| tombstones(format.magic(), file, &secret)) {
        Ok(graves) => {
            let doubtful = doubtful(rows, &graves);
            rows.extend(doubtful.into_iter().map(|session| lock(session, 0)));
        }
        Err(error) => warn!("{} can't be looked through: {error}", file.display()),
    }
}

/// Sessions in a sound store that were deleted by a newer batch than those that their rows are of: either
/// it was never made, or a damaged head leads to what was there before it.
fn doubtful(rows: &BTreeMap<Row, Content>, graves: &BTreeMap<u64, u64>) -> Vec<u64> {
    let is_newer = |(session, grave): (&u64, &u64)| {
        let row = |kind, number| Row { session: *session, kind, number };
        let rows = rows.range(row(Kind::Identity, 0)..=row(Kind::Format, u64::MAX));
        let newest = rows.map(|(_, content)| content.batch).max()?;
        (newest < *grave).then_some(*session)
    };
    graves.iter().filter_map(is_newer).collect()
}

/// The row that locks a session.
fn lock(session: u64, batch: u64) -> (Row, Content) {
    (Row { session, kind: Kind::Lock, number: 0 }, Content { batch, bytes: Vec::new() })
}

/// Bytes that are read of a file at a time.
const PART: u64 = 1 << 20;

/// Every tombstone with the store's secret in a file, whether the file's index leads to it or not: the newest batch that holds
/// one of each session.
///
/// # Errors
/// Those of reading.
fn tombstones(
    magic: &[u8],
    mut file: impl Read,
    secret: &Secret,
) -> io::Result<BTreeMap<u64, u64>> {
    let mut graves = BTreeMap::new();
    let mut bytes = Vec::new();
    loop {
        // One may lie across the edge.
        bytes.drain(..bytes.len().saturating_sub(HEAD + LENGTH - 1));
        if file.by_ref().take(PART).read_to_end(&mut bytes)? == 0 {
            return Ok(graves);
        }
        let mut at = 0;
        while let Some(next) = find(magic, &bytes[at..]) {
            at += next;
            let kind = bytes.get(at + magic.len() + 8);
            if kind == Some(&(Kind::Tombstone as u8))
                && let Some((row, content)) = frame::open(magic, &bytes[at..])
                && content.bytes == secret
            {
                let batch = graves.entry(row.session).or_default();
                *batch = content.batch.max(*batch);
            }
            at += 1;
        }
    }
}

/// Looks in a file for whole rows with some heads, and takes those out that are there.
///
/// # Errors
/// Those of reading.
pub fn find_all(magic: &[u8], mut file: impl Read, heads: &mut HashSet<Head>) -> io::Result<()> {
    let mut bytes = Vec::new();
    loop {
        // A head may lie across the edge.
        bytes.drain(..bytes.len().saturating_sub(HEAD - 1));
        if file.by_ref().take(PART).read_to_end(&mut bytes)? == 0 {
            return Ok(());
        }
        let mut at = 0;
        while let Some(next) = find(magic, &bytes[at..]) {
            at += next;
            let head = bytes[at..].first_chunk().filter(|head| heads.contains(*head)).copied();
            if let Some(head) = head {
                let whole = at + HEAD + frame::length(&head);
                let more = whole.saturating_sub(bytes.len()) as u64;
                file.by_ref().take(more).read_to_end(&mut bytes)?;
                if frame::open(magic, &bytes[at..]).is_some() {
                    heads.remove(&head);
                }
            }
            at += 1;
        }
    }
}

/// All sound rows in some bytes, of each the one that was written last: those of the present format, and of
/// the first.
///
/// Rows that were removed may be among them: their bytes lie about until they are written over.
fn scan(bytes: &[u8]) -> [BTreeMap<Row, Content>; 2] {
    let mut found: [BTreeMap<Row, Content>; 2] = Default::default();
    let mut at = 0;
    while let Some(next) = find(COMMON_MAGIC, &bytes[at..]) {
        at += next;
        let sound = [MAGIC, FIRST_MAGIC].map(|magic| frame::open(magic, &bytes[at..]));
        let Some((rows, (row, content))) =
            found.iter_mut().zip(sound).find_map(|(rows, sound)| Some((rows, sound?)))
        else {
            at += 1;
            continue;
        };
        // What is inside a sound row may have come from a client, and look like other rows.
        at += HEAD + content.bytes.len();
        if rows.get(&row).is_none_or(|known| known.batch < content.batch) {
            rows.insert(row, content);
        }
    }
    found
}

/// What rows of all formats begin with.
const COMMON_MAGIC: &[u8] = b"FIRNROW";

/// Where the next frame may begin.
fn find(magic: &[u8], bytes: &[u8]) -> Option<usize> {
    let mut from = 0;
    loop {
        from += bytes[from..].iter().position(|&byte| byte == magic[0])?;
        if bytes[from..].starts_with(magic) {
            return Some(from);
        }
        from += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tombstones_are_found_wherever_they_lie() {
        let secret = [7; LENGTH];
        let sealed = |session, batch, secret: &[u8]| {
            frame::seal(&Row { session, kind: Kind::Tombstone, number: 0 }, batch, secret)
        };
        let grave = |session, batch| sealed(session, batch, &secret);
        let mut bytes = vec![b'F'; 3 * PART as usize];
        for (session, place) in
            [0, 7, PART as usize - 20, 2 * PART as usize - 60].into_iter().enumerate()
        {
            let place = place + session * (HEAD + LENGTH);
            bytes[place..place + HEAD + LENGTH].copy_from_slice(&grave(session as u64, 9));
        }
        bytes.extend(grave(1, 12));
        // Clients may send such, and don't know the secret.
        bytes.extend(sealed(2, 13, b""));
        bytes.extend(sealed(3, 13, &[8; LENGTH]));
        let found = tombstones(MAGIC, &bytes[..], &secret).unwrap();
        assert_eq!(found, BTreeMap::from([(0, 9), (1, 12), (2, 9), (3, 9)]));
    }

    #[test]
    fn rows_are_looked_for_wherever_they_lie_and_only_whole_ones_count() {
        let sealed = |number, length: usize| {
            frame::seal(&Row { session: 1, kind: Kind::Checkpoint, number }, 7, &vec![b'F'; length])
        };
        let large = 2 * PART as usize;
        let rows = [sealed(1, 9), sealed(2, large), sealed(3, 0), sealed(4, large), sealed(5, 9)];
        let mut bytes = vec![b'F'; PART as usize - 20];
        rows[..4].iter().for_each(|row| bytes.extend(row));
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        let mut heads: HashSet<Head> = rows.iter().map(|row| *row.first_chunk().unwrap()).collect();
        find_all(MAGIC, &bytes[..], &mut heads).unwrap();
        let mut left: Vec<u64> =
            heads.iter().map(|head| frame::row(head).unwrap().number).collect();
        left.sort_unstable();
        assert_eq!(left, [4, 5]);
    }

    #[test]
    fn sound_rows_are_found_among_rubbish_and_the_newest_wins() {
        let row = |number| Row { session: 1, kind: Kind::Entry, number };
        let mut bytes = b"FIRNRO FIRNROW2 rubbish".to_vec();
        bytes.extend(frame::seal(&row(1), 5, b"new"));
        bytes.extend(frame::seal(&row(1), 4, b"old"));
        let mut damaged = frame::seal(&row(2), 6, b"damaged");
        damaged[55] ^= 1;
        bytes.extend(damaged);
        bytes.extend(frame::seal(&row(3), 6, b"whole"));
        bytes.extend(&frame::seal(&row(4), 6, b"cut short")[..58]);
        let found: Vec<(u64, Vec<u8>)> = scan(&bytes)[0]
            .clone()
            .into_iter()
            .map(|(row, content)| (row.number, content.bytes))
            .collect();
        assert_eq!(found, [(1, b"new".to_vec()), (3, b"whole".to_vec())]);
    }

    #[test]
    fn a_row_inside_a_sound_row_is_not_found_whatever_the_formats() {
        let row = |session, kind| Row { session, kind, number: 0 };
        let first = |sealed: Vec<u8>| {
            let (row, content) = frame::open(MAGIC, &sealed).unwrap();
            frame::seal_as(FIRST_MAGIC, &row, content.batch, &content.bytes)
        };
        let planted = frame::seal(&row(1, Kind::Identity), u64::MAX, b"");
        for planted in [planted.clone(), first(planted)] {
            let sent = [b"a snapshot with ", &planted[..], b" in it"].concat();
            let origin = frame::seal(&row(2, Kind::Origin), 5, &sent);
            let identity = frame::seal(&row(1, Kind::Identity), 5, b"the next one");
            let rows = [row(1, Kind::Identity), row(2, Kind::Origin)];
            let found = scan(&[&origin[..], &identity].concat()).map(BTreeMap::into_keys);
            assert_eq!(found.map(Vec::from_iter), [rows.to_vec(), Vec::new()]);
            let found = scan(&[first(origin), first(identity)].concat()).map(BTreeMap::into_keys);
            assert_eq!(found.map(Vec::from_iter), [Vec::new(), rows.to_vec()]);
        }
    }
}
