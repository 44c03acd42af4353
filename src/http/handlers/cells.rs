//! The fixed grid, sampled from the snow.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::response::{IntoResponse, Response};
use serde::{Serialize, Serializer};
use utoipa::{IntoParams, ToSchema};

use crate::http::docs::{ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query, Segments};
use crate::http::query::Params;
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::{MOST_SAMPLES, Session, Stamp};
use crate::snow::{ColumnRect, Content, Sample};

use super::{off_thread, span, stamp_headers};

/// Which cells are asked for, and what of them.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct CellsQuery {
    /// First column along x.
    #[param(default = 0)]
    column_x: Option<u32>,
    /// First column along z.
    #[param(default = 0)]
    column_z: Option<u32>,
    /// First cell along y; 0 stands on the lowest ground.
    #[param(default = 0)]
    cell_y: Option<u32>,
    /// Cells along x; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    width: Option<u32>,
    /// Cells along z; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    depth: Option<u32>,
    /// Cells along y; up to the grid's height on the highest ground where there is none.
    #[param(minimum = 1)]
    height: Option<u32>,
    /// Names of fields, separated by commas.
    #[param(value_type = Option<String>, default = "density,temperature")]
    fields: Vec<Field>,
}

/// A field of the fixed grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Field {
    /// Density \[kg/m³\].
    Density,
    /// Temperature \[°C\].
    Temperature,
    /// Hardness \[Pa\].
    Hardness,
    /// Stiffness \[Pa/m\].
    Stiffness,
    /// Vertical stress \[Pa\].
    Stress,
    /// Part of the stress that comes from objects \[Pa\].
    ExternalStress,
    /// Indent of one cycle \[m\].
    Indent,
    /// Areal mass \[kg/m²\].
    Mass,
    /// Part of the cell that snow fills, from 0 to 1.
    Fill,
}

/// Every field by its name.
const FIELDS: [(&str, Field); 9] = [
    ("density", Field::Density),
    ("temperature", Field::Temperature),
    ("hardness", Field::Hardness),
    ("stiffness", Field::Stiffness),
    ("stress", Field::Stress),
    ("external_stress", Field::ExternalStress),
    ("indent", Field::Indent),
    ("mass", Field::Mass),
    ("fill", Field::Fill),
];

impl Field {
    fn of(self, sample: &Sample) -> f32 {
        match self {
            Field::Density => sample.density,
            Field::Temperature => sample.temperature,
            Field::Hardness => sample.hardness,
            Field::Stiffness => sample.stiffness,
            Field::Stress => sample.stress,
            Field::ExternalStress => sample.external_stress,
            Field::Indent => sample.indent,
            Field::Mass => sample.mass,
            Field::Fill => sample.fill,
        }
    }
}

impl FromQuery for CellsQuery {
    fn from_query(params: &mut Params) -> CellsQuery {
        CellsQuery {
            column_x: params.whole("column_x", 0, u32::MAX),
            column_z: params.whole("column_z", 0, u32::MAX),
            cell_y: params.whole("cell_y", 0, u32::MAX),
            width: params.whole("width", 1, u32::MAX),
            depth: params.whole("depth", 1, u32::MAX),
            height: params.whole("height", 1, u32::MAX),
            fields: fields(params),
        }
    }
}

fn fields(params: &mut Params) -> Vec<Field> {
    let text = params.text("fields").unwrap_or_else(|| "density,temperature".to_owned());
    let mut fields = Vec::new();
    for name in text.split(',').filter(|name| !name.is_empty()) {
        match FIELDS.iter().find(|(known, _)| *known == name) {
            Some((_, field)) => fields.push(*field),
            None => {
                let known: Vec<&str> = FIELDS.iter().map(|(name, _)| *name).collect();
                let shown: String = name.chars().take(40).collect();
                params.reject(
                    "fields",
                    format!("'{shown}' is no field; known are {}", known.join(", ")),
                );
            }
        }
    }
    fields
}

