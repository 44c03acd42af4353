//! ETags and `If-None-Match` (RFC 9110, sections 8.8.3 and 13.1.2).

use axum::http::{HeaderMap, HeaderValue, header};

/// Whether a client says that it holds what an ETag names. Weak and strong tags compare alike; a
/// header that can't be read holds nothing.
pub fn is_held(headers: &HeaderMap, tag: &str) -> bool {
    let tag = opaque(tag);
    headers
        .get_all(header::IF_NONE_MATCH)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .any(|value| value.trim() == "*" || tags(value).any(|held| held == tag))
}

/// Makes an answer's strong ETag a weak one: other bytes are sent than those that it names.
pub fn weaken(headers: &mut HeaderMap) {
    let Some(tag) = headers.get_mut(header::ETAG) else { return };
    if !tag.as_bytes().starts_with(b"W/") {
        let weak = [b"W/", tag.as_bytes()].concat();
        *tag = HeaderValue::try_from(weak).expect("it was a value before");
    }
}

/// A tag without what says that it is weak.
fn opaque(tag: &str) -> &str {
    tag.strip_prefix("W/").unwrap_or(tag)
}

/// The opaque tags of a list, quotes included, as far as it can be read. A tag may contain commas.
fn tags(list: &str) -> impl Iterator<Item = &str> {
    let mut rest = list;
    std::iter::from_fn(move || {
        let start = opaque(rest.trim_start_matches([' ', '\t', ',']));
        let length = start.strip_prefix('"')?.find('"')? + 2;
        let (tag, behind) = start.split_at(length);
        rest = behind;
        Some(tag)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(values: &[&str]) -> bool {
        let mut headers = HeaderMap::new();
        for value in values {
            headers.append(header::IF_NONE_MATCH, value.parse().unwrap());
        }
        is_held(&headers, "W/\"a-1\"")
    }

    #[test]
    fn a_tag_is_found_in_lists_weak_or_strong() {
        for values in [
            &["W/\"a-1\""][..],
            &["\"a-1\""],
            &["*"],
            &[" * "],
            &["\"x\", W/\"a-1\""],
            &["\"x\",\"a-1\" , \"y\""],
            &["\"a,b\", \"a-1\""],
            &["\"x\"", "W/\"a-1\""],
        ] {
            assert!(held(values), "{values:?}");
        }
    }

    #[test]
    fn other_tags_and_nonsense_are_not_it() {
        for values in [
            &[][..],
            &[""],
            &["\"a-2\""],
            &["W/\"a-12\""],
            &["a-1"],
            &["\"a-1"],
            &["w/\"a-1\""],
            &["\"x, \"a-1\""],
            &["**"],
        ] {
            assert!(!held(values), "{values:?}");
        }
    }
}
