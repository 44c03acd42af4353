//! A point in time as a client writes it.

use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

/// A point in time as RFC 3339 writes it, such as `2005-10-01T00:00:00Z`. It is told as it was given.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    text: String,
    instant: f64,
}

impl Start {
    /// What is expected of a text.
    pub const EXPECTED: &str = "a time as RFC 3339 writes it, such as \"2005-10-01T00:00:00Z\"";

    /// Reads it; none where the text is no such time.
    pub fn parse(text: &str) -> Option<Start> {
        let time = OffsetDateTime::parse(text, &Rfc3339).ok()?;
        let instant = time.unix_timestamp() as f64 + f64::from(time.nanosecond()) * 1e-9;
        Some(Start { text: text.to_owned(), instant })
    }

    /// As it was given.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Seconds since 1970-01-01T00:00:00Z.
    pub fn instant(&self) -> f64 {
        self.instant
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_time_of_rfc_3339() {
        for (text, instant) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2005-10-01T00:00:00Z", 1_128_124_800.0),
            ("2005-10-01T02:00:00+02:00", 1_128_124_800.0),
            ("2005-09-30t17:00:00.5-07:00", 1_128_124_800.5),
        ] {
            let start = Start::parse(text).unwrap();
            assert_eq!((start.as_str(), start.instant()), (text, instant));
        }
        for wrong in [
            "",
            "yesterday",
            "2005-10-01",
            "2005-10-01T00:00:00",
            "2005-02-30T00:00:00Z",
            "1128124800",
        ] {
            assert_eq!(Start::parse(wrong), None, "{wrong}");
        }
    }
}
