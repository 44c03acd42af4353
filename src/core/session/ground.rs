//! The ground that a snowpack lies on.

use std::fmt;
use std::sync::{Arc, OnceLock};

use base64::prelude::{BASE64_STANDARD, Engine};
use firn_protocol::Terrain;
use firn_snow::{Grid, MAX_RELIEF_CELLS};
use serde::{Deserialize, Serialize};

use crate::core::session::{Check, SessionError};

/// Farthest elevation of the ground from 0 \[m\]: no ground on Earth is beyond it, and an `f32` still tells
/// 2 mm there.
const FARTHEST: f64 = 20_000.0;

/// How hard elevations are packed: they are packed while a client waits.
const COMPRESSION_LEVEL: i32 = 1;

/// Elevations of the ground. Clones share them.
#[derive(Clone, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Ground {
    heights: Arc<[f64]>,
    lowest: f64,
    highest: f64,
    /// As it is stored.
    packed: Arc<OnceLock<String>>,
}

impl Ground {
    /// Level ground at 0.
    pub fn level() -> Ground {
        Ground::new(Arc::default())
    }

    /// Ground of an elevation for each column \[m\], row by row; level at 0 where there are none.
    pub fn new(heights: Arc<[f64]>) -> Ground {
        let range =
            heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &height| {
                (low.min(height), high.max(height))
            });
        let (lowest, highest) = if heights.is_empty() { (0.0, 0.0) } else { range };
        Ground { heights, lowest, highest, packed: Arc::default() }
    }

    /// The ground that a client tells.
    pub fn of(terrain: Option<&Terrain>) -> Ground {
        terrain.map_or_else(Ground::level, |terrain| Ground::new(terrain.heights.clone()))
    }

    /// Elevation of each column \[m\], row by row; empty where all is level at 0.
    pub fn heights(&self) -> &Arc<[f64]> {
        &self.heights
    }

    /// Elevation of a column \[m\].
    pub fn height(&self, grid: &Grid, x: u32, z: u32) -> f64 {
        let index = z as usize * grid.width as usize + x as usize;
        self.heights.get(index).copied().unwrap_or_default()
    }

    /// Lowest elevation \[m\].
    pub fn lowest(&self) -> f64 {
        self.lowest
    }

    /// Highest elevation \[m\].
    pub fn highest(&self) -> f64 {
        self.highest
    }

    /// Whether nobody has told any ground.
    pub fn is_level(&self) -> bool {
        self.heights.is_empty()
    }

    /// Whether both are the same elevations in memory.
    pub fn is(&self, other: &Ground) -> bool {
        Arc::ptr_eq(&self.heights, &other.heights)
    }

    /// Memory that it takes \[bytes\].
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.heights) + self.packed.get().map_or(0, String::len)
    }

    /// Packs it to be stored, which takes a while for millions of columns.
    pub fn pack(&self) -> &str {
        self.packed.get_or_init(|| {
            let bytes: Vec<u8> =
                self.heights.iter().flat_map(|height| height.to_le_bytes()).collect();
            let packed = zstd::bulk::compress(&bytes, COMPRESSION_LEVEL);
            BASE64_STANDARD.encode(packed.expect("memory has no errors"))
        })
    }

    /// Checks elevations for the columns of a grid. `at` is where the list stands.
    pub fn check(check: &mut Check, at: &str, heights: &[f64], grid: &Grid) {
        if heights.len() as u64 != grid.columns() {
            let (count, Grid { width, depth, .. }) = (heights.len(), grid);
            check.reject(at, format!("{count} elevations for {width} × {depth} columns"));
            return;
        }
        let allowed = -FARTHEST..=FARTHEST;
        if let Some(index) = heights.iter().position(|height| !allowed.contains(height)) {
            check.range(format!("{at}/{index}"), heights[index], -FARTHEST, FARTHEST, "m");
            return;
        }
        let (lowest, highest) =
            heights.iter().fold((FARTHEST, -FARTHEST), |(low, high), &height| {
                (low.min(height), high.max(height))
            });
        let (relief, most) = (highest - lowest, f64::from(MAX_RELIEF_CELLS) * grid.cell_size);
        if relief > most {
            let detail = format!("elevations range over {relief} m; at most {most} m are allowed");
            check.reject(at, detail);
        }
    }

    /// Ground that a client tells for a grid, ready to be stored.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] where it is no ground of that grid.
    pub fn checked(heights: Arc<[f64]>, grid: &Grid) -> Result<Ground, SessionError> {
        let mut check = Check::default();
        Ground::check(&mut check, "/heights", &heights, grid);
        check.finish()?;
        let ground = Ground::new(heights);
        ground.pack();
        Ok(ground)
    }
}

impl From<Ground> for String {
    fn from(ground: Ground) -> String {
        ground.pack().to_owned()
    }
}

impl TryFrom<String> for Ground {
    type Error = String;

    fn try_from(packed: String) -> Result<Ground, String> {
        let bytes = BASE64_STANDARD.decode(&packed).map_err(|error| error.to_string())?;
        let bytes = zstd::decode_all(&*bytes).map_err(|error| error.to_string())?;
        let heights = bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
        let ground = Ground::new(heights.collect());
        let _ = ground.packed.set(packed);
        Ok(ground)
    }
}

impl PartialEq for Ground {
    fn eq(&self, other: &Ground) -> bool {
        self.is(other) || self.heights == other.heights
    }
}

impl fmt::Debug for Ground {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Millions of them are of no use.
        let Ground { heights, lowest, highest, .. } = self;
        write!(f, "Ground({} elevations from {lowest} to {highest} m)", heights.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stored_of_ground_is_that_ground() {
        let heights: Vec<f64> = (0..1000).map(|i| f64::from(i).sin() * 1e4).collect();
        let ground = Ground::new(heights.into());
        let stored = serde_json::to_string(&ground).unwrap();
        let read: Ground = serde_json::from_str(&stored).unwrap();
        assert_eq!(read, ground);
        assert_eq!((read.lowest(), read.highest()), (ground.lowest(), ground.highest()));
        assert!(serde_json::from_str::<Ground>("\"rubbish\"").is_err());
    }

    #[test]
    fn elevations_that_are_no_ground_are_named() {
        let grid = Grid { width: 2, depth: 2, height: 1, cell_size: 0.02 };
        let wrong = |heights: &[f64]| match Ground::checked(heights.into(), &grid) {
            Err(SessionError::Invalid(errors)) => errors[0].pointer.clone(),
            other => panic!("{other:?}"),
        };
        assert_eq!(wrong(&[0.0; 3]), "/heights");
        assert_eq!(wrong(&[0.0, 1.0, f64::NAN, 0.0]), "/heights/2");
        assert_eq!(wrong(&[0.0, 1.0, 0.0, -20_000.5]), "/heights/3");
        assert_eq!(wrong(&[0.0, 1310.73, 0.0, 0.0]), "/heights");
        assert!(Ground::checked([0.0, 1310.72, 0.0, 0.0].as_slice().into(), &grid).is_ok());
    }
}
