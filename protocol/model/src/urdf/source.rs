//! XML with positions: elements that know whose they are, and read their attributes strictly.

use std::sync::Arc;

use roxmltree::{Document, Node, ParsingOptions};

use super::error::{Place, UrdfError, UrdfProblem};
use super::guard::{self, MAX_ATTRIBUTES};

/// Largest robot description \[bytes\]; the largest known one has 0.2 MiB.
const MAX_BYTES: usize = 16 * 1024 * 1024;
/// Most XML nodes, so that memory stays bounded by the size of the text.
const MAX_NODES: u32 = 1_000_000;

/// Label of the text, for places.
#[derive(Clone)]
pub(super) struct Label(Arc<str>);

impl Label {
    pub(super) fn new(file: &str) -> Self {
        Self(file.into())
    }

    fn at(&self, position: roxmltree::TextPos) -> Place {
        Place { file: Arc::clone(&self.0), line: position.row, column: position.col }
    }

    /// The text as a tree.
    ///
    /// Entities cannot expand: document type declarations are refused. The parser keeps its stack
    /// on the heap, so nesting cannot overflow ours.
    pub(super) fn parse<'t>(&self, text: &'t str) -> Result<Document<'t>, UrdfError> {
        let fail = |position, problem| UrdfError { place: self.at(position), problem };
        if text.len() > MAX_BYTES {
            let problem = UrdfProblem::TooLarge { bytes: text.len(), limit: MAX_BYTES };
            return Err(fail(roxmltree::TextPos::new(1, 1), Box::new(problem)));
        }
        if let Some(start) = guard::overfull_element(text) {
            let problem = UrdfProblem::TooManyAttributes { limit: MAX_ATTRIBUTES };
            return Err(fail(position_of(text, start), Box::new(problem)));
        }
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        Document::parse_with_options(text, options)
            .map_err(|error| fail(error.pos(), Box::new(UrdfProblem::Xml(error))))
    }
}

fn position_of(text: &str, byte: usize) -> roxmltree::TextPos {
    let before = text.get(..byte).unwrap_or(text);
    let count = |counted: usize| u32::try_from(counted).unwrap_or(u32::MAX);
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let column = before.get(line_start..).unwrap_or_default().chars().count() + 1;
    roxmltree::TextPos::new(count(before.matches('\n').count() + 1), count(column))
}

/// An element of the document, and the link or joint it belongs to.
#[derive(Clone)]
pub(super) struct Element<'d> {
    node: Node<'d, 'd>,
    label: &'d Label,
    subject: Arc<str>,
}

impl<'d> Element<'d> {
    /// The document's root element.
    pub(super) fn root(document: &'d Document<'d>, label: &'d Label) -> Self {
        let node = document.root_element();
        Self { node, label, subject: node.tag_name().name().into() }
    }

    /// The same element as `subject`, the name by which its problems are reported.
    pub(super) fn with_subject(mut self, subject: &str) -> Self {
        self.subject = subject.into();
        self
    }

