//! What the partners in motions of several robots are called, and why they stopped.

use std::collections::VecDeque;

use armada_protocol::RobotName;
use armada_protocol::messages::Denial;
use uuid::Uuid;

/// Motions whose partners are kept.
const KEPT: usize = 16;

/// The partners in the newest motions of several robots.
#[derive(Clone, Debug, Default)]
pub(super) struct GroupNames {
    groups: VecDeque<(Uuid, Vec<NamedPartner>)>,
}

/// One of them.
#[derive(Clone, Debug)]
struct NamedPartner {
    name: RobotName,
    /// Why it said that it stops.
    said: Option<Denial>,
}

impl GroupNames {
    /// Notes the partners in a motion, in their order.
    pub(super) fn note(&mut self, group: Uuid, partners: &[RobotName]) {
        let named = partners.iter().map(|name| NamedPartner { name: name.clone(), said: None });
        self.groups.retain(|(known, _)| *known != group);
        self.groups.push_back((group, named.collect()));
        while self.groups.len() > KEPT {
            self.groups.pop_front();
        }
    }

    /// Notes why a partner says that it stops; the first reason counts.
    pub(super) fn note_reason(&mut self, group: Uuid, partner: u8, reason: Denial) {
        let named = self.groups.iter_mut().find(|(known, _)| *known == group);
        if let Some(named) = named.and_then(|(_, all)| all.get_mut(usize::from(partner))) {
            named.said.get_or_insert(reason);
        }
    }

    /// A partner's name and, if it said one, the reason why it stopped.
    pub(super) fn of(&self, group: Uuid, partner: u8) -> (&str, Option<&Denial>) {
        let named = self.groups.iter().find(|(known, _)| *known == group);
        let named = named.and_then(|(_, all)| all.get(usize::from(partner)));
        named.map_or(("unknown", None), |named| (named.name.as_str(), named.said.as_ref()))
    }
}
