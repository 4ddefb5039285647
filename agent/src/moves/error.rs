//! Why moves are not planned.

use armada_model::{
    BlendError, CartesianError, InverseFailure, MotionLimitsError, PathTrajectoryError,
    RetimeError, TrajectoryError,
};

/// A move that cannot be made.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{problem}")]
pub struct MoveError {
    /// Which of the moves, from 0.
    pub index: usize,
    /// What is wrong with it.
    pub problem: MoveProblem,
}

/// What is wrong with a move. Joints count in the robot's order, but where it says otherwise.
#[derive(Clone, Debug, thiserror::Error)]
pub enum MoveProblem {
    /// There is no such chain.
    #[error("there is no chain number {chain}")]
    NoSuchChain {
        /// Its number.
        chain: usize,
    },
    /// The goal does not have one value per joint.
    #[error("{given} joint positions, but the robot has {expected} joints")]
    WrongLength {
        /// Number given.
        given: usize,
        /// Number of joints.
        expected: usize,
    },
    /// A goal lies outside a joint's limits.
    #[error("joint {joint}: {value} is beyond the limit {limit}")]
    BeyondLimit {
        /// Which joint.
        joint: usize,
        /// The goal \[rad or m\].
        value: f64,
        /// The limit \[rad or m\].
        limit: f64,
    },
    /// No joint positions reach the pose.
    #[error("{failure}")]
    Unreachable {
        /// The robot's joint for each variable of the chain.
        joints: Vec<usize>,
        /// What stands in the way; joints are variables of the chain.
        failure: Box<InverseFailure>,
    },
    /// The straight line cannot be followed.
    #[error("{error}")]
    Line {
        /// The robot's joint for each variable of the chain.
        joints: Vec<usize>,
        /// Where and why; joints are variables of the chain.
        error: Box<CartesianError>,
    },
    /// A line of the tool and one of the joints have no corner that could be rounded off.
    #[error(
        "a blend between a straight move and one of another kind or chain does not exist: give the \
         move before it blend_radius_m 0"
    )]
    MixedBlend,
    /// Moves without a stop between them have one speed.
    #[error(
        "speed {value} differs from {expected} of the move before it: give them one speed, or that \
         move blend_radius_m 0"
    )]
    BlendedSpeed {
        /// The speed.
        value: f64,
        /// The speed of the moves before.
        expected: f64,
    },
    /// The robot has no tool that a blend radius could be measured at.
    #[error("a blend radius is measured at a tool, but the robot file gives no chains")]
    NoToolToBlend,
    /// The limits leave no motion.
    #[error("limits: {0}")]
    Limits(MotionLimitsError),
    /// The moves make no way.
    #[error("way: {0}")]
    Way(#[from] BlendError),
    /// The way cannot be followed in time.
    #[error("motion: {0}")]
    Retime(#[from] RetimeError),
    /// The motion makes no waypoints.
    #[error("waypoints: {0}")]
    Waypoints(#[from] PathTrajectoryError),
    /// The whole is not legal.
    #[error("trajectory: {0}")]
    Trajectory(Box<TrajectoryError>),
}
