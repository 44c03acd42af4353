//! Points in time as XML Schema writes them.

use time::OffsetDateTime;

/// The first and the last second of the years 0 to 9999, counted from 1970-01-01T00:00:00Z.
const SECONDS: [i64; 2] = [-62_167_219_200, 253_402_300_799];

/// A number of seconds since 1970-01-01T00:00:00Z as a time in UTC, to the millisecond. What lies before the year 0 or
/// after the year 9999 is told as the end of that span.
pub fn written(instant: f64) -> String {
    let [first, last] = SECONDS.map(|second| 1000 * second);
    let millis = ((instant * 1000.0).round() as i64).clamp(first, last);
    let time = OffsetDateTime::from_unix_timestamp(millis.div_euclid(1000));
    let time = time.unwrap_or(OffsetDateTime::UNIX_EPOCH);
    let (year, month, day) = time.to_calendar_date();
    let (hour, minute, second) = time.to_hms();
    let millis = match millis.rem_euclid(1000) {
        0 => String::new(),
        millis => format!(".{millis:03}"),
    };
    let month = u8::from(month);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}{millis}Z")
}

#[cfg(test)]
mod tests {
    use super::written;

    #[test]
    fn times_are_those_of_the_calendar() {
        for (instant, expected) in [
            (0.0, "1970-01-01T00:00:00Z"),
            (1_128_124_800.25, "2005-10-01T00:00:00.250Z"),
            (-0.5, "1969-12-31T23:59:59.500Z"),
            (1e18, "9999-12-31T23:59:59Z"),
            (-1e18, "0000-01-01T00:00:00Z"),
        ] {
            assert_eq!(written(instant), expected);
        }
    }
}
