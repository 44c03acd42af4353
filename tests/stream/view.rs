//! What a subscription has been told, put together from its messages.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::support::numbers;

/// What one subscription has been told.
#[derive(Default)]
pub struct View {
    /// Heights by row and column, so that they are in the order of a read.
    heights: BTreeMap<(u64, u64), f64>,
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
                let field = |name: &str| tile[name].as_u64().unwrap();
                let (width, depth) = (field("width"), field("depth"));
                let heights = numbers(&tile["heights"]);
                assert_eq!(heights.len() as u64, width * depth);
                for (i, height) in (0..).zip(heights) {
                    let z = field("column_z") + i / width * self.stride;
                    let x = field("column_x") + i % width * self.stride;
                    self.heights.insert((z, x), height);
                }
            }
            if let Some(colliders) = part.get("colliders") {
                self.colliders = colliders.clone();
            }
        }
        true
    }
}
