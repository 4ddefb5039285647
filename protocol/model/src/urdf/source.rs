//! XML with positions: elements that know whose they are, and read their attributes strictly.

use std::sync::Arc;

use roxmltree::{Document, Node};

use super::error::{UrdfError, UrdfProblem};
use super::findings::{Fault, Problems};
use crate::xml::{MAX_ATTRIBUTES, MAX_BYTES, Source, Unreadable};

/// The text of `source` as a tree.
pub(super) fn parse<'t>(source: &Source<'t>) -> Result<Document<'t>, UrdfError> {
    source.parse().map_err(|(place, fault)| {
        let problem = match fault {
            Unreadable::TooLarge { bytes } => UrdfProblem::TooLarge { bytes, limit: MAX_BYTES },
            Unreadable::TooManyAttributes => {
                UrdfProblem::TooManyAttributes { limit: MAX_ATTRIBUTES }
            }
            Unreadable::Xml(error) => UrdfProblem::Xml(error),
        };
        UrdfError { place, problem: Box::new(problem) }
    })
}

/// An element of the document, and the link or joint it belongs to.
#[derive(Clone)]
pub(super) struct Element<'d> {
    node: Node<'d, 'd>,
    source: &'d Source<'d>,
    subject: Arc<str>,
}

impl<'d> Element<'d> {
    /// The document's root element.
    pub(super) fn root(document: &'d Document<'d>, source: &'d Source<'d>) -> Self {
        let node = document.root_element();
        Self { node, source, subject: node.tag_name().name().into() }
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

    /// Byte of the text at which the element starts.
    pub(super) fn offset(&self) -> usize {
        self.node.range().start
    }

    /// Line on which the element starts.
    pub(super) fn line(&self) -> u32 {
        self.source.line(self.offset())
    }

    pub(super) fn fault(&self, problem: UrdfProblem) -> Fault {
        Fault { offset: self.offset(), problem: Box::new(problem) }
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

    /// The first child element of that name; a second one is a problem.
    pub(super) fn child(&self, name: &'static str, problems: &mut Problems) -> Option<Self> {
        let mut children = self.children_named(name);
        let first = children.next();
        if let Some(second) = children.next() {
            problems.report(second.fault(UrdfProblem::RepeatedElement {
                subject: self.subject(),
                parent: self.name().to_owned(),
                element: name,
            }));
        }
        first
    }

    /// The first child element of that name; none and a second one are problems.
    pub(super) fn required_child(
        &self,
        name: &'static str,
        problems: &mut Problems,
    ) -> Option<Self> {
        let child = self.child(name, problems);
        if child.is_none() {
            problems.report(self.fault(UrdfProblem::MissingElement {
                subject: self.subject(),
                parent: self.name().to_owned(),
                element: name,
            }));
        }
        child
    }

    /// Names of attributes that are of no other namespace.
    pub(super) fn attribute_names(&self) -> impl Iterator<Item = &'d str> + use<'d> {
        let ours = |attribute: &roxmltree::Attribute<'_, '_>| attribute.namespace().is_none();
        self.node.attributes().filter(ours).map(|attribute| attribute.name())
    }

    pub(super) fn attribute(&self, name: &'static str) -> Option<&'d str> {
        self.node.attribute(name)
    }

    pub(super) fn required_attribute(&self, name: &'static str) -> Result<&'d str, Fault> {
        self.attribute(name).ok_or_else(|| self.missing(name))
    }

    /// `N` finite numbers, if the attribute is there.
    pub(super) fn numbers<const N: usize>(
        &self,
        name: &'static str,
    ) -> Result<Option<[f64; N]>, Fault> {
        self.attribute(name).map(|text| self.parse_numbers(name, text)).transpose()
    }

    /// One finite number, if the attribute is there.
    pub(super) fn number(&self, name: &'static str) -> Result<Option<f64>, Fault> {
        Ok(self.numbers::<1>(name)?.map(|[number]| number))
    }

    /// One finite number not below zero, if the attribute is there.
    pub(super) fn non_negative(&self, name: &'static str) -> Result<Option<f64>, Fault> {
        let number = self.number(name)?;
        match number {
            Some(value) if value < 0.0 => Err(self.negative(name, value)),
            _ => Ok(number),
        }
    }

    pub(super) fn required_numbers<const N: usize>(
        &self,
        name: &'static str,
    ) -> Result<[f64; N], Fault> {
        self.numbers(name)?.ok_or_else(|| self.missing(name))
    }

    pub(super) fn required_non_negative(&self, name: &'static str) -> Result<f64, Fault> {
        self.non_negative(name)?.ok_or_else(|| self.missing(name))
    }

    pub(super) fn negative(&self, attribute: &'static str, value: f64) -> Fault {
        self.fault(UrdfProblem::Negative {
            subject: self.subject(),
            element: self.name().to_owned(),
            attribute,
            value,
        })
    }

    fn missing(&self, attribute: &'static str) -> Fault {
        self.fault(UrdfProblem::MissingAttribute {
            subject: self.subject(),
            element: self.name().to_owned(),
            attribute,
        })
    }

    fn parse_numbers<const N: usize>(
        &self,
        attribute: &'static str,
        text: &str,
    ) -> Result<[f64; N], Fault> {
        let (subject, element) = (self.subject(), self.name().to_owned());
        let value = text.to_owned();
        let mut numbers = [0.0_f64; N];
        let mut words = text.split_whitespace();
        let parsed = numbers
            .iter_mut()
            .try_for_each(|number| words.next()?.parse().ok().map(|parsed| *number = parsed));
        if parsed.is_none() || words.next().is_some() {
            let expected = N;
            return Err(self.fault(UrdfProblem::NotNumbers {
                subject,
                element,
                attribute,
                value,
                expected,
            }));
        }
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(self.fault(UrdfProblem::NotFinite { subject, element, attribute, value }));
        }
        Ok(numbers)
    }
}
