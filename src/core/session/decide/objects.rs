//! Objects on the snow.

use std::collections::BTreeSet;
use std::sync::Arc;

use firn_protocol::{
    BatchOutcome, BatchResult, BatchResults, ColliderBatch, ColliderPatch, ColliderSpec,
    FieldError, OnError,
};
use firn_snow::{Body, Grid};

use crate::core::session::{
    Check, Collider, Command, Decision, Invalid, Reach, SessionError, SessionState, Told,
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
        check.path("", spec.path.as_deref(), spec.over);
        let id = Arc::from(spec.id.as_deref().unwrap_or_default());
        self.decide_body(id, spec.body(), check, most)
    }

    fn decide_body(
        &self,
        id: Arc<str>,
        object: Body,
        mut check: Check,
        most: Option<usize>,
    ) -> Result<Decision, SessionError> {
        let created = !self.colliders.contains_key(&id);
        if let Some(most) = most.filter(|most| created && self.colliders.len() >= *most) {
            check.reject("", format!("a session may have at most {most} colliders"));
        }
        check.object("", &id, &object, &self.grid);
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
        let mut check = Check::default();
        check.path("", patch.path.as_deref(), patch.over);
        if patch.sweep && patch.position.is_none() && patch.heading.is_none() {
            check.reject("/sweep", "is there without a position or heading to sweep to");
        }
        if patch.sweep && patch.path.is_some() {
            check.reject("/path", "is there beside a sweep; an object takes one way at a time");
        }
        self.decide_body(Arc::from(id), patch.clone().apply(&old.body), check, most)
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
        let mut entries = Entries::new(self, most);
        let delete = batch.delete.iter().map(|id| entries.delete(id)).collect();
        let put = (0..).zip(&batch.put).map(|(i, spec)| entries.put(i, spec)).collect();
        let results = match batch.on_error {
            OnError::Refuse => {
                entries.invalid.finish()?;
                None
            }
            OnError::Skip => Some(Box::new(BatchResults { put, delete })),
        };
        let command = Command::Objects { removed: entries.removed, put: entries.objects };
        Ok(Decision { command, told: Told::Batch(results) })
    }

    /// What the objects that a command takes away or replaces have of the device's tables, and what those
    /// take that it puts.
    pub fn object_words(&self, command: &Command) -> (u64, u64) {
        let Command::Objects { removed, put } = command else { return (0, 0) };
        let words = |id: &Arc<str>| self.colliders.get(id).map_or(0, |it| it.reach.words());
        let named: BTreeSet<&Arc<str>> = removed.iter().chain(put.iter().map(|it| &it.0)).collect();
        let more = |object: &Body| Reach::new(object, &self.grid).words();
        (named.into_iter().map(words).sum(), put.iter().map(|(_, object)| more(object)).sum())
    }

    fn known_collider(&self, id: &str) -> Result<&Collider, SessionError> {
        let unknown = || SessionError::NotFound { kind: "collider", id: id.to_owned() };
        self.colliders.get(id).ok_or_else(unknown)
    }
}

/// The entries of a batch, as far as they have been looked at.
struct Entries<'a> {
    grid: &'a Grid,
    most: Option<usize>,
    /// Names of the colliders there are then.
    ids: BTreeSet<&'a str>,
    /// Names of those that are put.
    named: BTreeSet<&'a str>,
    removed: Vec<Arc<str>>,
    objects: Vec<(Arc<str>, Body)>,
    /// What is wrong with any of them.
    invalid: Check,
}

impl<'a> Entries<'a> {
    fn new(state: &'a SessionState, most: Option<usize>) -> Self {
        Entries {
            grid: &state.grid,
            most,
            ids: state.colliders.keys().map(|id| &**id).collect(),
            named: BTreeSet::new(),
            removed: Vec::new(),
            objects: Vec::new(),
            invalid: Check::default(),
        }
    }

    /// Takes a collider away. It is no error where there is none of that name.
    fn delete(&mut self, id: &'a str) -> BatchResult {
        let there = self.ids.remove(id);
        if there {
            self.removed.push(Arc::from(id));
        }
        let result = if there { BatchOutcome::Removed } else { BatchOutcome::Absent };
        BatchResult { id: Some(id.to_owned()), result, errors: Vec::new() }
    }

    /// Puts the collider of an entry, unless something is wrong with it.
    fn put(&mut self, i: usize, spec: &'a ColliderSpec) -> BatchResult {
        let at = format!("/put/{i}");
        let mut check = Check::default();
        let object = spec.body();
        let id = spec.id.as_deref().unwrap_or_default();
        if spec.id.is_none() {
            check.reject(format!("{at}/id"), "is missing; a batch names its colliders");
        } else if self.named.contains(id) {
            check.reject(format!("{at}/id"), format!("{} stands twice in the batch", quote(id)));
        }
        check.path(&at, spec.path.as_deref(), spec.over);
        if spec.id.is_some() {
            check.object(&at, id, &object, self.grid);
        }
        let created = !self.ids.contains(id);
        if let Some(most) = self.most.filter(|most| created && self.ids.len() >= *most) {
            check.reject(at, format!("a session may have at most {most} colliders"));
        }
        if check.passed() {
            self.ids.insert(id);
            self.named.insert(id);
            self.objects.push((Arc::from(id), object));
            let result = if created { BatchOutcome::Created } else { BatchOutcome::Replaced };
            return BatchResult { id: spec.id.clone(), result, errors: Vec::new() };
        }
        let told = |Invalid { pointer, detail }: Invalid| FieldError { pointer, detail };
        let errors = check.errors().cloned().map(told).collect();
        self.invalid.join(check);
        BatchResult { id: spec.id.clone(), result: BatchOutcome::Skipped, errors }
    }
}
