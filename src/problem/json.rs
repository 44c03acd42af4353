//! Reads JSON, and says in plain words what is wrong with it and where.

use serde::de::{DeserializeOwned, IgnoredAny};
use serde_path_to_error::{Path, Segment, Track};

use crate::quote::shorten;

use super::Problem;
use super::strict::Strict;

/// Reads a value from JSON text.
///
/// # Errors
/// 400 where the text is not JSON at all; 422 with a pointer to the field where it is not the
/// value that was expected: of another type, out of its type's range, unknown, missing or double.
pub fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    let mut track = Track::new();
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let read =
        T::deserialize(serde_path_to_error::Deserializer::new(Strict(&mut json), &mut track));
    let error = match read.and_then(|value| json.end().map(|()| value)) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    // A field can be found wrong before the text is found broken further on.
    if std::str::from_utf8(bytes).is_err() {
        return Err(Problem::malformed("the body is not UTF-8 text"));
    }
    if let Err(broken) = serde_json::from_slice::<IgnoredAny>(bytes) {
        return Err(Problem::malformed(format!("the body is not JSON: {broken}")));
    }
    Err(explain(&track.path(), &error.to_string()))
}

fn explain(path: &Path, message: &str) -> Problem {
    let message = message.rsplit_once(" at line ").map_or(message, |(message, _)| message);
    let mut pointer = pointer(path);
    // The path ends at the object that a field is missing from, and sometimes at the one that has
    // a field too many.
    for prefix in ["missing field ", "unknown field ", "duplicate field "] {
        if let Some(field) = quoted_after(message, prefix)
            && (prefix == "missing field " || !pointer.ends_with(&token(field)))
        {
            push_token(&mut pointer, field);
        }
    }
    Problem::invalid_field(pointer, shorten(plain(message)))
}

/// The JSON pointer (RFC 6901) of a path.
fn pointer(path: &Path) -> String {
    let mut pointer = String::new();
    for segment in path {
        match segment {
            Segment::Seq { index } => push_token(&mut pointer, &index.to_string()),
            Segment::Map { key } => push_token(&mut pointer, key),
            Segment::Enum { .. } | Segment::Unknown => {}
        }
    }
    pointer
}

fn push_token(pointer: &mut String, name: &str) {
    pointer.push_str(&token(name));
}

/// A name as it stands in a pointer.
fn token(name: &str) -> String {
    format!("/{}", shorten(name.to_owned()).replace('~', "~0").replace('/', "~1"))
}

/// What stands in backticks behind a prefix.
fn quoted_after<'a>(message: &'a str, prefix: &str) -> Option<&'a str> {
    let rest = message.strip_prefix(prefix)?.strip_prefix('`')?;
    rest.split_once('`').map(|(quoted, _)| quoted)
}

/// Says in plain words what the parser reports in terms of its types.
fn plain(message: &str) -> String {
    for prefix in ["invalid type: ", "invalid value: ", "invalid length "] {
        if let Some((found, expected)) =
            message.strip_prefix(prefix).and_then(|rest| rest.rsplit_once(", expected "))
        {
            return format!("expected {}, found {}", expected_words(expected), found_words(found));
        }
    }
    if message.starts_with("number out of range") {
        return "expected a finite number, found one too large to be represented".to_owned();
    }
    if let Some(field) = quoted_after(message, "missing field ") {
        return format!("the field `{field}` is missing");
    }
    if let Some(field) = quoted_after(message, "duplicate field ") {
        return format!("the field `{field}` is given more than once");
    }
    if let Some((found, known)) = message.split_once(", expected ") {
        let known = known.strip_prefix("one of ").unwrap_or(known);
        return format!("{found}; known are {known}");
    }
    message.to_owned()
}

fn expected_words(expected: &str) -> String {
    let words = match expected {
        "f32" | "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "usize" => "a whole number, not negative",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a sequence" => "an array",
        "a map" => "an object",
        "string or map" | "a borrowed string" => "a string",
        other if other.starts_with("struct ") || other.starts_with("internally tagged enum ") => {
            "an object"
        }
        other if other.starts_with("enum ") => "a string",
        other => other,
    };
    words.to_owned()
}

