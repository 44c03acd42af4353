//! What a client has sent, as it is repeated to it: in part, where it is long.

use std::fmt;

/// Most characters that are repeated.
const MOST: usize = 200;

/// Some text in quotes, cut after 200 characters.
pub fn quote(text: &str) -> Quote<'_> {
    Quote(text)
}

/// See [`quote`].
#[derive(Clone, Copy, Debug)]
pub struct Quote<'a>(&'a str);

impl fmt::Display for Quote<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (text, ellipsis) = cut(self.0);
        write!(f, "'{text}{ellipsis}'")
    }
}

/// Some text, cut after 200 characters.
pub fn shorten(mut text: String) -> String {
    let (kept, ellipsis) = cut(&text);
    let length = kept.len();
    text.truncate(length);
    text.push_str(ellipsis);
    text
}

/// The first characters of a text, and what stands for the others.
fn cut(text: &str) -> (&str, &'static str) {
    match text.char_indices().nth(MOST) {
        Some((end, _)) => (&text[..end], "…"),
        None => (text, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_text_is_cut_between_two_characters() {
        assert_eq!(quote("snow").to_string(), "'snow'");
        let most = "é".repeat(MOST);
        assert_eq!(quote(&most).to_string(), format!("'{most}'"));
        assert_eq!(quote(&format!("{most}é")).to_string(), format!("'{most}…'"));
        assert_eq!(shorten(format!("{most}aaa")), format!("{most}…"));
        assert_eq!(shorten(most.clone()), most);
    }
}
