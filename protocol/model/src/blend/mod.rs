//! Consecutive moves in joint space, joined without stopping.

mod error;
mod path;

#[cfg(test)]
mod tests;

pub use error::BlendError;
pub use path::{BlendedCorner, BlendedPath, JointCorner, MIN_BLEND_RADIUS, blended_legs};
