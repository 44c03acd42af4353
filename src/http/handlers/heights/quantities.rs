//! What else is told of the columns of alpine snow, read back from the device.

use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use firn_snow::{ColumnRect, ColumnTotals, MASS_QUANTA};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::accept;
use crate::http::answers::carry_on;
use crate::http::handlers::{json, reserved, stamp_headers};
use crate::http::npy;
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::Visit;

use super::encode::LONGEST_NUMBER;
use super::window::Window;
use super::{FLOATS, HeightsView, JSON, NPY, Origin, Values, WindowQuery};

/// Most columns that are read at a time.
const MOST_COLUMNS: u64 = 1 << 20;

/// The quantity that is read of each column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Depth of the snow \[m\].
    #[default]
    Depth,
    /// Mass of ice and water \[kg/m²\].
    SnowWaterEquivalent,
    /// Mass of liquid water \[kg/m²\].
    LiquidWater,
    /// Temperature of the surface of snow or ground \[°C\].
    SkinTemperature,
}

/// Every quantity by its name.
pub const QUANTITIES: [(&str, Quantity); 4] = [
    ("depth", Quantity::Depth),
    ("snow_water_equivalent", Quantity::SnowWaterEquivalent),
    ("liquid_water", Quantity::LiquidWater),
    ("skin_temperature", Quantity::SkinTemperature),
];

/// What these quantities exist as; the first is the default.
const MEDIA_TYPES: [&str; 3] = [JSON, FLOATS, NPY];

impl Quantity {
    fn of(self, totals: &ColumnTotals) -> f32 {
        let mass = |quanta: u32| (f64::from(quanta) / MASS_QUANTA) as f32;
        match self {
            Quantity::SnowWaterEquivalent => mass(totals.mass),
            Quantity::LiquidWater => mass(totals.water),
            Quantity::SkinTemperature => totals.surface.skin,
            // Depths are known without the device.
            Quantity::Depth => 0.0,
        }
    }
}

/// Answers with a quantity of a window, as the client accepts it.
pub async fn tell(
    app: &App,
    session: Visit,
    query: &WindowQuery,
    quantity: Quantity,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let media_type = accept::choose(headers, &MEDIA_TYPES).ok_or_else(|| {
        Problem::not_acceptable(format!("this quantity exists as {}", MEDIA_TYPES.join(", ")))
    })?;
    let grid = session.spec.grid;
    let window = Window::new(query, &grid)?;
    let columns = window.columns();
    let count = columns.columns();
    if count > MOST_COLUMNS {
        return Err(Problem::too_large(format!(
            "the window has {count} columns, more than the {MOST_COLUMNS} of one answer; ask for a part of them"
        )));
    }
    let bytes = count * size_of::<ColumnTotals>() as u64 + window.samples() * LONGEST_NUMBER as u64;
    let leave = app.answers.admit_found(&session, bytes).await?;
    carry_on(async move {
        let (stamp, totals) = session.column_totals(columns).await?;
        let answer = move || {
            let values: Vec<f32> = window.places().map(|at| quantity.of(&totals[at])).collect();
            let kind = [
                (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
                (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
                (header::VARY, HeaderValue::from_static("accept, accept-encoding")),
            ];
            let head = (stamp_headers(stamp), kind);
            Ok(match media_type {
                FLOATS => (head, floats(&[], &values)?).into_response(),
                NPY => {
                    let first = npy::header(window.depth as usize, window.width as usize);
                    (head, floats(&first, &values)?).into_response()
                }
                _ => {
                    let Window { origin, width, depth, stride } = window;
                    let (cell_size, count) = (grid.cell_size, values.len());
                    let view = HeightsView {
                        stamp,
                        origin,
                        width,
                        depth,
                        stride,
                        cell_size,
                        quantity: Some(quantity),
                        heights: Values::Others(values),
                    };
                    (head, json(&view, count * LONGEST_NUMBER)?).into_response()
                }
            })
        };
        leave.make(answer).await
    })
    .await
}

/// 32-bit floats, little-endian, behind some bytes.
fn floats(first: &[u8], values: &[f32]) -> Result<Vec<u8>, Problem> {
    let mut file = reserved(first.len() + 4 * values.len())?;
    file.extend(first);
    file.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    Ok(file)
}

impl Window {
    /// The columns that samples are taken from, with those between them.
    fn columns(&self) -> ColumnRect {
        let Origin { column_x: x0, column_z: z0 } = self.origin;
        let end = |first: u32, samples: u32| first + (samples - 1) * self.stride + 1;
        ColumnRect { x0, z0, x1: end(x0, self.width), z1: end(z0, self.depth) }
    }

    /// Where each sample is among those columns.
    fn places(&self) -> impl Iterator<Item = usize> + '_ {
        let across = (self.width - 1) * self.stride + 1;
        let place = move |x: u32, z: u32| (z * self.stride * across + x * self.stride) as usize;
        (0..self.depth).flat_map(move |z| (0..self.width).map(move |x| place(x, z)))
    }
}
