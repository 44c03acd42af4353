//! Weak layers: snow less dense than what lies above and below it (thesis 3.2.3).

use firn_protocol::{LayerView, WeakLayerView};

/// Largest density of a cell of a weak layer, relative to the cells around.
const WEAK_RATIO: f64 = 0.8;

/// Maximal runs of cells with ρ ≤ 0.8 · min(densest cell anywhere above, densest anywhere below),
/// from the ground up.
pub(crate) fn weak_layers(layers: &[LayerView]) -> Vec<WeakLayerView> {
    let ratios = density_ratios(layers);
    let mut found: Vec<WeakLayerView> = Vec::new();
    let mut start = 0;
    while start < layers.len() {
        let length = ratios[start..].iter().take_while(|&&ratio| ratio <= WEAK_RATIO).count();
        if length > 0 {
            let run = start..start + length;
            let smallest = ratios[run.clone()].iter().copied().fold(f64::INFINITY, f64::min);
            found.push(describe(&layers[run], 1.0 - smallest));
        }
        start += length + 1;
    }
    found
}

/// Each cell's density over that of the less dense of the densest cell above and the densest
/// below; infinite for the lowest and the highest cell.
fn density_ratios(layers: &[LayerView]) -> Vec<f64> {
    let mut above = vec![0.0f64; layers.len()];
    let mut densest = 0.0f64;
    for (i, layer) in layers.iter().enumerate().rev() {
        above[i] = densest;
        densest = densest.max(layer.density);
    }
    let mut below = 0.0f64;
    let mut ratios = Vec::with_capacity(layers.len());
    for (layer, above) in layers.iter().zip(above) {
        ratios.push(layer.density / above.min(below));
        below = below.max(layer.density);
    }
    ratios
}

fn describe(run: &[LayerView], contrast: f64) -> WeakLayerView {
    let thickness: f64 = run.iter().map(|cell| cell.thickness).sum();
    let mass: f64 = run.iter().map(|cell| cell.mass).sum();
    WeakLayerView {
        bottom: run[0].bottom,
        thickness,
        density: run.iter().map(|cell| cell.density * cell.thickness).sum::<f64>() / thickness,
        temperature: run.iter().map(|cell| cell.temperature * cell.mass).sum::<f64>() / mass,
        contrast,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(densities: &[f64]) -> Vec<LayerView> {
        densities
            .iter()
            .enumerate()
            .map(|(i, &density)| LayerView {
                bottom: 0.2 * i as f64,
                thickness: 0.2,
                density,
                temperature: -3.0,
                hardness: 0.0,
                stress: 0.0,
                mass: density * 0.2,
                liquid_water: None,
                hand_hardness: None,
            })
            .collect()
    }

    #[test]
    fn a_run_between_denser_snow_is_one_weak_layer() {
        let found = weak_layers(&column(&[42.0, 41.0, 28.0, 27.0, 38.0, 35.0, 30.0]));
        assert_eq!(found.len(), 1);
        assert!((found[0].bottom - 0.4).abs() < 1e-12);
        assert!((found[0].thickness - 0.4).abs() < 1e-12);
        assert!((found[0].contrast - (1.0 - 27.0 / 38.0)).abs() < 1e-12);
    }

    #[test]
    fn snow_that_only_gets_lighter_upwards_has_no_weak_layer() {
        assert!(weak_layers(&column(&[60.0, 50.0, 30.0, 20.0])).is_empty());
        assert!(weak_layers(&[]).is_empty());
    }
}
