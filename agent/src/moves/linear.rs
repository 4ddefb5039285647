//! Moves whose tool goes straight.

use armada_model::{
    CartesianError, CartesianMove, CartesianOptions, CartesianPath, CartesianPlanner,
    DEFAULT_ROTATION_WEIGHT, JointTrajectory, JointVector, MIN_PATH_LENGTH, Pose,
};

use super::timeline::Timeline;
use super::{MoveGoal, MovePlanner, MoveProblem, SingleMove};
use crate::control::EquippedChain;

impl MovePlanner<'_> {
    /// Adds a group of straight moves of the tool of `chain`.
    pub(super) fn go_straight(
        &self,
        chain: usize,
        group: &[SingleMove],
        timeline: &mut Timeline,
    ) -> Result<(), (usize, MoveProblem)> {
        let last = group.len().saturating_sub(1);
        let equipped = self.chain(chain).map_err(|problem| (0, problem))?;
        let line = |error: CartesianError| MoveProblem::Line {
            joints: equipped.joints.clone(),
            error: Box::new(error),
        };
        let start = *timeline.end();
        let tip = equipped.tip(&start, &JointVector::EMPTY);
        let from = tip.map_err(|error| (0, line(error.into())))?.tcp;
        let (moves, ends) = lines(&from, group);
        let begun_s = timeline.end_s();
        if moves.is_empty() {
            timeline.passed_s.extend(group.iter().map(|_| begun_s));
            return Ok(());
        }
        let planned = (|| {
            let path = CartesianPath::new(&from, &moves, DEFAULT_ROTATION_WEIGHT)
                .map_err(|error| line(error.into()))?;
            let limits =
                self.limits_at(group.first().map_or(1.0, |first| first.speed), &equipped.joints)?;
            let planner = CartesianPlanner::new(&equipped.to_tcp(), &CartesianOptions::default());
            let motion =
                planner.and_then(|planner| planner.follow(&path, &equipped.gather(&start)));
            motion.and_then(|motion| motion.trajectory(&limits)).map_err(line)
        })();
        let motion = planned.map_err(|problem| (last, problem))?;
        timeline.append(&motion, &equipped.joints);
        let goals: Vec<Pose> = group.iter().filter_map(goal_of).collect();
        let mut search = Search { equipped, motion: &motion, start, at: 0 };
        for (index, goal) in goals.iter().enumerate() {
            let is_end = ends.get(index) == ends.last();
            let passed_s = if is_end { timeline.end_s() - begun_s } else { search.nearest_s(goal) };
            timeline.passed_s.push(begun_s + passed_s);
        }
        Ok(())
    }
}

/// The lines of a group; for each of its moves, how many lines are behind it. A move to where the
/// tool is already is no line.
fn lines(start: &Pose, group: &[SingleMove]) -> (Vec<CartesianMove>, Vec<usize>) {
    let mut moves: Vec<CartesianMove> = Vec::new();
    let mut ends = Vec::new();
    let mut from = *start;
    for step in group {
        if let Some(to) = goal_of(step) {
            let (length, angle) = from.distance(&to);
            if length.max(DEFAULT_ROTATION_WEIGHT * angle) >= MIN_PATH_LENGTH {
                moves.push(CartesianMove::line(to).blended(step.blend_radius_m));
                from = to;
            }
        }
        ends.push(moves.len());
    }
    if let Some(last) = moves.last_mut() {
        // Its corner is the end, if what follows goes nowhere.
        last.blend_radius = 0.0;
    }
    (moves, ends)
}

const fn goal_of(step: &SingleMove) -> Option<Pose> {
    match step.goal {
        MoveGoal::Linear { pose, .. } | MoveGoal::Pose { pose, .. } => Some(pose),
        MoveGoal::Joint(_) => None,
    }
}

/// Looks for the waypoint that is nearest to a corner, from the corner before it on.
struct Search<'a> {
    equipped: &'a EquippedChain,
    motion: &'a JointTrajectory,
    start: JointVector,
    at: usize,
}

impl Search<'_> {
    fn nearest_s(&mut self, corner: &Pose) -> f64 {
        let distance = |row: &[f64]| {
            let own = JointVector::from_slice(row).ok()?;
            let all = self.equipped.scatter(&own, &self.start);
            let tip = self.equipped.tip(&all, &JointVector::EMPTY).ok()?;
            Some(tip.tcp.distance(corner).0)
        };
        let mut nearest = (f64::INFINITY, 0.0, self.at);
        for (index, waypoint) in self.motion.waypoints.iter().enumerate().skip(self.at) {
            let Some(distance) = distance(&waypoint.joint_position) else { continue };
            if distance < nearest.0 {
                nearest = (distance, waypoint.time_from_start_s, index);
            }
        }
        self.at = nearest.2;
        nearest.1
    }
}
