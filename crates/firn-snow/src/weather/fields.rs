//! Weather as it is written. A row is flat, and whether a series is meant is seen by its fields; still every error
//! names its field, and unknown fields are refused. Derived code can't do that: it buffers what it does not know yet.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeSeed, Error, IntoDeserializer, MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Weather;
use super::series::{WeatherInput, WeatherRow, WeatherSeries};
use super::start::Start;

#[cfg(feature = "schema")]
mod schema;

const OF_SERIES: &[&str] = &["series", "interpolate"];

impl Serialize for Start {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for Start {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        Start::parse(&text)
            .ok_or_else(|| D::Error::invalid_value(Unexpected::Str(&text), &Start::EXPECTED))
    }
}

impl<'de> Deserialize<'de> for WeatherRow {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Fields(PhantomData))
    }
}

impl<'de> Deserialize<'de> for WeatherSeries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match WeatherInput::deserialize(deserializer)? {
            WeatherInput::Series(series) => Ok(series),
            WeatherInput::Steady(_) => Err(D::Error::missing_field("series")),
        }
    }
}

impl<'de> Deserialize<'de> for WeatherInput {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Fields(PhantomData))
    }
}

/// Reads one of the types from the fields of an object.
struct Fields<T>(PhantomData<T>);

/// What is made of the fields of an object.
trait FromFields: Sized {
    fn from_fields<'de, A: MapAccess<'de>>(fields: A) -> Result<Self, A::Error>;
}

impl<'de, T: FromFields> Visitor<'de> for Fields<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<T, A::Error> {
        T::from_fields(fields)
    }
}

impl FromFields for WeatherRow {
    fn from_fields<'de, A: MapAccess<'de>>(fields: A) -> Result<Self, A::Error> {
        let mut at = None;
        let rest = Rest { fields, first: None, at: Some(&mut at) };
        let weather = Weather::deserialize(MapAccessDeserializer::new(rest))?;
        Ok(WeatherRow { at: at.ok_or_else(|| A::Error::missing_field("at"))?, weather })
    }
}

impl FromFields for WeatherInput {
    fn from_fields<'de, A: MapAccess<'de>>(mut fields: A) -> Result<Self, A::Error> {
        let (mut series, mut interpolate) = (None, None);
        while let Some(name) = fields.next_key::<String>()? {
            match name.as_str() {
                "series" if series.is_some() => return Err(A::Error::duplicate_field("series")),
                "series" => series = Some(fields.next_value()?),
                "interpolate" if interpolate.is_some() => {
                    return Err(A::Error::duplicate_field("interpolate"));
                }
                "interpolate" => interpolate = Some(fields.next_value()?),
                // The first field that isn't a series's settles that it is none.
                _ if series.is_none() && interpolate.is_none() => {
                    let rest = Rest { fields, first: Some(name), at: None };
                    let weather = Weather::deserialize(MapAccessDeserializer::new(rest))?;
                    return Ok(WeatherInput::Steady(weather));
                }
                _ => return Err(A::Error::unknown_field(&name, OF_SERIES)),
            }
        }
        match (series, interpolate) {
            (Some(series), interpolate) => Ok(WeatherInput::Series(WeatherSeries {
                series,
                interpolate: interpolate.unwrap_or(false),
            })),
            (None, Some(_)) => Err(A::Error::missing_field("series")),
            (None, None) => Err(A::Error::missing_field("air_temperature")),
        }
    }
}

/// The fields of an object that are weather: all but `at`, where one is asked for.
struct Rest<'a, A> {
    fields: A,
    /// The name of the first field, where it has been read already.
    first: Option<String>,
    /// Where the value of `at` goes.
    at: Option<&'a mut Option<f64>>,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Rest<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        loop {
            let name = match self.first.take() {
                Some(first) => Some(first),
                None => self.fields.next_key::<String>()?,
            };
            let Some(name) = name else { return Ok(None) };
            match &mut self.at {
                Some(Some(_)) if name == "at" => return Err(A::Error::duplicate_field("at")),
                Some(at) if name == "at" => **at = Some(self.fields.next_value()?),
                _ => return seed.deserialize(name.into_deserializer()).map(Some),
            }
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.fields.next_value_seed(seed)
    }
}

#[cfg(test)]
mod tests;
