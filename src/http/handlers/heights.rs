//! Snow depths of many columns.

pub(super) mod decode;
mod encode;
mod quantities;
mod view;
mod window;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::Stamp;
use utoipa::IntoParams;

use crate::http::accept;
use crate::http::docs::{AlpineProblems, Held, ParameterProblems, SessionPath, SessionProblems};
use crate::http::etag;
use crate::http::extract::{FromQuery, Query};
use crate::http::npy;
use crate::http::query::Params;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::{Mirror, Session, Visit};

use self::quantities::{QUANTITIES, Quantity};
pub(super) use self::view::{Floats, GreyImage, HeightsView, NumpyArray};
use self::view::{Heights, Origin, Values};
use self::window::Window;
use super::{json, stamp_headers};

pub(super) const JSON: &str = "application/json";
pub(super) const FLOATS: &str = "application/octet-stream";
pub(super) const PNG: &str = "image/png";
pub(super) const NPY: &str = npy::MEDIA_TYPE;

/// What heights exist as; the first is the default.
pub(super) const MEDIA_TYPES: [&str; 4] = [JSON, FLOATS, PNG, NPY];

/// Which columns are asked for.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct WindowQuery {
    /// First column along x.
    #[param(default = 0)]
    column_x: Option<u32>,
    /// First column along z.
    #[param(default = 0)]
    column_z: Option<u32>,
    /// Samples along x; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    width: Option<u32>,
    /// Samples along z; up to the grid's edge where there is none.
    #[param(minimum = 1)]
    depth: Option<u32>,
    /// Columns from one sample to the next: 1, 2, 4 or 8.
    #[param(minimum = 1, maximum = 8, default = 1)]
    stride: Option<u32>,
}

impl FromQuery for WindowQuery {
    fn from_query(params: &mut Params) -> WindowQuery {
        let query = WindowQuery {
            column_x: params.whole("column_x", 0, u32::MAX),
            column_z: params.whole("column_z", 0, u32::MAX),
            width: params.whole("width", 1, u32::MAX),
            depth: params.whole("depth", 1, u32::MAX),
            stride: params.whole("stride", 1, 8),
        };
        if let Some(stride) = query.stride.filter(|stride| !stride.is_power_of_two()) {
            params.reject("stride", format!("expected 1, 2, 4 or 8, found {stride}"));
        }
        query
    }
}

/// Which heights are asked for.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct SurfaceQuery {
    /// Adds the elevation of the ground; of depths only.
    #[param(default = false)]
    surface: Option<bool>,
    /// What of the columns is told; what is not a depth, of alpine snow only.
    #[param(inline, required = false)]
    quantity: Quantity,
}

impl FromQuery for SurfaceQuery {
    fn from_query(params: &mut Params) -> SurfaceQuery {
        let query = SurfaceQuery {
            surface: params.flag("surface"),
            quantity: params.choice("quantity", &QUANTITIES).unwrap_or_default(),
        };
        if query.surface == Some(true) && query.quantity != Quantity::Depth {
            params.reject(
                "surface",
                "it stands beside another quantity than depth; leave one out".to_owned(),
            );
        }
        query
    }
}

/// What of the columns is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// Snow depths.
    Depth,
    /// Elevations of the snow's surface.
    Surface,
    /// Elevations of the ground.
    Ground,
}

/// Read snow depths
///
/// Of all columns, or of a region, or of every second, fourth or eighth column. By `Accept` as JSON,
/// as 32-bit floats, as a grey image, or as a NumPy array. Of alpine snow another `quantity` may be asked for, which
/// no image shows and of which up to 2²⁰ columns are read at a time. The `ETag` changes with the region's
/// snow, so that asking again with `If-None-Match` costs next to nothing while it rests.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/heights",
    operation_id = "get_heights",
    tag = "snow",
    params(SessionPath, WindowQuery, SurfaceQuery, Held),
    responses(
        (status = 200, description = "Snow depths in metres, row by row",
            content((HeightsView = "application/json"), (Floats = "application/octet-stream"),
                (GreyImage = "image/png"), (NumpyArray = "application/x-npy")),
            headers(
                ("Firn-Tick" = u64, description = "Tick at which they hold"),
                ("Firn-Seq" = u64, description = "Seq at which they hold"),
                ("Firn-Height-Scale" = f64, description = "Metres per step of grey (PNG only)"),
                ("Firn-Height-Offset" = f64, description = "Metres at grey 0 (PNG only)"),
                ("ETag" = String, description = "Weak: names the state of the region's tiles and \
                    the representation")
            )),
        (status = 304, description = "The client holds them already",
            headers(
                ("Firn-Tick" = u64, description = "Tick at which they hold"),
                ("Firn-Seq" = u64, description = "Seq at which they hold"),
                ("ETag" = String, description = "As of the whole answer")
            )),
        (status = 406, description = "The client accepts none of the media types", body = Problem,
            content_type = "application/problem+json"),
        (status = 413, description = "The answer would have more than 2²⁴ samples",
            body = Problem, content_type = "application/problem+json"),
        AlpineProblems,
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Target(session): Target,
    Query(query): Query<(WindowQuery, SurfaceQuery)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (window, SurfaceQuery { surface, quantity }) = query;
    if quantity != Quantity::Depth {
        return quantities::tell(&app, session, &window, quantity, &headers).await;
    }
    let shown = if surface.unwrap_or(false) { Shown::Surface } else { Shown::Depth };
    tell(&app, session, &window, shown, &headers).await
}

