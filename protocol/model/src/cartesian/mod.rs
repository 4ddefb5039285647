//! Motion of a tool along lines and arcs.
//!
//! ```text
//! moves --CartesianPath--> poses along s --CartesianPlanner--> joints along s, or where it is blocked
//!                                                                    |
//!                                                JointTrajectory <---+ trajectory, under all limits
//! ```

mod blend;
mod error;
mod motion;
mod moves;
mod path;
mod rotation;
mod segment;

#[cfg(test)]
mod tests;

pub use error::CartesianPathError;
pub use motion::{
    BlockReason, CartesianError, CartesianMotion, CartesianOptions, CartesianPlanner,
    MIN_PATH_TOLERANCE, PathBlock, ReachableMotion,
};
pub use moves::{ArcOrientation, CartesianMove, CartesianSegment};
pub use path::{
    CartesianPath, Corner, CornerPassing, DEFAULT_ROTATION_WEIGHT, MIN_PATH_LENGTH, MIN_TURN_MARGIN,
};