/// A box of the fixed grid. Arrays have x fastest, then y, then z.
#[derive(Debug, Serialize, ToSchema)]
pub struct CellsView {
    /// When this holds.
    #[serde(flatten)]
    stamp: Stamp,
    /// First cell.
    origin: CellOrigin,
    /// Cells along x.
    width: u32,
    /// Cells along z.
    depth: u32,
    /// Cells along y.
    height: u32,
    /// What each cell holds.
    #[schema(value_type = Vec<ContentName>)]
    content: Contents,
    /// The fields asked for, by their names; `null` outside the snow.
    #[schema(value_type = BTreeMap<String, Vec<Option<f32>>>)]
    fields: BTreeMap<Field, Vec<Option<f32>>>,
}

/// A cell of the fixed grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct CellOrigin {
    /// Along x.
    column_x: u32,
    /// Along z.
    column_z: u32,
    /// Along y, from the lowest ground up.
    cell_y: u32,
}

/// What a cell holds.
#[derive(Clone, Copy, Debug, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContentName {
    /// Nothing.
    Air,
    /// Any snow.
    Snow,
    /// The terrain.
    Ground,
}

/// What cells hold, named as they are written.
#[derive(Debug)]
struct Contents(Vec<Sample>);

impl Serialize for Contents {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|sample| match sample.content() {
            Content::Air => ContentName::Air,
            Content::Snow => ContentName::Snow,
            Content::Ground => ContentName::Ground,
        }))
    }
}

/// Read the fixed grid
///
/// Cells of the grid's cell size, sampled from the material cells: density is the mass over the
/// part of a cell that snow fills, temperature is weighted by mass, everything else by that part.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/cells",
    operation_id = "get_cells",
    tag = "snow",
    params(SessionPath, CellsQuery),
    responses(
        (status = 200, description = "The cells", body = CellsView),
        (status = 413, description = "The answer would have more than 2²⁰ cells",
            body = Problem, content_type = "application/problem+json"),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Segments(id): Segments<String>,
    Query(query): Query<CellsQuery>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id)?;
    let (columns, y0, height) = window(&query, &session)?;
    let sampled = session.sample(columns, y0, height).await?;
    let answer = move || {
        let values = |field: Field| -> Vec<Option<f32>> {
            let snow = |sample: &Sample| sample.content() == Content::Snow;
            sampled.cells.iter().map(|s| snow(s).then(|| field.of(s))).collect()
        };
        let view = CellsView {
            stamp: sampled.stamp,
            origin: CellOrigin { column_x: columns.x0, column_z: columns.z0, cell_y: y0 },
            width: columns.x1 - columns.x0,
            depth: columns.z1 - columns.z0,
            height,
            fields: query.fields.iter().map(|&field| (field, values(field))).collect(),
            content: Contents(sampled.cells),
        };
        (stamp_headers(view.stamp), axum::Json(view)).into_response()
    };
    off_thread(answer).await
}

/// The box that is asked for: its columns, its first cell along y and how many there are.
fn window(query: &CellsQuery, session: &Session) -> Result<(ColumnRect, u32, u32), Problem> {
    let grid = session.spec.grid;
    let mut errors = Vec::new();
    let mut span = |names, first, count, cells| span(names, first, count, cells, &mut errors);
    let (x0, width) = span(["column_x", "width"], query.column_x, query.width, grid.width);
    let (z0, depth) = span(["column_z", "depth"], query.column_z, query.depth, grid.depth);
    let cells_y = session.sampled_height();
    let (y0, height) = span(["cell_y", "height"], query.cell_y, query.height, cells_y);
    if !errors.is_empty() {
        return Err(Problem::invalid(errors));
    }
    let columns = ColumnRect { x0, z0, x1: x0 + width, z1: z0 + depth };
    let cells = columns.columns() * u64::from(height);
    if cells > MOST_SAMPLES {
        return Err(Problem::too_large(format!(
            "{width} × {height} × {depth} makes {cells} cells, more than the {MOST_SAMPLES} of one \
             answer; ask for a part of them"
        )));
    }
    Ok((columns, y0, height))
}
