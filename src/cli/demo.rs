//! The live session `demo`: 5.8 m of snow at −3 °C with three objects of 100 kg on it.

use firn_protocol::{ColliderBatch, ColliderSpec, SessionSpec, SnowLayer};
use firn_snow::{Position, Shape};

use crate::session::{Change, SessionError, Sessions};

/// Sides \[m\] of the boxes and where they stand \[m\]: apart from each other, so that each shows
/// how far its own pressure makes it sink.
const BOXES: [(&str, f64, f64, f64); 3] =
    [("wide", 4.0, 3.0, 3.0), ("middle", 1.0, 7.5, 3.0), ("narrow", 0.3162, 7.5, 7.5)];

/// Creates the session and puts the objects on it.
///
/// # Errors
/// Where the server can't hold it.
pub async fn create(sessions: &Sessions) -> Result<(), SessionError> {
    let spec = SessionSpec {
        id: Some("demo".to_owned()),
        initial_snow: vec![SnowLayer { depth: 5.8, temperature: Some(-3.0), density: Some(20.0) }],
        ..SessionSpec::default()
    };
    let (session, _tokens) = sessions.create(spec).await?;
    let put = BOXES
        .iter()
        .map(|&(id, side, x, z)| ColliderSpec {
            id: Some(id.to_owned()),
            mass: 100.0,
            shape: Some(Shape::Box { width: side, depth: side }),
            position: Position { x, z },
            ..ColliderSpec::default()
        })
        .collect();
    session.change(Change::Colliders(ColliderBatch { put, ..ColliderBatch::default() })).await?;
    Ok(())
}