    pub(super) fn name(&self) -> &'d str {
        self.node.tag_name().name()
    }

    pub(super) fn subject(&self) -> String {
        self.subject.as_ref().to_owned()
    }

    pub(super) fn place(&self) -> Place {
        self.label.at(self.node.document().text_pos_at(self.node.range().start))
    }

    pub(super) fn error(&self, problem: UrdfProblem) -> UrdfError {
        UrdfError { place: self.place(), problem: Box::new(problem) }
    }

    /// First element of a xacro namespace, here or below.
    pub(super) fn first_xacro(&self) -> Option<Self> {
        let is_xacro =
            |node: &Node<'_, '_>| node.tag_name().namespace().is_some_and(|n| n.ends_with("xacro"));
        let node = self.node.descendants().find(|node| node.is_element() && is_xacro(node))?;
        Some(Self { node, ..self.clone() })
    }

    /// Child elements of the root's namespace; those of others are not URDF.
    pub(super) fn children(&self) -> impl Iterator<Item = Self> + use<'d> {
        let parent = self.clone();
        let ours = self.node.document().root_element().tag_name().namespace();
        self.node
            .children()
            .filter(move |node| node.is_element() && node.tag_name().namespace() == ours)
            .map(move |node| Self { node, ..parent.clone() })
    }

    /// Child elements of one name.
    pub(super) fn children_named(
        &self,
        name: &'static str,
    ) -> impl Iterator<Item = Self> + use<'d> {
        self.children().filter(move |child| child.name() == name)
    }

    /// The child element of that name, which may stand once.
    pub(super) fn child(&self, name: &'static str) -> Result<Option<Self>, UrdfError> {
        let mut children = self.children_named(name);
        let first = children.next();
        match children.next() {
            Some(second) => Err(second.error(UrdfProblem::RepeatedElement {
                subject: self.subject(),
                parent: self.name().to_owned(),
                element: name,
            })),
            None => Ok(first),
        }
    }

    /// The child element of that name, which must stand once.
    pub(super) fn required_child(&self, name: &'static str) -> Result<Self, UrdfError> {
        self.child(name)?.ok_or_else(|| {
            self.error(UrdfProblem::MissingElement {
                subject: self.subject(),
                parent: self.name().to_owned(),
                element: name,
            })
        })
    }

    pub(super) fn attribute(&self, name: &'static str) -> Option<&'d str> {
        self.node.attribute(name)
    }

    pub(super) fn required_attribute(&self, name: &'static str) -> Result<&'d str, UrdfError> {
        self.attribute(name).ok_or_else(|| self.missing(name))
    }

    /// `N` finite numbers, if the attribute is there.
    pub(super) fn numbers<const N: usize>(
        &self,
        name: &'static str,
    ) -> Result<Option<[f64; N]>, UrdfError> {
        self.attribute(name).map(|text| self.parse_numbers(name, text)).transpose()
    }

    /// One finite number, if the attribute is there.
    pub(super) fn number(&self, name: &'static str) -> Result<Option<f64>, UrdfError> {
        Ok(self.numbers::<1>(name)?.map(|[number]| number))
    }

    /// One finite number not below zero, if the attribute is there.
    pub(super) fn non_negative(&self, name: &'static str) -> Result<Option<f64>, UrdfError> {
        let number = self.number(name)?;
        match number {
            Some(value) if value < 0.0 => Err(self.negative(name, value)),
            _ => Ok(number),
        }
    }

    pub(super) fn required_numbers<const N: usize>(
        &self,
        name: &'static str,
    ) -> Result<[f64; N], UrdfError> {
        self.numbers(name)?.ok_or_else(|| self.missing(name))
    }

    pub(super) fn required_non_negative(&self, name: &'static str) -> Result<f64, UrdfError> {
        self.non_negative(name)?.ok_or_else(|| self.missing(name))
    }

    pub(super) fn negative(&self, attribute: &'static str, value: f64) -> UrdfError {
        self.error(UrdfProblem::Negative {
            subject: self.subject(),
            element: self.name().to_owned(),
            attribute,
            value,
        })
    }

    fn missing(&self, attribute: &'static str) -> UrdfError {
        self.error(UrdfProblem::MissingAttribute {
            subject: self.subject(),
            element: self.name().to_owned(),
            attribute,
        })
    }

    fn parse_numbers<const N: usize>(
        &self,
        attribute: &'static str,
        text: &str,
    ) -> Result<[f64; N], UrdfError> {
        let (subject, element) = (self.subject(), self.name().to_owned());
        let value = text.to_owned();
        let mut numbers = [0.0_f64; N];
        let mut words = text.split_whitespace();
        let parsed = numbers
            .iter_mut()
            .try_for_each(|number| words.next()?.parse().ok().map(|parsed| *number = parsed));
        if parsed.is_none() || words.next().is_some() {
            let expected = N;
            return Err(self.error(UrdfProblem::NotNumbers {
                subject,
                element,
                attribute,
                value,
                expected,
            }));
        }
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(self.error(UrdfProblem::NotFinite { subject, element, attribute, value }));
        }
        Ok(numbers)
    }
}
