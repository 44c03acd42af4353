//! Objects seen from above: their outline, and the columns under it.

#[cfg(feature = "serde")]
mod fields;

use super::grid::Grid;

/// Slack \[m\] with which a column's centre counts as inside a footprint.
const EDGE_SLACK: f64 = 1e-6;

/// Outline of a rigid, level object seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(tag = "type", rename_all = "snake_case", try_from = "fields::ShapeFields")
)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum Shape {
    /// An axis-aligned rectangle.
    Box {
        /// Extent along x \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        width: f64,
        /// Extent along z \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        depth: f64,
    },
    /// A circle.
    Disk {
        /// Radius \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        radius: f64,
    },
}

/// A horizontal position \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Position {
    /// Along x \[m\].
    pub x: f64,
    /// Along z \[m\].
    pub z: f64,
}

impl Shape {
    /// Area A₀ \[m²\].
    pub fn area(&self) -> f64 {
        match *self {
            Shape::Box { width, depth } => width * depth,
            Shape::Disk { radius } => std::f64::consts::PI * radius * radius,
        }
    }

    /// Half extents along x and z \[m\].
    pub fn half_extents(&self) -> (f64, f64) {
        match *self {
            Shape::Box { width, depth } => (width / 2.0, depth / 2.0),
            Shape::Disk { radius } => (radius, radius),
        }
    }

    /// Half the chord along x \[m\] at a distance along z from the centre, if there is one.
    fn half_chord(&self, distance: f64) -> Option<f64> {
        match *self {
            Shape::Box { width, depth } => {
                (distance.abs() <= depth / 2.0 + EDGE_SLACK).then_some(width / 2.0 + EDGE_SLACK)
            }
            Shape::Disk { radius } => {
                let reach = radius + EDGE_SLACK;
                let square = reach * reach - distance * distance;
                (square >= 0.0).then(|| square.sqrt())
            }
        }
    }
}

/// The columns under an object: one span of columns for each row along z.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// Row of the first span.
    pub z0: u32,
    /// Columns `[x0, x1)` of each row.
    pub spans: Vec<(u32, u32)>,
    /// Number n of columns.
    pub columns: u32,
    /// True area A₀ \[m²\] that the columns stand for.
    pub area: f64,
}

impl Footprint {
    /// The columns whose centres lie inside the shape, at least the one its centre is in.
    ///
    /// `None` where the shape reaches beyond the grid.
    pub fn new(grid: &Grid, shape: &Shape, position: Position) -> Option<Footprint> {
        let h = grid.cell_size;
        let (half_x, half_z) = shape.half_extents();
        let inside = |centre: f64, half: f64, cells: u32| {
            centre - half >= -EDGE_SLACK && centre + half <= f64::from(cells) * h + EDGE_SLACK
        };
        if !inside(position.x, half_x, grid.width) || !inside(position.z, half_z, grid.depth) {
            return None;
        }
        let column = |metres: f64, cells: u32| ((metres / h).floor() as u32).min(cells - 1);
        let centre = (column(position.x, grid.width), column(position.z, grid.depth));
        let first = column((position.z - half_z - h).max(0.0), grid.depth);
        let last = column(position.z + half_z + h, grid.depth);

        let mut rows: Vec<(u32, (u32, u32))> = (first..=last)
            .filter_map(|z| {
                let half = shape.half_chord((f64::from(z) + 0.5) * h - position.z)?;
                let x0 = ((position.x - half) / h - 0.5).ceil().max(0.0) as u32;
                let x1 = ((position.x + half) / h - 0.5).floor() + 1.0;
                let x1 = (x1.max(0.0) as u32).min(grid.width);
                (x0 < x1).then_some((z, (x0, x1)))
            })
            .collect();
        if !rows.iter().any(|&(z, (x0, x1))| z == centre.1 && (x0..x1).contains(&centre.0)) {
            // A shape too thin to hold the centre of a column holds none: it stands on its own.
            rows = vec![(centre.1, (centre.0, centre.0 + 1))];
        }
        Some(Footprint {
            z0: rows[0].0,
            columns: rows.iter().map(|(_, (x0, x1))| x1 - x0).sum(),
            spans: rows.into_iter().map(|(_, span)| span).collect(),
            area: shape.area(),
        })
    }

