//! Robot description, kinematics and trajectories: values and pure functions.
//!
//! ```text
//! URDF text --urdf--> RobotModel --kinematics--> poses of links
//! base and tip --Chain--> pose, Jacobian and twist of a tool; joint velocities for a twist
//! pose --InverseKinematics--> joint positions, or what is in the way
//! lines and arcs --CartesianPath--> poses --CartesianPlanner--> joint path, or where it is blocked
//! pose --AnalyticArm--> all branches of joint positions in closed form
//! waypoints --blended_legs--> joint paths that round corners off
//! waypoints --path--> q(s) --retime--> q(s(t)) --to_trajectory--> waypoints with times
//! waypoints --trajectory--> validated piecewise polynomial --sample--> set-points
//! any of these motions --OnPath--> paused, slowed, stopped on its path, within all limits
//! state, target --online--> jerk-limited move, retargeted at any instant
//! links and shapes --clearance--> distances of pairs, of a pose or of a whole motion
//! ```
//!
//! Invariants: nothing here reads a clock, a file or a socket; evaluating a model or a trajectory
//! allocates nothing; every number that a constructor accepted is finite.

mod analytic;
mod blend;
mod cartesian;
mod clearance;
mod inverse;
mod joint_vector;
mod kinematics;
mod limits;
mod on_path;
mod online;
mod path;
mod pose;
mod robot_model;
mod srdf;
mod time;
mod trajectory;
mod urdf;
mod xml;

pub use analytic::{
    AnalyticArm, AnalyticError, ArmFamily, BeyondLimit, Branch, BranchError, Branches,
    Configuration, Elbow, MAX_BRANCHES, Mismatch, Selection, SevenAxisArm, Shoulder, Singularities,
    Wrist,
};
pub use blend::{
    BlendError, BlendedCorner, BlendedPath, JointCorner, MIN_BLEND_RADIUS, blended_legs,
};
pub use cartesian::{
    ArcOrientation, BlockReason, CartesianError, CartesianMotion, CartesianMove, CartesianOptions,
    CartesianPath, CartesianPathError, CartesianPlanner, CartesianSegment, Corner, CornerPassing,
    DEFAULT_ROTATION_WEIGHT, MIN_PATH_LENGTH, MIN_PATH_TOLERANCE, MIN_TURN_MARGIN, PathBlock,
    ReachableMotion,
};
pub use clearance::{
    Accuracy, Body, BodyId, Capsule, ClearanceError, ClearanceWorkspace, CollisionScene,
    MissingShape, MotionCheck, MotionReport, MotionVerdict, Mount, Nearest, Owner, PairDistance,
    Placement, RobotId, SceneBuilder, StlError, TimedDistance, read_stl,
};
pub use inverse::{
    InverseCause, InverseFailure, InverseKinematics, InverseOptions, InverseSolution,
    InverseTarget, LimitSide, PreferredPosture, Residual,
};
pub use joint_vector::{JointVector, JointVectorError, MAX_JOINTS};
pub use kinematics::{
    Chain, ChainError, ChainVariable, Damping, Jacobian, Load, LoadError, Payload,
    ResolvedVelocity, SingularValues, Twist, Wrench,
};
pub use limits::{JointLimits, JointType};
pub use on_path::{
    CurveBounds, CurvePoint, OnPath, OnPathError, PathState, PredictedStop, Span, TimedCurve,
    Transition,
};
pub use online::{
    AxisDurations, AxisMotion, AxisPoint, AxisRequest, AxisTarget, JerkLimitedMove,
    JerkLimitedStop, MAX_ONLINE_VALUE, OnlineError, OnlineGenerator, OnlineOptions, OnlineState,
    Retargeter, RuckigGenerator, Synchronisation,
};
pub use path::{
    ConstraintScheme, GeometricPath, Grid, JointPath, MAX_GRID_POINTS, PathError, PathKnot,
    PathRows, PathSample, PathTrajectory, PathTrajectoryError, RetimeError, RetimeOptions,
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
