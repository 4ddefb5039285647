//! What is wrong with one value of a file.

use std::ops::RangeInclusive;

/// A value of a file that is not allowed, before it is known where in which file it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Path of the field from the top of the file or table, parts joined by dots.
    pub field: String,
    /// What is wrong with it, to be read after the field.
    pub text: String,
}

impl Problem {
    /// A problem with `field`.
    pub fn new(field: impl Into<String>, text: impl Into<String>) -> Self {
        Self { field: field.into(), text: text.into() }
    }

    /// The same problem, seen from the table that holds this one as `parent`.
    #[must_use]
    pub fn under(self, parent: &str) -> Self {
        Self { field: format!("{parent}.{}", self.field), text: self.text }
    }
}

/// Refuses a value outside `range`, and one that is not a number.
pub(crate) fn check_range(
    field: &str,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<(), Problem> {
    if range.contains(&value) {
        return Ok(());
    }
    let text = format!("{value} is outside {} to {}", range.start(), range.end());
    Err(Problem::new(field, text))
}
