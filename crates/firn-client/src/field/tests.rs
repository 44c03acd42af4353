use firn_protocol::{Pressing, Settings, Stamp};

use super::*;

fn welcome(epoch: &str) -> Welcome {
    let settings = Settings {
        air_temperature: -3.0,
        time_scale: 1.0,
        tick_rate: 60.0,
        paused: true,
        snowfall_rate: 0.0,
        pressing: Pressing::default(),
        idle_timeout_s: None,
        delete_after_s: None,
    };
    Welcome {
        session: "alp".to_owned(),
        epoch: epoch.to_owned(),
        stamp: Stamp::default(),
        tile_size: TILE_SIDE,
        grid: Grid { width: 20, depth: 10, height: 4, cell_size: 0.5 },
        settings,
    }
}

fn field(wish: &Subscribe) -> HeightField {
    HeightField::new(&welcome("e"), 1, wish)
}

fn told(seq: u64, more: bool, tiles: Vec<HeightTile>) -> Heights {
    Heights {
        snapshot: false,
        id: 1,
        seq,
        tick: 7,
        recovered: None,
        more,
        tiles,
        level: false,
        terrain: Vec::new(),
        colliders: None,
    }
}

fn tile(column_x: u64, column_z: u64, width: u32, depth: u32, height: f64) -> HeightTile {
    let heights = vec![height; (width * depth) as usize];
    HeightTile { column_x, column_z, width, depth, heights }
}

#[test]
fn a_region_is_widened_to_whole_tiles_of_the_grid() {
    let region = ColumnRegion { column_x: 9, column_z: -3, width: 8, depth: 5 };
    let part = field(&Subscribe { region: Some(region), ..Subscribe::default() });
    assert_eq!((part.origin(), part.size()), ((8, 0), (12, 8)));
    let all = field(&Subscribe { stride: 4, ..Subscribe::default() });
    assert_eq!((all.origin(), all.size()), ((0, 0), (5, 3)));
}

#[test]
fn a_sample_stands_for_the_columns_that_there_are() {
    let mut coarse = field(&Subscribe { stride: 8, ..Subscribe::default() });
    assert!(coarse.take(&told(1, false, vec![tile(16, 8, 1, 1, 2.0)])));
    assert_eq!((coarse.height(16, 8), coarse.height(19, 9)), (Some(2.0), Some(2.0)));
    assert_eq!((coarse.height(20, 9), coarse.height(19, 10)), (None, None));
}

#[test]
fn the_ground_is_level_but_where_it_is_told() {
    let mut field = field(&Subscribe { terrain: true, ..Subscribe::default() });
    assert_eq!((field.ground().len(), field.ground_height(0, 0)), (200, None));
    let level = |terrain| Heights { level: true, terrain, ..told(1, false, Vec::new()) };
    assert!(field.take(&level(vec![tile(16, 8, 4, 2, -2.5)])));
    assert_eq!((field.ground_height(15, 9), field.ground_height(16, 8)), (Some(0.0), Some(-2.5)));
    let hill = Heights { terrain: vec![tile(8, 0, 8, 8, 3.0)], ..told(2, false, Vec::new()) };
    assert!(field.take(&hill));
    assert_eq!((field.ground_height(8, 0), field.ground_height(16, 8)), (Some(3.0), Some(-2.5)));
    assert!(field.take(&level(Vec::new())));
    assert!(field.ground().iter().all(|&elevation| elevation == 0.0));
    assert_eq!(field.height(8, 0), None, "no snow was told");
}

#[test]
fn ground_that_is_not_wanted_is_not_kept() {
    let mut field = field(&Subscribe::default());
    let told = Heights { terrain: vec![tile(0, 0, 8, 8, 1.0)], ..told(1, false, Vec::new()) };
    assert!(field.take(&told));
    assert_eq!((field.ground(), field.ground_height(0, 0)), (&[][..], None));
}

#[test]
fn it_resumes_from_what_is_complete() {
    let mut field = field(&Subscribe::default());
    assert_eq!((field.height(1, 1), field.resume()), (None, None));
    assert!(!field.take(&told(5, true, vec![tile(0, 0, 8, 8, 1.5)])));
    assert_eq!((field.height(7, 7), field.resume()), (Some(1.5), None));
    assert!(field.take(&told(5, false, vec![tile(16, 8, 4, 2, 0.25)])));
    assert_eq!((field.height(19, 9), field.height(20, 9)), (Some(0.25), None));
    assert_eq!(field.resume(), Some(Resume { epoch: "e".to_owned(), seq: 5 }));
}

#[test]
fn another_stream_goes_on_with_it() {
    let mut field = field(&Subscribe::default());
    assert!(field.take(&told(5, false, vec![tile(0, 0, 8, 8, 1.5)])));
    assert_eq!(field.reconnect(&welcome("e"), 2), Ok(()));
    assert!(field.resume().is_some() && field.height(0, 0) == Some(1.5));
    assert!(!field.take(&told(6, false, Vec::new())), "of the old subscription");
    assert_eq!(field.reconnect(&welcome("f"), 3), Ok(()));
    let seen = field.resume().unwrap();
    assert_eq!((&*seen.epoch, seen.seq), ("e", 5), "the server has been started since");
    let told = Heights { id: 3, ..told(70, false, vec![tile(0, 0, 8, 8, 2.5)]) };
    assert!(field.take(&told) && field.height(0, 0) == Some(2.5));
    assert_eq!(field.resume().unwrap().epoch, "f");
    let mut other = welcome("f");
    other.grid.width += 1;
    assert_eq!(field.reconnect(&other, 4), Err(OtherGrid));
}
