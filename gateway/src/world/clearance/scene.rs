//! Two robots and what carries them, with no pairs but those between the two.

use armada_model::{
    Accuracy, ClearanceError, ClearanceWorkspace, CollisionScene, MotionCheck, MotionReport, Mount,
    Owner, RobotId, RobotModel, SceneBuilder, TimedDistance,
};
use armada_protocol::messages::{Denial, DenialCode};

use super::problem::{Course, Solid, Solids};

/// A peak of speed may be exceeded by so much between two samples: rounding.
const ROUNDING: f64 = 1.0 + 1e-9;
/// Shortest step of a check \[s\].
const RESOLUTION_S: f64 = 2e-4;

/// Two robots and what carries them.
pub(super) struct PairScene<'p> {
    scene: CollisionScene,
    solids: Vec<&'p Solid>,
    /// Robots that follow a trajectory, by their index in `solids`: the first is the one whose phase
    /// is shifted against the second, which is the reference.
    followers: Vec<usize>,
    pub(super) duration_s: f64,
}

/// Phases of a motion: a stretch of time of the reference, and how far ahead the shifted one is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Phases {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    /// In the middle \[s\].
    pub(super) ahead_s: f64,
    /// To both sides of the middle \[s\].
    pub(super) spread_s: f64,
}

impl<'p> PairScene<'p> {
    /// `None` if nothing moves, or one of the two has no shape.
    pub(super) fn new(
        problem: &'p Solids,
        first: usize,
        second: usize,
    ) -> Result<Option<Self>, Denial> {
        let mut members = [first, second].map(|robot| chain(problem, robot)).concat();
        members.sort_unstable();
        members.dedup();
        let solids: Vec<_> = members.iter().filter_map(|m| problem.solids.get(*m)).collect();
        let at = |robot: usize| members.iter().position(|member| *member == robot);
        let (Some(a), Some(b)) = (at(first), at(second)) else { return Ok(None) };
        let follows = |index: &usize| solids.get(*index).is_some_and(|solid| solid.follows());
        let others = (0..solids.len()).filter(|index| *index != a && *index != b);
        let followers: Vec<_> = [b, a].into_iter().chain(others).filter(follows).collect();
        if followers.is_empty() {
            return Ok(None);
        }
        let scene = build(problem, &members, (a, b)).map_err(impossible)?;
        if scene.pair_count() == 0 {
            return Ok(None);
        }
        let durations = solids.iter().filter_map(|solid| match &solid.course {
            Course::Follows(course) => Some(course.duration_s()),
            Course::Stands(_) => None,
        });
        let duration_s = durations.fold(0.0, f64::max);
        Ok(Some(Self { scene, followers, duration_s, solids }))
    }

    pub(super) fn workspace(&self) -> ClearanceWorkspace {
        self.scene.workspace()
    }

    /// Whether the phases of two robots can differ.
    pub(super) const fn can_shift(&self) -> bool {
        self.followers.len() > 1
    }

    pub(super) fn body(&self, id: armada_model::BodyId) -> String {
        self.scene.body(id).map(|body| body.name().to_owned()).unwrap_or_default()
    }

    /// Which robot is shifted, and against which.
    pub(super) fn shifted(&self) -> Option<(String, String)> {
        let name = |at: usize| {
            let solid = self.solids.get(*self.followers.get(at)?)?;
            Some(solid.name.to_string())
        };
        Some((name(0)?, name(1)?))
    }

    /// By how much a distance within the phases can be below one in their middle \[m\], if robots
    /// besides the shifted one and the reference are up to `offset_s` away from the reference.
    pub(super) fn slack(&self, phases: &Phases, offset_s: f64) -> Result<f64, Denial> {
        let mut slack = 0.0;
        for (place, robot) in self.followers.iter().enumerate() {
            let reach_s = match place {
                0 if self.can_shift() => phases.spread_s,
                0 | 1 => continue,
                _ => offset_s,
            };
            let mut speeds = vec![0.0; self.scene.variable_count()];
            self.add_speeds(*robot, phases, offset_s, &mut speeds);
            slack += self.scene.max_rate(&speeds).map_err(impossible)? * reach_s;
        }
        Ok(slack)
    }