    /// Every column (x, z), row by row.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.spans.iter().zip(self.z0..).flat_map(|(&(x0, x1), z)| (x0..x1).map(move |x| (x, z)))
    }

    /// Tiles the footprint touches, ascending and without repetition.
    pub fn tiles(&self, grid: &Grid) -> Vec<u32> {
        let mut tiles: Vec<u32> = self.iter().map(|(x, z)| grid.locate(x, z).0).collect();
        tiles.sort_unstable();
        tiles.dedup();
        tiles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { width: 10, depth: 6, height: 20, cell_size: 0.2 };

    fn columns(shape: Shape, x: f64, z: f64) -> Vec<(u32, u32)> {
        let footprint = Footprint::new(&GRID, &shape, Position { x, z }).expect("it fits");
        assert_eq!(footprint.columns as usize, footprint.iter().count());
        assert_eq!(footprint.area, shape.area());
        footprint.iter().collect()
    }

    #[test]
    fn centres_on_the_edge_are_inside() {
        let plate = Shape::Box { width: 0.4, depth: 0.2 };
        let inside = columns(plate, 0.5, 0.4);
        assert_eq!(inside, [(1, 1), (2, 1), (3, 1), (1, 2), (2, 2), (3, 2)]);
        assert_eq!(columns(plate, 0.5001, 0.4), [(2, 1), (3, 1), (2, 2), (3, 2)]);
        assert_eq!(columns(plate, 0.5 + 5e-7, 0.4), inside, "within the slack");
        assert_eq!(columns(plate, 0.4, 0.5), [(1, 2), (2, 2)]);
    }

    #[test]
    fn a_shape_between_centres_stands_on_the_column_of_its_centre() {
        assert_eq!(columns(Shape::Box { width: 0.05, depth: 0.05 }, 0.75, 0.45), [(3, 2)]);
        assert_eq!(columns(Shape::Box { width: 1.0, depth: 0.02 }, 0.9, 0.45), [(4, 2)]);
        assert_eq!(columns(Shape::Disk { radius: 0.01 }, 1.99, 1.19), [(9, 5)]);
        assert_eq!(columns(Shape::Disk { radius: 0.0 }, 2.0, 1.2), [(9, 5)], "the far corner");
    }

    #[test]
    fn a_disk_covers_the_centres_within_its_radius() {
        let disk = Shape::Disk { radius: 0.25 };
        let plus = [(4, 1), (3, 2), (4, 2), (5, 2), (4, 3)];
        assert_eq!(columns(disk, 0.9, 0.5), plus);
        assert_eq!(columns(Shape::Disk { radius: 0.2 }, 0.9, 0.5), plus, "on the rim");
        assert_eq!(columns(disk, 1.0, 0.4).len(), 4);
    }

    #[test]
    fn shapes_beyond_the_grid_have_no_footprint() {
        let footprint = |shape: Shape, x, z| Footprint::new(&GRID, &shape, Position { x, z });
        let plate = Shape::Box { width: 1.0, depth: 0.4 };
        assert!(footprint(plate, 0.5, 0.2).is_some(), "along the near edges");
        assert!(footprint(plate, 1.5, 1.0).is_some(), "along the far edges");
        for (x, z) in [(0.49, 0.2), (0.5, 0.19), (1.51, 1.0), (1.5, 1.01), (-9.0, 0.5), (9.0, 0.5)]
        {
            assert!(footprint(plate, x, z).is_none(), "at ({x}, {z})");
        }
        assert!(footprint(Shape::Disk { radius: 0.7 }, 1.0, 0.6).is_none(), "wider than the grid");
    }

    #[test]
    fn a_footprint_lists_its_tiles_once() {
        let grid = Grid { width: 20, depth: 20, ..GRID };
        let plate = Shape::Box { width: 1.0, depth: 1.0 };
        let tiles = |x, z| {
            let footprint = Footprint::new(&grid, &plate, Position { x, z });
            footprint.expect("it fits").tiles(&grid)
        };
        assert_eq!(tiles(0.5, 0.5), [0]);
        assert_eq!(tiles(1.6, 1.6), [0, 1, 3, 4]);
        assert_eq!(tiles(3.5, 1.6), [1, 2, 4, 5]);
    }
}
