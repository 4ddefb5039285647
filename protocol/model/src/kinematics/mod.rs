//! Velocity of a frame, and mass that a flange carries.

mod load;
mod twist;

pub use load::{Load, LoadError, Payload};
pub use twist::Twist;
