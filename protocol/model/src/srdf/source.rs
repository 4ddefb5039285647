//! XML with positions, for the entries of an SRDF.

use std::sync::Arc;

use roxmltree::{Document, Node, ParsingOptions};

use super::problem::{Severity, SrdfFault, SrdfProblem};
use super::{SrdfError, SrdfErrorKind};
use crate::Place;
use crate::urdf::guard::{self, MAX_ATTRIBUTES};

/// Largest SRDF \[bytes\]; the largest known one has 0.1 MiB.
const MAX_BYTES: usize = 16 * 1024 * 1024;
/// Most XML nodes, so that memory stays bounded by the size of the text.
const MAX_NODES: u32 = 1_000_000;

/// A text with its label: where its bytes stand.
pub(super) struct Source<'t> {
    file: Arc<str>,
    text: &'t str,
    /// Byte at which each line starts.
    line_starts: Vec<usize>,
}

impl<'t> Source<'t> {
    pub(super) fn new(text: &'t str, file: &str) -> Self {
        let after = text.match_indices('\n').map(|(at, _)| at + 1);
        Self { file: file.into(), text, line_starts: std::iter::once(0).chain(after).collect() }
    }

    /// The text as a tree; document type declarations, and so entities, are refused.
    pub(super) fn parse(&self) -> Result<Document<'t>, SrdfError> {
        if self.text.len() > MAX_BYTES {
            let kind = SrdfErrorKind::TooLarge { bytes: self.text.len(), limit: MAX_BYTES };
            return Err(self.error(0, kind));
        }
        if let Some(start) = guard::overfull_element(self.text) {
            let kind = SrdfErrorKind::TooManyAttributes { limit: MAX_ATTRIBUTES };
            return Err(self.error(start, kind));
        }
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        Document::parse_with_options(self.text, options).map_err(|error| {
            let position = error.pos();
            let place = self.place(position.row, position.col);
            SrdfError { place, kind: SrdfErrorKind::Xml(error) }
        })
    }

    fn error(&self, byte: usize, kind: SrdfErrorKind) -> SrdfError {
        SrdfError { place: self.place_of(byte), kind }
    }

    fn place(&self, line: u32, column: u32) -> Place {
        Place { file: Arc::clone(&self.file), line, column }
    }

    fn place_of(&self, byte: usize) -> Place {
        let line = self.line_starts.partition_point(|&start| start <= byte);
        let start = line.checked_sub(1).and_then(|line| self.line_starts.get(line)).copied();
        let before = self.text.get(start.unwrap_or(0)..byte).unwrap_or_default();
        let count = |counted: usize| u32::try_from(counted).unwrap_or(u32::MAX);
        self.place(count(line), count(before.chars().count() + 1))
    }
}

/// An element of the document.
#[derive(Clone, Copy)]
pub(super) struct Element<'d> {
    node: Node<'d, 'd>,
    source: &'d Source<'d>,
}

impl<'d> Element<'d> {
    pub(super) fn root(document: &'d Document<'d>, source: &'d Source<'d>) -> Self {
        Self { node: document.root_element(), source }
    }

    pub(super) fn name(&self) -> &'d str {
        self.node.tag_name().name()
    }

    /// Whether the element is of a xacro namespace.
    pub(super) fn is_xacro(&self) -> bool {
        self.node.tag_name().namespace().is_some_and(|name| name.ends_with("xacro"))
    }

    /// First element of a xacro namespace, here or below.
    pub(super) fn first_xacro(&self) -> Option<Self> {
        let source = self.source;
        self.node
            .descendants()
            .filter(Node::is_element)
            .map(|node| Self { node, source })
            .find(Self::is_xacro)
    }

    /// Child elements of the root's namespace; those of others are not SRDF.
    pub(super) fn children(&self) -> impl Iterator<Item = Self> + use<'d> {
        let source = self.source;
        let ours = self.node.document().root_element().tag_name().namespace();
        self.node
            .children()
            .filter(move |node| node.is_element() && node.tag_name().namespace() == ours)
            .map(move |node| Self { node, source })
    }

    pub(super) fn attribute(&self, name: &'static str) -> Option<&'d str> {
        self.node.attribute(name)
    }

    pub(super) fn place(&self) -> Place {
        self.source.place_of(self.node.range().start)
    }

    pub(super) fn line(&self) -> u32 {
        self.place().line
    }

    pub(super) fn fatal(&self, kind: SrdfErrorKind) -> SrdfError {
        SrdfError { place: self.place(), kind }
    }
}

/// All problems found so far.
#[derive(Default)]
pub(super) struct Problems(pub(super) Vec<SrdfProblem>);

impl Problems {
    pub(super) fn error(&mut self, at: &Element<'_>, fault: SrdfFault) {
        self.add(at, Severity::Error, fault);
    }

    pub(super) fn warning(&mut self, at: &Element<'_>, fault: SrdfFault) {
        self.add(at, Severity::Warning, fault);
    }

    pub(super) fn add(&mut self, at: &Element<'_>, severity: Severity, fault: SrdfFault) {
        self.0.push(SrdfProblem { place: at.place(), severity, element: at.name().into(), fault });
    }

    /// The attribute, which must be there and not be empty.
    pub(super) fn required<'d>(
        &mut self,
        at: &Element<'d>,
        attribute: &'static str,
    ) -> Option<&'d str> {
        let value = at.attribute(attribute).filter(|value| !value.is_empty());
        if value.is_none() {
            self.error(at, SrdfFault::MissingAttribute { attribute });
        }
        value
    }

    /// One finite number, which must be there.
    pub(super) fn number(&mut self, at: &Element<'_>, attribute: &'static str) -> Option<f64> {
        self.numbers::<1>(at, attribute).map(|[number]| number)
    }

    /// `N` finite numbers, which must be there.
    pub(super) fn numbers<const N: usize>(
        &mut self,
        at: &Element<'_>,
        attribute: &'static str,
    ) -> Option<[f64; N]> {
        let text = self.required(at, attribute)?;
        let mut numbers = [0.0_f64; N];
        let mut words = text.split_whitespace();
        let parsed = numbers.iter_mut().try_for_each(|number| {
            let value: f64 = words.next()?.parse().ok()?;
            *number = Some(value).filter(|value| value.is_finite())?;
            Some(())
        });
        if parsed.is_none() || words.next().is_some() {
            let value = text.to_owned();
            self.error(at, SrdfFault::NotNumbers { attribute, value, expected: N });
            return None;
        }
        Some(numbers)
    }
}
