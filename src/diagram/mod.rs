//! Diagrams as SVG: of single columns of snow, and whatever else has two axes.

mod axis;
mod chart;
mod column;

pub use axis::Axis;
pub use chart::{Band, Chart, ChartError, Dots, Line, Weight, draw};
pub use column::{
    REFERENCE, colours, density_over_depth, depth_axis, greatest, hardness_over_density,
    over_depth, profile, weak_bands,
};

/// A number with a number of digits after the point, and a true minus sign.
pub fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}
