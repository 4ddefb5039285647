//! Why a trajectory is refused.

use std::fmt;

/// Why a [`JointTrajectory`](super::JointTrajectory) is refused.
///
/// Waypoints are counted from zero. Values are in the joint's unit, \[rad\] or \[m\], and seconds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// A selection does not have one name per column.
    #[error("{columns} columns, but {names} names")]
    ColumnNames {
        /// Number of columns.
        columns: usize,
        /// Number of names.
        names: usize,
    },
    /// A selection asks for a column that does not exist.
    #[error("column {column} does not exist, the trajectory has {joints} joints")]
    ColumnUnknown {
        /// The column asked for.
        column: usize,
        /// Number of joints of the trajectory.
        joints: usize,
    },
    /// The caller's joint order and limits do not belong together.
    #[error("{joints} joints in the robot's order, but limits of {limits}")]
    LimitCount {
        /// Number of joints in the robot's order.
        joints: usize,
        /// Number of joints that have limits.
        limits: usize,
    },
    /// A joint of the robot is not in `joint_names`.
    #[error("joint_names lacks the robot's joint {joint}")]
    JointMissing {
        /// Name of the robot's joint.
        joint: String,
    },
    /// A name is not one of the robot's joints.
    #[error("joint_names has {joint}, which the robot does not have")]
    JointUnknown {
        /// The name.
        joint: String,
    },
    /// A joint is named more than once.
    #[error("joint_names has {joint} more than once")]
    JointRepeated {
        /// The name.
        joint: String,
    },
    /// There is nothing to move along.
    #[error("{count} waypoints, at least 2 are needed")]
    TooFewWaypoints {
        /// Number of waypoints.
        count: usize,
    },
    /// There are more waypoints than allowed.
    #[error("{count} waypoints, at most {limit} are allowed")]
    TooManyWaypoints {
        /// Number of waypoints.
        count: usize,
        /// Highest number allowed.
        limit: usize,
    },
    /// A row does not have one value per joint.
    #[error(
        "waypoint {waypoint}: {field} has {len} values, expected one for each of {expected} joints"
    )]
    RowLength {
        /// Index of the waypoint.
        waypoint: usize,
        /// Field that holds the row.
        field: &'static str,
        /// Number of values in the row.
        len: usize,
        /// Number of joints.
        expected: usize,
    },
    /// Some waypoints have velocities and some have not.
    #[error(
        "waypoint {waypoint}: joint_velocity must be given at every waypoint or at none, \
         waypoint 0 is different"
    )]
    VelocityMixed {
        /// Index of the first waypoint that is unlike waypoint 0.
        waypoint: usize,
    },
    /// A time is infinite or not a number.
    #[error("waypoint {waypoint}: time_from_start_s is {value}, which is not finite")]
    TimeNotFinite {
        /// Index of the waypoint.
        waypoint: usize,
        /// The time.
        value: f64,
    },
    /// A position or velocity is infinite or not a number.
    #[error("waypoint {waypoint}: {field} of {joint} is {value}, which is not finite")]
    NotFinite {
        /// Index of the waypoint.
        waypoint: usize,
        /// Field that holds the value.
        field: &'static str,
        /// Name of the joint.
        joint: String,
        /// The value.
        value: f64,
    },
    /// The first waypoint is not at time zero.
    #[error("waypoint 0: time_from_start_s is {time_s}, expected 0")]
    FirstTime {
        /// Time of the first waypoint \[s\].
        time_s: f64,
    },
    /// A waypoint is not later than the one before it by the least spacing.
    #[error(
        "waypoint {waypoint}: time_from_start_s is {time_s}, expected at least {spacing_s} s \
         after the {previous_s} of waypoint {}",
        .waypoint - 1
    )]
    Spacing {
        /// Index of the later waypoint.
        waypoint: usize,
        /// Its time \[s\].
        time_s: f64,
        /// Time of the waypoint before it \[s\].
        previous_s: f64,
        /// Least spacing allowed \[s\].
        spacing_s: f64,
    },
    /// The trajectory takes longer than allowed.
    #[error("duration is {duration_s} s, at most {limit_s} s is allowed")]
    TooLong {
        /// Time of the last waypoint \[s\].
        duration_s: f64,
        /// Longest duration allowed \[s\].
        limit_s: f64,
    },
    /// The first or the last waypoint is passed in motion.
    #[error(
        "waypoint {waypoint}: joint_velocity of {joint} is {value}, but a trajectory starts and \
         ends at rest"
    )]
    NotAtRest {
        /// Index of the waypoint, the first or the last.
        waypoint: usize,
        /// Name of the joint.
        joint: String,
        /// The velocity.
        value: f64,
    },
    /// The interpolated motion leaves a joint's limits.
    #[error(
        "{joint}: {quantity} {} at {} s, between waypoints {segment} and {}, is beyond the limit \
         {limit}",
        readable(*.value),
        readable(*.time_s),
        .segment + 1
    )]
    BeyondLimit {
        /// What is beyond its limit.
        quantity: LimitedQuantity,
        /// Name of the joint.
        joint: String,
        /// Index of the waypoint before it happens.
        segment: usize,
        /// When it happens \[s since the start\].
        time_s: f64,
        /// The extreme value there.
        value: f64,
        /// The limit; velocity and acceleration are limited in both directions.
        limit: f64,
    },
}

/// What a joint limit limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LimitedQuantity {
    /// Position \[rad or m\].
    Position,
    /// Velocity \[rad/s or m/s\].
    Velocity,
    /// Acceleration \[rad/s² or m/s²\].
    Acceleration,
}

impl fmt::Display for LimitedQuantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
        })
    }
}

/// Without the digits that are only rounding.
fn readable(value: f64) -> f64 {
    if value.abs() < 1e6 { (value * 1e9).round() / 1e9 } else { value }
}
