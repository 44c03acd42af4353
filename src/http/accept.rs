//! Chooses a representation by the `Accept` header, and its coding by `Accept-Encoding` (RFC 9110, sections
//! 12.5.1 and 12.5.3).

use axum::http::{HeaderMap, HeaderName, header};

/// The coding of what is sent as it is.
pub const IDENTITY: &str = "identity";

/// The offer a client likes best; the first of those it likes equally. `None` where it accepts
/// none of them.
pub fn choose<'a>(headers: &HeaderMap, offers: &[&'a str]) -> Option<&'a str> {
    best(headers, header::ACCEPT, offers)
}

/// The coding that a client likes best, the first of those it likes equally. `None` where it asks for none of
/// them: then an answer is sent as it is.
pub fn choose_coding<'a>(headers: &HeaderMap, offers: &[&'a str]) -> Option<&'a str> {
    let offers = [&[IDENTITY], offers].concat();
    best(headers, header::ACCEPT_ENCODING, &offers).filter(|&coding| coding != IDENTITY)
}

fn best<'a>(headers: &HeaderMap, header: HeaderName, offers: &[&'a str]) -> Option<&'a str> {
    let ranges: Vec<Range> = headers
        .get_all(header)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .filter_map(Range::parse)
        .collect();
    if ranges.is_empty() {
        return offers.first().copied();
    }
    let mut best: Option<(&'a str, f32)> = None;
    for &offer in offers {
        let quality = quality(&ranges, offer);
        if quality > best.map_or(0.0, |(_, quality)| quality) {
            best = Some((offer, quality));
        }
    }
    best.map(|(offer, _)| offer)
}

/// How much an offer is liked: the most specific range that matches it says.
fn quality(ranges: &[Range], offer: &str) -> f32 {
    ranges
        .iter()
        .filter_map(|range| {
            range.specificity(offer).map(|specificity| (specificity, range.quality))
        })
        .max_by_key(|(specificity, _)| *specificity)
        .map_or(0.0, |(_, quality)| quality)
}

/// One range of media types, or one coding, of the header.
struct Range {
    name: String,
    quality: f32,
}

impl Range {
    fn parse(text: &str) -> Option<Range> {
        let mut parts = text.split(';').map(str::trim);
        let name = parts.next().filter(|name| !name.is_empty())?.to_ascii_lowercase();
        let quality = parts
            .filter_map(|parameter| parameter.split_once('='))
            .find(|(name, _)| name.trim().eq_ignore_ascii_case("q"))
            .and_then(|(_, value)| value.trim().parse::<f32>().ok())
            .filter(|quality| (0.0..=1.0).contains(quality))
            .unwrap_or(1.0);
        Some(Range { name, quality })
    }

    fn specificity(&self, offer: &str) -> Option<u8> {
        if self.name == offer {
            Some(2)
        } else if ["*/*", "*"].contains(&&*self.name) {
            Some(0)
        } else {
            let kind = self.name.strip_suffix("/*")?;
            offer.strip_prefix(kind)?.starts_with('/').then_some(1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JSON: &str = "application/json";
    const BINARY: &str = "application/octet-stream";

    fn chosen(accept: Option<&str>) -> Option<&'static str> {
        let mut headers = HeaderMap::new();
        if let Some(accept) = accept {
            headers.insert(header::ACCEPT, accept.parse().unwrap());
        }
        choose(&headers, &[JSON, BINARY])
    }

    #[test]
    fn the_first_offer_is_the_default() {
        for accept in [None, Some("*/*"), Some("application/*"), Some("")] {
            assert_eq!(chosen(accept), Some(JSON), "{accept:?}");
        }
    }

    #[test]
    fn preferences_decide() {
        assert_eq!(chosen(Some(BINARY)), Some(BINARY));
        assert_eq!(chosen(Some("application/json;q=0.5, application/octet-stream")), Some(BINARY));
        assert_eq!(chosen(Some("Application/JSON; charset=utf-8")), Some(JSON));
        assert_eq!(chosen(Some("*/*;q=0.1, application/json;q=0")), Some(BINARY));
    }

    #[test]
    fn a_coding_is_chosen_where_it_is_asked_for() {
        for (accepted, coding) in [
            (None, None),
            (Some(""), None),
            (Some("identity"), None),
            (Some("br, deflate"), None),
            (Some("*"), None),
            (Some("*;q=0"), None),
            (Some("gzip;q=0"), None),
            (Some("gzip;q=0.5, identity"), None),
            (Some("GZIP"), Some("gzip")),
            (Some("gzip, deflate, br, zstd"), Some("zstd")),
            (Some("gzip, zstd;q=0.9"), Some("gzip")),
            (Some("zstd;q=0, gzip;q=0.1"), Some("gzip")),
            (Some("identity;q=0, *"), Some("zstd")),
        ] {
            let mut headers = HeaderMap::new();
            if let Some(accepted) = accepted {
                headers.insert(header::ACCEPT_ENCODING, accepted.parse().unwrap());
            }
            assert_eq!(choose_coding(&headers, &["zstd", "gzip"]), coding, "{accepted:?}");
        }
    }

    #[test]
    fn nothing_acceptable_is_nothing() {
        assert_eq!(chosen(Some("image/png")), None);
        assert_eq!(chosen(Some("application/json;q=0, text/*")), None);
    }
}