/// Answers with heights of a window, as the client accepts them.
pub(super) async fn tell(
    app: &App,
    session: Visit,
    query: &WindowQuery,
    shown: Shown,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let media_type = accept::choose(headers, &MEDIA_TYPES).ok_or_else(|| {
        Problem::not_acceptable(format!("heights exist as {}", MEDIA_TYPES.join(", ")))
    })?;
    let window = Window::new(query, &session.spec.grid)?;
    let read = Read { window, shown, media_type };
    if headers.contains_key(header::IF_NONE_MATCH) {
        let (stamp, tag) = {
            let mirror = session.mirror();
            (mirror.stamp_at(session.frame()), read.tag(&session, read.version(&mirror)))
        };
        if etag::is_held(headers, &tag) {
            return Ok(
                (StatusCode::NOT_MODIFIED, stamp_headers(stamp), validators(tag)).into_response()
            );
        }
    }
    let leave = app.answers.admit(read.window.samples() * read.bytes_per_sample()).await?;
    leave.make(move || read.answer(&session)).await
}

/// What a client reads, and as what.
struct Read {
    window: Window,
    shown: Shown,
    media_type: &'static str,
}

impl Read {
    /// The newest change of what it shows.
    fn version(&self, mirror: &Mirror) -> u64 {
        match self.shown {
            Shown::Depth => self.window.version(mirror),
            Shown::Surface => self.window.version(mirror).max(mirror.ground_version),
            Shown::Ground => mirror.ground_version,
        }
    }

    /// The weak ETag of the answer while `version` is the newest of its tiles.
    fn tag(&self, session: &Session, version: u64) -> String {
        let Window { origin: Origin { column_x, column_z }, width, depth, stride } = self.window;
        let media = match self.media_type {
            FLOATS => 'f',
            PNG => 'p',
            NPY => 'n',
            _ => 'j',
        };
        let shown = match self.shown {
            Shown::Depth => "",
            Shown::Surface => "s",
            Shown::Ground => "g",
        };
        let epoch = &session.epoch;
        format!(
            "W/\"{epoch}-{version}-{column_x}.{column_z}.{width}.{depth}.{stride}{media}{shown}\""
        )
    }

    /// Memory that making the answer takes for a sample: its thickness, its elevation, and what is
    /// written, with room for it to grow.
    fn bytes_per_sample(&self) -> u64 {
        let read = match self.shown {
            Shown::Depth => 4,
            Shown::Surface => 4 + 8,
            Shown::Ground => 8,
        };
        let written = match self.media_type {
            FLOATS | NPY => 4,
            PNG => 6,
            _ => encode::LONGEST_NUMBER as u64,
        };
        read + written
    }

    fn answer(&self, session: &Session) -> Result<Response, Problem> {
        let grid = session.spec.grid;
        let (stamp, version, quanta, ground) = {
            let mirror = session.mirror();
            let stamp = mirror.stamp_at(session.frame());
            let quanta = (self.shown != Shown::Ground).then(|| self.window.copy(&mirror));
            (stamp, self.version(&mirror), quanta, mirror.ground.clone())
        };
        let elevations = || self.window.ground(&ground, &grid).collect();
        let elevations = (self.shown != Shown::Depth).then(elevations);
        let heights = Heights { grid, quanta, ground: elevations };
        let headers = (stamp_headers(stamp), validators(self.tag(session, version)));
        let kind = [(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type))];
        let (width, depth) = (self.window.width, self.window.depth);
        Ok(match self.media_type {
            FLOATS => (headers, kind, encode::floats(&heights)?).into_response(),
            NPY => (headers, kind, encode::npy(&heights, width, depth)?).into_response(),
            PNG => {
                let grey = encode::Grey::new(&grid, &ground, self.shown);
                let image = encode::png(&heights, width, depth, grey)
                    .map_err(|_| Problem::internal("the image can't be written"))?;
                (headers, kind, grey.headers(), image).into_response()
            }
            _ => {
                let bytes = heights.count() * encode::LONGEST_NUMBER;
                let view = self.view(stamp, grid.cell_size, heights);
                (headers, json(&view, bytes)?).into_response()
            }
        })
    }

    fn view(&self, stamp: Stamp, cell_size: f64, heights: Heights) -> HeightsView {
        let Window { origin, width, depth, stride } = self.window;
        let heights = Values::Heights(heights);
        HeightsView { stamp, origin, width, depth, stride, cell_size, quantity: None, heights }
    }
}

/// The headers by which a client may ask for it again. Nothing says how long heights hold, so a
/// cache asks every time.
fn validators(tag: String) -> [(HeaderName, HeaderValue); 3] {
    [
        (header::ETAG, HeaderValue::try_from(tag).expect("an epoch is ASCII")),
        (header::VARY, HeaderValue::from_static("accept, accept-encoding")),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ]
}
