//! What the state says of the robot's condition: the flag word and the controller state.
//!
//! Source of the bits: Robot Raconteur `RobotStateFlags`. There `communication_failure` is the only
//! bit while it is set. Here only the bits that the controller tells are away then: a latched
//! stop and a latched fault are known all the same, and whoever looks must see them.
//!
//! | bit | set while |
//! |---|---|
//! | `error` | a fault is latched, or the controller reports an error |
//! | `fatal_error` | the controller reports one, or it is latched |
//! | `estop` | a stop is latched, or the controller's emergency stop is in force |
//! | `estop_software` | Armada's own stop is latched |
//! | `estop_internal` | the controller's emergency stop is in force, and it does not say which |
//! | `estop_button1..4`, `estop_fault`, `estop_other`, `estop_guard1..4`, `enabling_switch` | the controller says so |
//! | `estop_released` | the controller says so, or its emergency stop is over and its fault still latched |
//! | `enabled`, `ready` | drives are on; commands are taken |
//! | `homed`, `homing_required` | every joint knows its reference; one does not |
//! | `communication_failure` | nothing is heard, or not yet |
//! | `valid_position_command`, `valid_velocity_command` | a sample of a stream was followed in this tick |
//! | `trajectory_running` | a trajectory makes the set-points |
//!
//! | controller state, the first that holds | while |
//! |---|---|
//! | `undefined` | nothing is heard |
//! | `emergency_stop` | its emergency stop is in force |
//! | `guard_stop` | a safeguard is open, or it reports an error |
//! | `emergency_stop_reset` | its emergency stop is over, and its fault still latched |
//! | `motor_off` | drives are off |
//! | `guard_stop` | drives are on, but it takes no commands and searches no reference |
//! | `motor_on` | otherwise |

use armada_protocol::messages::{CommandMode, ControllerState, FaultCode, MotionKind, RobotFlags};

use super::state::LoopState;
use crate::drivers::{Feedback, JointSet};

impl LoopState {
    /// Conditions as bits.
    pub(super) fn flags(&self) -> RobotFlags {
        let stopped = self.stop.level().is_some();
        let following = self
            .motion
            .as_ref()
            .is_some_and(|motion| motion.kind() == MotionKind::Trajectory && motion.is_moving());
        let streaming = |mode| self.mode == mode && self.stream.is_followed();
        let told = self
            .condition
            .feedback()
            .map_or(RobotFlags::COMMUNICATION_FAILURE, |feedback| self.told(feedback));
        told.with(RobotFlags::ERROR, !self.faults.is_empty())
            .with(RobotFlags::FATAL_ERROR, self.is_latched(FaultCode::FatalError))
            .with(RobotFlags::ESTOP, stopped)
            .with(RobotFlags::ESTOP_SOFTWARE, stopped)
            .with(RobotFlags::TRAJECTORY_RUNNING, following)
            .with(RobotFlags::VALID_POSITION_COMMAND, streaming(CommandMode::PositionCommand))
            .with(RobotFlags::VALID_VELOCITY_COMMAND, streaming(CommandMode::VelocityCommand))
    }

    /// What the controller is doing.
    pub(super) fn controller_state(&self) -> ControllerState {
        let Some(feedback) = self.condition.feedback() else {
            return ControllerState::Undefined;
        };
        let fatal = feedback.conditions.contains(RobotFlags::FATAL_ERROR);
        if feedback.emergency_stop {
            ControllerState::EmergencyStop
        } else if feedback.guard_stop || feedback.error_code != 0 || fatal {
            ControllerState::GuardStop
        } else if self.emergency_stop_is_released(feedback) {
            ControllerState::EmergencyStopReset
        } else if !feedback.enabled {
            ControllerState::MotorOff
        } else if !feedback.ready && feedback.homing.is_empty() {
            ControllerState::GuardStop
        } else {
            ControllerState::MotorOn
        }
    }

    /// The bits that the controller tells.
    fn told(&self, feedback: &Feedback) -> RobotFlags {
        let conditions = feedback.conditions.intersection(Feedback::CONDITIONS);
        let names_source = SOURCES.into_iter().any(|source| conditions.contains(source));
        let homed = feedback.homed.contains_all(JointSet::first(self.limits.len()));
        conditions
            .with(RobotFlags::ERROR, feedback.error_code != 0)
            .with(RobotFlags::ESTOP, feedback.emergency_stop)
            .with(RobotFlags::ESTOP_INTERNAL, feedback.emergency_stop && !names_source)
            .with(RobotFlags::ESTOP_RELEASED, self.emergency_stop_is_released(feedback))
            .with(RobotFlags::ENABLED, feedback.enabled)
            .with(RobotFlags::READY, feedback.ready)
            .with(RobotFlags::HOMED, homed)
            .with(RobotFlags::HOMING_REQUIRED, !homed)
    }

    fn emergency_stop_is_released(&self, feedback: &Feedback) -> bool {
        let latched = self.is_latched(FaultCode::EmergencyStop);
        !feedback.emergency_stop
            && (latched || feedback.conditions.contains(RobotFlags::ESTOP_RELEASED))
    }
}

/// Where an emergency stop comes from, if the controller says so.
const SOURCES: [RobotFlags; 6] = [
    RobotFlags::ESTOP_BUTTON1,
    RobotFlags::ESTOP_BUTTON2,
    RobotFlags::ESTOP_BUTTON3,
    RobotFlags::ESTOP_BUTTON4,
    RobotFlags::ESTOP_FAULT,
    RobotFlags::ESTOP_OTHER,
];