    /// Checks the phases in the middle of the shift.
    pub(super) fn check(
        &self,
        phases: &Phases,
        offset_s: f64,
        threshold_m: f64,
        max_states: usize,
        workspace: &mut ClearanceWorkspace,
    ) -> Result<MotionReport, Denial> {
        let mut speeds = vec![0.0; self.scene.variable_count()];
        for robot in &self.followers {
            self.add_speeds(*robot, phases, offset_s, &mut speeds);
        }
        let check = MotionCheck {
            duration_s: phases.to_s - phases.from_s,
            resolution_s: RESOLUTION_S,
            threshold_m,
            speeds: Some(&speeds),
            max_states,
        };
        let mut hints = vec![0; self.solids.len()];
        let sample = |time_s: f64, positions: &mut [f64]| {
            self.write(phases, time_s, &mut hints, positions);
        };
        self.scene.check_motion(&check, sample, workspace).map_err(impossible)
    }

    /// The nearest pair at some times of the phases, in the middle of the shift.
    pub(super) fn probe(
        &self,
        phases: &Phases,
        probes: u32,
        workspace: &mut ClearanceWorkspace,
    ) -> Result<Option<TimedDistance>, Denial> {
        let mut hints = vec![0; self.solids.len()];
        let mut positions = vec![0.0; self.scene.variable_count()];
        let mut nearest: Option<TimedDistance> = None;
        for probe in 0..probes {
            let share = (f64::from(probe) + 0.5) / f64::from(probes);
            let time_s = share * (phases.to_s - phases.from_s);
            self.write(phases, time_s, &mut hints, &mut positions);
            let mut placed = self.scene.place(&positions, workspace).map_err(impossible)?;
            let Some(pair) = placed.minimum(Accuracy::Shapes) else { continue };
            if nearest.is_none_or(|least| pair.distance_m < least.pair.distance_m) {
                nearest = Some(TimedDistance { time_s, pair });
            }
        }
        Ok(nearest)
    }

    /// Writes where all are at a time since the phases begin.
    fn write(&self, phases: &Phases, time_s: f64, hints: &mut [usize], positions: &mut [f64]) {
        for (robot, (solid, hint)) in self.solids.iter().zip(hints).enumerate() {
            let time_s = phases.from_s + time_s + self.shift_of(robot, phases);
            let own = positions.get_mut(self.range(robot)).unwrap_or_default();
            solid.write(time_s, hint, own);
        }
    }

    fn shift_of(&self, robot: usize, phases: &Phases) -> f64 {
        let is_shifted = self.can_shift() && self.followers.first() == Some(&robot);
        if is_shifted { phases.ahead_s } else { 0.0 }
    }

    fn range(&self, robot: usize) -> std::ops::Range<usize> {
        let starts = self.solids.iter().take(robot).map(|solid| solid.model.variable_count());
        let start: usize = starts.sum();
        let count = self.solids.get(robot).map_or(0, |solid| solid.model.variable_count());
        start..start + count
    }

    /// The highest speeds of a robot within the phases.
    fn add_speeds(&self, robot: usize, phases: &Phases, offset_s: f64, speeds: &mut [f64]) {
        let Some(solid) = self.solids.get(robot) else { return };
        let place = self.followers.iter().position(|follower| *follower == robot);
        let reach_s = match place {
            Some(0) if self.can_shift() => phases.spread_s,
            Some(0 | 1) => 0.0,
            _ => offset_s,
        };
        let shift_s = self.shift_of(robot, phases);
        let from_s = phases.from_s + shift_s - reach_s;
        let to_s = phases.to_s + shift_s + reach_s;
        let own = speeds.get_mut(self.range(robot)).unwrap_or_default();
        solid.raise_speeds(from_s, to_s, own);
    }
}

/// The robot and everything that carries it.
fn chain(problem: &Solids, robot: usize) -> Vec<usize> {
    let carrier = |at: &usize| Some(problem.solids.get(*at)?.carrier?.0);
    std::iter::successors(Some(robot), carrier).collect()
}

