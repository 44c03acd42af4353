//! Snapshots of anybody: read without a panic and in bounded memory, and what is taken is taken back.

#![no_main]

use firn::session::{Limits, Snapshot};
use libfuzzer_sys::fuzz_target;

const LIMITS: Limits =
    Limits { sessions: 1, cells_per_session: 1 << 12, cells: 1 << 12, colliders_per_session: 64 };

/// A file with this body, whose hash is right: chance alone would never find one.
fn sealed(body: &[u8]) -> Vec<u8> {
    let mut file = b"FIRNSNOW\x01\0\0\0\0\0\0\0".to_vec();
    file.extend(blake3::hash(body).as_bytes());
    file.extend(zstd::encode_all(body, 1).expect("it fits in memory"));
    file
}

fuzz_target!(|input: &[u8]| {
    let _ = Snapshot::decode(input, &LIMITS);
    let Ok(snapshot) = Snapshot::decode(&sealed(input), &LIMITS) else { return };
    let again = snapshot.encode().expect("what was read can be written");
    let twin = Snapshot::decode(&again, &LIMITS).expect("what was written can be read");
    assert_eq!(twin.digest().ok(), snapshot.digest().ok());
});
