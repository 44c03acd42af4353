//! A row as bytes that can be checked, and found again in a damaged file without its index.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `FIRNROW2`; `FIRNROW1` in the first format |
//! | 17 | the row's name: session, kind, number, big-endian |
//! | 8 | number of the batch, little-endian |
//! | 4 | length of the content, little-endian |
//! | 16 | the first half of the BLAKE3 hash of name, batch, length and content |
//! | length | the content |

use super::{Content, Kind, Row};

/// What every framed row begins with.
pub const MAGIC: &[u8; 8] = b"FIRNROW2";

/// The same in the first format.
pub const FIRST_MAGIC: &[u8; 8] = b"FIRNROW1";

/// Bytes of a row's name.
pub const NAME: usize = 17;

const CHECKED: usize = 8 + NAME + 8 + 4;

/// Bytes of a frame before its content.
pub const HEAD: usize = CHECKED + 16;

/// A frame before its content.
pub type Head = [u8; HEAD];

impl Row {
    /// Its name: rows are ordered as their names are.
    pub fn name(&self) -> [u8; NAME] {
        let mut name = [0; NAME];
        name[..8].copy_from_slice(&self.session.to_be_bytes());
        name[8] = self.kind as u8;
        name[9..].copy_from_slice(&self.number.to_be_bytes());
        name
    }

    /// The row of a name; `None` for what no version has written.
    pub fn named(name: &[u8]) -> Option<Row> {
        let (session, rest) = name.split_first_chunk::<8>()?;
        let (&kind, number) = rest.split_first()?;
        let kinds = [
            Kind::Identity,
            Kind::Origin,
            Kind::Checkpoint,
            Kind::Entry,
            Kind::Mark,
            Kind::Answer,
            Kind::Heartbeat,
            Kind::Tombstone,
            Kind::Roster,
            Kind::Lock,
            Kind::Clock,
            Kind::Secret,
            Kind::Anchor,
            Kind::Epochs,
            Kind::Head,
            Kind::Format,
            Kind::Points,
            Kind::Point,
        ];
        Some(Row {
            session: u64::from_be_bytes(*session),
            kind: kinds.into_iter().find(|&known| known as u8 == kind)?,
            number: u64::from_be_bytes(number.try_into().ok()?),
        })
    }
}

/// A row as it is written.
pub fn seal(row: &Row, batch: u64, content: &[u8]) -> Vec<u8> {
    seal_as(MAGIC, row, batch, content)
}

/// A row as it is written in a format.
pub fn seal_as(magic: &[u8; 8], row: &Row, batch: u64, content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEAD + content.len());
    bytes.extend(magic);
    bytes.extend(row.name());
    bytes.extend(batch.to_le_bytes());
    // Contents are far below 4 GiB: a longer one would not be found whole again.
    bytes.extend((content.len() as u32).to_le_bytes());
    let sum = checksum(&bytes, content);
    bytes.extend(sum);
    bytes.extend(content);
    bytes
}

/// Reads the row that some bytes begin with, where it is whole and sound; `magic` tells its format.
pub fn open(magic: &[u8], bytes: &[u8]) -> Option<(Row, Content)> {
    let (head, rest) = bytes.split_at_checked(HEAD)?;
    let (checked, sum) = head.split_at(CHECKED);
    if !checked.starts_with(magic) {
        return None;
    }
    let row = Row::named(&checked[8..8 + NAME])?;
    let number = |at: usize| u64::from_le_bytes(checked[at..at + 8].try_into().expect("8 bytes"));
    let batch = number(8 + NAME);
    let content = rest.get(..length(head.first_chunk()?))?;
    let sound = checksum(checked, content) == sum;
    sound.then(|| (row, Content { batch, bytes: content.to_vec() }))
}

/// Bytes of the content behind a head.
pub fn length(head: &Head) -> usize {
    let length = head[CHECKED - 4..CHECKED].try_into().expect("4 bytes");
    u32::from_le_bytes(length) as usize
}

/// The row that a head says it is of.
pub fn row(head: &Head) -> Option<Row> {
    Row::named(&head[8..8 + NAME])
}

fn checksum(head: &[u8], content: &[u8]) -> [u8; 16] {
    let hash = blake3::Hasher::new().update(head).update(content).finalize();
    let mut half = [0; 16];
    half.copy_from_slice(&hash.as_bytes()[..16]);
    half
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROW: Row = Row { session: 7, kind: Kind::Entry, number: 258 };

    #[test]
    fn what_was_sealed_is_opened_again() {
        for content in [&b""[..], b"snow", &[0xff; 5000]] {
            let mut bytes = seal(&ROW, 9, content);
            bytes.extend(b"whatever follows");
            let (row, opened) = open(MAGIC, &bytes).unwrap();
            assert_eq!((row, opened.batch, &opened.bytes[..]), (ROW, 9, content));
        }
    }

    #[test]
    fn no_flipped_bit_and_no_cut_goes_unnoticed() {
        let bytes = seal(&ROW, 9, b"snow");
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(open(MAGIC, &flipped), None, "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert_eq!(open(MAGIC, &bytes[..length]), None, "{length} bytes");
        }
    }

    #[test]
    fn rows_are_ordered_as_their_names() {
        let row = |session, kind, number| Row { session, kind, number };
        let rows = [
            row(1, Kind::Answer, 0),
            row(2, Kind::Entry, 255),
            row(2, Kind::Entry, 256),
            row(2, Kind::Mark, 0),
            row(256, Kind::Identity, 0),
            row(u64::MAX, Kind::Heartbeat, 0),
            row(u64::MAX, Kind::Clock, 0),
        ];
        assert!(rows.windows(2).all(|pair| pair[0] < pair[1] && pair[0].name() < pair[1].name()));
        assert!(rows.iter().all(|row| Row::named(&row.name()) == Some(*row)));
        assert_eq!(Row::named(&[0xff; NAME]), None);
    }
}
