//! Restore points: states of a session that are kept under names, to go back to.

use std::sync::Arc;

use firn_protocol::{CheckpointView, SessionView};

use crate::core::Control;
use crate::core::record::RestorePoint;
use crate::core::restore_points::PointChange;
use crate::core::session::{Check, SessionError};
use crate::machine;
use crate::session::handle::Session;
use crate::session::requests::blocking;

impl Session {
    /// Its restore points, in ascending order of their names.
    pub fn checkpoints(&self) -> Vec<CheckpointView> {
        self.points().iter().map(view).collect()
    }

    /// The restore point of a name.
    ///
    /// # Errors
    /// [`SessionError::NotFound`].
    pub fn checkpoint(&self, name: &str) -> Result<CheckpointView, SessionError> {
        Ok(view(self.points().named(name)?))
    }

    /// Keeps the present state under a name. Returns when that is durable, with whether the name is new.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] where nothing can have that name, [`SessionError::Conflict`] where there are
    /// as many restore points as may be, [`SessionError::Locked`], and those of [`Session::snapshot`].
    pub async fn keep_checkpoint(
        &self,
        name: &str,
    ) -> Result<(CheckpointView, bool), SessionError> {
        self.check_unlocked()?;
        let mut check = Check::default();
        check.id("name", name);
        check.finish()?;
        self.points().check_room(name)?;
        let snapshot = self.snapshot().await?;
        let sim_time = snapshot.sim_time();
        let tick = snapshot.stamp.tick;
        let encode = move || snapshot.check_mass().and_then(|()| snapshot.encode());
        let snapshot: Arc<[u8]> = blocking(encode).await?.into();
        let point = RestorePoint {
            name: name.to_owned(),
            number: 0,
            tick,
            sim_time,
            created_at: humantime::format_rfc3339_millis(machine::date()).to_string(),
            bytes: snapshot.len() as u64,
            held: None,
        };
        let (kept, is_new) = (view(&point), self.points().named(name).is_err());
        let change = PointChange::Keep(point, snapshot);
        self.control(|reply| Control::Points(change, reply)).await?;
        Ok((kept, is_new))
    }

    /// Deletes the restore point of a name. Returns when that is durable.
    ///
    /// # Errors
    /// [`SessionError::NotFound`] and [`SessionError::Locked`].
    pub async fn delete_checkpoint(&self, name: &str) -> Result<(), SessionError> {
        self.check_unlocked()?;
        let change = PointChange::Delete(name.to_owned());
        self.control(|reply| Control::Points(change, reply)).await
    }

    /// The snapshot that a restore point is, as bytes.
    ///
    /// # Errors
    /// [`SessionError::NotFound`], and [`SessionError::Internal`] where it can't be read.
    pub async fn checkpoint_snapshot(&self, name: &str) -> Result<Vec<u8>, SessionError> {
        loop {
            let points = self.points();
            let RestorePoint { number, held, .. } = points.named(name)?;
            if let Some(held) = held {
                return Ok(held.to_vec());
            }
            if let Some(snapshot) = self.store.restore_point(self.key, *number).await? {
                return Ok(snapshot);
            }
            // It may have been replaced meanwhile.
            if self.points().named(name)?.number == *number {
                let why = format!("the restore point '{name}' is missing in the store; delete it");
                return Err(SessionError::Internal(why));
            }
        }
    }

    /// Brings the session back to a restore point; name, tokens and seqs go on.
    ///
    /// # Errors
    /// As [`Session::checkpoint_snapshot`] and [`Session::reset_to_snapshot`].
    pub async fn reset_to_checkpoint(&self, name: &str) -> Result<SessionView, SessionError> {
        self.check_unlocked()?;
        self.reset_to_snapshot(self.checkpoint_snapshot(name).await?).await
    }
}

fn view(point: &RestorePoint) -> CheckpointView {
    let RestorePoint { name, tick, sim_time, created_at, bytes, .. } = point.clone();
    CheckpointView { name, tick, sim_time, created_at, bytes }
}
