//! Bounds on a text before it is parsed.

/// Most attributes of one element; URDF's own have at most six.
pub(crate) const MAX_ATTRIBUTES: usize = 256;

/// Position of the first element with more than [`MAX_ATTRIBUTES`] attributes.
///
/// The XML parser compares every attribute of an element with every other, so 16 MiB in one
/// element would keep it busy for minutes. A text that is not XML may be judged wrongly here; the
/// parser refuses it anyway.
pub(crate) fn overfull_element(text: &str) -> Option<usize> {
    let mut rest = text;
    loop {
        rest = rest.get(rest.find('<')?..)?;
        let (attributes, length) = match passive_length(rest) {
            Some(length) => (0, length),
            None => tag_size(rest),
        };
        if attributes > MAX_ATTRIBUTES {
            return Some(text.len() - rest.len());
        }
        rest = rest.get(length..)?;
    }
}

/// Length of a comment, character data or processing instruction, if `text` starts with one.
fn passive_length(text: &str) -> Option<usize> {
    let (start, end) = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")]
        .into_iter()
        .find(|(start, _)| text.starts_with(start))?;
    let content = text.get(start.len()..)?;
    let length = content.find(end).map_or(content.len(), |at| at + end.len());
    Some(start.len() + length)
}

/// Number of quoted values in the tag that starts `text`, and its length.
fn tag_size(text: &str) -> (usize, usize) {
    let (mut values, mut quote) = (0, None);
    for (position, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (None, b'>') => return (values, position + 1),
            (None, b'"' | b'\'') => {
                values += 1;
                quote = Some(byte);
            }
            (Some(open), close) if open == close => quote = None,
            _ => {}
        }
    }
    (values, text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(attributes: usize) -> String {
        let attributes: String = (0..attributes).map(|n| format!(" a{n}='>\"'")).collect();
        format!("<robot{attributes}/>")
    }

    #[test]
    fn the_attributes_of_one_element_are_counted_behind_marks_in_values() {
        assert_eq!(overfull_element(&element(MAX_ATTRIBUTES)), None);
        let text = format!("<a b=\"c\"/>{}", element(MAX_ATTRIBUTES + 1));
        assert_eq!(overfull_element(&text), Some(10));
    }

    #[test]
    fn comments_and_character_data_have_no_attributes() {
        let many = "a='' ".repeat(MAX_ATTRIBUTES + 1);
        let text = format!("<?x {many}?><!-- {many}--><a><![CDATA[{many}]]></a>");
        assert_eq!(overfull_element(&text), None);
    }

    #[test]
    fn unfinished_text_ends_the_search() {
        for text in ["", "<", "<a b='", "<!--", "<?", "a < b", "<![CDATA["] {
            assert_eq!(overfull_element(text), None, "{text}");
        }
    }
}
