//! Second pass: the links are one tree, and every mimic joint follows a driven one.

use super::error::{UrdfError, UrdfProblem};
use super::scan::{JointSite, Named, Scan};

/// A joint's position as a linear function of another's: `multiplier * master + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Follow {
    pub(crate) master: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

/// Joint that leads to each link, `None` for the root.
pub(super) fn parent_joints(scan: &Scan<'_>) -> Result<Vec<Option<usize>>, UrdfError> {
    let mut parents: Vec<Option<usize>> = vec![None; scan.links.len()];
    for (index, joint) in scan.joints.iter().enumerate() {
        let Some(slot) = parents.get_mut(joint.child) else { continue };
        if let Some(first) = slot.replace(index) {
            return Err(several_parents(scan, first, joint));
        }
    }
    one_root(scan, &parents)?;
    no_cycle(scan, &parents)?;
    Ok(parents)
}

/// Links from the root outwards, a link's children in the order of the file.
pub(super) fn topological_order(scan: &Scan<'_>, parents: &[Option<usize>]) -> Vec<usize> {
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); scan.links.len()];
    for joint in &scan.joints {
        if let Some(of_parent) = children.get_mut(joint.parent) {
            of_parent.push(joint.child);
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

/// What each joint follows, over chains of mimic joints, with `rules` as the file gives them.
pub(super) fn resolve_mimics(
    scan: &Scan<'_>,
    rules: &[Option<(f64, f64)>],
) -> Result<Vec<Option<Follow>>, UrdfError> {
    scan.joints
        .iter()
        .enumerate()
        .map(|(index, joint)| joint.master.map(|_| resolve(scan, rules, index)).transpose())
        .collect()
}

fn resolve(
    scan: &Scan<'_>,
    rules: &[Option<(f64, f64)>],
    index: usize,
) -> Result<Follow, UrdfError> {
    let mut follow = Follow { master: index, multiplier: 1.0, offset: 0.0 };
    let Some(first) = scan.joints.get(index) else { return Ok(follow) };
    let fail = |problem| Err(first.element.error(problem));
    let subject = || first.element.subject();
    // A chain without loop has at most one step per joint.
    for _ in 0..=scan.joints.len() {
        let Some(joint) = scan.joints.get(follow.master) else { break };
        if !joint.moves {
            let master = joint.name.to_owned();
            return fail(UrdfProblem::FixedMaster { subject: subject(), master });
        }
        let Some(master) = joint.master else {
            return if follow.multiplier.is_finite() && follow.offset.is_finite() {
                Ok(follow)
            } else {
                let master = joint.name.to_owned();
                fail(UrdfProblem::MimicOverflow { subject: subject(), master })
            };
        };
        let (multiplier, offset) =
            rules.get(follow.master).copied().flatten().unwrap_or((1.0, 0.0));
        follow = Follow {
            master,
            multiplier: follow.multiplier * multiplier,
            offset: follow.multiplier * offset + follow.offset,
        };
    }
    fail(UrdfProblem::MimicLoop { subject: subject() })
}

fn several_parents(scan: &Scan<'_>, first: usize, second: &JointSite<'_>) -> UrdfError {
    second.element.error(UrdfProblem::SeveralParents {
        link: link_name(scan, second.child),
        first: scan.joints.get(first).map_or("", |joint| joint.name).to_owned(),
        second: second.name.to_owned(),
    })
}

fn one_root(scan: &Scan<'_>, parents: &[Option<usize>]) -> Result<(), UrdfError> {
    let mut roots = scan.links.iter().zip(parents).filter(|(_, parent)| parent.is_none());
    match (roots.next(), roots.next()) {
        (Some((first, _)), Some((second, _))) => {
            Err(second.element.error(UrdfProblem::SeveralRoots {
                first: first.name.to_owned(),
                second: second.name.to_owned(),
            }))
        }
        (None, _) if scan.links.is_empty() => Err(scan.root.error(UrdfProblem::NoLinks)),
        // Without a root every link has a parent: that is a cycle, found next.
        _ => Ok(()),
    }
}

fn no_cycle(scan: &Scan<'_>, parents: &[Option<usize>]) -> Result<(), UrdfError> {
    // Links known to hang on the root, so that every link is walked over once.
    let mut rooted = vec![false; scan.links.len()];
    for start in 0..scan.links.len() {
        let mut path = Vec::new();
        let mut link = start;
        while !rooted.get(link).copied().unwrap_or(true) {
            path.push(link);
            let Some(joint) = parents.get(link).copied().flatten() else { break };
            let Some(site) = scan.joints.get(joint) else { break };
            if path.len() > scan.links.len() {
                return Err(site.element.error(UrdfProblem::Cycle {
                    joint: site.name.to_owned(),
                    link: link_name(scan, site.child),
                }));
            }
            link = site.parent;
        }
        for link in path {
            if let Some(slot) = rooted.get_mut(link) {
                *slot = true;
            }
        }
    }
    Ok(())
}

fn link_name(scan: &Scan<'_>, link: usize) -> String {
    scan.links.get(link).map_or("", |Named { name, .. }| name).to_owned()
}
