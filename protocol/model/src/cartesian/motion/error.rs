//! Why joints cannot follow a path.

use super::options::MIN_PATH_TOLERANCE;
use crate::{
    CartesianPathError, JointVector, KinematicsError, PathError, PathTrajectoryError, Pose,
    RetimeError,
};

/// Why a Cartesian path does not become a motion. Joints are the chain's variables, counted from
/// zero.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CartesianError {
    /// The poses make no path.
    #[error(transparent)]
    Path(#[from] CartesianPathError),
    /// An option is out of its range.
    #[error("{field} is {value}, expected a number above 0, or 0 for min_singular_value")]
    Option {
        /// Which option.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// A tolerance is not a number or too small to be kept.
    #[error("{field} is {value}, expected at least {MIN_PATH_TOLERANCE}")]
    Tolerance {
        /// Which option.
        field: &'static str,
        /// The value \[m or rad\].
        value: f64,
    },
    /// The start positions do not fit the chain, or are not finite.
    #[error("start positions: {0}")]
    Kinematics(#[from] KinematicsError),
    /// The start positions do not put the tool at the start of the path.
    #[error("the tool is {distance} m and {angle} rad away from the start of the path")]
    Start {
        /// Distance \[m\].
        distance: f64,
        /// Angle \[rad\].
        angle: f64,
    },
    /// A joint is beyond its limits at the start.
    #[error("joint {joint} starts at {value}, beyond its limit {limit}")]
    StartLimit {
        /// Index of the joint.
        joint: usize,
        /// Its position \[rad or m\].
        value: f64,
        /// The limit \[rad or m\].
        limit: f64,
    },
    /// The path cannot be followed to its end.
    #[error(transparent)]
    Blocked(#[from] Box<PathBlock>),
    /// There are not limits for every joint of the chain.
    #[error("limits of {limits} joints, but the chain has {joints}")]
    LimitCount {
        /// Number of joints that have limits.
        limits: usize,
        /// Number of joints of the chain.
        joints: usize,
    },
    /// The solved poses make no curve.
    #[error("no curve through the solved poses: {0}")]
    Curve(#[from] PathError),
    /// The curve cannot be followed in time.
    #[error("no motion along the curve: {0}")]
    Retime(#[from] RetimeError),
    /// The motion makes no waypoints.
    #[error("no waypoints of the motion: {0}")]
    Waypoints(#[from] PathTrajectoryError),
}

/// Where a path cannot be followed any more, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("path can be followed to fraction {fraction}: {reason}")]
pub struct PathBlock {
    /// How much of the path can be followed, from 0 to 1.
    pub fraction: f64,
    /// The first pose that cannot be taken.
    pub pose: Pose,
    /// Positions of the joints at the last pose that can be taken \[rad or m\].
    pub joint_position: JointVector,
    /// Distance of the nearest pose that the solver found to `pose` \[m\]; small where not the pose
    /// is the reason.
    pub position_residual: f64,
    /// Angle of that pose to `pose` \[rad\].
    pub angle_residual: f64,
    /// Why.
    pub reason: BlockReason,
}

/// Why a path cannot be followed further.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BlockReason {
    /// A joint would have to jump: posture changes from one branch of solutions to another.
    #[error("joint {joint} jumps by {size}, above {limit}")]
    JointJump {
        /// Index of the joint that moves most.
        joint: usize,
        /// How far it would move \[rad or m\].
        size: f64,
        /// The most it may move in one step \[rad or m\].
        limit: f64,
    },
    /// A joint is at the end of its range, and the path leads beyond it.
    #[error("joint {joint} is at its limit {limit}")]
    JointLimit {
        /// Index of the joint.
        joint: usize,
        /// The limit \[rad or m\].
        limit: f64,
    },
    /// The arm loses a direction of motion.
    #[error("smallest singular value {value} is below {limit}")]
    Singular {
        /// The smallest singular value of the Jacobian.
        value: f64,
        /// The smallest allowed.
        limit: f64,
    },
    /// A joint would have to move too far per length of the path, as beside a singularity.
    #[error("joint {joint} moves {rate} per m of path, above {limit}")]
    JointRate {
        /// Index of the joint.
        joint: usize,
        /// How far it moves per length of the path \[rad/m or m/m\].
        rate: f64,
        /// The most allowed.
        limit: f64,
    },
    /// No posture near the last one puts the tool there: it is out of reach, or beyond a singularity.
    #[error("no posture near by puts the tool there")]
    Unreachable,
    /// The curve between solved poses does not get within tolerance of the path.
    #[error("joints do not come within tolerance of the path: {distance} m, {angle} rad")]
    Deviation {
        /// Distance \[m\].
        distance: f64,
        /// Angle \[rad\].
        angle: f64,
    },
}
