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
    length: Option<f64>,
    radius: Option<f64>,
    corners: Option<Vec<[f64; 2]>>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ShapeType {
    Box,
    Disk,
    Capsule,
    Polygon,
    Wheel,
}

impl ShapeType {
    /// The fields that a shape of the type has, and must have.
    fn fields(self) -> &'static [&'static str] {
        match self {
            ShapeType::Box => &["width", "depth"],
            ShapeType::Disk => &["radius"],
            ShapeType::Capsule => &["length", "radius"],
            ShapeType::Polygon => &["corners"],
            ShapeType::Wheel => &["width", "radius"],
        }
    }
}

impl TryFrom<ShapeFields> for Shape {
    type Error = String;

    fn try_from(fields: ShapeFields) -> Result<Shape, String> {
        let own = fields.r#type.fields();
        for (name, given) in [
            ("width", fields.width.is_some()),
            ("depth", fields.depth.is_some()),
            ("length", fields.length.is_some()),
            ("radius", fields.radius.is_some()),
            ("corners", fields.corners.is_some()),
        ] {
            if given && !own.contains(&name) {
                let known = own.join("`, `");
                return Err(format!("unknown field `{name}`, expected `type`, `{known}`"));
            }
        }
        Ok(match fields.r#type {
            ShapeType::Box => Shape::Box {
                width: need("width", fields.width)?,
                depth: need("depth", fields.depth)?,
            },
            ShapeType::Disk => Shape::Disk { radius: need("radius", fields.radius)? },
            ShapeType::Capsule => Shape::Capsule {
                length: need("length", fields.length)?,
                radius: need("radius", fields.radius)?,
            },
            ShapeType::Polygon => Shape::Polygon { corners: need("corners", fields.corners)? },
            ShapeType::Wheel => Shape::Wheel {
                width: need("width", fields.width)?,
                radius: need("radius", fields.radius)?,
            },
        })
    }
}

fn need<T>(name: &str, value: Option<T>) -> Result<T, String> {
    value.ok_or_else(|| format!("missing field `{name}`"))
}
