//! Groups: members by name, by chain and by other groups.

use std::collections::{BTreeMap, BTreeSet};

use super::source::Element;
use super::{JointGroup, Reader, Severity, SrdfFault};
use crate::RobotModel;

/// A group with the names of the groups in it, before those are known.
struct Draft<'d> {
    element: Element<'d>,
    name: &'d str,
    own: Members,
    /// Drafts of the groups in it.
    subgroups: Vec<usize>,
    members: Option<Members>,
}

#[derive(Clone, Default)]
struct Members {
    joints: BTreeSet<usize>,
    links: BTreeSet<usize>,
    virtual_joints: BTreeSet<usize>,
    chains: Vec<[usize; 2]>,
}

impl Members {
    fn add_joint(&mut self, joint: usize, model: &RobotModel) {
        self.joints.insert(joint);
        self.links.extend(model.joints().get(joint).map(|joint| joint.child));
    }

    fn add_link(&mut self, link: usize, model: &RobotModel) {
        self.links.insert(link);
        self.joints.extend(model.links().get(link).and_then(|link| link.parent_joint));
    }

    fn add_all(&mut self, other: &Self) {
        self.joints.extend(&other.joints);
        self.links.extend(&other.links);
        self.virtual_joints.extend(&other.virtual_joints);
    }

    fn is_empty(&self) -> bool {
        self.joints.is_empty() && self.links.is_empty() && self.virtual_joints.is_empty()
    }
}

