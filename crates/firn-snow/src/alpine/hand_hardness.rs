//! Hardness as it is told in the field, by what can be pushed into the snow with a gentle force.

use super::hardness;

/// Hardness by hand, from the softest on: what can just be pushed into the snow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum HandHardness {
    /// A fist.
    #[cfg_attr(feature = "serde", serde(rename = "F"))]
    Fist,
    /// Four fingers.
    #[cfg_attr(feature = "serde", serde(rename = "4F"))]
    FourFingers,
    /// One finger.
    #[cfg_attr(feature = "serde", serde(rename = "1F"))]
    OneFinger,
    /// A pencil.
    #[cfg_attr(feature = "serde", serde(rename = "P"))]
    Pencil,
    /// The blade of a knife.
    #[cfg_attr(feature = "serde", serde(rename = "K"))]
    Knife,
    /// Nothing: ice.
    #[cfg_attr(feature = "serde", serde(rename = "I"))]
    Ice,
}

/// Densities \[kg/m³\] from which dry snow belongs to the next class: half way between the classes by Geldsetzer and
/// Jamieson (2001), who have 154 + 1.51 i^3.15 for rounded grains, i being 1 for a fist and 5 for a knife. They tell
/// nothing of ice; here it begins where no load presses snow any further.
const DENSITIES: [(f32, HandHardness); 5] = [
    (159.0, HandHardness::FourFingers),
    (181.0, HandHardness::OneFinger),
    (232.0, HandHardness::Pencil),
    (326.0, HandHardness::Knife),
    (hardness::PRESSED_DENSITY, HandHardness::Ice),
];

/// Temperature \[°C\] at which snow of those densities is as hard as its class.
const TEMPERATURE: f32 = -5.0;

impl HandHardness {
    /// That of snow of a hardness \[Pa\]. Dry snow of −5 °C has the class of its density; warmer and wetter snow a
    /// softer one.
    pub fn of(hardness: f32) -> HandHardness {
        let reached = DENSITIES
            .iter()
            .rev()
            .find(|(density, _)| hardness >= hardness::hardness(*density, TEMPERATURE, 0.0));
        reached.map_or(HandHardness::Fist, |(_, class)| *class)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dry_snow_has_the_class_of_its_density_and_wet_snow_a_softer_one() {
        use HandHardness::{Fist, FourFingers, Ice, Knife, OneFinger, Pencil};
        let of = |density, celsius, wetness| {
            HandHardness::of(hardness::hardness(density, celsius, wetness))
        };
        for (density, class) in [
            (60.0, Fist),
            (158.0, Fist),
            (160.0, FourFingers),
            (200.0, OneFinger),
            (280.0, Pencil),
            (400.0, Knife),
            (699.0, Knife),
            (701.0, Ice),
        ] {
            assert_eq!(of(density, -5.0, 0.0), class, "{density} kg/m³");
        }
        assert_eq!((of(280.0, -0.1, 0.0), of(280.0, 0.0, 0.05)), (Pencil, OneFinger));
        assert!(Fist < FourFingers && Knife < Ice);
        assert_eq!(HandHardness::of(0.0), Fist);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn it_is_written_as_in_the_field() {
        let all = [
            HandHardness::Fist,
            HandHardness::FourFingers,
            HandHardness::OneFinger,
            HandHardness::Pencil,
            HandHardness::Knife,
            HandHardness::Ice,
        ];
        let written = r#"["F","4F","1F","P","K","I"]"#;
        assert_eq!(serde_json::to_string(&all).unwrap(), written);
        assert_eq!(serde_json::from_str::<[HandHardness; 6]>(written).unwrap(), all);
    }
}
