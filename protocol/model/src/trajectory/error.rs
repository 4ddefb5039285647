//! Why a trajectory is refused.

use std::fmt;

use super::units::JointUnit;
use super::waypoints::Interpolation;
use crate::JointType;

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
    /// There is not one joint type per joint.
    #[error("{joints} joints, but types of {types}")]
    TypeCount {
        /// Number of joints.
        joints: usize,
        /// Number of joint types given.
        types: usize,
    },
    /// There are units, but not one per joint.
    #[error("joint_units has {len} values, expected none or one for each of {joints} joints")]
    UnitCount {
        /// Number of units.
        len: usize,
        /// Number of joints of the trajectory.
        joints: usize,
    },
    /// A joint that slides has a unit of angle, or one that turns a unit of length.
    #[error("joint_units has {unit} for {joint}, which {}", moves(*.joint_type))]
    UnitMismatch {
        /// Name of the joint.
        joint: String,
        /// The unit.
        unit: JointUnit,
        /// How the joint moves.
        joint_type: JointType,
    },
    /// A unit needs conversion, but whether it fits cannot be told.
    #[error(
        "joint_units has {unit} for {joint}, but whether that turns or slides is not known here: \
         use rad or m"
    )]
    UnitUnknownType {
        /// Name of the joint.
        joint: String,
        /// The unit.
        unit: JointUnit,
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
    /// Some waypoints have velocities, or accelerations, and some have not.
    #[error(
        "waypoint {waypoint}: {field} must be given at every waypoint or at none, waypoint 0 is \
         different"
    )]
    RowMixed {
        /// Index of the first waypoint that is unlike waypoint 0.
        waypoint: usize,
        /// Field that holds the row.
        field: &'static str,
    },
    /// A waypoint has a row that the interpolation cannot honour.
    #[error("waypoint {waypoint}: {interpolation} takes no {field}, leave it out")]
    RowNotTaken {
        /// Index of the first such waypoint.
        waypoint: usize,
        /// Field that holds the row.
        field: &'static str,
        /// The interpolation asked for.
        interpolation: Interpolation,
    },
    /// A tolerance is not a finite number above zero.
    #[error("waypoint {waypoint}: {field} of {joint} is {value}, expected a finite number above 0")]
    NotPositive {
        /// Index of the waypoint.
        waypoint: usize,
        /// Field that holds the tolerance.
        field: &'static str,
        /// Name of the joint.
        joint: String,
        /// The tolerance.
        value: f64,
    },
    /// A time is infinite or not a number.
    #[error("waypoint {waypoint}: time_from_start_s is {value}, which is not finite")]
    TimeNotFinite {
        /// Index of the waypoint.
        waypoint: usize,
        /// The time.
        value: f64,
    },
    /// A position, velocity or acceleration is infinite or not a number.
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
    /// The natural spline does not rest at an end, as it almost never does.
    #[error(
        "waypoint {waypoint}: cubic_spline_natural passes {joint} at velocity {}, but a \
         trajectory starts and ends at rest: use cubic_spline or quintic_hermite",
        readable(*.velocity)
    )]
    NaturalInMotion {
        /// Index of the waypoint, the first or the last.
        waypoint: usize,
        /// Name of the joint.
        joint: String,
        /// The velocity that follows from the waypoints.
        velocity: f64,
    },
    /// Between two waypoints there is no time for the blends at them.
    #[error(
        "waypoint {waypoint}: from here to waypoint {} the blends of {joint} need {} s within its \
         acceleration limit, but there are {} s: give it more time",
        .waypoint + 1,
        readable(*.needed_s),
        readable(*.available_s)
    )]
    BlendsOverlap {
        /// Index of the waypoint before.
        waypoint: usize,
        /// Name of the joint that needs longest.
        joint: String,
        /// Time the blends need \[s\].
        needed_s: f64,
        /// Time between the waypoints \[s\].
        available_s: f64,
    },
    /// The shortest possible blend passes a waypoint at more than its tolerance.
    #[error(
        "waypoint {waypoint}: the blend passes at {} from the position of {joint}, but \
         position_tolerance is {}: be slower there or widen it",
        readable(*.needed),
        readable(*.available)
    )]
    BlendTolerance {
        /// Index of the waypoint.
        waypoint: usize,
        /// Name of the joint.
        joint: String,
        /// Distance of the blend.
        needed: f64,
        /// The tolerance.
        available: f64,
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
        /// The limit; all but position are limited in both directions.
        limit: f64,
    },
    /// Acceleration jumps where the limits of jerk were to be kept.
    #[error(
        "{joint}: acceleration jumps from {} to {} at {} s, which no limit of jerk allows",
        readable(*.before),
        readable(*.after),
        readable(*.time_s)
    )]
    AccelerationJump {
        /// Name of the joint.
        joint: String,
        /// When it happens \[s since the start\].
        time_s: f64,
        /// Acceleration before; zero before a start at rest.
        before: f64,
        /// Acceleration after; zero after an end at rest.
        after: f64,
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
    /// Jerk \[rad/s³ or m/s³\], see [`JerkLimit`](super::JerkLimit).
    Jerk,
}

impl fmt::Display for LimitedQuantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
        })
    }
}

const fn moves(joint_type: JointType) -> &'static str {
    match joint_type {
        JointType::Revolute | JointType::Continuous => "turns",
        JointType::Prismatic => "slides",
    }
}

/// Without the digits that are only rounding.
fn readable(value: f64) -> f64 {
    if value.abs() < 1e6 { (value * 1e9).round() / 1e9 } else { value }
}
