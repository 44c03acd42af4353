//! What the server says about itself.

use firn::config::BackendChoice;

use crate::on_each_backend;
use crate::support::Server;
use crate::support::wait::until;

on_each_backend!(what_happens_is_counted);

/// The value of a metric, by its name and labels as they are written.
fn value(text: &str, metric: &str) -> Option<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(metric)?.strip_prefix(' '));
    line.map(|number| number.parse().expect("a metric is a number"))
}

async fn what_happens_is_counted(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let before = server.get("/metrics").await;
    assert_eq!(before.status, 200);
    assert!(before.header("content-type").starts_with("application/openmetrics-text"));
    let before = String::from_utf8(before.body).unwrap();
    assert_eq!(value(&before, "firn_sessions"), Some(0.0));
    assert_eq!(value(&before, "firn_engine_healthy"), Some(1.0));
    assert_eq!(value(&before, r#"firn_streams_ended_total{cause="too_slow"}"#), Some(0.0));

    let session = server.create(crate::support::small()).await;
    server.get(&session).await.expect(200);
    server.get("/v1/sessions/nobody").await.problem(404);
    // A frame is counted when it has ended, after what was done in it was answered.
    let mut after = String::new();
    until("a frame has ended", async || {
        after = String::from_utf8(server.get("/metrics").await.body).unwrap();
        value(&after, "firn_frames_total") > Some(0.0)
    })
    .await;
    assert_eq!(value(&after, "firn_sessions"), Some(1.0));
    assert!(value(&after, "firn_frame_time_seconds_total") > Some(0.0));
    assert!(value(&after, "firn_device_memory_bytes") > Some(0.0));
    let body = server.get(&session).await.expect(200);
    let taken = body["device_memory_bytes"].as_f64();
    // 2 × 1 tiles of 64 columns with 20 slots of 16 bytes.
    assert_eq!(taken, Some(40_960.0));
    assert_eq!(value(&after, "firn_session_memory_bytes"), taken);
    assert_eq!(value(&after, "firn_tiles"), Some(2.0));
    assert_eq!(value(&after, "firn_active_tiles"), body["summary"]["active_tiles"].as_f64());
    assert_eq!(value(&after, "firn_active_tiles"), Some(2.0), "fresh snow moves");
    for (status, count) in [(200, 1.0), (404, 1.0)] {
        let labels = format!(r#"method="GET",route="/v1/sessions/{{id}}",status="{status}""#);
        let metric = format!("firn_request_duration_seconds_count{{{labels}}}");
        assert_eq!(value(&after, &metric), Some(count), "{metric} in\n{after}");
    }
    for line in after.lines().filter(|line| !line.starts_with('#')) {
        assert!(line.starts_with("firn_"), "{line}");
    }
    server.stop().await;
}
