//! The methods under `rpc/` with the types of their parameters and answers.

use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::messages::{
    Accepted, AcquireLeaseParams, AttachPayloadParams, AttachToolParams, CancelParams,
    CellAcquireLeaseParams, CellExecuteTrajectory, CellLeaseParams, CellResetAnswer,
    CellResetParams, CellSpeedRatioParams, CheckClearanceParams, ClearanceAnswer, CommitParams,
    DelegateLeaseParams, DetachParams, Empty, EquipmentAnswer, ExecuteTrajectoryParams,
    ForwardKinematicsAnswer, ForwardKinematicsParams, GroupLease, GroupLeaseReleased, HaltAnswer,
    HomeParams, InverseKinematicsAnswer, InverseKinematicsParams, JogCartesianParams,
    JogFreespaceParams, JogJointParams, LeaseGrant, LeaseParams, LeaseReleased, ModeAnswer,
    MotionParams, MoveHomeParams, MoveJointParams, MovePoseParams, NameParams, NamedValue,
    PrepareParams, Prepared, RecordingAnswer, RenewLeaseParams, ResetAnswer, ResetParams,
    SetModeParams, SetValueParams, SpeedRatioAnswer, SpeedRatioParams, StopReport, StopRequest,
    TakeLeaseParams,
};

/// A method: one query, one answer.
pub trait Method {
    /// Last part of its key.
    const NAME: &'static str;
    /// How long an asker waits; longer than the answerer ever takes.
    const TIMEOUT: Duration;
    /// What is asked, inside a [`Request`](crate::messages::Request).
    type Params: Serialize + DeserializeOwned + Send;
    /// What is answered.
    type Answer: Serialize + DeserializeOwned + Send;
}

/// A row of the list of methods, for documentation and other languages.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MethodRow {
    /// Last part of its key.
    pub name: &'static str,
    /// Name of the type of its parameters.
    pub params: &'static str,
    /// Name of the type of its answer.
    pub answer: &'static str,
    /// How long an asker waits for the answer \[ms\].
    pub timeout_ms: u64,
    /// What it does.
    pub notes: &'static str,
}

