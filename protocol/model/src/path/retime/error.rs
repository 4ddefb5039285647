//! Why a path cannot be retimed.

use super::grid::{MAX_GRID_POINTS, MIN_GRID_POINTS};
use crate::LimitedQuantity;

/// Why there is no motion along a path. Joints are the coordinates of the path, counted from zero;
/// a fraction is 0 at the start of the path and 1 at its end.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RetimeError {
    /// There is not one set of limits per coordinate.
    #[error("limits of {limits} joints, but the path has {coordinates} coordinates")]
    LimitCount {
        /// Number of joints that have limits.
        limits: usize,
        /// Number of coordinates of the path.
        coordinates: usize,
    },
    /// A limit is not a finite number above zero.
    #[error("joint {joint}: {quantity} limit is {value}, expected a finite number above 0")]
    Limit {
        /// Index of the joint.
        joint: usize,
        /// Which limit.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// The grid asked for has too few or too many points.
    #[error("{points} grid points, expected {MIN_GRID_POINTS} to {MAX_GRID_POINTS}")]
    GridPoints {
        /// Number of points.
        points: usize,
    },
    /// A path velocity of the options is negative or not a number, or the highest is zero.
    #[error("{field} is {value}, expected a number above 0, or 0 for rest at an end")]
    PathVelocity {
        /// Which of the options.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// A motion that is limited in jerk shall begin or end in motion.
    #[error("{field} is {value}, but a jerk-limited motion starts and ends at rest")]
    NotFromRest {
        /// Which of the options.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// The range of the path parameter is not finite, or not increasing.
    #[error("path parameter goes from {start} to {end}, expected finite and increasing")]
    Range {
        /// First path parameter.
        start: f64,
        /// Last path parameter.
        end: f64,
    },
    /// The path gave a number that is not finite, or so large that it overflows.
    #[error("joint {joint}: {row} of the path is {value} at fraction {fraction}, not finite")]
    NotFinite {
        /// Index of the joint.
        joint: usize,
        /// Position, or which derivative.
        row: &'static str,
        /// Where on the path.
        fraction: f64,
        /// The value.
        value: f64,
    },
    /// No joint moves anywhere on the path.
    #[error("the path has no length: no joint moves")]
    NoMotion,
    /// The path cannot be passed in finite time: limits are too small against it for the numbers.
    #[error("path velocity vanishes after fraction {fraction}")]
    Standstill {
        /// Where on the path.
        fraction: f64,
    },
    /// The path leaves the position limits of a joint.
    #[error("joint {joint}: position {value} at fraction {fraction} is beyond the limit {limit}")]
    PositionBeyondLimit {
        /// Index of the joint.
        joint: usize,
        /// Where on the path.
        fraction: f64,
        /// Position there.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// The path cannot be begun or ended that fast: the joint would have to exceed its limit.
    #[error(
        "path velocity {value} at fraction {fraction} is above {highest}, the highest that \
         the {quantity} limit of joint {joint} allows"
    )]
    TooFast {
        /// Where on the path: 0 or 1.
        fraction: f64,
        /// The path velocity asked for.
        value: f64,
        /// The highest possible.
        highest: f64,
        /// Index of the joint that limits it.
        joint: usize,
        /// Which of its limits, here or where the path goes on.
        quantity: LimitedQuantity,
    },
    /// The path cannot be begun that slowly, since its end shall be passed too fast.
    #[error(
        "path velocity {value} at fraction 0 is below {lowest}, the lowest from which the end \
         velocity can be reached within the {quantity} limit of joint {joint}"
    )]
    TooSlow {
        /// The path velocity asked for.
        value: f64,
        /// The lowest possible.
        lowest: f64,
        /// Index of the joint that limits it.
        joint: usize,
        /// Which of its limits.
        quantity: LimitedQuantity,
    },
    /// No path velocity at this place keeps the limits and leads to the end velocity.
    #[error(
        "no path velocity at fraction {fraction} leads to the end velocity within the {quantity} \
         limit of joint {joint}"
    )]
    Infeasible {
        /// Where on the path.
        fraction: f64,
        /// Index of the joint that limits it.
        joint: usize,
        /// Which of its limits.
        quantity: LimitedQuantity,
    },
}
