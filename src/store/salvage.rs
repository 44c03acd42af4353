//! What can be had of a damaged file: every row that is sound, found by its frame.

use std::collections::BTreeMap;

use super::frame::{self, MAGIC};
use super::{Content, Row};

/// All sound rows in some bytes, of each the one that was written last.
///
/// Rows that were removed may be among them: their bytes lie about until they are written over.
pub fn scan(bytes: &[u8]) -> BTreeMap<Row, Content> {
    let mut rows: BTreeMap<Row, Content> = BTreeMap::new();
    let mut at = 0;
    while let Some(next) = find(&bytes[at..]) {
        at += next;
        if let Some((row, content)) = frame::open(&bytes[at..])
            && rows.get(&row).is_none_or(|known| known.batch < content.batch)
        {
            rows.insert(row, content);
        }
        at += 1;
    }
    rows
}

/// Where the next frame may begin.
fn find(bytes: &[u8]) -> Option<usize> {
    let mut from = 0;
    loop {
        from += bytes[from..].iter().position(|&byte| byte == MAGIC[0])?;
        if bytes[from..].starts_with(MAGIC) {
            return Some(from);
        }
        from += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Kind;
    use super::*;

    #[test]
    fn sound_rows_are_found_among_rubbish_and_the_newest_wins() {
        let row = |number| Row { session: 1, kind: Kind::Entry, number };
        let mut bytes = b"FIRNRO FIRNROW1 rubbish".to_vec();
        bytes.extend(frame::seal(&row(1), 5, b"new"));
        bytes.extend(frame::seal(&row(1), 4, b"old"));
        let mut damaged = frame::seal(&row(2), 6, b"damaged");
        damaged[55] ^= 1;
        bytes.extend(damaged);
        bytes.extend(frame::seal(&row(3), 6, b"whole"));
        bytes.extend(&frame::seal(&row(4), 6, b"cut short")[..58]);
        let found: Vec<(u64, Vec<u8>)> =
            scan(&bytes).into_iter().map(|(row, content)| (row.number, content.bytes)).collect();
        assert_eq!(found, [(1, b"new".to_vec()), (3, b"whole".to_vec())]);
    }
}
