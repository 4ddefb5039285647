//! What a trajectory is compiled for.

use super::motion_limits::MotionLimits;
use crate::JointType;

/// The robot a trajectory is compiled for.
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryContext<'a, S> {
    /// Names of the driven joints in the robot's order.
    pub joint_order: &'a [S],
    /// How each of them moves, in the same order. `None` if it is not known: then a trajectory may
    /// only have units that need no conversion.
    pub joint_types: Option<&'a [JointType]>,
    /// Limits of each of them, in the same order.
    pub limits: &'a MotionLimits,
}

/// What a trajectory may be like, apart from the robot's limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryOptions {
    /// Longest duration \[s\].
    pub max_duration_s: f64,
    /// Highest number of waypoints.
    pub max_waypoints: usize,
    /// Whether it must start and end at rest.
    pub ends: Ends,
    /// Whether it must keep the limits of jerk.
    pub jerk: JerkLimit,
}

impl Default for TrajectoryOptions {
    /// One hour, 100 000 waypoints, from rest to rest, any jerk.
    fn default() -> Self {
        Self {
            max_duration_s: 3600.0,
            max_waypoints: 100_000,
            ends: Ends::AtRest,
            jerk: JerkLimit::Ignored,
        }
    }
}

/// How a trajectory starts and ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Ends {
    /// At rest; one that does not is refused.
    #[default]
    AtRest,
    /// At any velocity, since something else moves the robot before and after. It is for the
    /// caller to see that the velocities fit.
    InMotion,
}

/// What is asked of jerk, the rate of change of acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum JerkLimit {
    /// Nothing.
    #[default]
    Ignored,
    /// At most the limit of the joint, and no jump of acceleration anywhere: between segments and,
    /// if the ends are at rest, at the ends. Of the interpolations only
    /// [`QuinticHermite`](super::Interpolation::QuinticHermite) can have that at the ends.
    Enforced,
}
