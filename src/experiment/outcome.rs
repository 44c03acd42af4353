//! The studies of the experiments, made of what was recorded and what the thesis and the oracle have.

use firn_protocol::{ColumnView, LayerView, WeakLayerView};

use crate::diagram::number;

use super::recording::{PlateRecord, Recording};
use super::reference::{Expected, Row};
use super::setup::Experiment;
use super::study::{History, Profile, Study};

/// Simulated time of the last state \[s\] of an experiment with one snowfall.
const END: f64 = 120.0;

/// Simulated time of the early state \[s\].
const EARLY: f64 = 30.0;

/// What the thesis and the oracle have for snow that settles from the beginning.
struct Settling {
    thesis_height: f64,
    /// The oracle's height \[m\] after 30 s and after 120 s.
    heights: [f64; 2],
    /// Mass of a column \[kg\].
    mass: f64,
    thesis_mass: &'static str,
}

/// The studies of an experiment, made of the recordings of its set-ups.
pub(super) fn studies(experiment: Experiment, recordings: &[Recording]) -> Vec<Study> {
    match (experiment, recordings) {
        (Experiment::OneA, [it]) => vec![settling(
            "1a",
            "Experiment 1.a: 5.8 m of snow at −3 °C",
            it,
            &Settling {
                thesis_height: 4.8,
                heights: [4.797, 4.685],
                mass: 4.64,
                thesis_mass: "4.92",
            },
        )],
        (Experiment::OneB, [it]) => vec![settling(
            "1b",
            "Experiment 1.b: 5.8 m of snow at −10 °C",
            it,
            &Settling {
                thesis_height: 5.4,
                heights: [5.411, 5.408],
                mass: 4.64,
                thesis_mass: "4.66",
            },
        )],
        (Experiment::Two, [it]) => vec![settling(
            "2",
            "Experiment 2: 5.6 m of snow, −3 °C at the ground and 2 °C colder every 0.8 m",
            it,
            &Settling {
                thesis_height: 5.0,
                heights: [5.016, 4.969],
                mass: 4.48,
                thesis_mass: "4.92",
            },
        )],
        (Experiment::Three, [it]) => vec![snowfalls(it)],
        (Experiment::Colliders, [warm, cold]) => vec![
            colliders(
                "colliders-1a",
                "Colliders on experiment 1.a: 100 kg on 16, 1 and 0.1 m², −3 °C",
                warm,
                [0.049, 0.567, 1.622].map(Expected::height),
            ),
            colliders(
                "colliders-1b",
                "Colliders on experiment 1.b: 100 kg on 16, 1 and 0.1 m², −10 °C",
                cold,
                // The oracle has the warm snow only; colder snow carries better.
                [0, 1, 2].map(|i| Expected::AtMost(sink(warm, &warm.plates[i]))),
            ),
        ],
        (Experiment::Prototype, [warm, cold]) => vec![prototype(warm, cold)],
        _ => Vec::new(),
    }
}

fn settling(name: &str, title: &str, it: &Recording, known: &Settling) -> Study {
    let end = &it.phases[0];
    let thesis_fallen = format!("{:.2}", known.mass);
    let mut rows = vec![
        Row::new("height after 30 s [m]", 3, it.early.height)
            .expect(Expected::height(known.heights[0])),
        Row::new("height after 120 s [m]", 3, end.height)
            .thesis(number(known.thesis_height, 1))
            .expect(Expected::height(known.heights[1])),
        uneven(it),
    ];
    rows.extend(mass(it, known.mass, &thesis_fallen, known.thesis_mass));
    Study {
        name: name.to_owned(),
        title: title.to_owned(),
        profiles: vec![
            Profile::new("fresh", 0.0, &it.fresh),
            Profile::new("after 30 s", EARLY, &it.early),
            Profile::new("after 120 s", END, end).last(),
        ],
        histories: vec![History { label: "snow".to_owned(), points: it.heights.clone() }],
        thesis_height: Some(known.thesis_height),
        oracle_heights: vec![(EARLY, known.heights[0]), (END, known.heights[1])],
        rows,
    }
}

fn snowfalls(it: &Recording) -> Study {
    const ORDER: [&str; 4] = ["1st", "2nd", "3rd", "4th"];
    const HEIGHTS: [f64; 4] = [3.295, 4.092, 6.277, 7.687];
    let end = it.phases.last().expect("four snowfalls");
    let mut rows: Vec<Row> = (it.phases.iter().zip(ORDER).zip(HEIGHTS))
        .map(|((column, nth), height)| {
            Row::new(format!("height after the {nth} snowfall [m]"), 3, column.height)
                .expect(Expected::height(height))
        })
        .collect();
    rows.push(uneven(it));
    rows.extend(mass(it, 9.28, "–", "not conserved"));

    let weak = end.weak_layers.first();
    let of_weak = |value: fn(&WeakLayerView) -> f64| weak.map_or(f64::NAN, value);
    let cold = end.layers.iter().filter(|layer| layer.temperature < -12.0);
    let coldest = end.layers.iter().map(|layer| layer.temperature).fold(0.0, f64::min);
    rows.extend([
        Row::new("weak layers", 0, end.weak_layers.len() as f64)
            .thesis("1")
            .expect(Expected::exactly(1.0)),
        Row::new("density of the weak layer [kg/m³]", 1, of_weak(|weak| weak.density))
            .expect(Expected::Near { value: 28.0, tolerance: 0.2 }),
        Row::new("its contrast", 2, of_weak(|weak| weak.contrast))
            .expect(Expected::Near { value: 0.27, tolerance: 0.01 }),
        Row::new("snow below −12 °C [m]", 2, cold.map(|layer| layer.thickness).sum())
            .expect(Expected::AtLeast(0.80)),
        Row::new("coldest snow [°C]", 1, coldest).expect(Expected::AtMost(-14.9)),
    ]);

    let mut profiles: Vec<Profile> = (it.phases.iter().zip(ORDER).zip(1..))
        .map(|((column, nth), i)| {
            Profile::new(format!("after the {nth} snowfall"), END * f64::from(i), column)
        })
        .collect();
    profiles[ORDER.len() - 1].last = true;
    Study {
        name: "3".to_owned(),
        title: "Experiment 3: snowfalls of 3.6, 1.2, 3.6 and 3.2 m, the second at −15 °C"
            .to_owned(),
        profiles,
        histories: vec![History { label: "snow".to_owned(), points: it.heights.clone() }],
        thesis_height: None,
        oracle_heights: (1..).map(|i| END * f64::from(i)).zip(HEIGHTS).collect(),
        rows,
    }
}

