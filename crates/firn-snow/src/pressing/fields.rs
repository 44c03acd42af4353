//! How it is written: a word, or a number of seconds.

use std::fmt;

use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Pressing;

const CREEP: &str = "creep";

impl Serialize for Pressing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Pressing::Creep => serializer.serialize_str(CREEP),
            Pressing::Within(seconds) => serializer.serialize_f64(*seconds),
        }
    }
}

impl<'de> Deserialize<'de> for Pressing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

struct Written;

impl Visitor<'_> for Written {
    type Value = Pressing;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{CREEP}\" or seconds from 0 to {}", Pressing::LONGEST)
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Pressing, E> {
        match word {
            CREEP => Ok(Pressing::Creep),
            _ => Err(E::invalid_value(serde::de::Unexpected::Str(word), &self)),
        }
    }

    fn visit_f64<E: Error>(self, seconds: f64) -> Result<Pressing, E> {
        Ok(Pressing::Within(seconds))
    }

    fn visit_u64<E: Error>(self, seconds: u64) -> Result<Pressing, E> {
        self.visit_f64(seconds as f64)
    }

    fn visit_i64<E: Error>(self, seconds: i64) -> Result<Pressing, E> {
        self.visit_f64(seconds as f64)
    }
}

#[cfg(feature = "schema")]
mod schema {
    use utoipa::openapi::RefOr;
    use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};

    use super::{CREEP, Pressing};

    impl utoipa::PartialSchema for Pressing {
        fn schema() -> RefOr<Schema> {
            let word = ObjectBuilder::new().schema_type(Type::String).enum_values(Some([CREEP]));
            let seconds = ObjectBuilder::new()
                .schema_type(Type::Number)
                .minimum(Some(0.0))
                .maximum(Some(Pressing::LONGEST));
            let what = "How snow gives way under objects: it creeps as under its own weight, or is pressed to where it \
                        carries them. A number is the simulated time [s] in which a full cell would be pressed flat, 0 \
                        for at once.";
            OneOfBuilder::new().item(word).item(seconds).description(Some(what)).into()
        }
    }

    impl utoipa::ToSchema for Pressing {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_word_or_seconds() {
        for (pressing, written) in [
            (Pressing::Creep, "\"creep\""),
            (Pressing::Within(0.25), "0.25"),
            (Pressing::Within(2.0), "2.0"),
        ] {
            assert_eq!(serde_json::to_string(&pressing).unwrap(), written);
            assert_eq!(serde_json::from_str::<Pressing>(written).unwrap(), pressing);
        }
        assert_eq!(serde_json::from_str::<Pressing>("0").unwrap(), Pressing::Within(0.0));
        for wrong in ["\"fast\"", "true", "null", "{}", "[1]"] {
            let error = serde_json::from_str::<Pressing>(wrong).unwrap_err().to_string();
            assert!(error.contains("expected \"creep\" or seconds from 0 to 10"), "{error}");
        }
    }
}
