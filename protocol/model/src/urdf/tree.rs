//! Second pass: the links are one tree, and every mimic joint follows a driven one.

use super::error::UrdfProblem;
use super::findings::Problems;
use super::scan::{JointSite, MimicRule, Named, Scan};

/// A joint's position as a linear function of another's: `multiplier * master + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Follow {
    pub(crate) master: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

/// Joint that leads to each link, `None` for the root.
///
/// Nothing is reported where an end of a joint is not known: every answer would follow from that.
pub(super) fn parent_joints(scan: &Scan<'_>, problems: &mut Problems) -> Vec<Option<usize>> {
    let mut parents: Vec<Option<usize>> = vec![None; scan.links.len()];
    let unknown = |joint: &JointSite<'_>| joint.parent.is_none() || joint.child.is_none();
    if scan.joints.iter().any(unknown) || !scan.links_sound {
        return parents;
    }
    let mut one_parent_each = true;
    for (index, joint) in scan.joints.iter().enumerate() {
        let Some(slot) = joint.child.and_then(|child| parents.get_mut(child)) else { continue };
        if let Some(first) = *slot {
            one_parent_each = false;
            problems.report(joint.element.fault(several_parents(scan, first, joint)));
        } else {
            *slot = Some(index);
        }
    }
    // A joint to the wrong link leaves another link without one: that is no second mistake.
    if one_parent_each {
        one_root(scan, &parents, problems);
        no_cycle(scan, &parents, problems);
    }
    parents
}

/// Links from the root outwards, a link's children in the order of the file.
pub(super) fn topological_order(scan: &Scan<'_>, parents: &[Option<usize>]) -> Vec<usize> {
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); scan.links.len()];
    for joint in &scan.joints {
        let of_parent = joint.parent.and_then(|parent| children.get_mut(parent));
        if let (Some(of_parent), Some(child)) = (of_parent, joint.child) {
            of_parent.push(child);
        }
    }
    let mut order = Vec::with_capacity(scan.links.len());
    let mut open: Vec<usize> = parents.iter().position(Option::is_none).into_iter().collect();
    while let Some(link) = open.pop() {
        order.push(link);
        open.extend(children.get(link).into_iter().flatten().rev());
    }
    order
}

/// What is known of a joint while mimic rules are followed.
#[derive(Clone, Copy)]
enum Known {
    No,
    /// It is being followed: to come here again is a loop.
    Open,
    /// It follows that joint, a driven one itself.
    Follows(Follow),
    /// Nothing, and why has been reported.
    Nothing,
}

/// What each mimic joint follows, over chains of mimic joints to their ends.
pub(super) fn resolve_mimics(scan: &Scan<'_>, problems: &mut Problems) -> Vec<Option<Follow>> {
    let mut known = vec![Known::No; scan.joints.len()];
    if scan.joints_sound {
        for start in 0..scan.joints.len() {
            resolve(scan, &mut known, start, problems);
        }
    }
    let follow = |(joint, known): (&JointSite<'_>, Known)| match known {
        Known::Follows(follow) => joint.mimic.map(|_| follow),
        Known::No | Known::Open | Known::Nothing => None,
    };
    scan.joints.iter().zip(known).map(follow).collect()
}

/// Follows the rules from a joint to one that is known, and comes back with what that means.
fn resolve(scan: &Scan<'_>, known: &mut [Known], start: usize, problems: &mut Problems) {
    let mut path = Vec::new();
    let mut at = Some(start);
    let mut end = Known::Nothing;
    while let Some(index) = at {
        match known.get(index).copied() {
            Some(Known::No) => {}
            Some(Known::Open) => {
                report_loop(scan, &path, index, problems);
                break;
            }
            Some(found) => {
                end = found;
                break;
            }
            None => break,
        }
        set(known, index, Known::Open);
        path.push(index);
        at = scan.joints.get(index).and_then(|joint| joint.mimic?.master);
    }
    for index in path.into_iter().rev() {
        end = come_back(scan, index, end, problems);
        set(known, index, end);
    }
}

fn set(known: &mut [Known], index: usize, to: Known) {
    if let Some(slot) = known.get_mut(index) {
        *slot = to;
    }
}

