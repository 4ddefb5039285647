//! Jerk-limited motion from any state, made in a control loop.
//!
//! ```text
//! OnlineState, target --plan--> JerkLimitedMove --at(t)-----> OnlineState
//! OnlineState ---------plan--> JerkLimitedStop --at(t)-----> OnlineState
//! target, target, … --retarget--> Retargeter ---tick(dt)---> OnlineState
//! AxisPoint, target that moves --toward(dt)----------------> AxisPoint
//! OnlineState, velocity --toward_velocity(dt)--------------> OnlineState
//! ```
//!
//! What the library behind it answers is never trusted: every motion is integrated anew from its
//! jerks, and refused unless it arrives and keeps all limits, by the exact extremes of its phases.
//!
//! Set-points that are sampled from these curves at a uniform period have backward differences of
//! first, second and third order that are means of velocity, acceleration and jerk, so they keep
//! the limits at any period; with late ticks the divided differences do. Where a way ends, the
//! set-point goes to exactly its target, which is at most 1e-8 rad or m away.

mod axis;
mod follow;
mod generator;
mod jerk_limited;
mod line;
mod request;
mod retargeter;
mod ruckig;
mod speed;
mod stop;
mod together;

#[cfg(test)]
mod tests;

pub use axis::{AxisMotion, AxisPoint};
pub use follow::AxisTarget;
pub use generator::{AxisDurations, AxisRequest, OnlineGenerator};
pub use jerk_limited::JerkLimitedMove;
pub use request::{MAX_ONLINE_VALUE, OnlineError, OnlineOptions, OnlineState, Synchronisation};
pub use retargeter::Retargeter;
pub use ruckig::RuckigGenerator;
pub use stop::JerkLimitedStop;
