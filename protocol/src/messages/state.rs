//! Where a robot is and what it is told, at the state rate.

use armada_model::{JointVector, MonoTime, Pose, Twist};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::{CommandMode, ControllerState, MotionProgress, OperationalMode, RobotFlags};

/// Measured and commanded state of a robot at one tick of its control loop.
///
/// Arrays are in the joint order of [`super::RobotInfo`], in \[rad\] for joints that turn and
/// \[m\] for joints that slide; an array is empty where the controller does not give the value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// Time of the tick, agent's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// Wall clock at the tick, for display only \[ns since 1970 UTC\].
    pub utc_ns: u64,
    /// This run of the agent.
    pub boot_id: Uuid,
    /// Number of the tick in this run.
    pub seqno: u64,
    /// Raised by every halt, stop, reset and change of mode.
    pub epoch: u64,
    /// What kind of command is followed.
    pub command_mode: CommandMode,
    /// The controller's key switch.
    pub operational_mode: OperationalMode,
    /// What the controller does.
    pub controller_state: ControllerState,
    /// Conditions as bits.
    pub flags: RobotFlags,
    /// Measured positions.
    pub joint_position_rad: JointVector,
    /// Measured speeds \[1/s\].
    pub joint_velocity_rad_s: JointVector,
    /// Measured torques \[Nm\] or forces \[N\].
    pub joint_effort_nm: JointVector,
    /// Positions last sent to the controller.
    pub joint_position_command_rad: JointVector,
    /// Speeds that go with them \[1/s\].
    pub joint_velocity_command_rad_s: JointVector,
    /// Where each chain's tool centre point and flange are, in the order of [`super::RobotInfo`]'s chains.
    pub tcp: Vec<TcpState>,
    /// The motion in progress.
    pub motion: Option<MotionProgress>,
    /// Speed of all motions over what they were planned for, 0.01 to 1.
    pub speed_ratio: f64,
    /// Revision of tools and payloads.
    pub config_seqno: u64,
}

/// Where the tool centre point and the flange of a chain are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TcpState {
    /// Name of the chain.
    pub chain: String,
    /// Pose of the tool centre point in the chain's base link.
    pub pose: Pose,
    /// Its speed, in the axes of the chain's base link; null while joint speeds are not known.
    pub twist: Option<Twist>,
    /// Pose of the flange, which is the chain's tip link, in the chain's base link.
    pub flange_pose: Pose,
    /// Its speed, in the axes of the chain's base link.
    pub flange_twist: Option<Twist>,
}

impl TcpState {
    /// A chain without tool whose tip is at `pose`, speeds not known.
    #[must_use]
    pub fn of(chain: impl Into<String>, pose: Pose) -> Self {
        Self { chain: chain.into(), pose, twist: None, flange_pose: pose, flange_twist: None }
    }
}

/// Joint states in the shape of ROS `sensor_msgs/JointState`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Time of the tick, agent's monotonic clock \[ns\].
    pub stamp_ns: MonoTime,
    /// This run of the agent.
    pub boot_id: Uuid,
    /// Number of the tick in this run.
    pub seqno: u64,
    /// Joint names.
    pub name: Vec<String>,
    /// Positions \[rad or m\].
    pub position: JointVector,
    /// Speeds \[rad/s or m/s\]; empty if not available.
    pub velocity: JointVector,
    /// Torques \[Nm\] or forces \[N\]; empty if not available.
    pub effort: JointVector,
}
