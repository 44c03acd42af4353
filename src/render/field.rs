//! What the colours of a picture can show.

use firn_snow::Sample;
use serde::Serialize;
use utoipa::ToSchema;

/// A quantity that colours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(default = "density")]
pub enum Field {
    /// Density \[kg/m³\].
    #[default]
    Density,
    /// Temperature \[°C\].
    Temperature,
    /// Vertical stress less hardness \[Pa\]: snow is compacted where it is above 0.
    Overpressure,
    /// Hardness \[Pa\].
    Hardness,
    /// Elevation above the lowest ground \[m\]: that of a cell's middle, or of the surface.
    Position,
}

impl Field {
    /// Every field by its name.
    pub const ALL: [(&'static str, Field); 5] = [
        ("density", Field::Density),
        ("temperature", Field::Temperature),
        ("overpressure", Field::Overpressure),
        ("hardness", Field::Hardness),
        ("position", Field::Position),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Field::ALL[self as usize].0
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Field::Density => "kg/m³",
            Field::Temperature => "°C",
            Field::Overpressure | Field::Hardness => "Pa",
            Field::Position => "m",
        }
    }

    /// Its value for a cell of the fixed grid; `elevation` \[m\] is what [`Field::Position`] shows.
    pub fn of(self, sample: &Sample, elevation: f32) -> f32 {
        match self {
            Field::Density => sample.density,
            Field::Temperature => sample.temperature,
            Field::Overpressure => sample.stress - sample.hardness,
            Field::Hardness => sample.hardness,
            Field::Position => elevation,
        }
    }

    /// Whether values below and above 0 are to be told apart.
    pub(super) fn is_diverging(self) -> bool {
        self == Field::Overpressure
    }

    /// The shortest range of values that colours are spread over.
    pub(super) fn least_range(self) -> f32 {
        match self {
            Field::Density | Field::Temperature => 1.0,
            Field::Overpressure | Field::Hardness => 10.0,
            Field::Position => 0.1,
        }
    }

    /// Its colour at a place from 0 to 1. Perceptually uniform maps of matplotlib (van der Walt and
    /// Smith; Nuñez, Anderton and Renslow for cividis), and a diverging one of ColorBrewer (Brewer).
    pub(super) fn colour(self, place: f64) -> [u8; 3] {
        let colour = match self {
            Field::Density => colorous::VIRIDIS.eval_continuous(place),
            Field::Temperature => colorous::PLASMA.eval_continuous(place),
            // It begins with red; stress above the hardness is what red stands for.
            Field::Overpressure => colorous::RED_BLUE.eval_continuous(1.0 - place),
            // The shape of what is nearly black can't be seen.
            Field::Hardness => colorous::MAGMA.eval_continuous((2.0 + 7.0 * place) / 9.0),
            Field::Position => colorous::CIVIDIS.eval_continuous(place),
        };
        colour.as_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_variants() {
        for (name, field) in Field::ALL {
            assert_eq!(field.name(), name);
            assert_eq!(serde_json::to_value(field).unwrap(), name);
        }
    }
}
