//! What checkpoints do to frames.

use std::time::Duration;

use firn::config::BackendChoice;
use serde_json::json;

use crate::disk::Disk;
use crate::support::wait::until;
use crate::support::{Options, Server};

#[tokio::test(flavor = "multi_thread")]
async fn a_checkpoint_is_taken_in_a_frame_of_its_own() {
    let durability = Disk::default().durability(Duration::from_millis(1));
    let server = Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await;
    for _ in 0..3 {
        let body = json!({"grid": {"width": 9, "depth": 9, "height": 40, "cell_size": 0.2},
            "initial_snow": [{"depth": 7}]});
        server.create(body).await;
    }
    until("one has a frame for itself", async || {
        let frames = server.sessions.vitals().frame_times();
        assert!(frames.iter().all(|frame| frame.checkpoints <= 1), "one at a time");
        // On a machine that is late another's cycles may come into it.
        frames.iter().any(|frame| (frame.checkpoints, frame.sessions) == (1, 1))
    })
    .await;
    server.stop().await;
}
