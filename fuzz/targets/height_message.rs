//! Binary messages of a server that lies: read without a panic and in bounded memory.

#![no_main]

use firn_protocol::heights;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    if let Ok(message) = heights::decode(input) {
        for run in message.runs.iter().chain(&message.terrain) {
            let (tile, samples) = (&run.tile, run.tile.width * run.tile.depth);
            assert_eq!(tile.heights.len(), samples as usize);
        }
    }
});