fn build(
    problem: &Solids,
    members: &[usize],
    (a, b): (usize, usize),
) -> Result<CollisionScene, ClearanceError> {
    let mut builder = SceneBuilder::new();
    let mut ids: Vec<RobotId> = Vec::new();
    for member in members {
        let Some(solid) = problem.solids.get(*member) else { continue };
        let carrier = solid.carrier.and_then(|(robot, link)| {
            let at = members.iter().position(|member| *member == robot)?;
            Some((*ids.get(at)?, link))
        });
        let mount = match carrier {
            Some((robot, link)) => Mount::Link { robot, link, pose: solid.pose },
            None => Mount::World(solid.pose),
        };
        ids.push(builder.add_robot(solid.name.as_str(), &solid.model, mount, &mut |_| None)?);
    }
    for (i, one) in ids.iter().enumerate() {
        for (j, other) in ids.iter().enumerate().take(i + 1) {
            let wanted = (i, j) == (a.max(b), a.min(b));
            let (Some(upper), Some(lower)) = (
                members.get(i).and_then(|member| problem.solids.get(*member)),
                members.get(j).and_then(|member| problem.solids.get(*member)),
            ) else {
                continue;
            };
            let mounted = upper.carrier.filter(|(robot, _)| members.get(j) == Some(robot));
            for link in 0..upper.model.links().len() {
                for below in 0..lower.model.links().len() {
                    let joined = mounted.is_some_and(|(_, carrier)| {
                        let steps = steps(&upper.model, link, root(&upper.model))
                            + steps(&lower.model, below, carrier);
                        steps <= 1
                    });
                    if joined || !wanted {
                        let owner = |robot: &RobotId, link| Owner::Link { robot: *robot, link };
                        builder.allow(owner(one, link), owner(other, below))?;
                    }
                }
            }
        }
    }
    Ok(builder.build())
}

fn root(model: &RobotModel) -> usize {
    model.links().iter().position(|link| link.parent_joint.is_none()).unwrap_or_default()
}

/// Moving joints between two links, as far as that is none or one; more count as two.
fn steps(model: &RobotModel, a: usize, b: usize) -> usize {
    let (a, b) = (rigid(model, a), rigid(model, b));
    let carrier = |link: usize| {
        let joint = model.links().get(link)?.parent_joint?;
        Some(rigid(model, model.joints().get(joint)?.parent))
    };
    if a == b {
        0
    } else if carrier(a) == Some(b) || carrier(b) == Some(a) {
        1
    } else {
        2
    }
}

/// The first link of those that are fixed to this one.
fn rigid(model: &RobotModel, mut link: usize) -> usize {
    // As many steps as there are links lead to the root.
    for _ in 0..model.links().len() {
        let joint = model.links().get(link).and_then(|link| link.parent_joint);
        match joint.and_then(|joint| model.joints().get(joint)) {
            Some(joint) if joint.motion.is_none() => link = joint.parent,
            _ => break,
        }
    }
    link
}

impl Solid {
    const fn follows(&self) -> bool {
        matches!(self.course, Course::Follows(_))
    }

    /// Writes where it is at a phase \[s\].
    fn write(&self, time_s: f64, hint: &mut usize, positions: &mut [f64]) {
        match &self.course {
            Course::Stands(standing) => {
                for (slot, position) in positions.iter_mut().zip(standing) {
                    *slot = *position;
                }
            }
            Course::Follows(course) => {
                let sample = course.sample(time_s.clamp(0.0, course.duration_s()), hint);
                for (variable, position) in self.variables.iter().zip(sample.position.iter()) {
                    if let Some(slot) = positions.get_mut(*variable) {
                        *slot = *position;
                    }
                }
            }
        }
    }

    fn raise_speeds(&self, from_s: f64, to_s: f64, speeds: &mut [f64]) {
        let Course::Follows(course) = &self.course else { return };
        let mut hint = 0;
        let segments = course.segments_at(from_s.clamp(0.0, course.duration_s()), &mut hint);
        for segment in segments.take_while(|segment| segment.start_s <= to_s.max(0.0)) {
            for (variable, velocity) in self.variables.iter().zip(segment.velocity) {
                if let Some(speed) = speeds.get_mut(*variable) {
                    *speed = speed.max(velocity * ROUNDING);
                }
            }
        }
    }
}

/// What the model cannot say anything about.
fn impossible(error: ClearanceError) -> Denial {
    let message = format!("clearances cannot be checked: {error}");
    Denial::new(DenialCode::NotSupported, message)
}
