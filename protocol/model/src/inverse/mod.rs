//! Joint positions for a pose of the tool centre point.
//!
//! ```text
//! solve_warm: seed --descend--> solution? --approach posture--> InverseSolution
//!                                  | no
//!                                  +--diagnose--> InverseFailure: cause, best posture
//! solve:      as well, from the table's nearest postures and from random ones
//! ```

mod bounds;
mod descent;
mod diagnosis;
mod linear;
mod options;
mod outcome;
mod posture;
mod reach;
mod seeds;
mod solver;
mod target;

pub use options::{InverseOptions, PreferredPosture};
pub use outcome::{InverseCause, InverseFailure, InverseSolution, LimitSide};
pub use solver::InverseKinematics;
pub use target::{InverseTarget, Residual};