fn colliders(name: &str, title: &str, it: &Recording, sinks: [Expected; 3]) -> Study {
    const THESIS: [&str; 3] = ["none", "little", "almost all"];
    const PRESSURES: [f64; 3] = [61.3125, 981.0, 9810.0];
    let end = &it.phases[0];
    let mut rows = vec![Row::new("height of the snow around [m]", 3, end.height)];
    let mut profiles = vec![Profile::new("snow around", END, end).last()];
    let mut histories =
        vec![History { label: "snow around".to_owned(), points: it.heights.clone() }];
    for (i, record) in it.plates.iter().enumerate() {
        let label = format!("under {}", record.plate.label);
        let view = &record.view;
        let pressure = PRESSURES[i];
        rows.push(
            Row::new(format!("pressure {label} [Pa]"), 1, view.pressure)
                .expect(Expected::Near { value: pressure, tolerance: 1e-4 * pressure }),
        );
        rows.push(
            Row::new(format!("sink {label} [m]"), 3, sink(it, record))
                .thesis(THESIS[i])
                .expect(sinks[i]),
        );
        profiles.push(Profile::new(label.clone(), END, &record.column).last());
        histories.push(History { label, points: record.bottoms.clone() });
    }
    rows.extend(mass(it, 4.64, "–", "–"));
    Study {
        name: name.to_owned(),
        title: title.to_owned(),
        profiles,
        histories,
        thesis_height: None,
        oracle_heights: Vec::new(),
        rows,
    }
}

/// How far a plate is below the snow around \[m\].
fn sink(it: &Recording, record: &PlateRecord) -> f64 {
    it.phases[0].height - record.view.bottom
}

fn prototype(warm: &Recording, cold: &Recording) -> Study {
    let mut rows = Vec::new();
    let mut profiles = Vec::new();
    let mut histories = Vec::new();
    let expected = [("−3 °C", "about 2", 1.9), ("−10 °C", "deeper", 3.0)];
    for (it, (label, thesis, depth)) in [warm, cold].into_iter().zip(expected) {
        let end = &it.phases[0];
        let start = compaction_start(&it.fresh);
        rows.push(
            Row::new(format!("compaction starts at {label} [m]"), 1, start)
                .thesis(thesis)
                .expect(Expected::Near { value: depth, tolerance: 0.05 }),
        );
        // The cell that the start lies in is compacted, those above it are not.
        rows.push(
            Row::new(format!("snow still fresh at {label} [m]"), 1, untouched(&it.fresh, end))
                .expect(Expected::AtMost(start)),
        );
        rows.push(Row::new(format!("height at {label} [m]"), 3, end.height));
        rows.extend(mass(it, 6.4, "–", "–"));
        profiles.push(Profile::new(label, END, end).last());
        histories.push(History { label: label.to_owned(), points: it.heights.clone() });
    }
    Study {
        name: "prototype".to_owned(),
        title: "Prototype: a column of 8 m at −3 °C and at −10 °C".to_owned(),
        profiles,
        histories,
        thesis_height: None,
        oracle_heights: Vec::new(),
        rows,
    }
}

/// Depth \[m\] at which the weight of fresh snow reaches its hardness, between the lower faces of
/// two cells.
fn compaction_start(fresh: &ColumnView) -> f64 {
    let (mut above, mut over_above) = (0.0, None);
    for layer in fresh.layers.iter().rev() {
        let (depth, over) = (fresh.height - layer.bottom, layer.stress - layer.hardness);
        if over > 0.0 {
            let from = over_above.unwrap_or(-layer.hardness);
            return above + (depth - above) * -from / (over - from);
        }
        (above, over_above) = (depth, Some(over));
    }
    f64::NAN
}

/// Depth \[m\] down to which no cell has changed.
fn untouched(fresh: &ColumnView, end: &ColumnView) -> f64 {
    let unchanged = |(a, b): &(&LayerView, &LayerView)| a.thickness == b.thickness;
    let pairs = end.layers.iter().rev().zip(fresh.layers.iter().rev());
    pairs.take_while(unchanged).map(|(layer, _)| layer.thickness).sum()
}

fn uneven(it: &Recording) -> Row {
    Row::new("largest difference between columns [m]", 3, it.unevenness)
        .expect(Expected::exactly(0.0))
}

/// Mass of a column before and after, and what is out of balance.
fn mass(it: &Recording, fallen: f64, thesis_fallen: &str, thesis_present: &str) -> [Row; 3] {
    [
        Row::new("mass that fell [kg/column]", 3, it.fallen)
            .thesis(thesis_fallen)
            .expect(Expected::exactly(fallen)),
        Row::new("mass in the end [kg/column]", 3, it.present)
            .thesis(thesis_present)
            .expect(Expected::exactly(fallen)),
        Row::new("mass out of balance [quanta]", 0, it.imbalance as f64)
            .expect(Expected::exactly(0.0)),
    ]
}
