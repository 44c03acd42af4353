//! Restore points are kept and deleted wherever the snow of their session is.

use std::sync::Arc;

use crate::core::World;
use crate::core::record::{Part, RestorePoint, RestorePoints};
use crate::core::session::{Answer, SessionError};

/// What is done to the restore points of a session.
pub(crate) enum PointChange {
    /// One is kept, with its snapshot as bytes.
    Keep(RestorePoint, Arc<[u8]>),
    /// The one of a name is deleted.
    Delete(String),
}

impl World {
    /// Changes the restore points of a session, and answers once that is durable.
    pub(crate) fn change_points(&mut self, key: u64, change: PointChange, reply: Answer<()>) {
        let known =
            self.records.get(&key).map(|record| record.points().clone()).unwrap_or_default();
        let parts = match self.storage.refusal() {
            Some(why) => Err(why),
            None => self.parts_of(&known, change),
        };
        match parts {
            Ok(parts) => self.submit_parts(key, parts, Some(reply)),
            Err(why) => reply.refuse(&why),
        }
    }

    fn parts_of(
        &self,
        known: &RestorePoints,
        change: PointChange,
    ) -> Result<Vec<Part>, SessionError> {
        match change {
            PointChange::Keep(point, snapshot) => {
                let held = (!self.durable).then(|| snapshot.clone());
                let (points, number) = known.with(RestorePoint { held, ..point })?;
                Ok(vec![Part::Point(number, snapshot), Part::Points(Arc::new(points))])
            }
            PointChange::Delete(name) => Ok(vec![Part::Points(Arc::new(known.without(&name)?))]),
        }
    }

    /// Shows the restore points that a session has. Snapshots of others are removed only from then on: where a
    /// change of them can't be stored, none is missing.
    pub(crate) fn show_points(&mut self, key: u64, points: &Arc<RestorePoints>) {
        if let Some(session) = self.session(key) {
            session.set_points(points.clone());
        }
        let gone = self.records.get(&key).map(|record| record.stored.gone_points.clone());
        if let Some(gone) = gone.filter(|gone| !gone.is_empty()) {
            self.submit_parts(key, vec![Part::RemovePoints(gone)], None);
        }
    }
}