fn found_words(found: &str) -> String {
    for kind in ["integer `", "floating point `", "boolean `"] {
        if let Some(value) = found.strip_prefix(kind) {
            return value.trim_end_matches('`').to_owned();
        }
    }
    match found {
        "sequence" => "an array".to_owned(),
        "map" => "an object".to_owned(),
        text if text.starts_with("string ") => format!("the {text}"),
        other => other.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firn_protocol::{ColliderSpec, SessionSpec, Snowfall, StepSpec};

    fn wrong<T: DeserializeOwned>(json: &str) -> (u16, String, String) {
        let Err(problem) = parse::<T>(json.as_bytes()) else { panic!("{json} was accepted") };
        let error = problem.errors.first().cloned();
        let (pointer, detail) =
            error.map_or((String::new(), String::new()), |e| (e.pointer, e.detail));
        (problem.status, pointer, detail)
    }

    fn at(status: u16, pointer: &str, detail: &str) -> (u16, String, String) {
        (status, pointer.to_owned(), detail.to_owned())
    }

    #[test]
    fn text_that_is_not_json_is_a_bad_request() {
        for json in ["", "{", "{\"depth\": NaN}", "{\"depth\": 1} x", "{\"depth\": \"a\", \"b\": "]
        {
            assert_eq!(wrong::<Snowfall>(json).0, 400, "{json}");
        }
        assert_eq!(parse::<Snowfall>(b"{\"depth\": \"\xff\"}").map_err(|p| p.status), Err(400));
    }

    #[test]
    fn wrong_types_name_their_field_in_plain_words() {
        let number = "a whole number from 0 to 4294967295";
        assert_eq!(
            wrong::<SessionSpec>(r#"{"grid": {"width": "wide"}}"#),
            at(422, "/grid/width", &format!("expected {number}, found the string \"wide\""))
        );
        assert_eq!(
            wrong::<SessionSpec>(r#"{"grid": {"width": -3}}"#),
            at(422, "/grid/width", &format!("expected {number}, found -3"))
        );
        assert_eq!(
            wrong::<SessionSpec>(r#"{"initial_snow": [{"depth": 1}, {"depth": null}]}"#),
            at(422, "/initial_snow/1/depth", "expected a number, found null")
        );
        assert_eq!(
            wrong::<SessionSpec>(r#"{"grid": 5}"#),
            at(422, "/grid", "expected an object, found 5")
        );
        assert_eq!(wrong::<SessionSpec>("[]"), at(422, "", "expected an object, found an array"));
        assert_eq!(wrong::<SessionSpec>(r#"{"grid": [9, 9]}"#).1, "/grid");
        assert_eq!(wrong::<SessionSpec>(r#"{"initial_snow": [[1]]}"#).1, "/initial_snow/0");
    }

    #[test]
    fn numbers_beyond_the_representable_are_invalid_not_malformed() {
        let expected = "expected a finite number, found one too large to be represented";
        assert_eq!(wrong::<Snowfall>(r#"{"depth": 1e999}"#), at(422, "/depth", expected));
        assert_eq!(wrong::<StepSpec>(r#"{"ticks": 1e999}"#), at(422, "/ticks", expected));
    }

    #[test]
    fn unknown_missing_and_double_fields_are_named() {
        let (status, pointer, detail) = wrong::<SessionSpec>(r#"{"grid": {"a/b": 1}}"#);
        assert_eq!((status, pointer.as_str()), (422, "/grid/a~1b"));
        assert!(detail.contains("`width`"), "{detail}");
        assert_eq!(wrong::<Snowfall>("{}"), at(422, "/depth", "the field `depth` is missing"));
        assert_eq!(
            wrong::<SessionSpec>(r#"{"initial_snow": [{}]}"#),
            at(422, "/initial_snow/0/depth", "the field `depth` is missing")
        );
        assert_eq!(
            wrong::<Snowfall>(r#"{"depth": 1, "depth": 2}"#),
            at(422, "/depth", "the field `depth` is given more than once")
        );
    }

    #[test]
    fn a_shape_names_the_field_that_is_wrong() {
        let shape = |shape: &str| {
            wrong::<ColliderSpec>(&format!(
                r#"{{"mass": 1, "position": {{"x": 1, "z": 1}}, "shape": {shape}}}"#
            ))
        };
        assert_eq!(shape(r#"{"type": "disk"}"#).1, "/shape/radius");
        assert_eq!(shape(r#"{"width": 1}"#).1, "/shape/type");
        assert_eq!(shape(r#"{"type": "disk", "radius": "big"}"#).1, "/shape/radius");
        assert_eq!(
            shape(r#"{"type": "box", "width": 1, "depth": 1, "height": 1}"#).1,
            "/shape/height"
        );
        assert_eq!(shape(r#"{"type": "cone"}"#).1, "/shape/type");
        assert_eq!(shape("7"), at(422, "/shape", "expected an object, found 7"));
    }

    #[test]
    fn long_input_is_not_repeated_whole() {
        let (_, _, detail) = wrong::<Snowfall>(&format!(r#"{{"depth": "{}"}}"#, "é".repeat(5000)));
        assert!(detail.len() < 400, "{} bytes", detail.len());
    }
}
