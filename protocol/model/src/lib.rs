//! Robot description, kinematics and trajectories: values and pure functions.
//!
//! ```text
//! URDF text --urdf--> RobotModel --kinematics--> poses of links
//! base and tip --Chain--> pose, Jacobian and twist of a tool; joint velocities for a twist
//! pose --InverseKinematics--> joint positions, or what is in the way
//! waypoints --path--> q(s) --retime--> q(s(t)) --to_trajectory--> waypoints with times
//! waypoints --trajectory--> validated piecewise cubic --sample--> set-points
//! waypoints --trajectory--> validated piecewise polynomial --sample--> set-points
//! ```
//!
//! Invariants: nothing here reads a clock, a file or a socket; evaluating a model or a trajectory
//! allocates nothing; every number that a constructor accepted is finite.

mod inverse;
mod clearance;
mod analytic;
mod joint_vector;
mod kinematics;
mod limits;
mod path;
mod pose;
mod robot_model;
mod srdf;
mod time;
mod trajectory;
mod urdf;

pub use inverse::{
    InverseCause, InverseFailure, InverseKinematics, InverseOptions, InverseSolution,
    InverseTarget, LimitSide, PreferredPosture, Residual,
pub use clearance::{
    Accuracy, Body, BodyId, Capsule, ClearanceError, ClearanceWorkspace, CollisionScene,
    MissingShape, MotionCheck, MotionReport, MotionVerdict, Mount, Nearest, Owner, PairDistance,
    Placement, RobotId, SceneBuilder, StlError, TimedDistance, read_stl,
pub use analytic::{
    AnalyticArm, AnalyticError, ArmFamily, BeyondLimit, Branch, BranchError, Branches,
    Configuration, Elbow, MAX_BRANCHES, Mismatch, Selection, SevenAxisArm, Shoulder, Singularities,
    Wrist,
};
pub use joint_vector::{JointVector, JointVectorError, MAX_JOINTS};
pub use kinematics::{
    Chain, ChainError, ChainVariable, Damping, Jacobian, Load, LoadError, Payload,
    ResolvedVelocity, SingularValues, Twist, Wrench,
};
pub use limits::{JointLimits, JointType};
pub use path::{
    ConstraintScheme, GeometricPath, Grid, JointPath, MAX_GRID_POINTS, PathError, PathRows,
    PathSample, PathState, PathTrajectory, PathTrajectoryError, RetimeError, RetimeOptions,
    Saturation, SplineEnds, StackedPath, TimedPath, retime, retime_jerk_limited,
};
pub use pose::{Pose, PoseError};
pub use robot_model::{
    Collision, Inertial, Joint, KinematicsError, Link, Motion, PositionSource, RobotModel, Shape,
    SoftLimits, Variable, Visual,
};
pub use srdf::{
    DisabledPair, EndEffector, GroupState, JointGroup, LinkSpheres, Severity, Srdf, SrdfError,
    SrdfErrorKind, SrdfFault, SrdfProblem, VirtualJoint, VirtualJointType,
};
pub use time::MonoTime;
pub use trajectory::{
    AxisLimits, AxisProfile, AxisState, CompiledTrajectory, DEFAULT_JERK_TIME_S, Ends,
    Interpolation, JerkLimit, JointMove, JointMoveError, JointTrajectory, JointUnit,
    LIMIT_TOLERANCE, LimitedQuantity, MIN_BLEND_S, MIN_WAYPOINT_SPACING_S, MotionLimits,
    MotionLimitsError, MotionState, ProfileError, REST_TOLERANCE, START_TIME_TOLERANCE_S, Sample,
    SegmentBounds, StopRamp, Tolerance, TrajectoryContext, TrajectoryError, TrajectoryOptions,
    TrajectoryState, Waypoint,
};
pub use urdf::{
    Place, QuaternionFault, UrdfDoubt, UrdfError, UrdfProblem, UrdfReport, UrdfWarning,
};
