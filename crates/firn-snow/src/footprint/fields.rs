//! A shape as it is written.

use serde::Deserialize;

use super::Shape;

/// A shape as it is read: field by field, so that an error can name the one that is wrong.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeFields {
    r#type: ShapeType,
    width: Option<f64>,
    depth: Option<f64>,
    radius: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ShapeType {
    Box,
    Disk,
}

impl TryFrom<ShapeFields> for Shape {
    type Error = String;

    fn try_from(fields: ShapeFields) -> Result<Shape, String> {
        let needed =
            |name: &str, value: Option<f64>| value.ok_or_else(|| format!("missing field `{name}`"));
        let unknown = |name: &str, value: Option<f64>, known: &str| match value {
            Some(_) => Err(format!("unknown field `{name}`, expected {known}")),
            None => Ok(()),
        };
        match fields.r#type {
            ShapeType::Box => {
                unknown("radius", fields.radius, "`type`, `width` or `depth`")?;
                Ok(Shape::Box {
                    width: needed("width", fields.width)?,
                    depth: needed("depth", fields.depth)?,
                })
            }
            ShapeType::Disk => {
                unknown("width", fields.width, "`type` or `radius`")?;
                unknown("depth", fields.depth, "`type` or `radius`")?;
                Ok(Shape::Disk { radius: needed("radius", fields.radius)? })
            }
        }
    }
}