/// What is known of a joint, if `end` is known of the one that it mimics.
fn come_back(scan: &Scan<'_>, index: usize, end: Known, problems: &mut Problems) -> Known {
    let Some(joint) = scan.joints.get(index) else { return Known::Nothing };
    let Some(rule) = joint.mimic else {
        return Known::Follows(Follow { master: index, multiplier: 1.0, offset: 0.0 });
    };
    let Known::Follows(end) = end else { return Known::Nothing };
    match compose(scan, joint, rule, end) {
        Ok(follow) => Known::Follows(follow),
        Err(problem) => {
            problems.report(joint.element.fault(problem));
            Known::Nothing
        }
    }
}

/// The rule of a joint over what the joint that it mimics follows.
fn compose(
    scan: &Scan<'_>,
    joint: &JointSite<'_>,
    rule: MimicRule,
    end: Follow,
) -> Result<Follow, UrdfProblem> {
    let subject = joint.element.subject();
    let name = |joint: Option<&JointSite<'_>>| joint.map_or("", |joint| joint.name).to_owned();
    let master = rule.master.and_then(|master| scan.joints.get(master));
    if master.is_some_and(|master| !master.moves) {
        return Err(UrdfProblem::FixedMaster { subject, master: name(master) });
    }
    let follow = Follow {
        master: end.master,
        multiplier: rule.multiplier * end.multiplier,
        offset: rule.multiplier * end.offset + rule.offset,
    };
    if follow.multiplier.is_finite() && follow.offset.is_finite() {
        return Ok(follow);
    }
    Err(UrdfProblem::MimicOverflow { subject, master: name(scan.joints.get(end.master)) })
}

/// Reports a loop once, at its first joint in the order of the file.
fn report_loop(scan: &Scan<'_>, path: &[usize], again: usize, problems: &mut Problems) {
    let first = path.iter().rev().take_while(|&&index| index != again).min();
    let first = first.map_or(again, |&first| first.min(again));
    if let Some(JointSite { element, .. }) = scan.joints.get(first) {
        problems.report(element.fault(UrdfProblem::MimicLoop { subject: element.subject() }));
    }
}

fn several_parents(scan: &Scan<'_>, first: usize, second: &JointSite<'_>) -> UrdfProblem {
    UrdfProblem::SeveralParents {
        link: link_name(scan, second.child),
        first: scan.joints.get(first).map_or("", |joint| joint.name).to_owned(),
        second: second.name.to_owned(),
    }
}

fn one_root(scan: &Scan<'_>, parents: &[Option<usize>], problems: &mut Problems) {
    let mut roots = scan.links.iter().zip(parents).filter(|(_, parent)| parent.is_none());
    // Without a root every link has a parent: that is a cycle, found next.
    let Some((first, _)) = roots.next() else { return };
    for (second, _) in roots {
        problems.report(second.element.fault(UrdfProblem::SeveralRoots {
            first: first.name.to_owned(),
            second: second.name.to_owned(),
        }));
    }
}

/// Reports each cycle once, at its first joint in the order of the file.
fn no_cycle(scan: &Scan<'_>, parents: &[Option<usize>], problems: &mut Problems) {
    // In which walk each link was met, so that every link is walked over once.
    let mut met: Vec<Option<usize>> = vec![None; scan.links.len()];
    for start in 0..scan.links.len() {
        let mut path = Vec::new();
        let mut link = start;
        while let Some(slot) = met.get_mut(link) {
            if let Some(walk) = *slot {
                if walk == start {
                    report_cycle(scan, &path, link, problems);
                }
                break;
            }
            *slot = Some(start);
            let Some(joint) = parents.get(link).copied().flatten() else { break };
            let Some(parent) = scan.joints.get(joint).and_then(|site| site.parent) else { break };
            path.push((link, joint));
            link = parent;
        }
    }
}

fn report_cycle(scan: &Scan<'_>, path: &[(usize, usize)], again: usize, problems: &mut Problems) {
    let start = path.iter().position(|&(link, _)| link == again).unwrap_or_default();
    let first = path.iter().skip(start).map(|&(_, joint)| joint).min();
    if let Some(site) = first.and_then(|first| scan.joints.get(first)) {
        let (joint, link) = (site.name.to_owned(), link_name(scan, site.child));
        problems.report(site.element.fault(UrdfProblem::Cycle { joint, link }));
    }
}

fn link_name(scan: &Scan<'_>, link: Option<usize>) -> String {
    link.and_then(|link| scan.links.get(link)).map_or("", |Named { name, .. }| name).to_owned()
}
