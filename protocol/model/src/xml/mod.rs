//! XML texts with positions: what reading a URDF and an SRDF have in common.

mod guard;

use std::sync::Arc;

use roxmltree::{Document, ParsingOptions};

use crate::Place;
pub(crate) use guard::MAX_ATTRIBUTES;

/// Largest text \[bytes\]; the largest known robot description has 0.2 MiB.
pub(crate) const MAX_BYTES: usize = 16 * 1024 * 1024;
/// Most XML nodes, so that memory stays bounded by the size of the text.
const MAX_NODES: u32 = 1_000_000;

/// A text with its label: where its bytes stand.
pub(crate) struct Source<'t> {
    file: Arc<str>,
    text: &'t str,
    /// Byte at which each line starts.
    line_starts: Vec<usize>,
}

/// Why a text is not read as XML.
pub(crate) enum Unreadable {
    /// It has more than [`MAX_BYTES`].
    TooLarge { bytes: usize },
    /// An element has more than [`MAX_ATTRIBUTES`].
    TooManyAttributes,
    /// It is not well formed.
    Xml(roxmltree::Error),
}

impl<'t> Source<'t> {
    pub(crate) fn new(text: &'t str, file: &str) -> Self {
        let after = text.match_indices('\n').map(|(at, _)| at + 1);
        Self { file: file.into(), text, line_starts: std::iter::once(0).chain(after).collect() }
    }

    /// The text as a tree.
    ///
    /// Entities cannot expand: document type declarations are refused. The parser keeps its stack
    /// on the heap, so nesting cannot overflow ours.
    pub(crate) fn parse(&self) -> Result<Document<'t>, (Place, Unreadable)> {
        let bytes = self.text.len();
        if bytes > MAX_BYTES {
            return Err((self.place(0), Unreadable::TooLarge { bytes }));
        }
        if let Some(start) = guard::overfull_element(self.text) {
            return Err((self.place(start), Unreadable::TooManyAttributes));
        }
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        Document::parse_with_options(self.text, options).map_err(|error| {
            let roxmltree::TextPos { row: line, col: column } = error.pos();
            (Place { file: Arc::clone(&self.file), line, column }, Unreadable::Xml(error))
        })
    }

    /// Line and column of a byte; takes time with the length of its line.
    pub(crate) fn place(&self, offset: usize) -> Place {
        let line = self.line(offset);
        let start = usize::try_from(line).ok().and_then(|line| self.line_starts.get(line - 1));
        let before = self.text.get(start.copied().unwrap_or_default()..offset).unwrap_or_default();
        Place { file: Arc::clone(&self.file), line, column: count(before.chars().count() + 1) }
    }

    /// Line of a byte, counted from one.
    pub(crate) fn line(&self, offset: usize) -> u32 {
        count(self.line_starts.partition_point(|&start| start <= offset).max(1))
    }
}

fn count(counted: usize) -> u32 {
    u32::try_from(counted).unwrap_or(u32::MAX)
}
