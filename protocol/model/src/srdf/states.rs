//! Named states of groups.

use std::collections::{BTreeMap, BTreeSet};

use super::source::Element;
use super::{GroupState, Reader, SrdfFault};
use crate::{Motion, PositionSource};

/// How far a mimic joint may be from where its master puts it \[rad or m\]: files are rounded.
const MIMIC_TOLERANCE: f64 = 1e-3;

/// A state in the making.
#[derive(Default)]
struct Draft<'d> {
    positions: BTreeMap<usize, f64>,
    /// Mimic joints, looked at when all variables are known.
    mimics: Vec<(Element<'d>, usize, f64)>,
    joints: BTreeSet<usize>,
    is_broken: bool,
}

impl<'d> Reader<'d, '_> {
    pub(super) fn read_states(&mut self) {
        let mut names: BTreeMap<(usize, &str), u32> = BTreeMap::new();
        for element in self.entries("group_state") {
            let name = self.problems.required(&element, "name");
            let group = self.group(&element, "group");
            let (Some(name), Some(group)) = (name, group) else { continue };
            if let Some(&first_line) = names.get(&(group, name)) {
                let name = name.to_owned();
                self.problems.error(&element, SrdfFault::RepeatedName { name, first_line });
                continue;
            }
            names.insert((group, name), element.line());
            let mut draft = Draft::default();
            for child in element.children() {
                self.read_value(&child, group, &mut draft);
            }
            self.check_mimics(&draft);
            if !draft.is_broken {
                self.check_complete(&element, group, &draft.positions);
                let positions = draft.positions.into_iter().collect();
                self.srdf.states.push(GroupState { name: name.to_owned(), group, positions });
            }
        }
    }

    fn read_value(&mut self, child: &Element<'d>, group: usize, draft: &mut Draft<'d>) {
        if child.name() != "joint" {
            let parent = "group_state".to_owned();
            return self.problems.warning(child, SrdfFault::UnknownElement { parent });
        }
        let Some(name) = self.problems.required(child, "name") else {
            draft.is_broken = true;
            return;
        };
        let joint = name.to_owned();
        let Some(index) = self.model.joint_index(name) else {
            if self.srdf.virtual_joints.iter().any(|joint| joint.name == name) {
                return self.problems.warning(child, SrdfFault::VirtualValue { joint });
            }
            draft.is_broken = true;
            return self.problems.error(child, SrdfFault::UnknownJoint { joint });
        };
        let Some(value) = self.problems.number(child, "value") else {
            draft.is_broken = true;
            return;
        };
        let Some(motion) = self.model.joints().get(index).and_then(|joint| joint.motion.as_ref())
        else {
            return self.problems.warning(child, SrdfFault::FixedJoint { joint });
        };
        if let Some(fault) = self.fault_of(index, group, value, motion, draft) {
            draft.is_broken = true;
            return self.problems.error(child, fault);
        }
        match motion.position {
            PositionSource::Variable(variable) => {
                draft.positions.insert(variable, value);
            }
            PositionSource::Mimic { .. } => draft.mimics.push((*child, index, value)),
        }
    }

    /// Why the value cannot be used.
    fn fault_of(
        &self,
        index: usize,
        group: usize,
        value: f64,
        motion: &Motion,
        draft: &mut Draft<'d>,
    ) -> Option<SrdfFault> {
        let group = self.srdf.groups.get(group)?;
        let joint = self.joint_name(index);
        if !draft.joints.insert(index) {
            return Some(SrdfFault::RepeatedValue { joint });
        }
        let is_mimic = matches!(motion.position, PositionSource::Mimic { .. });
        if !is_mimic && group.joints.binary_search(&index).is_err() {
            return Some(SrdfFault::NotInGroup { joint, group: group.name.clone() });
        }
        if !motion.limits.contains(value) {
            let lower = motion.limits.lower.unwrap_or(f64::NEG_INFINITY);
            let upper = motion.limits.upper.unwrap_or(f64::INFINITY);
            return Some(SrdfFault::OutsideLimits { joint, value, lower, upper });
        }
        None
    }

    fn check_mimics(&mut self, draft: &Draft<'d>) {
        for (element, index, value) in &draft.mimics {
            let joint = self.joint_name(*index);
            let motion = self.model.joints().get(*index).and_then(|joint| joint.motion.as_ref());
            let Some(PositionSource::Mimic { variable, multiplier, offset }) =
                motion.map(|motion| motion.position)
            else {
                continue;
            };
            let Some(position) = draft.positions.get(&variable) else {
                let master = self.variable_name(variable);
                self.problems.warning(element, SrdfFault::MimicAlone { joint, master });
                continue;
            };
            let expected = multiplier * position + offset;
            if (expected - value).abs() > MIMIC_TOLERANCE {
                let fault = SrdfFault::MimicValue { joint, value: *value, expected };
                self.problems.warning(element, fault);
            }
        }
    }

    fn check_complete(
        &mut self,
        element: &Element<'d>,
        group: usize,
        positions: &BTreeMap<usize, f64>,
    ) {
        let Some(group) = self.srdf.groups.get(group) else { return };
        let mut open = group.variables.iter().filter(|variable| !positions.contains_key(variable));
        if let Some(&first) = open.next() {
            let count = open.count() + 1;
            let first = self.variable_name(first);
            self.problems.warning(element, SrdfFault::IncompleteState { first, count });
        }
    }

    fn joint_name(&self, joint: usize) -> String {
        self.model.joints().get(joint).map(|joint| joint.name.clone()).unwrap_or_default()
    }

    fn variable_name(&self, variable: usize) -> String {
        self.model.variables().nth(variable).map(|v| v.name.to_owned()).unwrap_or_default()
    }
}
