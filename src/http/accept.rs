//! Chooses a representation by the `Accept` header (RFC 9110, section 12.5.1).

use axum::http::{HeaderMap, header};

/// The offer a client likes best; the first of those it likes equally. `None` where it accepts
/// none of them.
pub fn choose<'a>(headers: &HeaderMap, offers: &[&'a str]) -> Option<&'a str> {
    let ranges: Vec<Range> = headers
        .get_all(header::ACCEPT)
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

/// How much a media type is liked: the most specific range that matches it says.
fn quality(ranges: &[Range], offer: &str) -> f32 {
    ranges
        .iter()
        .filter_map(|range| {
            range.specificity(offer).map(|specificity| (specificity, range.quality))
        })
        .max_by_key(|(specificity, _)| *specificity)
        .map_or(0.0, |(_, quality)| quality)
}

/// One media range of the header.
struct Range {
    media: String,
    quality: f32,
}

impl Range {
    fn parse(text: &str) -> Option<Range> {
        let mut parts = text.split(';').map(str::trim);
        let media = parts.next().filter(|media| !media.is_empty())?.to_ascii_lowercase();
        let quality = parts
            .filter_map(|parameter| parameter.split_once('='))
            .find(|(name, _)| name.trim().eq_ignore_ascii_case("q"))
            .and_then(|(_, value)| value.trim().parse::<f32>().ok())
            .filter(|quality| (0.0..=1.0).contains(quality))
            .unwrap_or(1.0);
        Some(Range { media, quality })
    }

    fn specificity(&self, offer: &str) -> Option<u8> {
        if self.media == offer {
            Some(2)
        } else if self.media == "*/*" {
            Some(0)
        } else {
            let kind = self.media.strip_suffix("/*")?;
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
    fn nothing_acceptable_is_nothing() {
        assert_eq!(chosen(Some("image/png")), None);
        assert_eq!(chosen(Some("application/json;q=0, text/*")), None);
    }
}
