//! A diagram with two axes and a legend beside it, as SVG.

use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, IntoTextStyle, RGBColor, ShapeStyle, TextStyle, WHITE};

use super::axis::{Axis, LABELS, Marked};

/// Size of a picture, and width of the diagram without its legend, in pixels.
const SIZE: (u32, u32) = (800, 460);
const DIAGRAM: u32 = 580;

/// Units of the drawing in a pixel. Plotters draws in whole units: curves of whole pixels would be
/// jagged.
const SCALE: u32 = 4;

/// Distance between two lines of the legend, and where the first one is.
const LEGEND_LINE: i32 = 24;
const LEGEND_TOP: i32 = 24;

/// Radius of a dot.
const DOT: u32 = 3 * SCALE;

const TEXT: RGBColor = RGBColor(40, 40, 40);
const MESH: RGBColor = RGBColor(225, 225, 225);

/// Why a diagram can't be drawn.
#[derive(Debug, thiserror::Error)]
#[error("'{title}' can't be drawn: {why}")]
pub struct ChartError {
    /// The diagram's title.
    pub title: String,
    /// The drawing's own message.
    pub why: String,
}

/// A diagram.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Stands above it.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards, or downwards.
    pub y: Axis,
    /// Behind everything else.
    pub bands: Vec<Band>,
    /// Above the bands.
    pub lines: Vec<Line>,
    /// Above everything else.
    pub dots: Vec<Dots>,
}

/// A line through points.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its name in the legend.
    pub label: String,
    /// Its colour.
    pub colour: RGBColor,
    /// How it looks.
    pub weight: Weight,
    /// What it goes through.
    pub points: Vec<(f64, f64)>,
}

/// How a line looks: a thin line on a broad one shows that the two are alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// For references.
    Thin,
    /// For most.
    Usual,
    /// For what lies below another line.
    Broad,
}

/// A cloud of points.
#[derive(Clone, Debug)]
pub struct Dots {
    /// Its name in the legend.
    pub label: String,
    /// Its colour.
    pub colour: RGBColor,
    /// Whether dots are more than circles.
    pub filled: bool,
    /// The middles of the dots.
    pub points: Vec<(f64, f64)>,
}

/// A horizontal band.
#[derive(Clone, Debug)]
pub struct Band {
    /// Its name in the legend.
    pub label: String,
    /// Its colour.
    pub colour: RGBColor,
    /// Where it begins on the vertical axis.
    pub from: f64,
    /// Where it ends there.
    pub to: f64,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Plane<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Marked, RangedCoordf64>>;
type Drawn<T> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

impl Weight {
    fn style(self, colour: RGBColor) -> ShapeStyle {
        match self {
            Weight::Thin => colour.stroke_width(SCALE),
            Weight::Usual => colour.stroke_width(2 * SCALE),
            Weight::Broad => colour.mix(0.35).stroke_width(6 * SCALE),
        }
    }
}

impl Dots {
    fn style(&self) -> ShapeStyle {
        if self.filled { self.colour.filled() } else { self.colour.stroke_width(SCALE) }
    }
}

/// Draws diagrams below each other in one picture.
///
/// # Errors
/// [`ChartError`] for the first one that can't be drawn.
pub fn draw(charts: &[Chart]) -> Result<String, ChartError> {
    let rows = charts.len().max(1);
    let (width, height) = (SIZE.0, SIZE.1 * rows as u32);
    let mut svg = String::new();
    {
        let root =
            SVGBackend::with_string(&mut svg, (width * SCALE, height * SCALE)).into_drawing_area();
        for (chart, area) in charts.iter().zip(root.split_evenly((rows, 1))) {
            chart.draw_into(&area).map_err(|error| ChartError {
                title: chart.title.clone(),
                why: error.to_string(),
            })?;
        }
    }
    let [drawn, shown] = [SCALE, 1]
        .map(|scale| format!("width=\"{}\" height=\"{}\"", width * scale, height * scale));
    Ok(svg.replacen(&drawn, &shown, 1))
}

impl Chart {
    fn draw_into(&self, root: &Area<'_>) -> Drawn<()> {
        root.fill(&WHITE)?;
        let body = root.margin(6 * SCALE, 0, 0, 0).titled(&self.title, text(19, root))?;
        let (diagram, legend) = body.split_horizontally(DIAGRAM * SCALE);
        let x = self.x.marked();
        let mut plane = ChartBuilder::on(&diagram)
            .margin(10 * SCALE)
            .x_label_area_size(50 * SCALE)
            .y_label_area_size(66 * SCALE)
            .build_cartesian_2d(x, self.y.range())?;
        plane
            .configure_mesh()
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .x_labels(LABELS)
            .y_labels(LABELS)
            .x_label_formatter(&|&place| self.x.text(place))
            .y_label_formatter(&|&place| self.y.number(place))
            .label_style(text(15, root))
            .axis_desc_style(text(16, root))
            .axis_style(TEXT.stroke_width(SCALE))
            .bold_line_style(MESH.stroke_width(SCALE))
            .set_all_tick_mark_size(5 * SCALE)
            .max_light_lines(0)
            .draw()?;
        self.draw_content(&mut plane)?;
        self.draw_legend(&legend)
    }

    fn draw_content(&self, plane: &mut Plane<'_, '_>) -> Drawn<()> {
        let place = |&(x, y): &(f64, f64)| (self.x.place(x), self.y.place(y));
        for band in &self.bands {
            let corners = [place(&(self.x.from, band.from)), place(&(self.x.to, band.to))];
            plane.draw_series([Rectangle::new(corners, band.colour.filled())])?;
        }
        for line in &self.lines {
            let points: Vec<_> = line.points.iter().map(place).collect();
            plane.draw_series([PathElement::new(points, line.weight.style(line.colour))])?;
        }
        for dots in &self.dots {
            let style = dots.style();
            plane.draw_series(dots.points.iter().map(|p| Circle::new(place(p), DOT, style)))?;
        }
        Ok(())
    }

    fn draw_legend(&self, area: &Area<'_>) -> Drawn<()> {
        let mut y = LEGEND_TOP;
        let mut entry = |label: &str, draw: &mut dyn FnMut(i32) -> Drawn<()>| {
            draw(y)?;
            let style = text(15, area).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(label.to_owned(), at(40, y), style))?;
            y += LEGEND_LINE;
            Drawn::Ok(())
        };
        for line in &self.lines {
            let style = line.weight.style(line.colour);
            entry(&line.label, &mut |y| {
                area.draw(&PathElement::new([at(6, y), at(32, y)], style))
            })?;
        }
        for dots in &self.dots {
            entry(&dots.label, &mut |y| area.draw(&Circle::new(at(19, y), DOT, dots.style())))?;
        }
        for band in &self.bands {
            entry(&band.label, &mut |y| {
                let corners = [at(6, y - 7), at(32, y + 7)];
                area.draw(&Rectangle::new(corners, band.colour.filled()))
            })?;
        }
        Ok(())
    }
}

/// A place given in pixels.
fn at(x: i32, y: i32) -> (i32, i32) {
    (x * SCALE as i32, y * SCALE as i32)
}

/// Text of a size in pixels.
fn text(size: u32, area: &Area<'_>) -> TextStyle<'static> {
    ("sans-serif", size * SCALE).into_font().color(&TEXT).into_text_style(area)
}
