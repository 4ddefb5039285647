//! Motions as pure functions of time: waypoints to follow, moves to a target, the ramp to a stop.
//!
//! ```text
//! JointTrajectory --compile--> CompiledTrajectory --sample(t)--> set-point
//! MotionState, target --plan--> JointMove         --at(t)-----> set-point
//! last commands      --plan--> StopRamp           --step()----> set-point
//! ```
//!
//! A control loop sends positions `x_k` at a uniform period `T`. What a controller, or a limiter
//! behind the loop, can see of them are the backward differences `v_k = (x_k - x_(k-1)) / T` and
//! `a_k = (v_k - v_(k-1)) / T`. Every motion here is a curve with continuous velocity, velocity at
//! most `V` and acceleration at most `A`; then `|v_k| <= V` and `|a_k| <= A` at any period and
//! any phase, since `v_k` is a mean of the velocity over one period and `a_k` a weighted mean of
//! the acceleration over two. It stays true across the change from one motion to the next as long
//! as position and velocity of the *curves* are equal there: start a motion at the state that the
//! one before it has at the last tick ([`JointMove::at`], [`CompiledTrajectory::state_at`]), or at
//! rest. Rounding adds at most some units in the last place of `x`, divided by `T²`. A trajectory
//! compiled for [`Ends::InMotion`] is such a curve between its ends only.
//!
//! [`StopRamp`] is the exception: it must work whatever moved before, also where no curve is
//! known, so it is a sequence of ticks that starts from the two last commands.

mod blend;
mod check;
mod compiled;
mod curve;
mod error;
mod interpolate;
mod joint_move;
mod motion_limits;
mod options;
mod piece;
mod profile;
mod ramp;
mod roots;
mod spline;
mod tolerance;
mod units;
mod validate;
mod waypoints;

#[cfg(test)]
mod tests;

pub use blend::MIN_BLEND_S;
pub use compiled::{CompiledTrajectory, Sample, SegmentBounds, TrajectoryState};
pub use error::{LimitedQuantity, TrajectoryError};
pub use joint_move::{JointMove, JointMoveError, MotionState};
pub use motion_limits::{AxisLimits, DEFAULT_JERK_TIME_S, MotionLimits, MotionLimitsError};
pub use options::{Ends, JerkLimit, TrajectoryContext, TrajectoryOptions};
pub use profile::{AxisProfile, AxisState, ProfileError};
pub use ramp::StopRamp;
pub use tolerance::Tolerance;
pub use units::JointUnit;
pub use validate::{
    LIMIT_TOLERANCE, MIN_WAYPOINT_SPACING_S, REST_TOLERANCE, START_TIME_TOLERANCE_S,
};
pub use waypoints::{Interpolation, JointTrajectory, Waypoint};
