//! Why a Cartesian path cannot be made.

use super::path::{MIN_PATH_LENGTH, MIN_TURN_MARGIN};

/// Why poses do not make a [`CartesianPath`](super::CartesianPath). Moves are counted from zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CartesianPathError {
    /// There is no move.
    #[error("a path needs at least one move")]
    Empty,
    /// A number is infinite or not a number.
    #[error("move {index}: {field} is not finite")]
    NotFinite {
        /// Index of the move; the start pose counts to move 0.
        index: usize,
        /// What is not finite.
        field: &'static str,
    },
    /// The weight of rotation is not a finite number above zero.
    #[error("rotation_weight is {value} m/rad, expected a finite number above 0")]
    RotationWeight {
        /// The weight \[m/rad\].
        value: f64,
    },
    /// A move goes nowhere.
    #[error("move {index}: length {length} m is below {MIN_PATH_LENGTH} m")]
    TooShort {
        /// Index of the move.
        index: usize,
        /// Its length in the path's measure \[m\].
        length: f64,
    },
    /// Two of the three points of an arc are the same.
    #[error("move {index}: two points of the arc are {distance} m apart, which is one point")]
    Coincident {
        /// Index of the move.
        index: usize,
        /// Their distance \[m\].
        distance: f64,
    },
    /// The three points of an arc lie on a line.
    #[error("move {index}: the points of the arc lie on a line, sine of their angle is {sine}")]
    Collinear {
        /// Index of the move.
        index: usize,
        /// Sine of the angle at the arc's start between the other two points.
        sine: f64,
    },
    /// The axis of a turn is no direction, or goes through the start.
    #[error("move {index}: the axis of the turn gives no circle, {field} is {value}")]
    NoCircle {
        /// Index of the move.
        index: usize,
        /// What is too small.
        field: &'static str,
        /// Its value \[m\], or without unit for the length of the normal.
        value: f64,
    },
    /// Two orientations are half a turn apart, so no way between them is the shortest.
    #[error(
        "move {index}: orientations are {angle} rad apart, within {MIN_TURN_MARGIN} rad of half a \
         turn, so the way is ambiguous; give an orientation between them"
    )]
    HalfTurn {
        /// Index of the move.
        index: usize,
        /// The angle \[rad\].
        angle: f64,
    },
    /// A blend radius is negative, not a number, or too small to be one.
    #[error("move {index}: blend_radius {value} m is neither 0 nor at least {MIN_PATH_LENGTH} m")]
    BlendRadius {
        /// Index of the move before the corner.
        index: usize,
        /// The radius \[m\].
        value: f64,
    },
    /// The last move has a blend radius, but no corner follows.
    #[error("move {index} is the last, its blend_radius must be 0, not {value} m")]
    BlendAtEnd {
        /// Index of the move.
        index: usize,
        /// The radius \[m\].
        value: f64,
    },
}
