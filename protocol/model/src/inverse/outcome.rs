//! What a solver answers.

use super::target::Residual;
use crate::{JointVector, KinematicsError, Twist};

/// Joint positions that reach a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseSolution {
    /// Position of each variable of the chain \[rad or m\], inside the limits.
    pub positions: JointVector,
    /// How far the TCP is from the target, within the tolerances.
    pub residual: Residual,
    /// Iterations over all starts.
    pub iterations: u32,
    /// Starts, the successful one included.
    pub starts: u32,
}

/// Why no joint positions were found, with the best that were.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("no solution: {cause}; best is {} m and {} rad off", residual.position, residual.orientation)]
pub struct InverseFailure {
    /// What stands in the way.
    pub cause: InverseCause,
    /// Best joint positions found \[rad or m\], inside the limits; empty if there was no search.
    pub positions: JointVector,
    /// How far from the target they leave the TCP.
    pub residual: Residual,
    /// Iterations over all starts.
    pub iterations: u32,
    /// Starts.
    pub starts: u32,
}

/// What stands in the way of a solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InverseCause {
    /// The seed does not fit the chain.
    #[error("{0}")]
    Seed(KinematicsError),
    /// The target has a number that is infinite or not a number.
    #[error("the target is not finite")]
    Target,
    /// The target is farther than the links stretched out are long, whatever the joints do.
    #[error("the target is at least {excess} m out of reach")]
    OutOfReach {
        /// By how much at least \[m\].
        excess: f64,
    },
    /// A solution was found that a joint's limits forbid, and none inside all limits.
    #[error("joint {joint} would stand at {value}, beyond its {side} limit {limit}")]
    JointLimit {
        /// Index of the variable in the chain: the one that is farthest beyond its limits.
        joint: usize,
        /// Which limit.
        side: LimitSide,
        /// Its position in that solution \[rad or m\].
        value: f64,
        /// The limit \[rad or m\], the margin taken off.
        limit: f64,
    },
    /// The search came to a halt in a posture from which the TCP cannot move in one direction.
    #[error("the search ended at a singularity of value {smallest}")]
    Singular {
        /// Smallest singular value there, lengths in units of half the chain's reach.
        smallest: f64,
        /// The direction that is lost, see [`Jacobian::weakest_direction`](crate::Jacobian::weakest_direction).
        direction: Twist,
    },
    /// Neither solution nor reason was found in the iterations allowed.
    #[error("nothing found in {iterations} iterations")]
    Iterations {
        /// Iterations over all starts.
        iterations: u32,
    },
}

/// One of a joint's two limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitSide {
    /// The lowest position.
    Lower,
    /// The highest position.
    Upper,
}

impl std::fmt::Display for LimitSide {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Lower => "lower",
            Self::Upper => "upper",
        })
    }
}
