//! Single moves to a goal, planned outside the control loop into one trajectory.
//!
//! ```text
//! moves --goals: inverse kinematics--> joint positions --+--> group --retime--> waypoints --+
//!       --lines of a tool------------------------------+     (no stop inside)              |
//!                                            CompiledTrajectory, time of each corner <-----+
//! ```
//!
//! Moves that are joined by a blend radius make a group, which is passed without a stop: all of
//! one kind, for a line of the tool and a line of the joints have no corner in common, and of one
//! speed. Between groups the robot comes to rest. A radius is the distance of the tool from the
//! corner, for moves of the joints as well: how far that is along their way is measured on it.

mod corner;
mod error;
mod joint;
mod linear;
#[cfg(test)]
mod tests;
mod timeline;

use armada_model::{
    CompiledTrajectory, InverseKinematics, InverseOptions, InverseTarget, JointLimits, JointVector,
    MotionLimits, Pose, TrajectoryOptions,
};

pub use error::{MoveError, MoveProblem};
use timeline::Timeline;

use crate::control::{Equipment, EquippedChain};

/// Distance \[rad or m\] that is no distance.
const SAME: f64 = 1e-9;

/// One move to a goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SingleMove {
    /// Where it goes, and on which way.
    pub goal: MoveGoal,
    /// Speed over the limits, above 0 to 1.
    pub speed: f64,
    /// How far from the goal the tool may leave the way for the next move \[m\]; 0 for a stop.
    pub blend_radius_m: f64,
}

/// Where a move goes. Chains count in the order of the robot file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MoveGoal {
    /// Joint positions \[rad or m\], every joint on the straight way.
    Joint(JointVector),
    /// A pose of the tool centre point in the chain's base link, the joints on the straight way.
    Pose {
        /// Which chain.
        chain: usize,
        /// The pose.
        pose: Pose,
    },
    /// A pose of the tool centre point in the chain's base link, the tool on a straight line.
    Linear {
        /// Which chain.
        chain: usize,
        /// The pose.
        pose: Pose,
    },
}

/// Moves as one trajectory.
#[derive(Clone, Debug)]
pub struct MovePlan {
    /// All joints of the robot, from rest to rest.
    pub trajectory: CompiledTrajectory,
    /// When each move has passed its goal, or its corner if it is rounded off \[s\].
    pub passed_s: Vec<f64>,
}

/// What moves are planned with.
#[derive(Clone, Copy, Debug)]
pub struct MovePlanner<'a> {
    /// The chains with their tools.
    pub equipment: &'a Equipment,
    /// Limits in force of all joints.
    pub limits: &'a MotionLimits,
    /// Names of all joints.
    pub names: &'a [String],
}

impl MovePlanner<'_> {
    /// The trajectory of `moves`, one at least, from rest at `start`.
    ///
    /// # Errors
    /// [`MoveError`] with the index of the move and what is wrong with it.
    pub fn plan(&self, start: &JointVector, moves: &[SingleMove]) -> Result<MovePlan, MoveError> {
        let mut timeline = Timeline::new(start);
        let mut first = 0;
        while first < moves.len() {
            let group = self.group(moves.get(first..).unwrap_or_default());
            let at = |(index, problem): (usize, MoveProblem)| MoveError {
                index: first + index,
                problem,
            };
            let count = group.len();
            check_group(group).map_err(at)?;
            match group.first().map(|step| step.goal) {
                Some(MoveGoal::Linear { chain, .. }) => {
                    self.go_straight(chain, group, &mut timeline).map_err(at)?;
                }
                _ => self.go_by_joints(group, &mut timeline).map_err(at)?,
            }
            first += count;
        }
        let last = moves.len().saturating_sub(1);
        let trajectory = timeline.trajectory(self.names);
        let options = TrajectoryOptions::default();
        let trajectory =
            CompiledTrajectory::compile(&trajectory, self.names, self.limits, &options).map_err(
                |error| MoveError {
                    index: last,
                    problem: MoveProblem::Trajectory(Box::new(error)),
                },
            )?;
        Ok(MovePlan { trajectory, passed_s: timeline.passed_s })
    }

    /// The joint positions near `seed`, those of all joints, that bring the tool to `pose`; joints
    /// outside the chain stay.
    ///
    /// # Errors
    /// [`MoveProblem::NoSuchChain`] and [`MoveProblem::Unreachable`].
    pub fn solve(
        &self,
        chain: usize,
        pose: &Pose,
        seed: &JointVector,
    ) -> Result<JointVector, MoveProblem> {
        let equipped = self.chain(chain)?;
        let solver = InverseKinematics::new(&equipped.to_tcp(), InverseOptions::default());
        let target = InverseTarget::Pose(*pose.isometry());
        match solver.solve(&equipped.gather(seed), &target) {
            Ok(solution) => Ok(equipped.scatter(&solution.positions, seed)),
            Err(failure) => Err(MoveProblem::Unreachable {
                joints: equipped.joints.clone(),
                failure: Box::new(failure),
            }),
        }
    }

    fn chain(&self, chain: usize) -> Result<&EquippedChain, MoveProblem> {
        self.equipment.chains.get(chain).ok_or(MoveProblem::NoSuchChain { chain })
    }

    /// The moves up to the first that ends in a stop.
    fn group<'m>(&self, moves: &'m [SingleMove]) -> &'m [SingleMove] {
        let stop = moves.iter().position(|step| step.blend_radius_m == 0.0);
        moves.get(..=stop.unwrap_or(moves.len())).unwrap_or(moves)
    }

    /// The limits at a share of the speed; of `joints` only, in their order.
    fn limits_at(&self, speed: f64, joints: &[usize]) -> Result<MotionLimits, MoveProblem> {
        let limits =
            joints.iter().filter_map(|&joint| self.limits.get(joint)).map(|axis| JointLimits {
                lower: axis.lower.is_finite().then_some(axis.lower),
                upper: axis.upper.is_finite().then_some(axis.upper),
                velocity: speed * axis.velocity,
                acceleration: Some(axis.acceleration),
                jerk: Some(axis.jerk),
                effort: None,
            });
        MotionLimits::new(&limits.collect::<Vec<_>>()).map_err(MoveProblem::Limits)
    }

    fn all_joints(&self) -> Vec<usize> {
        (0..self.limits.len()).collect()
    }
}

/// Refuses moves that cannot be passed without a stop between them.
fn check_group(group: &[SingleMove]) -> Result<(), (usize, MoveProblem)> {
    let line = |step: &SingleMove| match step.goal {
        MoveGoal::Linear { chain, .. } => Some(chain),
        MoveGoal::Joint(_) | MoveGoal::Pose { .. } => None,
    };
    let Some(first) = group.first() else {
        return Ok(());
    };
    for (index, step) in group.iter().enumerate() {
        if line(step) != line(first) {
            return Err((index, MoveProblem::MixedBlend));
        }
        if step.speed != first.speed {
            let (value, expected) = (step.speed, first.speed);
            return Err((index, MoveProblem::BlendedSpeed { value, expected }));
        }
    }
    Ok(())
}
