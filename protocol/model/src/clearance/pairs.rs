//! Which pairs of bodies are checked.

use super::body::{Body, Owner};
use super::builder::{Mount, Robot, RobotId, SceneBuilder};
use super::reach::{Lever, levers, unshared};

/// Two bodies that must not touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) a: usize,
    pub(super) b: usize,
    /// Index of each body among the scene's boxes.
    pub(super) boxes: [Option<usize>; 2],
}

/// Pairs of the same two robots, or of a robot and what is fixed.
#[derive(Clone, Debug)]
pub(super) struct PairGroup {
    /// Robots of the first and the second body, the lower first; `None` for what is fixed.
    pub(super) robots: [Option<usize>; 2],
    /// Where they stand among all pairs.
    pub(super) range: std::ops::Range<usize>,
}

/// Links that no joint moves against each other, each by the first of its robot, or the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rigid {
    World,
    Link(usize, usize),
}

/// Pairs in groups, and the joints that move each pair against each other.
pub(super) struct Table {
    pub(super) pairs: Vec<Pair>,
    pub(super) groups: Vec<PairGroup>,
    /// Joints of all pairs, one pair after the other.
    pub(super) levers: Vec<Lever>,
    /// Where those of each pair end.
    pub(super) ends: Vec<usize>,
}

pub(super) fn table(scene: &SceneBuilder, offsets: &[usize]) -> Table {
    let bodies = &scene.bodies;
    let key = |pair: &Pair| {
        [pair.a, pair.b].map(|body| bodies.get(body).and_then(robot_of).unwrap_or(usize::MAX))
    };
    let mut pairs: Vec<Pair> = Vec::new();
    for (a, first) in bodies.iter().enumerate() {
        for (b, second) in bodies.iter().enumerate().skip(a + 1) {
            if is_checked(scene, first, second) {
                let pair = Pair { a, b, boxes: [None; 2] };
                let [low, high] = key(&pair);
                pairs.push(if low <= high { pair } else { Pair { a: b, b: a, ..pair } });
            }
        }
    }
    pairs.sort_by_key(key);
    let ways: Vec<Vec<Lever>> =
        bodies.iter().map(|body| levers(&scene.robots, offsets, body)).collect();
    let mut table = Table { groups: Vec::new(), levers: Vec::new(), ends: Vec::new(), pairs };
    for (index, pair) in table.pairs.iter().enumerate() {
        if let (Some(a), Some(b)) = (ways.get(pair.a), ways.get(pair.b)) {
            table.levers.extend(unshared(a, b));
        }
        table.ends.push(table.levers.len());
        let robots = key(pair).map(|robot| Some(robot).filter(|&robot| robot != usize::MAX));
        match table.groups.last_mut() {
            Some(last) if last.robots == robots => last.range.end = index + 1,
            _ => table.groups.push(PairGroup { robots, range: index..index + 1 }),
        }
    }
    table
}

const fn robot_of(body: &Body) -> Option<usize> {
    match body.owner {
        Owner::Link { robot, .. } => Some(robot.0),
        Owner::Fixed { .. } => None,
    }
}

fn is_checked(scene: &SceneBuilder, a: &Body, b: &Body) -> bool {
    let (one, other) = (a.owner.min(b.owner), a.owner.max(b.owner));
    let (first, second) = (rigid(&scene.robots, one), rigid(&scene.robots, other));
    if first == second || scene.allowed.contains(&[one, other]) {
        return false;
    }
    let (Owner::Link { robot, link: low }, Owner::Link { robot: same, link: high }) = (one, other)
    else {
        return true;
    };
    let Some(known) = scene.robots.get(robot.0).filter(|_| robot == same) else { return true };
    let links = [low, high];
    known.enabled.contains(&links)
        || !(known.disabled.contains(&links)
            || links.iter().any(|link| known.unchecked.contains(link))
            || carrier(&scene.robots, first) == Some(second)
            || carrier(&scene.robots, second) == Some(first))
}

/// What the owner is rigidly connected to.
fn rigid(robots: &[Robot], owner: Owner) -> Rigid {
    let Owner::Link { robot, link } = owner else { return Rigid::World };
    let (mut at, mut link) = (robot.0, link);
    while let Some(robot) = robots.get(at) {
        let joint = robot.model.links().get(link).and_then(|link| link.parent_joint);
        match joint.and_then(|joint| robot.model.joints().get(joint)) {
            Some(joint) if joint.motion.is_some() => return Rigid::Link(at, link),
            Some(joint) => link = joint.parent,
            None => match robot.mount {
                Mount::World(_) => return Rigid::World,
                Mount::Link { robot, link: carrier, .. } => (at, link) = (robot.0, carrier),
            },
        }
    }
    Rigid::World
}

/// What carries it with one moving joint, within its robot.
fn carrier(robots: &[Robot], rigid_link: Rigid) -> Option<Rigid> {
    let Rigid::Link(at, link) = rigid_link else { return None };
    let model = &robots.get(at)?.model;
    let joint = model.joints().get(model.links().get(link)?.parent_joint?)?;
    Some(rigid(robots, Owner::Link { robot: RobotId(at), link: joint.parent }))
}
