//! The checked copy of a robot description, as text for the URDF reader.

use std::fmt::Write as _;

/// Value of an attribute.
#[derive(Clone, Copy)]
pub(super) enum Value<'a> {
    Text(&'a str),
    Numbers(&'a [f64]),
}

/// Writes elements without namespace, comment, text or entity.
#[derive(Default)]
pub(super) struct Writer {
    text: String,
}

impl Writer {
    pub(super) fn empty(&mut self, name: &str, attributes: &[(&str, Value<'_>)]) {
        self.tag(name, attributes);
        self.text.push_str("/>");
    }

    pub(super) fn open(&mut self, name: &str, attributes: &[(&str, Value<'_>)]) {
        self.tag(name, attributes);
        self.text.push('>');
    }

    pub(super) fn close(&mut self, name: &str) {
        self.text.push_str("</");
        self.text.push_str(name);
        self.text.push('>');
    }

    pub(super) fn finish(self) -> String {
        self.text
    }

    fn tag(&mut self, name: &str, attributes: &[(&str, Value<'_>)]) {
        self.text.push('<');
        self.text.push_str(name);
        for (key, value) in attributes {
            self.text.push(' ');
            self.text.push_str(key);
            self.text.push_str("=\"");
            match value {
                Value::Text(text) => self.escaped(text),
                Value::Numbers(numbers) => self.numbers(numbers),
            }
            self.text.push('"');
        }
    }

    fn numbers(&mut self, numbers: &[f64]) {
        for (index, number) in numbers.iter().enumerate() {
            let separator = if index == 0 { "" } else { " " };
            // Rust prints the shortest text that reads back as the same number. Writing to a
            // String cannot fail.
            let _ = write!(self.text, "{separator}{number:?}");
        }
    }

    fn escaped(&mut self, text: &str) {
        for character in text.chars() {
            match character {
                '&' => self.text.push_str("&amp;"),
                '<' => self.text.push_str("&lt;"),
                '>' => self.text.push_str("&gt;"),
                '"' => self.text.push_str("&quot;"),
                '\'' => self.text.push_str("&apos;"),
                other => self.text.push(other),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_marks_survive() {
        let mut writer = Writer::default();
        let numbers = [0.1 + 0.2, -0.0, f64::INFINITY];
        writer.open("a", &[("n", Value::Numbers(&numbers)), ("t", Value::Text("<\"&'>"))]);
        writer.close("a");
        assert_eq!(
            writer.finish(),
            r#"<a n="0.30000000000000004 -0.0 inf" t="&lt;&quot;&amp;&apos;&gt;"></a>"#
        );
    }
}
