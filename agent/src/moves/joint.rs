//! Moves whose joints go straight.

use armada_model::{
    BlendedPath, JointCorner, JointVector, MIN_BLEND_RADIUS, RetimeOptions, TimedPath,
    blended_legs, retime,
};

use super::timeline::Timeline;
use super::{MoveGoal, MovePlanner, MoveProblem, SAME, SingleMove};

/// Time between waypoints \[s\], longer if there would be more than so many.
const SPACING_S: f64 = 0.01;
const MAX_STEPS: f64 = 20_000.0;
/// Halvings until the time of a corner is known.
const HALVINGS: u32 = 50;

/// The waypoints of a group, and where on it each of its moves ends.
struct Way {
    rows: Vec<JointVector>,
    /// Radii of the corners between the rows.
    corners: Vec<JointCorner>,
    /// For each move, the row it ends at.
    ends: Vec<usize>,
}

impl MovePlanner<'_> {
    /// Adds a group of moves of the joints.
    pub(super) fn go_by_joints(
        &self,
        group: &[SingleMove],
        timeline: &mut Timeline,
    ) -> Result<(), (usize, MoveProblem)> {
        let way = self.way(group, timeline.end())?;
        let speed = group.first().map_or(1.0, |first| first.speed);
        let last = group.len().saturating_sub(1);
        let begun_s = timeline.end_s();
        let at_row_s = self.follow_way(&way, speed, timeline).map_err(|problem| (last, problem))?;
        for &row in &way.ends {
            timeline.passed_s.push(at_row_s.get(row).copied().unwrap_or(begun_s));
        }
        Ok(())
    }

    fn way(&self, group: &[SingleMove], start: &JointVector) -> Result<Way, (usize, MoveProblem)> {
        let mut rows = vec![*start];
        let mut radii = Vec::new();
        let mut ends = Vec::new();
        for (index, step) in group.iter().enumerate() {
            let from = rows.last().copied().unwrap_or(*start);
            let goal = self.goal(step, &from).map_err(|problem| (index, problem))?;
            if step.blend_radius_m > 0.0 && self.equipment.chains.is_empty() {
                return Err((index, MoveProblem::NoToolToBlend));
            }
            if goal.max_abs_difference(&from) > SAME {
                rows.push(goal);
                radii.push(step.blend_radius_m);
            }
            ends.push(rows.len() - 1);
        }
        let corners = rows.windows(3).zip(&radii).map(|(three, &radius_m)| match three {
            [before, corner, after] => {
                corner_of(self.joint_radius((before, corner, after), radius_m))
            }
            _ => JointCorner::Stop,
        });
        Ok(Way { corners: corners.collect(), rows, ends })
    }

    fn goal(&self, step: &SingleMove, from: &JointVector) -> Result<JointVector, MoveProblem> {
        let goal = match step.goal {
            MoveGoal::Joint(goal) => goal,
            MoveGoal::Pose { chain, pose } | MoveGoal::Linear { chain, pose } => {
                self.solve(chain, &pose, from)?
            }
        };
        let (given, expected) = (goal.len(), self.limits.len());
        if given != expected {
            return Err(MoveProblem::WrongLength { given, expected });
        }
        for (joint, (&value, axis)) in goal.iter().zip(self.limits.iter()).enumerate() {
            if !axis.contains(value) {
                let limit = axis.nearer_limit(value);
                return Err(MoveProblem::BeyondLimit { joint, value, limit });
            }
        }
        Ok(goal)
    }

    /// Adds the motion along the way; returns when each row of it is passed.
    fn follow_way(
        &self,
        way: &Way,
        speed: f64,
        timeline: &mut Timeline,
    ) -> Result<Vec<f64>, MoveProblem> {
        let mut at_row_s = vec![timeline.end_s()];
        if way.rows.len() < 2 {
            return Ok(at_row_s);
        }
        let joints = self.all_joints();
        let limits = self.limits_at(speed, &joints)?;
        let rows: Vec<Vec<f64>> = way.rows.iter().map(|row| row.to_vec()).collect();
        for leg in blended_legs(&rows, &way.corners)? {
            let begun_s = timeline.end_s();
            let corners: Vec<f64> = leg.corners().iter().map(|corner| corner.s).collect();
            let timed = retime(leg, &limits, &RetimeOptions::default())?;
            let spacing_s = SPACING_S.max(timed.duration_s() / MAX_STEPS);
            let motion = timed.to_trajectory(self.names, spacing_s)?;
            timeline.append(&motion.trajectory, &joints);
            let passed = corners.iter().map(|&s| begun_s + motion.stretch * time_at(&timed, s));
            at_row_s.extend(passed);
            at_row_s.push(timeline.end_s());
        }
        Ok(at_row_s)
    }
}

fn corner_of(radius: f64) -> JointCorner {
    if radius < MIN_BLEND_RADIUS { JointCorner::Stop } else { JointCorner::Radius(radius) }
}

/// When the motion is at this parameter of its path \[s\].
fn time_at(timed: &TimedPath<BlendedPath>, s: f64) -> f64 {
    let (mut early, mut late) = (0.0, timed.duration_s());
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(early, late);
        if timed.state_at(middle).s < s { early = middle } else { late = middle }
    }
    late
}
