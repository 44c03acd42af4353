//! What of the snow is to be drawn, and how.

use firn_snow::ColumnRect;
use utoipa::IntoParams;

use crate::http::extract::FromQuery;
use crate::http::handlers::span;
use crate::http::query::Params;
use crate::problem::{FieldError, Problem};
use crate::render::{
    Axis, Background, Camera, Field, MOST_PIXELS, Picture, Projection, SIDES, View,
};
use crate::session::Session;

/// Values beyond this are none that snow has.
const GREATEST: f32 = 1e9;

/// A picture of some columns.
#[derive(Debug)]
pub struct RenderQuery {
    /// How it is to look.
    pub picture: Picture,
    column_x: Option<u32>,
    column_z: Option<u32>,
    columns_x: Option<u32>,
    columns_z: Option<u32>,
    at: Option<u32>,
}

impl FromQuery for RenderQuery {
    fn from_query(params: &mut Params) -> RenderQuery {
        RenderQuery {
            picture: picture(params),
            column_x: params.whole("column_x", 0, u32::MAX),
            column_z: params.whole("column_z", 0, u32::MAX),
            columns_x: params.whole("columns_x", 1, u32::MAX),
            columns_z: params.whole("columns_z", 1, u32::MAX),
            // Only a section asks whether it lies in the grid: what no grid has is refused in any view.
            at: params.whole("at", 0, i32::MAX as u32),
        }
    }
}

fn picture(params: &mut Params) -> Picture {
    let usual = Picture::default();
    let (shortest, longest) = SIDES;
    let picture = Picture {
        view: params.choice("view", &View::ALL).unwrap_or(usual.view),
        field: params.choice("field", &Field::ALL).unwrap_or(usual.field),
        width: params.whole("width", shortest, longest).unwrap_or(usual.width),
        height: params.whole("height", shortest, longest).unwrap_or(usual.height),
        camera: Camera {
            yaw: params.number("yaw", -360.0, 360.0).unwrap_or(usual.camera.yaw),
            pitch: params.number("pitch", 0.0, 90.0).unwrap_or(usual.camera.pitch),
            zoom: params.number("zoom", 0.1, 10.0).unwrap_or(usual.camera.zoom),
            projection: params
                .choice("projection", &Projection::ALL)
                .unwrap_or(usual.camera.projection),
        },
        along: params.choice("along", &Axis::ALL).unwrap_or(usual.along),
        min: params.number("min", -GREATEST, GREATEST),
        max: params.number("max", -GREATEST, GREATEST),
        shading: params.flag("shading").unwrap_or(usual.shading),
        legend: params.flag("legend").unwrap_or(usual.legend),
        colliders: params.flag("colliders").unwrap_or(usual.colliders),
        background: params.choice("background", &Background::ALL).unwrap_or(usual.background),
    };
    if picture.width * picture.height > MOST_PIXELS {
        let (width, height) = (picture.width, picture.height);
        let detail = format!("{width} × {height} are more than {MOST_PIXELS} pixels");
        params.reject("width", detail);
    }
    if let (Some(min), Some(max)) = (picture.min, picture.max)
        && min >= max
    {
        params.reject("max", format!("expected more than `min`, which is {min}, found {max}"));
    }
    picture
}

impl RenderQuery {
    /// The columns that are shown.
    ///
    /// # Errors
    /// 422 where they are not all in the grid.
    pub fn region(&self, session: &Session) -> Result<ColumnRect, Problem> {
        let grid = session.spec.grid;
        let mut errors = Vec::new();
        let mut span = |names, first, count, cells| span(names, first, count, cells, &mut errors);
        let (x0, width) =
            span(["column_x", "columns_x"], self.column_x, self.columns_x, grid.width);
        let (z0, depth) =
            span(["column_z", "columns_z"], self.column_z, self.columns_z, grid.depth);
        let mut region = ColumnRect { x0, z0, x1: x0 + width, z1: z0 + depth };
        if self.picture.view == View::Section {
            let (first, end) = match self.picture.along {
                Axis::X => (&mut region.z0, &mut region.z1),
                Axis::Z => (&mut region.x0, &mut region.x1),
            };
            let at = self.at.unwrap_or(*first + (*end - *first) / 2);
            if errors.is_empty() && !(*first..*end).contains(&at) {
                let detail = format!("{at} is outside the columns {first} to {}", *end - 1);
                errors.push(FieldError { pointer: "at".to_owned(), detail });
            }
            (*first, *end) = (at, at.saturating_add(1));
        }
        if errors.is_empty() { Ok(region) } else { Err(Problem::invalid(errors)) }
    }
}

/// How the parameters are described.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
#[expect(dead_code, reason = "it only describes the parameters")]
struct Described {
    /// What is shown: the fixed grid as boxes, the surface of the snow, or a vertical cut.
    #[param(inline, required = false, example = "section")]
    view: View,
    /// What the colours show.
    #[param(inline, required = false, example = "temperature")]
    field: Field,
    /// Pixels across; 2²³ pixels in all.
    #[param(default = 800, minimum = 16, maximum = 4096)]
    width: Option<u32>,
    /// Pixels down.
    #[param(default = 600, minimum = 16, maximum = 4096)]
    height: Option<u32>,
    /// Degrees around the vertical from which grid and surface are seen: 0 looks along −z with x to
    /// the right, 90 along −x.
    #[param(default = 35, minimum = -360, maximum = 360)]
    yaw: Option<f32>,
    /// Degrees from above: 0 looks level, 90 straight down.
    #[param(default = 30, minimum = 0, maximum = 90)]
    pitch: Option<f32>,
    /// How much larger than fitted into the picture; not for sections.
    #[param(default = 1, minimum = 0.1, maximum = 10)]
    zoom: Option<f32>,
    /// `parallel` shows what is far away as large as what is near; sections always do.
    #[param(inline, required = false)]
    projection: Projection,
    /// The axis that a section runs along.
    #[param(inline, required = false)]
    along: Axis,
    /// The column across `along` that a section shows; the middle one where there is none.
    at: Option<u32>,
    /// First column along x that is shown.
    #[param(default = 0)]
    column_x: Option<u32>,
    /// First column along z that is shown.
    #[param(default = 0)]
    column_z: Option<u32>,
    /// Columns along x; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    columns_x: Option<u32>,
    /// Columns along z; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    columns_z: Option<u32>,
    /// Value of the first colour; the least value shown where there is none. Overpressure is
    /// symmetric around 0 unless both are given.
    min: Option<f32>,
    /// Value of the last colour; the greatest value shown where there is none.
    max: Option<f32>,
    /// Whether sides are shaded and boxes have outlines.
    #[param(default = true)]
    shading: Option<bool>,
    /// Whether a legend stands beside it; there is none in pictures below 160 × 120.
    #[param(default = true)]
    legend: Option<bool>,
    /// Whether objects are shown.
    #[param(default = true)]
    colliders: Option<bool>,
    /// What is around the snow.
    #[param(inline, required = false)]
    background: Background,
}

impl IntoParams for RenderQuery {
    fn into_params(
        parameter_in: impl Fn() -> Option<utoipa::openapi::path::ParameterIn>,
    ) -> Vec<utoipa::openapi::path::Parameter> {
        Described::into_params(parameter_in)
    }
}
