//! A study's numbers as comma-separated values.

use std::fmt::Write;

use super::study::Study;

/// All layers of all profiles, from the ground up.
pub(super) fn layers(study: &Study) -> String {
    let mut csv = "profile,time_s,layer,bottom_m,thickness_m,density_kg_m3,temperature_c,\
                   hardness_pa,stress_pa,mass_kg\n"
        .to_owned();
    for profile in &study.profiles {
        let name = field(&profile.label);
        for (i, layer) in profile.column.layers.iter().enumerate() {
            line(
                &mut csv,
                format_args!(
                    "{name},{:.3},{i},{:.6},{:.6},{:.4},{:.4},{:.3},{:.3},{:.6}",
                    profile.time,
                    layer.bottom,
                    layer.thickness,
                    layer.density,
                    layer.temperature,
                    layer.hardness,
                    layer.stress,
                    layer.mass
                ),
            );
        }
    }
    csv
}

/// Height over time, a column for each history.
pub(super) fn heights(study: &Study) -> String {
    let mut csv = "time_s".to_owned();
    for history in &study.histories {
        csv.push(',');
        csv.push_str(&field(&format!("{} [m]", history.label)));
    }
    csv.push('\n');
    let samples = study.histories.iter().map(|h| h.points.len()).min().unwrap_or(0);
    for i in 0..samples {
        let mut values = format!("{:.3}", study.histories[0].points[i].0);
        for history in &study.histories {
            // Writing to a string can't fail.
            let _ = write!(values, ",{:.6}", history.points[i].1);
        }
        line(&mut csv, format_args!("{values}"));
    }
    csv
}

fn line(csv: &mut String, values: std::fmt::Arguments<'_>) {
    // Writing to a string can't fail.
    let _ = writeln!(csv, "{values}");
}

/// A text as a field, in quotes where it needs them.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
