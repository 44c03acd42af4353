//! What of the schemas can't be derived.

use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{KnownFormat, ObjectBuilder, Schema, SchemaFormat, Type};
use utoipa::{PartialSchema, ToSchema};

use super::{Start, Weather, WeatherRow};

impl PartialSchema for Start {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .format(Some(SchemaFormat::KnownFormat(KnownFormat::DateTime)))
            .description(Some("A time as RFC 3339 writes it."))
            .examples(["2005-10-01T00:00:00Z"])
            .into()
    }
}

impl ToSchema for Start {}

/// A weather's with one property more: put together from both, nothing would fit, since a weather has no `at`.
impl PartialSchema for WeatherRow {
    fn schema() -> RefOr<Schema> {
        let mut schema = Weather::schema();
        if let RefOr::T(Schema::Object(object)) = &mut schema {
            let at = ObjectBuilder::new()
                .schema_type(Type::Number)
                .format(Some(SchemaFormat::KnownFormat(KnownFormat::Double)))
                .minimum(Some(0.0))
                .description(Some("Simulated time [s]."));
            object.description = Some("The weather from a time on.".to_owned());
            object.properties.insert("at".to_owned(), at.into());
            object.required.insert(0, "at".to_owned());
        }
        schema
    }
}

impl ToSchema for WeatherRow {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        Weather::schemas(schemas);
    }
}
