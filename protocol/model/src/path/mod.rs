//! Paths without time, and the fastest motion along them.
//!
//! ```text
//! waypoints --JointPath--> q(s) --retime--> TimedPath q(s(t)) --to_trajectory--> JointTrajectory
//! paths of several robots --StackedPath--> one q(s), so that all move in phase
//! ```
//!
//! Planning allocates; evaluating a path or a timed path does not.

mod geometric;
mod jerk;
mod retime;
mod smooth;
mod spline;
mod stacked;
mod timed;
mod waypoints;

#[cfg(test)]
mod tests;

pub use geometric::{GeometricPath, PathError, PathRows};
pub use jerk::retime_jerk_limited;
pub use retime::{ConstraintScheme, Grid, MAX_GRID_POINTS, RetimeError, RetimeOptions, retime};
pub use spline::{JointPath, SplineEnds};
pub use stacked::StackedPath;
pub use timed::{PathKnot, PathSample, Saturation, TimedPath};
pub use waypoints::{PathTrajectory, PathTrajectoryError};
