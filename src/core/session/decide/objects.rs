//! Objects on the snow.

use std::collections::BTreeSet;
use std::sync::Arc;

use firn_protocol::{
    BatchOutcome, BatchResult, BatchResults, ColliderBatch, ColliderPatch, ColliderSpec,
    FieldError, OnError,
};
use firn_snow::{Body, Grid, MOST_CORNERS, MOST_FOOTPRINTS, MOST_PATH_POINTS, Motion, Shape};

use crate::core::session::{
    Check, Collider, Command, Decision, Invalid, Reach, SessionError, SessionState, Told,
};
use crate::quote::quote;

/// Most entries of a batch of colliders.
const LARGEST_BATCH: usize = 4096;

/// Largest radius and width of a wheel \[m\].
const LARGEST_WHEEL: f64 = 5.0;

/// Fastest that an object moves \[m/s\] and turns \[°/s\].
const FASTEST: f64 = 100.0;
const FASTEST_TURN: f64 = 720.0;

/// Longest time for a path \[s\], and how far from 0 its points are at the most \[m\].
const LONGEST_WAY: f64 = 86_400.0;
const FARTHEST: f64 = 1e6;

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

impl Check {
    /// Notes what is wrong with an object.
    pub fn object(&mut self, at: &str, id: &str, object: &Body, grid: &Grid) {
        let before = self.errors().len();
        self.id(format!("{at}/id"), id);
        self.range(format!("{at}/mass"), object.mass, f64::MIN_POSITIVE, 1e9, "kg");
        self.range(format!("{at}/heading"), object.heading, -36_000.0, 36_000.0, "°");
        self.motion(at, &object.motion);
        match (&object.shape, &object.footprints[..]) {
            (Some(shape), []) => self.shape(&format!("{at}/shape"), shape),
            (None, parts) if (1..=MOST_FOOTPRINTS).contains(&parts.len()) => {
                for (i, part) in parts.iter().enumerate() {
                    let at = format!("{at}/footprints/{i}");
                    self.shape(&format!("{at}/shape"), &part.shape);
                    self.range(format!("{at}/heading"), part.heading, -36_000.0, 36_000.0, "°");
                    for (axis, offset) in [("x", part.offset.x), ("z", part.offset.z)] {
                        self.range(format!("{at}/offset/{axis}"), offset, -1000.0, 1000.0, "m");
                    }
                }
            }
            (Some(_), _) => self.reject(
                format!("{at}/footprints"),
                "is there beside a shape; an object has one or the other",
            ),
            (None, []) => self.reject(
                format!("{at}/shape"),
                format!("is missing; an object has a shape or 1 to {MOST_FOOTPRINTS} footprints"),
            ),
            (None, parts) => self.reject(
                format!("{at}/footprints"),
                format!("{} of them; an object has at most {MOST_FOOTPRINTS}", parts.len()),
            ),
        }
        if self.errors().len() == before && object.on(grid).is_none() {
            let (width, depth) = (f64::from(grid.width), f64::from(grid.depth));
            self.reject(
                format!("{at}/position"),
                format!(
                    "none of its columns is in the grid, which is 0 to {} m along x and 0 to {} m \
                     along z",
                    width * grid.cell_size,
                    depth * grid.cell_size
                ),
            );
        }
    }

    /// Notes what is wrong with a path and its time, as they are told.
    fn path(&mut self, at: &str, path: Option<&[[f64; 2]]>, over: Option<f64>) {
        if path.is_some_and(<[_]>::is_empty) {
            self.reject(format!("{at}/path"), "has no points; it has 1 to 4096");
        }
        if path.is_some() != over.is_some() {
            let field = if path.is_some() { "over" } else { "path" };
            self.reject(format!("{at}/{field}"), "is missing; 'path' and 'over' come together");
        }
        if let Some(over) = over {
            self.range(format!("{at}/over"), over, 1e-3, LONGEST_WAY, "s");
        }
    }

    /// Notes what is wrong with how an object moves.
    fn motion(&mut self, at: &str, motion: &Motion) {
        let Motion { velocity, turn_rate, path, speed, turn_to } = motion;
        let fastest = velocity.x.hypot(velocity.z);
        self.range(format!("{at}/velocity"), fastest, 0.0, FASTEST, "m/s");
        self.range(format!("{at}/turn_rate"), *turn_rate, -FASTEST_TURN, FASTEST_TURN, "°/s");
        if path.len() > MOST_PATH_POINTS {
            let detail = format!("{} points; a path has at most {MOST_PATH_POINTS}", path.len());
            self.reject(format!("{at}/path"), detail);
        }
        let far = |[x, z]: &[f64; 2]| !(x.abs() <= FARTHEST && z.abs() <= FARTHEST);
        if let Some(i) = path.iter().position(far) {
            self.reject(format!("{at}/path/{i}"), format!("is not within {FARTHEST} m of 0"));
        } else if let Some(speed) = speed.filter(|speed| !(0.0..=FASTEST).contains(speed))
            && !self.errors().any(|error| error.pointer == format!("{at}/over"))
        {
            let detail = format!("makes it {speed:.1} m/s along the path; at most {FASTEST} m/s");
            self.reject(format!("{at}/over"), detail);
        }
        if let Some(heading) = turn_to {
            self.range(format!("{at}/heading"), *heading, -36_000.0, 36_000.0, "°");
        }
    }

    /// Notes what is wrong with an outline.
    pub(super) fn shape(&mut self, at: &str, shape: &Shape) {
        let (sides, longest): (&[(&str, f64)], f64) = match shape {
            Shape::Box { width, depth } => (&[("width", *width), ("depth", *depth)], 1e6),
            Shape::Disk { radius } => (&[("radius", *radius)], 1e6),
            Shape::Capsule { length, radius } => (&[("length", *length), ("radius", *radius)], 1e6),
            Shape::Wheel { width, radius } => {
                (&[("width", *width), ("radius", *radius)], LARGEST_WHEEL)
            }
            Shape::Polygon { .. } => (&[], 0.0),
        };
        for (side, length) in sides {
            self.range(format!("{at}/{side}"), *length, 1e-3, longest, "m");
        }
        if let Shape::Polygon { corners } = shape {
            for (i, corner) in corners.iter().take(MOST_CORNERS).enumerate() {
                for (axis, along) in corner.iter().enumerate() {
                    self.range(format!("{at}/corners/{i}/{axis}"), *along, -1000.0, 1000.0, "m");
                }
            }
        }
        if let Some((field, flaw)) = shape.flaw() {
            self.reject(format!("{at}/{field}"), flaw);
        }
    }
}
