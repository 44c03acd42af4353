//! Restore points: states of a session that are kept under names, to go back to.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::core::session::SessionError;

/// Most restore points of a session.
pub(crate) const MOST_POINTS: usize = 16;

/// A state of a session that is kept under a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RestorePoint {
    pub name: String,
    /// Tells its snapshot from that of any other restore point that the session has had.
    pub number: u64,
    pub tick: u64,
    /// Simulated time \[s\].
    pub sim_time: f64,
    /// RFC 3339.
    pub created_at: String,
    /// Length of its snapshot.
    pub bytes: u64,
    /// The snapshot, where no store keeps it.
    #[serde(skip)]
    pub held: Option<Arc<[u8]>>,
}

/// All of a session, in ascending order of their names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct RestorePoints {
    /// Number of the next.
    next: u64,
    points: Vec<RestorePoint>,
}

impl RestorePoints {
    pub fn iter(&self) -> impl Iterator<Item = &RestorePoint> {
        self.points.iter()
    }

    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The one of a name.
    ///
    /// # Errors
    /// [`SessionError::NotFound`].
    pub fn named(&self, name: &str) -> Result<&RestorePoint, SessionError> {
        let found = self.points.iter().find(|point| point.name == name);
        found.ok_or_else(|| SessionError::NotFound { kind: "restore point", id: name.to_owned() })
    }

    /// Makes sure that there is room for one of a name.
    ///
    /// # Errors
    /// [`SessionError::Conflict`].
    pub fn check_room(&self, name: &str) -> Result<(), SessionError> {
        if self.points.len() < MOST_POINTS || self.named(name).is_ok() {
            return Ok(());
        }
        Err(SessionError::Conflict(format!(
            "the session has {MOST_POINTS} restore points already, the most it may; delete one first, or \
             replace one by its name"
        )))
    }

    /// Numbers of their snapshots.
    pub fn numbers(&self) -> impl Iterator<Item = u64> {
        self.points.iter().map(|point| point.number)
    }

    /// With one more, in place of the one of its name; and its number.
    ///
    /// # Errors
    /// As [`RestorePoints::check_room`].
    pub fn with(&self, point: RestorePoint) -> Result<(RestorePoints, u64), SessionError> {
        self.check_room(&point.name)?;
        let number = self.next;
        let others = self.points.iter().filter(|other| other.name != point.name).cloned();
        let mut points: Vec<RestorePoint> = others.collect();
        points.push(RestorePoint { number, ..point });
        points.sort_by(|one, other| one.name.cmp(&other.name));
        Ok((RestorePoints { next: number + 1, points }, number))
    }

    /// Without the one of a name.
    ///
    /// # Errors
    /// As [`RestorePoints::named`].
    pub fn without(&self, name: &str) -> Result<RestorePoints, SessionError> {
        self.named(name)?;
        let others = self.points.iter().filter(|other| other.name != name);
        Ok(RestorePoints { next: self.next, points: others.cloned().collect() })
    }

    /// Memory that they take \[bytes\].
    pub fn weight(&self) -> usize {
        let point = |point: &RestorePoint| {
            let held = point.held.as_ref().map_or(0, |held| held.len());
            size_of::<RestorePoint>() + point.name.capacity() + point.created_at.capacity() + held
        };
        self.points.iter().map(point).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(name: &str) -> RestorePoint {
        RestorePoint {
            name: name.to_owned(),
            number: 0,
            tick: 0,
            sim_time: 0.0,
            created_at: String::new(),
            bytes: 0,
            held: None,
        }
    }

    #[test]
    fn names_are_replaced_and_numbers_never_are() {
        let points = RestorePoints::default();
        let (points, first) = points.with(point("b")).unwrap();
        let (points, second) = points.with(point("a")).unwrap();
        let (points, third) = points.with(point("b")).unwrap();
        assert_eq!([first, second, third], [0, 1, 2]);
        assert_eq!(points.numbers().collect::<Vec<_>>(), [1, 2], "in the order of their names");
        assert!(points.without("c").is_err());
        let points = points.without("b").unwrap();
        assert_eq!(points.with(point("b")).unwrap().1, 3);
    }

    #[test]
    fn there_is_room_for_sixteen() {
        let names: Vec<String> = (0..MOST_POINTS).map(|number| number.to_string()).collect();
        let all = names
            .iter()
            .fold(RestorePoints::default(), |points, name| points.with(point(name)).unwrap().0);
        assert!(matches!(all.with(point("more")), Err(SessionError::Conflict(_))));
        assert!(all.with(point("7")).is_ok());
    }
}
