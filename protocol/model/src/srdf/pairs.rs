//! Which pairs of links need no collision check.

use std::collections::BTreeMap;

use super::source::Element;
use super::{DisabledPair, Reader, Severity, SrdfFault};

impl Reader<'_, '_> {
    pub(super) fn read_pairs(&mut self) {
        let disabled = self.read_disabled();
        self.read_unchecked();
        let mut enabled: BTreeMap<[usize; 2], u32> = BTreeMap::new();
        for element in self.entries("enable_collisions") {
            let Some(pair) = self.read_pair(&element, Severity::Error) else { continue };
            if let Some(&first_line) = enabled.get(&pair) {
                self.problems.warning(&element, SrdfFault::RepeatedEntry { first_line });
                continue;
            }
            if let Some(&line) = disabled.get(&pair) {
                self.problems.error(&element, SrdfFault::Contradiction { line });
            } else if !pair.iter().any(|link| self.srdf.unchecked_links.contains(link)) {
                self.problems.warning(&element, SrdfFault::NothingToEnable);
            }
            enabled.insert(pair, element.line());
            self.srdf.enabled_pairs.push(pair);
        }
    }

    /// Line of each disabled pair.
    fn read_disabled(&mut self) -> BTreeMap<[usize; 2], u32> {
        let mut lines: BTreeMap<[usize; 2], u32> = BTreeMap::new();
        for element in self.entries("disable_collisions") {
            // A link that does not exist touches nothing, so nothing is lost without the entry.
            let Some(links) = self.read_pair(&element, Severity::Warning) else { continue };
            if let Some(&first_line) = lines.get(&links) {
                self.problems.warning(&element, SrdfFault::RepeatedEntry { first_line });
                continue;
            }
            lines.insert(links, element.line());
            let reason = element.attribute("reason").map(str::to_owned);
            self.srdf.disabled_pairs.push(DisabledPair { links, reason });
        }
        lines
    }

    fn read_unchecked(&mut self) {
        let mut lines: BTreeMap<usize, u32> = BTreeMap::new();
        for element in self.entries("disable_default_collisions") {
            let Some(link) = self.link(&element, "link", Severity::Warning) else { continue };
            if let Some(&first_line) = lines.get(&link) {
                self.problems.warning(&element, SrdfFault::RepeatedEntry { first_line });
                continue;
            }
            lines.insert(link, element.line());
            self.srdf.unchecked_links.push(link);
        }
    }

    /// The two links, the lower index first.
    fn read_pair(&mut self, element: &Element<'_>, severity: Severity) -> Option<[usize; 2]> {
        let first = self.link(element, "link1", severity);
        let second = self.link(element, "link2", severity);
        let (first, second) = (first?, second?);
        if first == second {
            let link = self.link_name(first);
            self.problems.warning(element, SrdfFault::SelfPair { link });
            return None;
        }
        Some([first.min(second), first.max(second)])
    }
}
