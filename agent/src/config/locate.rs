//! Where in the text of a file a field stands.

use std::fmt;
use std::sync::Arc;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_saphyr::options::NonFiniteFloatPolicy;
use serde_saphyr::{DuplicateKeyPolicy, MergeKeyPolicy, Options, Spanned};

use super::{ConfigError, Problem};

/// The text a configuration came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Origin {
    label: Arc<str>,
    text: Arc<str>,
}

/// How robot files are read: one meaning of each text, no surprises, small budgets.
pub(super) fn options() -> Options {
    serde_saphyr::options! {
        budget: serde_saphyr::budget! {
            max_depth: 16,
            max_nodes: 20_000,
            max_events: 50_000,
            max_aliases: 1_000,
            max_documents: 1,
        },
        strict_booleans: true,
        duplicate_keys: DuplicateKeyPolicy::Error,
        merge_keys: MergeKeyPolicy::Error,
        reject_unsupported_tags: true,
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
    }
}

impl Origin {
    pub(super) fn new(label: &str, text: &str) -> Self {
        Self { label: label.into(), text: text.into() }
    }

    /// `problem` with the place of its field or, if that is missing, of the table around it.
    pub(super) fn error(&self, problem: Problem) -> ConfigError {
        let (line, column) = self.locate(&problem.field);
        ConfigError::Invalid {
            label: self.label.to_string(),
            line,
            column,
            field: problem.field,
            problem: problem.text,
            snippet: self.snippet(line, column),
        }
    }

    /// An error of the YAML reader with its place.
    pub(super) fn syntax(&self, error: &serde_saphyr::Error) -> ConfigError {
        let (line, column) = error.location().map_or((0, 0), |at| (at.line(), at.column()));
        let plain = error.without_snippet().to_string();
        let place = format!(" at line {line}, column {column}");
        ConfigError::Syntax {
            label: self.label.to_string(),
            line,
            column,
            message: plain.strip_suffix(&place).unwrap_or(&plain).to_owned(),
            snippet: self.snippet(line, column),
        }
    }

    /// The line with a mark under the column; empty if there is no such line.
    fn snippet(&self, line: u64, column: u64) -> String {
        let index = usize::try_from(line).ok().and_then(|line| line.checked_sub(1));
        let Some(text) = index.and_then(|index| self.text.lines().nth(index)) else {
            return String::new();
        };
        let before = usize::try_from(column).unwrap_or_default().saturating_sub(1);
        let indent = " ".repeat(before.min(text.chars().count()));
        format!("\n{line:>5} | {text}\n      | {indent}^")
    }

    /// Line and column of the value at the longest part of `path` that exists.
    fn locate(&self, path: &str) -> (u64, u64) {
        let Ok(mut at) =
            serde_saphyr::from_str_with_options::<Spanned<Node>>(&self.text, options())
        else {
            return (1, 1);
        };
        let mut place = at.referenced;
        let mut rest = path;
        while let Some((value, after)) = step(at.value, rest) {
            (at, rest) = (value, after);
            place = at.referenced;
        }
        (place.line(), place.column())
    }
}

/// A YAML value of which only the places of its parts matter.
enum Node {
    Leaf,
    List(Vec<Spanned<Self>>),
    Table(Vec<(String, Spanned<Self>)>),
}

/// One step down `path`, with what is left of it; a name may hold dots itself.
fn step(node: Node, path: &str) -> Option<(Spanned<Node>, &str)> {
    let after = |name: &str| match path.strip_prefix(name)? {
        "" => Some(""),
        rest => rest.strip_prefix('.'),
    };
    match node {
        Node::Leaf => None,
        Node::List(items) => items
            .into_iter()
            .enumerate()
            .find_map(|(index, value)| Some((value, after(&index.to_string())?))),
        Node::Table(entries) => {
            entries.into_iter().find_map(|(name, value)| Some((value, after(&name)?)))
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_bool<E>(self, _: bool) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_i128<E>(self, _: i128) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_u128<E>(self, _: u128) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_str<E>(self, _: &str) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_none<E>(self) -> Result<Node, E> {
        Ok(Node::Leaf)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Node, D::Error> {
        IgnoredAny::deserialize(deserializer)?;
        Ok(Node::Leaf)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Node, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Node::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Node, A::Error> {
        let mut table = Vec::new();
        while let Some(entry) = entries.next_entry()? {
            table.push(entry);
        }
        Ok(Node::Table(table))
    }
}
