//! Objects on the snow.

use std::collections::BTreeSet;
use std::sync::Arc;

use firn_protocol::{ColliderBatch, ColliderPatch, ColliderSpec};
use firn_snow::{Footprint, Grid, Shape};

use crate::core::session::{
    Check, Collider, Command, Decision, Invalid, ObjectSpec, Reach, SessionError, SessionState,
    Told,
};
use crate::quote::quote;

/// Most entries of a batch of colliders.
const LARGEST_BATCH: usize = 4096;

impl SessionState {
    pub(crate) fn decide_new_object(
        &self,
        spec: &ColliderSpec,
        most: Option<usize>,
    ) -> Result<Decision, SessionError> {
        if let Some(id) = spec.id.as_deref().filter(|id| self.colliders.contains_key(*id)) {
            return Err(SessionError::Conflict(format!(
                "there is a collider {} already; PUT replaces it",
                quote(id)
            )));
        }
        self.decide_object(spec, most)
    }

    pub(crate) fn decide_object(
        &self,
        spec: &ColliderSpec,
        most: Option<usize>,
    ) -> Result<Decision, SessionError> {
        let mut check = Check::default();
        let id: Arc<str> = Arc::from(spec.id.as_deref().unwrap_or_default());
        let created = !self.colliders.contains_key(&id);
        if let Some(most) = most.filter(|most| created && self.colliders.len() >= *most) {
            check.reject("", format!("a session may have at most {most} colliders"));
        }
        let object = ObjectSpec::from(spec);
        object.check(&mut check, "", &id, &self.grid);
        check.finish()?;
        let command = Command::Objects { removed: Vec::new(), put: vec![(id.clone(), object)] };
        Ok(Decision { command, told: Told::Collider { id, created } })
    }

    pub(crate) fn decide_patch(
        &self,
        id: &str,
        patch: &ColliderPatch,
        most: Option<usize>,
    ) -> Result<Decision, SessionError> {
        let old = self.known_collider(id)?;
        let spec = ColliderSpec {
            id: Some(id.to_owned()),
            mass: patch.mass.unwrap_or(old.mass),
            shape: patch.shape.unwrap_or(old.shape),
            position: patch.position.unwrap_or(old.position),
        };
        self.decide_object(&spec, most)
    }

    pub(crate) fn decide_removal(&self, id: &str) -> Result<Decision, SessionError> {
        self.known_collider(id)?;
        let command = Command::Objects { removed: vec![Arc::from(id)], put: Vec::new() };
        Ok(Decision { command, told: Told::Stamp })
    }

    pub(crate) fn decide_batch(
        &self,
        batch: &ColliderBatch,
        most: Option<usize>,
    ) -> Result<Decision, SessionError> {
        if batch.put.len() + batch.delete.len() > LARGEST_BATCH {
            let detail = format!("a batch may have at most {LARGEST_BATCH} entries");
            return Err(SessionError::Invalid(vec![Invalid::new("", detail)]));
        }
        let mut check = Check::default();
        let mut ids: BTreeSet<&str> = self.colliders.keys().map(|id| &**id).collect();
        for (i, id) in batch.delete.iter().enumerate() {
            if !ids.remove(id.as_str()) {
                check.reject(format!("/delete/{i}"), format!("there is no collider {}", quote(id)));
            }
        }
        let mut named: BTreeSet<&str> = BTreeSet::new();
        let mut put = Vec::with_capacity(batch.put.len());
        for (i, spec) in batch.put.iter().enumerate() {
            let Some(id) = &spec.id else {
                check.reject(format!("/put/{i}/id"), "is missing; a batch names its colliders");
                continue;
            };
            if !named.insert(id) {
                check.reject(
                    format!("/put/{i}/id"),
                    format!("{} stands twice in the batch", quote(id)),
                );
            }
            ids.insert(id);
            let (object, at) = (ObjectSpec::from(spec), format!("/put/{i}"));
            object.check(&mut check, &at, id, &self.grid);
            put.push((Arc::from(id.as_str()), object));
        }
        if let Some(most) = most.filter(|most| ids.len() > *most) {
            check.reject("/put", format!("a session may have at most {most} colliders"));
        }
        check.finish()?;
        let removed = batch.delete.iter().map(|id| Arc::from(id.as_str())).collect();
        Ok(Decision { command: Command::Objects { removed, put }, told: Told::Stamp })
    }

    /// What the objects that a command takes away or replaces have of the device's tables, and what those
    /// take that it puts.
    pub fn object_words(&self, command: &Command) -> (u64, u64) {
        let Command::Objects { removed, put } = command else { return (0, 0) };
        let words = |id: &Arc<str>| self.colliders.get(id).map_or(0, |it| it.reach.words());
        let named: BTreeSet<&Arc<str>> = removed.iter().chain(put.iter().map(|it| &it.0)).collect();
        let more = |object: &ObjectSpec| Reach::new(&object.shape, &self.grid).words();
        (named.into_iter().map(words).sum(), put.iter().map(|(_, object)| more(object)).sum())
    }

    fn known_collider(&self, id: &str) -> Result<&Collider, SessionError> {
        let unknown = || SessionError::NotFound { kind: "collider", id: id.to_owned() };
        self.colliders.get(id).ok_or_else(unknown)
    }
}

impl From<&ColliderSpec> for ObjectSpec {
    fn from(spec: &ColliderSpec) -> ObjectSpec {
        ObjectSpec { mass: spec.mass, shape: spec.shape, position: spec.position }
    }
}

impl ObjectSpec {
    /// Notes what is wrong with an object.
    pub fn check(&self, check: &mut Check, at: &str, id: &str, grid: &Grid) {
        check.id(format!("{at}/id"), id);
        check.range(format!("{at}/mass"), self.mass, f64::MIN_POSITIVE, 1e9, "kg");
        let sides: &[(&str, f64)] = match self.shape {
            Shape::Box { width, depth } => &[("width", width), ("depth", depth)],
            Shape::Disk { radius } => &[("radius", radius)],
        };
        for (side, length) in sides {
            check.range(format!("{at}/shape/{side}"), *length, 1e-3, 1e6, "m");
        }
        if check.passed() && Footprint::new(grid, &self.shape, self.position).is_none() {
            let (width, depth) = (f64::from(grid.width), f64::from(grid.depth));
            check.reject(
                format!("{at}/position"),
                format!(
                    "the footprint reaches beyond the grid, which is 0 to {} m along x and 0 to \
                     {} m along z",
                    width * grid.cell_size,
                    depth * grid.cell_size
                ),
            );
        }
    }
}
