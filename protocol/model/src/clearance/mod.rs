//! How far robots are from themselves, each other and what is fixed around them.
//!
//! ```text
//! RobotModel, Srdf, mounts --SceneBuilder--> CollisionScene: bodies, pairs
//! positions --CollisionScene::place--> Placement --> distances of pairs
//! motion    --CollisionScene::check_motion--> clear, or when, where and how near
//! ```
//!
//! Every shape is a *body*: a convex shape in a link, and a capsule that contains it. The distance
//! of two capsules is a closed form and never above that of their bodies, so the costly distance of
//! the shapes themselves is calculated only where the capsules leave it open. Queries allocate
//! nothing: what they need is in a [`ClearanceWorkspace`] of the caller.

#![allow(non_snake_case, reason = "X_WL is the pose of frame L in frame W")]

mod body;
mod builder;
mod capsule;
mod error;
mod fit;
mod hull;
mod motion;
mod pairs;
mod query;
mod reach;
mod scene;
mod stl;
mod sweep;

pub use body::{Body, BodyId, Owner};
pub use builder::{MissingShape, Mount, RobotId, SceneBuilder};
pub use capsule::{Capsule, Nearest};
pub use error::ClearanceError;
pub use motion::{MotionCheck, MotionReport, MotionVerdict, TimedDistance};
pub use query::{Accuracy, PairDistance, Placement};
pub use scene::{ClearanceWorkspace, CollisionScene};
pub use stl::{StlError, read_stl};
