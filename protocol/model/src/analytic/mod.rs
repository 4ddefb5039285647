//! Inverse kinematics in closed form: all postures in which an arm reaches a pose.
//!
//! ```text
//! RobotModel --recognise--> AnalyticArm --solve--> Branches --select--> Branch within limits
//! RobotModel --recognise--> SevenAxisArm --solve(arm angle)--> Branches, as above
//! ```
//!
//! Which closed form an arm has follows from how its axes stand to each other, never from names.
//! The equations are geometric subproblems on the axes at position zero; what they answer is
//! checked, and where needed refined, with the exact kinematics.

mod arm;
mod branch;
mod chain;
mod common;
mod error;
mod fit;
mod parts;
mod seven;
mod subproblem;

pub use arm::{AnalyticArm, ArmFamily};
pub use branch::{
    Branch, Branches, Configuration, Elbow, MAX_BRANCHES, Shoulder, Singularities, Wrist,
};
pub use common::Selection;
pub use error::{AnalyticError, BeyondLimit, BranchError, Mismatch};
pub use seven::SevenAxisArm;

use subproblem::wrapped;