macro_rules! methods {
    ($(#[$list_doc:meta])* $list:ident: $($(#[doc = $doc:literal])* $method:ident = $name:literal, $timeout_ms:literal, $params:ident -> $answer:ident;)+) => {
        $($(#[doc = $doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $method;

        impl Method for $method {
            const NAME: &'static str = $name;
            const TIMEOUT: Duration = Duration::from_millis($timeout_ms);
            type Params = $params;
            type Answer = $answer;
        })+

        $(#[$list_doc])*
        pub const $list: &[MethodRow] = &[$(MethodRow {
            name: $name,
            params: stringify!($params),
            answer: stringify!($answer),
            timeout_ms: $timeout_ms,
            notes: concat!($($doc),*),
        }),+];
    };
}

/// Methods of an agent, under `robots/{robot}/rpc/`.
pub mod robot {
    use super::*;

    methods! {
        /// Every method of an agent.
        ALL:
        /// Takes the right to command, if nobody has it.
        AcquireLease = "acquire_lease", 2000, AcquireLeaseParams -> LeaseGrant;
        /// Keeps the right to command.
        RenewLease = "renew_lease", 2000, RenewLeaseParams -> LeaseGrant;
        /// Takes the right to command from whoever has it: for a person, with a reason.
        TakeLease = "take_lease", 2000, TakeLeaseParams -> LeaseGrant;
        /// Lets somebody else command as well, under the holder's lease.
        DelegateLease = "delegate_lease", 2000, DelegateLeaseParams -> LeaseGrant;
        /// Gives the right to command back; a motion in progress ends with a ramp.
        ReleaseLease = "release_lease", 2000, LeaseParams -> LeaseReleased;
        /// Changes the command mode; every mode but `halt` is entered from `halt`.
        SetMode = "set_mode", 2000, SetModeParams -> ModeAnswer;
        /// Ramps to standstill and stays in `halt`; ends every motion.
        Halt = "halt", 2000, Empty -> HaltAnswer;
        /// Switches the drives on; answered when the controller reports them on.
        Enable = "enable", 8000, Empty -> ModeAnswer;
        /// Ramps to standstill and switches the drives off.
        Disable = "disable", 8000, Empty -> ModeAnswer;
        /// Clears latched faults whose cause is gone, here and at the controller.
        ResetErrors = "reset_errors", 8000, Empty -> ModeAnswer;
        /// Clears the latched stop; never moves, never enables.
        Reset = "reset", 2000, ResetParams -> ResetAnswer;
        /// Homes joints in an order, in mode `homing`.
        Home = "home", 4000, HomeParams -> Accepted;
        /// Moves all joints to a position, in mode `jog`; a new goal replaces the old one.
        JogFreespace = "jog_freespace", 2000, JogFreespaceParams -> Accepted;
        /// Moves joints at a speed as long as it is repeated, in mode `jog`.
        JogJoint = "jog_joint", 2000, JogJointParams -> Accepted;
        /// Moves tools at a speed as long as it is repeated, in mode `jog`.
        JogCartesian = "jog_cartesian", 2000, JogCartesianParams -> Accepted;
        /// Follows a trajectory, in mode `trajectory`: at once, or after those before it.
        ExecuteTrajectory = "execute_trajectory", 4000, ExecuteTrajectoryParams -> Accepted;
        /// Moves all joints to a position, in mode `trajectory`.
        MoveJoint = "move_joint", 4000, MoveJointParams -> Accepted;
        /// Moves the tool to a pose, the joints on the straight way, in mode `trajectory`.
        MovePose = "move_pose", 4000, MovePoseParams -> Accepted;
        /// Moves the tool on a straight line, in mode `trajectory`.
        MoveLinear = "move_linear", 4000, MovePoseParams -> Accepted;
        /// Moves all joints to their home positions, in mode `trajectory`.
        MoveHome = "move_home", 4000, MoveHomeParams -> Accepted;
        /// Ends a motion with a ramp to standstill, or takes it out of the queue; the mode stays.
        Cancel = "cancel", 2000, CancelParams -> Empty;
        /// Brings a motion to rest on its path until it is resumed.
        Pause = "pause", 2000, MotionParams -> Empty;
        /// Goes on with a paused motion.
        Resume = "resume", 2000, MotionParams -> Empty;
        /// Changes the speed of all motions, those in progress too.
        SetSpeedRatio = "set_speed_ratio", 2000, SpeedRatioParams -> SpeedRatioAnswer;
        /// Attaches a tool to a chain that has none.
        AttachTool = "attach_tool", 4000, AttachToolParams -> EquipmentAnswer;
        /// Detaches the tool of a chain that holds no payload.
        DetachTool = "detach_tool", 4000, DetachParams -> EquipmentAnswer;
        /// Attaches a payload to a chain with a tool.
        AttachPayload = "attach_payload", 4000, AttachPayloadParams -> EquipmentAnswer;
        /// Detaches the payload of a chain.
        DetachPayload = "detach_payload", 4000, DetachParams -> EquipmentAnswer;
        /// Value of a controller's setting.
        GetParam = "get_param", 2000, NameParams -> NamedValue;
        /// Sets a controller's setting; answered when the controller reports it.
        SetParam = "set_param", 4000, SetValueParams -> NamedValue;
        /// Value of a signal.
        GetSignal = "get_signal", 2000, NameParams -> NamedValue;
        /// Sets a signal; answered when the controller reports it.
        SetSignal = "set_signal", 4000, SetValueParams -> NamedValue;
        /// Where tool and flange of a chain are.
        ForwardKinematics = "forward_kinematics", 2000, ForwardKinematicsParams -> ForwardKinematicsAnswer;
        /// Joint positions for a pose of the tool.
        InverseKinematics = "inverse_kinematics", 2000, InverseKinematicsParams -> InverseKinematicsAnswer;
        /// Validates a trajectory and keeps it for `commit`.
        Prepare = "prepare", 4000, PrepareParams -> Prepared;
        /// Starts a prepared trajectory at an instant of the agent's clock.
        Commit = "commit", 2000, CommitParams -> Accepted;
        /// Forgets a prepared trajectory, or ends it with a ramp if it runs.
        Abort = "abort", 2000, CancelParams -> Empty;
        /// Writes the last seconds of the control loop to a file.
        SaveRecording = "save_recording", 8000, Empty -> RecordingAnswer;
    }
}

/// Methods of the gateway, under `cell/rpc/`.
pub mod cell {
    use super::*;

    methods! {
        /// Every method of the gateway.
        ALL:
        /// Stops the robots in scope and reports how far each has come.
        Stop = "stop", 5000, StopRequest -> StopReport;
        /// Clears the latched stops of robots; never moves, never enables.
        Reset = "reset", 4000, CellResetParams -> CellResetAnswer;
        /// Follows a trajectory with several robots that start at one instant.
        ExecuteTrajectory = "execute_trajectory", 8000, CellExecuteTrajectory -> Accepted;
        /// Ends a motion of several robots, each with a ramp to standstill.
        Cancel = "cancel", 4000, CancelParams -> Empty;
        /// Brings a motion of several robots to rest at one phase, until it is resumed.
        Pause = "pause", 4000, MotionParams -> Empty;
        /// Goes on with a paused motion of several robots.
        Resume = "resume", 4000, MotionParams -> Empty;
        /// Changes the speed of a motion of several robots, and of all later ones of its robots.
        SetSpeedRatio = "set_speed_ratio", 4000, CellSpeedRatioParams -> SpeedRatioAnswer;
        /// Gets the leases of several robots, all or none.
        AcquireLease = "acquire_lease", 4000, CellAcquireLeaseParams -> GroupLease;
        /// Keeps the leases of several robots.
        RenewLease = "renew_lease", 4000, CellLeaseParams -> GroupLease;
        /// Gives the leases of several robots back.
        ReleaseLease = "release_lease", 4000, CellLeaseParams -> GroupLeaseReleased;
        /// How near the robots come to each other on a trajectory.
        CheckClearance = "check_clearance", 8000, CheckClearanceParams -> ClearanceAnswer;
    }
}