impl<'d> Reader<'d, '_> {
    pub(super) fn read_groups(&mut self) {
        let mut drafts = self.drafts();
        self.resolve(&mut drafts);
        let usable: Vec<usize> = (0..drafts.len())
            .filter(|&draft| drafts.get(draft).is_some_and(|draft| draft.members.is_some()))
            .collect();
        let position = |draft: &usize| usable.binary_search(draft).ok();
        for draft in drafts {
            if let Some(members) = draft.members {
                let subgroups = draft.subgroups.iter().filter_map(position).collect();
                self.srdf.groups.push(finish(draft.name, members, subgroups, self.model));
            }
        }
    }

    /// One draft per group; groups in groups as indices of drafts.
    fn drafts(&mut self) -> Vec<Draft<'d>> {
        let mut names: BTreeMap<&str, (usize, u32)> = BTreeMap::new();
        let mut drafts = Vec::new();
        for element in self.entries("group") {
            let Some(name) = self.problems.required(&element, "name") else { continue };
            if let Some(&(_, first_line)) = names.get(name) {
                let name = name.to_owned();
                self.problems.error(&element, SrdfFault::RepeatedName { name, first_line });
                continue;
            }
            names.insert(name, (drafts.len(), element.line()));
            let (own, subgroups) = (Members::default(), Vec::new());
            drafts.push(Draft { element, name, own, subgroups, members: None });
        }
        for draft in &mut drafts {
            for child in draft.element.children() {
                self.read_member(draft, &child, &names);
            }
        }
        drafts
    }

    fn read_member(
        &mut self,
        draft: &mut Draft<'d>,
        child: &Element<'d>,
        names: &BTreeMap<&str, (usize, u32)>,
    ) {
        match child.name() {
            "link" => {
                if let Some(link) = self.link(child, "name", Severity::Error) {
                    draft.own.add_link(link, self.model);
                }
            }
            "joint" => self.read_joint(draft, child),
            "chain" => self.read_chain(draft, child),
            "group" => {
                let Some(name) = self.problems.required(child, "name") else { return };
                match names.get(name) {
                    Some(&(subgroup, _)) => draft.subgroups.push(subgroup),
                    None => {
                        let fault = SrdfFault::UnknownGroup { group: name.to_owned() };
                        self.problems.error(child, fault);
                    }
                }
            }
            _ => {
                let parent = "group".to_owned();
                self.problems.warning(child, SrdfFault::UnknownElement { parent });
            }
        }
    }

    fn read_joint(&mut self, draft: &mut Draft<'d>, child: &Element<'d>) {
        let Some(name) = self.problems.required(child, "name") else { return };
        let named = |joint: &super::VirtualJoint| joint.name == name;
        if let Some(joint) = self.model.joint_index(name) {
            draft.own.add_joint(joint, self.model);
        } else if let Some(joint) = self.srdf.virtual_joints.iter().position(named) {
            draft.own.virtual_joints.insert(joint);
            draft.own.links.insert(0);
        } else {
            self.problems.error(child, SrdfFault::UnknownJoint { joint: name.to_owned() });
        }
    }

    /// All joints and links between the two, over their common ancestor if neither carries the
    /// other.
    fn read_chain(&mut self, draft: &mut Draft<'d>, child: &Element<'d>) {
        let base = self.link(child, "base_link", Severity::Error);
        let tip = self.link(child, "tip_link", Severity::Error);
        let (Some(base), Some(tip)) = (base, tip) else { return };
        if base == tip {
            let link = self.link_name(base);
            return self.problems.error(child, SrdfFault::EmptyChain { link });
        }
        // Links stand after their parents, so the later one can be no ancestor of the other.
        let (mut a, mut b) = (base, tip);
        draft.own.links.extend([base, tip]);
        draft.own.chains.push([base, tip]);
        while a != b {
            let later = if a > b { &mut a } else { &mut b };
            let Some(joint) = self.model.links().get(*later).and_then(|link| link.parent_joint)
            else {
                break;
            };
            draft.own.joints.insert(joint);
            let Some(parent) = self.model.joints().get(joint).map(|joint| joint.parent) else {
                break;
            };
            draft.own.links.insert(parent);
            *later = parent;
        }
    }

    /// Adds to each group what the groups in it have, the inner ones first.
    fn resolve(&mut self, drafts: &mut [Draft<'d>]) {
        let mut users = vec![Vec::new(); drafts.len()];
        let mut open: Vec<usize> = drafts.iter().map(|draft| draft.subgroups.len()).collect();
        for (user, draft) in drafts.iter().enumerate() {
            for &subgroup in &draft.subgroups {
                if let Some(users) = users.get_mut(subgroup) {
                    users.push(user);
                }
            }
        }
        let mut ready: Vec<usize> =
            (0..open.len()).filter(|&draft| open.get(draft) == Some(&0)).collect();
        let mut done = vec![false; drafts.len()];
        while let Some(next) = ready.pop() {
            done[next] = true;
            self.complete(drafts, next);
            for &user in &users[next] {
                open[user] -= 1;
                if open[user] == 0 {
                    ready.push(user);
                }
            }
        }
        for (index, draft) in drafts.iter().enumerate() {
            if !done[index] {
                let group = draft.name.to_owned();
                self.problems.error(&draft.element, SrdfFault::CyclicGroup { group });
            }
        }
    }

    fn complete(&mut self, drafts: &mut [Draft<'d>], index: usize) {
        let Some(draft) = drafts.get(index) else { return };
        let mut members = draft.own.clone();
        for subgroup in draft.subgroups.iter().filter_map(|&subgroup| drafts.get(subgroup)) {
            match &subgroup.members {
                Some(others) => members.add_all(others),
                None => {
                    let group = subgroup.name.to_owned();
                    self.problems.error(&draft.element, SrdfFault::UnusableGroup { group });
                }
            }
        }
        if members.is_empty() {
            let group = draft.name.to_owned();
            return self.problems.error(&draft.element, SrdfFault::EmptyGroup { group });
        }
        if let Some(draft) = drafts.get_mut(index) {
            draft.members = Some(members);
        }
    }
}

fn finish(name: &str, members: Members, subgroups: Vec<usize>, model: &RobotModel) -> JointGroup {
    let mut variables: Vec<usize> =
        members.joints.iter().filter_map(|&joint| model.joints().get(joint)?.variable()).collect();
    variables.sort_unstable();
    JointGroup {
        name: name.to_owned(),
        variables,
        joints: members.joints.into_iter().collect(),
        links: members.links.into_iter().collect(),
        chains: members.chains,
        subgroups,
        virtual_joints: members.virtual_joints.into_iter().collect(),
    }
}
