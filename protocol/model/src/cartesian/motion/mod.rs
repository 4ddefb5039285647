//! From a path of the tool to a motion of the joints.
//!
//! ```text
//! CartesianPath --walk--> solved poses --fit--> q(s), one curve a leg --retime--> JointTrajectory
//!                   |                    |
//!                   +-----> PathBlock <--+  jump, limit, singularity, out of reach: where
//! ```

mod error;
mod fit;
mod options;
mod planner;
mod solve;
mod speed;
mod trajectory;
mod walk;

pub use error::{BlockReason, CartesianError, PathBlock};
pub use options::{CartesianOptions, MIN_PATH_TOLERANCE};
pub use planner::{CartesianMotion, CartesianPlanner, ReachableMotion};
