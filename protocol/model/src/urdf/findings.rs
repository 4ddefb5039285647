//! What is found in a text, in the order of the text, and never more than a person would read.

use std::collections::BTreeMap;

use super::error::UrdfProblem;

/// Most findings of one kind that are kept, so that a text made of mistakes costs no more.
pub(super) const MAX_FINDINGS: usize = 200;

/// Something wrong with the element that starts at a byte of the text.
#[derive(Debug)]
pub(super) struct Fault {
    /// Byte of the text.
    pub(super) offset: usize,
    pub(super) problem: Box<UrdfProblem>,
}

/// Findings, the first [`MAX_FINDINGS`] in the order of the text.
///
/// At one place they keep the order in which they were found.
#[derive(Debug)]
pub(super) struct Findings<T> {
    kept: BTreeMap<(usize, usize), T>,
    total: usize,
}

impl<T> Default for Findings<T> {
    fn default() -> Self {
        Self { kept: BTreeMap::new(), total: 0 }
    }
}

impl<T> Findings<T> {
    /// Adds a finding about the element at byte `offset`.
    pub(super) fn add(&mut self, offset: usize, finding: T) {
        self.kept.insert((offset, self.total), finding);
        self.total += 1;
        if self.kept.len() > MAX_FINDINGS {
            self.kept.pop_last();
        }
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.total == 0
    }

    /// How many were left out.
    pub(super) fn omitted(&self) -> usize {
        self.total - self.kept.len()
    }

    /// The findings with the byte where each one's element starts.
    pub(super) fn in_order(self) -> impl Iterator<Item = (usize, T)> {
        self.kept.into_iter().map(|((offset, _), finding)| (offset, finding))
    }
}

/// What makes a text unusable.
pub(super) type Problems = Findings<Box<UrdfProblem>>;

impl Problems {
    /// The value, or nothing and a problem more.
    pub(super) fn keep<T>(&mut self, result: Result<T, Fault>) -> Option<T> {
        result.map_err(|fault| self.report(fault)).ok()
    }

    pub(super) fn report(&mut self, Fault { offset, problem }: Fault) {
        self.add(offset, problem);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_are_sorted_and_the_last_of_too_many_left_out() {
        let mut findings = Findings::default();
        for offset in (0..MAX_FINDINGS + 3).rev() {
            findings.add(offset, offset);
        }
        findings.add(1, 7);
        assert_eq!(findings.omitted(), 4);
        let kept: Vec<_> = findings.in_order().collect();
        assert_eq!(kept.len(), MAX_FINDINGS);
        assert_eq!(kept[..4], [(0, 0), (1, 1), (1, 7), (2, 2)]);
    }
}
