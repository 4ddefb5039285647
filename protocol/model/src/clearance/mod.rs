//! How far robots are from themselves, each other and what is fixed around them.
//!
//! Every shape is a *body*: a convex shape in a link, and a capsule that contains it.

#![allow(non_snake_case, reason = "X_WL is the pose of frame L in frame W")]

mod capsule;
mod error;
mod fit;
mod hull;
mod stl;

pub use capsule::{Capsule, Nearest};
pub use error::ClearanceError;
pub use stl::{StlError, read_stl};
