//! The fixed grid, sampled from the snow.

use std::collections::BTreeSet;

use axum::extract::State;
use axum::response::{IntoResponse, Response};
use firn_protocol::{Reference, Stamp};
use firn_snow::{ColumnRect, Content, Sample};
use serde::{Serialize, Serializer};
use utoipa::{IntoParams, ToSchema};

use crate::http::answers::carry_on;
use crate::http::docs::{ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::{FromQuery, Query};
use crate::http::query::Params;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::quote::quote;
use crate::session::{CellBox, MOST_SAMPLES, Sampled, Session};

use super::{json, span, stamp_headers};

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
    /// What cells along y are counted from: the lowest ground of the session, or the ground of each column.
    #[param(inline, required = false)]
    reference: Reference,
    /// First cell along y; 0 stands on what is counted from.
    #[param(default = 0)]
    cell_y: Option<u32>,
    /// Cells along x; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    width: Option<u32>,
    /// Cells along z; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    depth: Option<u32>,
    /// Cells along y; up to the grid's height, on the highest ground, where there is none.
    #[param(minimum = 1)]
    height: Option<u32>,
    /// Names of fields, separated by commas.
    #[param(value_type = Option<String>, default = "density,temperature")]
    fields: BTreeSet<Field>,
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
    /// Areal mass of liquid water \[kg/m²\]; 0 but in alpine snow.
    LiquidWater,
}

/// What cells along y may be counted from, by name.
const REFERENCES: [(&str, Reference); 2] =
    [("lowest", Reference::Lowest), ("ground", Reference::Ground)];

/// Every field by its name.
const FIELDS: [(&str, Field); 10] = [
    ("density", Field::Density),
    ("temperature", Field::Temperature),
    ("hardness", Field::Hardness),
    ("stiffness", Field::Stiffness),
    ("stress", Field::Stress),
    ("external_stress", Field::ExternalStress),
    ("indent", Field::Indent),
    ("mass", Field::Mass),
    ("fill", Field::Fill),
    ("liquid_water", Field::LiquidWater),
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
            Field::LiquidWater => sample.liquid_water,
        }
    }
}

impl FromQuery for CellsQuery {
    fn from_query(params: &mut Params) -> CellsQuery {
        CellsQuery {
            column_x: params.whole("column_x", 0, u32::MAX),
            column_z: params.whole("column_z", 0, u32::MAX),
            reference: params.choice("reference", &REFERENCES).unwrap_or_default(),
            cell_y: params.whole("cell_y", 0, u32::MAX),
            width: params.whole("width", 1, u32::MAX),
            depth: params.whole("depth", 1, u32::MAX),
            height: params.whole("height", 1, u32::MAX),
            fields: fields(params),
        }
    }
}

fn fields(params: &mut Params) -> BTreeSet<Field> {
    let text = params.text("fields").unwrap_or_else(|| "density,temperature".to_owned());
    let mut fields = BTreeSet::new();
    for name in text.split(',').filter(|name| !name.is_empty()) {
        match FIELDS.iter().find(|(known, _)| *known == name) {
            Some((_, field)) => {
                fields.insert(*field);
            }
            None => {
                let known: Vec<&str> = FIELDS.iter().map(|(name, _)| *name).collect();
                let shown = quote(name);
                let known = known.join(", ");
                params.reject("fields", format!("{shown} is no field; known are {known}"));
            }
        }
    }
    fields
}

/// A box of the fixed grid. Arrays have x fastest, then y, then z.
#[derive(Debug, Serialize, ToSchema)]
pub struct CellsView<'a> {
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
    content: Contents<'a>,
    /// The fields asked for, by their names; `null` outside the snow.
    #[schema(value_type = std::collections::BTreeMap<String, Vec<Option<f32>>>)]
    fields: Fields<'a>,
}

/// A cell of the fixed grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct CellOrigin {
    /// Along x.
    column_x: u32,
    /// Along z.
    column_z: u32,
    /// Along y, from what `reference` says up.
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
struct Contents<'a>(&'a [Sample]);

impl Serialize for Contents<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|sample| match sample.content() {
            Content::Air => ContentName::Air,
            Content::Snow => ContentName::Snow,
            Content::Ground => ContentName::Ground,
        }))
    }
}

/// Some fields of cells, by their names.
#[derive(Debug)]
struct Fields<'a> {
    names: &'a BTreeSet<Field>,
    cells: &'a [Sample],
}

impl Serialize for Fields<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = |&field: &Field| (field, Values { field, cells: self.cells });
        serializer.collect_map(self.names.iter().map(values))
    }
}

/// One field of cells.
struct Values<'a> {
    field: Field,
    cells: &'a [Sample],
}

impl Serialize for Values<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let snow = |cell: &Sample| cell.content() == Content::Snow;
        serializer.collect_seq(self.cells.iter().map(|c| snow(c).then(|| self.field.of(c))))
    }
}

/// Memory that an answer takes for each cell while it is made \[bytes\]: the sample and the name of what
/// it holds, and the longest number there is for each field.
const BYTES_PER_CELL: u64 = 56;
const BYTES_PER_VALUE: u64 = 14;

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
    Target(session): Target,
    Query(query): Query<CellsQuery>,
) -> Result<Response, Problem> {
    let wanted = window(&query, &session)?;
    let bytes_per_cell = BYTES_PER_CELL + BYTES_PER_VALUE * query.fields.len() as u64;
    let leave = app.answers.admit_found(&session, wanted.cells() * bytes_per_cell).await?;
    carry_on(async move {
        let Sampled { stamp, cells } = session.sample_grid(wanted).await?;
        let answer = move || {
            let CellBox { columns, y0, height, .. } = wanted;
            let view = CellsView {
                stamp,
                origin: CellOrigin { column_x: columns.x0, column_z: columns.z0, cell_y: y0 },
                width: columns.x1 - columns.x0,
                depth: columns.z1 - columns.z0,
                height,
                content: Contents(&cells),
                fields: Fields { names: &query.fields, cells: &cells },
            };
            let json = json(&view, cells.len() * bytes_per_cell as usize)?;
            Ok((stamp_headers(stamp), json).into_response())
        };
        leave.make(answer).await
    })
    .await
}

/// The box that is asked for.
fn window(query: &CellsQuery, session: &Session) -> Result<CellBox, Problem> {
    let grid = session.spec.grid;
    let mut errors = Vec::new();
    let mut span = |names, first, count, cells| span(names, first, count, cells, &mut errors);
    let (x0, width) = span(["column_x", "width"], query.column_x, query.width, grid.width);
    let (z0, depth) = span(["column_z", "depth"], query.column_z, query.depth, grid.depth);
    let cells_y = session.sampled_height(query.reference);
    let (y0, height) = span(["cell_y", "height"], query.cell_y, query.height, cells_y);
    if !errors.is_empty() {
        return Err(Problem::invalid(errors));
    }
    let columns = ColumnRect { x0, z0, x1: x0 + width, z1: z0 + depth };
    let wanted = CellBox { columns, reference: query.reference, y0, height };
    let cells = wanted.cells();
    if cells > MOST_SAMPLES {
        return Err(Problem::too_large(format!(
            "{width} × {height} × {depth} makes {cells} cells, more than the {MOST_SAMPLES} of one \
             answer; ask for a part of them"
        )));
    }
    Ok(wanted)
}
