//! Robot description, kinematics and trajectories: values and pure functions.
//!
//! ```text
//! URDF text --urdf--> RobotModel --kinematics--> poses of links
//! waypoints --trajectory--> validated piecewise cubic --sample--> set-points
//! ```
//!
//! Invariants: nothing here reads a clock, a file or a socket; evaluating a model or a trajectory
//! allocates nothing; every number that a constructor accepted is finite.

mod joint_vector;
mod limits;
mod on_path;
mod online;
mod pose;
mod robot_model;
mod time;
mod trajectory;
mod urdf;

pub use joint_vector::{JointVector, JointVectorError, MAX_JOINTS};
pub use limits::{JointLimits, JointType};
pub use on_path::{
    CurveBounds, CurvePoint, OnPath, OnPathError, PathState, PredictedStop, Span, TimedCurve,
    Transition,
};
pub use online::{
    AxisDurations, AxisMotion, AxisPoint, AxisRequest, JerkLimitedMove, JerkLimitedStop,
    MAX_ONLINE_VALUE, OnlineError, OnlineGenerator, OnlineOptions, OnlineState, Retargeter,
    RuckigGenerator, Synchronisation,
};
pub use pose::{Pose, PoseError};
pub use robot_model::{
    Collision, Inertial, Joint, KinematicsError, Link, Motion, PositionSource, RobotModel, Shape,
    SoftLimits, Variable, Visual,
};
pub use time::MonoTime;
pub use trajectory::{
    AxisLimits, AxisProfile, AxisState, CompiledTrajectory, DEFAULT_JERK_TIME_S, Interpolation,
    JointMove, JointMoveError, JointTrajectory, LIMIT_TOLERANCE, LimitedQuantity,
    MIN_WAYPOINT_SPACING_S, MotionLimits, MotionLimitsError, MotionState, ProfileError,
    REST_TOLERANCE, START_TIME_TOLERANCE_S, Sample, StopRamp, TrajectoryError, TrajectoryOptions,
    Waypoint,
};
pub use urdf::{Place, QuaternionFault, UrdfError, UrdfProblem};
