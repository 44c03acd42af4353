//! What a subscription has been told, put together from its messages.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::support::numbers;

/// What one subscription has been told.
#[derive(Default)]
pub struct View {
    /// Heights by row and column, so that they are in the order of a read.
    heights: BTreeMap<(u64, u64), f64>,
    /// Elevations of the ground in the same way; what is not there is level where that was told.
    ground: BTreeMap<(u64, u64), f64>,
    is_level: bool,
    pub colliders: Value,
    /// Whole messages so far.
    pub messages: usize,
    pub stride: u64,
    pub quantum: f64,
    /// The newest state that it was told whole.
    pub seq: u64,
    parts: Vec<Value>,
}

impl View {
    /// A view that was told nothing yet.
    pub fn of(stride: u64, quantum: f64) -> View {
        View { stride, quantum, ..View::default() }
    }

    /// The same without the parts of a message that was cut off.
    pub fn without_parts(self) -> View {
        View { parts: Vec::new(), ..self }
    }

    /// All heights, in the order of a read.
    pub fn values(&self) -> Vec<f64> {
        self.heights.values().copied().collect()
    }

    /// Elevations of the ground wherever a height was told. Not a number where no ground was.
    #[allow(dead_code, reason = "not every test that has a client has ground")]
    pub fn elevations(&self) -> Vec<f64> {
        let unknown = if self.is_level { 0.0 } else { f64::NAN };
        self.heights.keys().map(|key| self.ground.get(key).copied().unwrap_or(unknown)).collect()
    }

    /// Heights of some rows and columns.
    pub fn part(&self, wanted: impl Fn(u64, u64) -> bool) -> Vec<f64> {
        let wanted = self.heights.iter().filter(|((z, x), _)| wanted(*z, *x));
        wanted.map(|(_, &height)| height).collect()
    }

    /// Forgets all but some rows and columns.
    pub fn keep(&mut self, wanted: impl Fn(u64, u64) -> bool) {
        self.heights.retain(|&(z, x), _| wanted(z, x));
    }

    pub fn samples_equal(&self, expected: &[f64]) -> bool {
        self.values() == expected
    }

    /// Takes a whole message over, once its last part is there.
    pub fn take(&mut self, part: &Value) -> bool {
        self.parts.push(part.clone());
        if part.get("more").is_some() {
            return false;
        }
        self.messages += 1;
        self.seq = part["seq"].as_u64().unwrap();
        for whole in std::mem::take(&mut self.parts) {
            for field in ["op", "seq", "tick"] {
                assert_eq!(whole[field], part[field], "all parts are of one state");
            }
            let part = whole;
            for tile in part["tiles"].as_array().unwrap() {
                self.heights.extend(samples(tile, self.stride));
            }
            if part.get("level").is_some() {
                self.ground.clear();
                self.is_level = true;
            }
            for tile in part.get("terrain").and_then(Value::as_array).into_iter().flatten() {
                self.ground.extend(samples(tile, self.stride));
            }
            if let Some(colliders) = part.get("colliders") {
                self.colliders = colliders.clone();
            }
        }
        true
    }
}

/// The samples of a tile, each with its row and its column.
fn samples(tile: &Value, stride: u64) -> impl Iterator<Item = ((u64, u64), f64)> {
    let field = |name: &str| tile[name].as_u64().unwrap();
    let (column_x, column_z, width) = (field("column_x"), field("column_z"), field("width"));
    let heights = numbers(&tile["heights"]);
    assert_eq!(heights.len() as u64, width * field("depth"));
    (0..).zip(heights).map(move |(i, height)| {
        ((column_z + i / width * stride, column_x + i % width * stride), height)
    })
}
