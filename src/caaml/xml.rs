//! A writer of XML: elements, attributes and text, each escaped, a line for each element.

use std::fmt::{Display, Write};

/// Attributes of an element, by their names.
pub type Attributes<'a> = &'a [(&'a str, &'a str)];

/// An XML document that is being written.
#[derive(Debug)]
pub struct Xml {
    text: String,
    depth: usize,
}

impl Xml {
    /// A document without its root element, with room for so many bytes.
    pub fn new(bytes: usize) -> Xml {
        let mut text = String::with_capacity(bytes);
        text.push_str("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        Xml { text, depth: 0 }
    }

    /// Writes an element that has others inside.
    pub fn element(
        &mut self,
        name: &str,
        attributes: Attributes<'_>,
        inside: impl FnOnce(&mut Xml),
    ) {
        self.begin(name, attributes);
        self.text.push_str(">\n");
        self.depth += 1;
        inside(self);
        self.depth -= 1;
        self.indent();
        self.end(name);
    }

    /// Writes an element that has text inside.
    pub fn text(&mut self, name: &str, attributes: Attributes<'_>, text: impl Display) {
        self.begin(name, attributes);
        self.text.push('>');
        escape(&text.to_string(), &mut self.text);
        self.end(name);
    }

    /// Writes an element that has nothing inside.
    pub fn empty(&mut self, name: &str) {
        self.begin(name, &[]);
        self.text.push_str("/>\n");
    }

    /// What was written.
    pub fn finish(self) -> String {
        self.text
    }

    fn begin(&mut self, name: &str, attributes: Attributes<'_>) {
        self.indent();
        self.text.push('<');
        self.text.push_str(name);
        for (name, value) in attributes {
            self.text.push(' ');
            self.text.push_str(name);
            self.text.push_str("=\"");
            escape(value, &mut self.text);
            self.text.push('"');
        }
    }

    fn end(&mut self, name: &str) {
        self.text.push_str("</");
        self.text.push_str(name);
        self.text.push_str(">\n");
    }

    fn indent(&mut self) {
        self.text.extend(std::iter::repeat_n("  ", self.depth));
    }
}

/// Writes text so that no character of it is taken for markup. What XML can't hold becomes U+FFFD.
fn escape(text: &str, into: &mut String) {
    for character in text.chars() {
        match character {
            '&' => into.push_str("&amp;"),
            '<' => into.push_str("&lt;"),
            '>' => into.push_str("&gt;"),
            '"' => into.push_str("&quot;"),
            // Readers would make spaces of them in attributes.
            '\t' | '\n' | '\r' => {
                // Writing to a string does not fail.
                let _ = write!(into, "&#{};", u32::from(character));
            }
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => into.push('\u{fffd}'),
            other => into.push(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let odd = "a < b & \"c\" > 'd'\n\té\u{1}";
        let mut xml = Xml::new(0);
        xml.element("root", &[("xmlns:p", "urn:p"), ("p:odd", odd)], |xml| {
            xml.text("p:leaf", &[], odd);
            xml.empty("none");
        });
        let text = xml.finish();
        let document = roxmltree::Document::parse(&text).unwrap();
        let read = odd.replace('\u{1}', "\u{fffd}");
        let root = document.root_element();
        assert_eq!(root.attribute(("urn:p", "odd")), Some(&*read));
        let leaf = root.first_element_child().unwrap();
        assert_eq!((leaf.tag_name().namespace(), leaf.text()), (Some("urn:p"), Some(&*read)));
        assert!(text.contains("\n  <none/>\n</root>\n"), "{text}");
    }
}
