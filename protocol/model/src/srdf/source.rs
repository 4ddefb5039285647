//! XML with positions, for the entries of an SRDF.

use roxmltree::{Document, Node};

use super::problem::{Severity, SrdfFault, SrdfProblem};
use super::{SrdfError, SrdfErrorKind};
use crate::Place;
use crate::xml::{MAX_ATTRIBUTES, MAX_BYTES, Source, Unreadable};

/// The text of `source` as a tree.
pub(super) fn parse<'t>(source: &Source<'t>) -> Result<Document<'t>, SrdfError> {
    source.parse().map_err(|(place, fault)| {
        let kind = match fault {
            Unreadable::TooLarge { bytes } => SrdfErrorKind::TooLarge { bytes, limit: MAX_BYTES },
            Unreadable::TooManyAttributes => {
                SrdfErrorKind::TooManyAttributes { limit: MAX_ATTRIBUTES }
            }
            Unreadable::Xml(error) => SrdfErrorKind::Xml(error),
        };
        SrdfError { place, kind }
    })
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
        self.source.place(self.node.range().start)
    }

    pub(super) fn line(&self) -> u32 {
        self.source.line(self.node.range().start)
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
