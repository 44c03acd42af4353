//! Much weather in one frame, as when a journal is gone through again.

use firn_engine::frame::{Backend, Edit};
use firn_snow::{Grid, Material};

use crate::support::*;

/// Thin snow that is topped up with, thick snow, snow on other columns and clearings, on several
/// tiles, until there is no room: whatever way each takes through the kernel, it is the same as if
/// it were alone in its frame.
#[test]
fn many_changes_of_one_frame_leave_the_bits_that_each_by_itself_leaves() {
    let Some(mut gpu) = gpu(false) else { return };
    let grid = Grid { width: 21, depth: 18, height: 14, cell_size: 0.2 };
    let material = Material::default();
    for slot in 0..2 {
        gpu.create(slot, &level(grid, material)).unwrap();
    }
    let mut dice = Dice::new(7);
    for round in 0..6 {
        let edits: Vec<Edit> = (0..200)
            .map(|_| match dice.below(8) {
                0 => dice.weather(&grid, &material),
                1..4 => {
                    let columns = if dice.unit() < 0.5 { grid.all() } else { dice.rect(&grid) };
                    let (depth, celsius) = (dice.range(0.001, 0.03), dice.range(-3.2, -3.0));
                    snow(&grid, columns, depth, dice.range(19.5, 20.5), celsius)
                }
                _ => snow(&grid, dice.rect(&grid), 0.001, 20.0, -3.0),
            })
            .collect();
        let together = edit(&mut gpu, 0, edits.clone()).edits;
        let alone: Vec<u64> =
            edits.iter().map(|one| edit(&mut gpu, 1, vec![one.clone()]).edits[0]).collect();
        assert_eq!(together, alone, "round {round}: what was refused and cleared");
        assert!(together.iter().any(|&quanta| quanta > 0), "round {round}: nothing was");
        let (a, b) = (cells(&mut gpu, 0, &grid), cells(&mut gpu, 1, &grid));
        assert!(a == b, "round {round}: {:?}", compare(&a, &b));
    }
}
