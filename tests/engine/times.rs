//! Stages are timed in some frames, which changes nothing in any of them.

use firn_engine::frame::Backend;
use firn_snow::{Grid, Material, Shape};

use crate::support::*;

#[test]
fn one_frame_in_so_many_is_timed_and_no_other() {
    let (Some(mut timed), Some(mut plain)) = (gpu(false), gpu(false)) else { return };
    if !timed.take_times_of_one_in(3) {
        eprintln!("NOT TESTED: this adapter takes no times");
        let everything = std::env::var("FIRN_TEST_EVERYTHING").is_ok_and(|set| set == "1");
        assert!(
            !everything,
            "FIRN_TEST_EVERYTHING=1 asks for every test, and so for an adapter that does"
        );
        return;
    }
    let grid = Grid { width: 20, depth: 10, height: 20, cell_size: 0.2 };
    let layout = level(grid, Material::default());
    for frame in 0..10 {
        for gpu in [&mut timed, &mut plain] {
            match frame {
                0 => {
                    gpu.create(0, &layout).unwrap();
                    let sledge = put(&grid, "a", 80.0, Shape::Disk { radius: 0.5 }, 1.0, 1.0);
                    edit(gpu, 0, vec![snow(&grid, grid.all(), 2.0, 20.0, -3.0), sledge]);
                }
                _ => drop(run(gpu, 0, 5, 0.1)),
            }
        }
        let times = timed.stage_times().unwrap();
        assert_eq!(times.is_empty(), frame % 3 != 0, "{frame}: {times:?}");
        assert!(plain.stage_times().unwrap().is_empty());
        let stages: Vec<&str> = times.iter().map(|&(stage, _)| stage).collect();
        if frame == 0 {
            assert_eq!(stages.first(), Some(&"snowfall"), "{times:?}");
        } else if !stages.is_empty() {
            assert!(stages.contains(&"compact") && stages.contains(&"contact"), "{times:?}");
            assert!(times.iter().any(|(_, time)| !time.is_zero()), "{times:?}");
        }
    }
    assert!(cells(&mut timed, 0, &grid) == cells(&mut plain, 0, &grid));
}
