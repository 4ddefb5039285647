//! Why waypoints cannot be joined.

use super::path::MIN_BLEND_RADIUS;

/// Why waypoints do not make [`blended_legs`](super::blended_legs). Waypoints and coordinates are
/// counted from zero, corners as the waypoints that they lie at.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BlendError {
    /// There is nothing to move along.
    #[error("{count} waypoints, at least 2 are needed")]
    TooFewWaypoints {
        /// Number of waypoints.
        count: usize,
    },
    /// The waypoints have no coordinates.
    #[error("there is no coordinate to move")]
    NoCoordinates,
    /// There is not one corner per waypoint between the first and the last.
    #[error("{corners} corners, expected one for each of {expected} waypoints between the ends")]
    CornerCount {
        /// Number of corners given.
        corners: usize,
        /// Number of waypoints but two.
        expected: usize,
    },
    /// A waypoint, or a corner's tolerance, does not have one value per coordinate.
    #[error("waypoint {waypoint}: {field} has {len} values, expected {expected}")]
    RowLength {
        /// Index of the waypoint.
        waypoint: usize,
        /// `position` or `tolerance`.
        field: &'static str,
        /// Number of values.
        len: usize,
        /// Number of coordinates of waypoint 0.
        expected: usize,
    },
    /// A coordinate is infinite or not a number, or a distance overflows.
    #[error("waypoint {waypoint}: coordinate {coordinate} is {value}, which is out of range")]
    NotFinite {
        /// Index of the waypoint.
        waypoint: usize,
        /// Index of the coordinate.
        coordinate: usize,
        /// The value.
        value: f64,
    },
    /// A waypoint is where the one before it is, so that the path has no direction there.
    #[error("waypoint {waypoint} is equal to waypoint {}", .waypoint - 1)]
    Repeated {
        /// Index of the later waypoint.
        waypoint: usize,
    },
    /// A radius is negative, not a number or too small to be one.
    #[error("waypoint {waypoint}: radius {value} is neither 0 nor at least {MIN_BLEND_RADIUS}")]
    Radius {
        /// Index of the waypoint.
        waypoint: usize,
        /// The radius \[rad or m\].
        value: f64,
    },
    /// A tolerance is negative or not a number.
    #[error("waypoint {waypoint}: tolerance of coordinate {coordinate} is {value}, below 0")]
    Tolerance {
        /// Index of the waypoint.
        waypoint: usize,
        /// Index of the coordinate.
        coordinate: usize,
        /// The tolerance \[rad or m\].
        value: f64,
    },
}
