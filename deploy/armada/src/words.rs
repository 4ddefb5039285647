//! Values in words and units for people.

use armada_model::{JointType, Pose};
use armada_protocol::messages::{
    ActionStatus, CellVerdict, CommandMode, ControllerState, Denial, Lease, LoopStatistics,
    OperationalMode, Presence, SchedulingPolicy, StopLatch, StopStage,
};
use serde::Serialize;

/// The name of a value on the wire, without underscores: `guard stop`.
pub(crate) fn wire_name<T: Serialize>(value: T) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name.replace('_', " "),
        Ok(other) => other.to_string(),
        Err(_) => "?".to_owned(),
    }
}

/// A mode as it is typed and shown: `halt`, `invalid_state`.
pub(crate) const fn mode(mode: CommandMode) -> &'static str {
    match mode {
        CommandMode::InvalidState => "invalid_state",
        CommandMode::Halt => "halt",
        CommandMode::Jog => "jog",
        CommandMode::Trajectory => "trajectory",
        CommandMode::PositionCommand => "position_command",
        CommandMode::VelocityCommand => "velocity_command",
        CommandMode::Homing => "homing",
    }
}

/// What the controller does.
pub(crate) const fn controller(state: ControllerState) -> &'static str {
    match state {
        ControllerState::Undefined => "unknown",
        ControllerState::Init => "starting",
        ControllerState::MotorOn => "motor on",
        ControllerState::MotorOff => "motor off",
        ControllerState::GuardStop => "guard stop",
        ControllerState::EmergencyStop => "emergency stop",
        ControllerState::EmergencyStopReset => "emergency stop reset",
    }
}

/// Where the key switch stands.
pub(crate) const fn operational(mode: OperationalMode) -> &'static str {
    match mode {
        OperationalMode::Undefined => "key switch unknown",
        OperationalMode::ManualReducedSpeed => "manual, reduced speed",
        OperationalMode::ManualFullSpeed => "manual, full speed",
        OperationalMode::Auto => "automatic",
        OperationalMode::Cobot => "collaborative",
    }
}

/// Whether an agent is there.
pub(crate) const fn presence(presence: Presence) -> &'static str {
    match presence {
        Presence::NeverSeen => "not seen",
        Presence::Online => "online",
        Presence::Lost => "LOST",
    }
}

/// The verdict on a cell.
pub(crate) const fn verdict(verdict: CellVerdict) -> &'static str {
    match verdict {
        CellVerdict::Ready => "ready: every robot is online, without fault or stop",
        CellVerdict::Moving => "moving: at least one robot is in motion, none is in trouble",
        CellVerdict::Stopped => "stopped: no motion before `armada reset`",
        CellVerdict::Degraded => {
            "degraded: a robot has a fault, cannot be commanded or is not there"
        }
    }
}

/// How far a stop has come.
pub(crate) const fn stage(stage: StopStage) -> &'static str {
    match stage {
        StopStage::Received => "received",
        StopStage::Commanded => "commanded",
        StopStage::Standstill => "standstill",
        StopStage::DrivesOff => "drives off",
    }
}

/// Where a motion stands.
pub(crate) const fn action(status: ActionStatus) -> &'static str {
    match status {
        ActionStatus::Queued => "waiting for its start",
        ActionStatus::Running => "running",
        ActionStatus::Paused => "paused",
        ActionStatus::Complete => "complete",
        ActionStatus::Cancelled => "cancelled",
        ActionStatus::Failed => "failed",
    }
}

/// A latched stop in one cell of a table: `L1 standstill`.
pub(crate) fn stop(latch: Option<&StopLatch>) -> String {
    latch.map_or_else(|| "-".to_owned(), |stop| format!("{:?} {}", stop.level, stage(stop.stage)))
}

/// A lease in one cell of a table.
pub(crate) fn lease(lease: Option<&Lease>) -> String {
    lease.map_or_else(
        || "-".to_owned(),
        |lease| format!("{} {:.1} s", lease.holder, lease.remaining_ms as f64 / 1e3),
    )
}

/// A position \[m\] and a rotation as roll, pitch and yaw \[°\].
pub(crate) fn pose(pose: &Pose) -> String {
    let p = pose.position();
    let (roll, pitch, yaw) = pose.isometry().rotation.euler_angles();
    let degrees = |angle: f64| tidy(angle.to_degrees(), 1);
    format!(
        "{} {} {} m  {} {} {}°",
        tidy(p.x, 3),
        tidy(p.y, 3),
        tidy(p.z, 3),
        degrees(roll),
        degrees(pitch),
        degrees(yaw)
    )
}

/// The timing of a control loop: `1000/1000 Hz, 0 overruns, 2 missed`.
pub(crate) fn control_loop(timing: &LoopStatistics) -> String {
    format!(
        "{:.0}/{:.0} Hz, {} overruns, {} missed",
        timing.rate_hz, timing.target_rate_hz, timing.overruns, timing.missed_periods
    )
}

/// How a control loop is scheduled.
pub(crate) fn scheduling(policy: SchedulingPolicy) -> String {
    match policy {
        SchedulingPolicy::Other => "not real-time".to_owned(),
        SchedulingPolicy::Fifo(priority) => format!("SCHED_FIFO {priority}"),
    }
}

/// The unit of a joint's position.
pub(crate) const fn unit(joint: JointType) -> &'static str {
    match joint {
        JointType::Revolute | JointType::Continuous => "rad",
        JointType::Prismatic => "m",
    }
}

/// How a joint moves.
pub(crate) const fn joint_type(joint: JointType) -> &'static str {
    match joint {
        JointType::Revolute => "revolute",
        JointType::Continuous => "continuous",
        JointType::Prismatic => "prismatic",
    }
}

/// A number with `decimals` digits, without a minus before zero.
pub(crate) fn tidy(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        _ => text,
    }
}

/// A refusal for people, with its code for looking it up.
pub(crate) fn denial(denial: &Denial) -> String {
    format!("{} ({})", denial.message, denial.code)
}

/// A time without needless digits: `840 ns`, `12 µs`, `3.4 ms`, `2.1 s`.
pub(crate) fn nanos(ns: u64) -> String {
    let ns = ns as f64;
    if ns < 1e3 {
        format!("{ns:.0} ns")
    } else if ns < 1e6 {
        format!("{:.0} µs", ns / 1e3)
    } else if ns < 1e9 {
        format!("{:.1} ms", ns / 1e6)
    } else {
        format!("{:.1} s", ns / 1e9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_in_metres_and_degrees_without_minus_zero() {
        assert_eq!(
            pose(&Pose::from_translation(0.5, -0.0001, 1.25)),
            "0.500 0.000 1.250 m  0.0 0.0 0.0°"
        );
    }

    #[test]
    fn zero_has_no_sign_and_others_keep_theirs() {
        assert_eq!(tidy(-0.04, 1), "0.0");
        assert_eq!(tidy(-0.06, 1), "-0.1");
    }

    #[test]
    fn times_are_shown_in_the_unit_that_fits() {
        let times = [840, 12_300, 3_400_000, 2_100_000_000].map(nanos);
        assert_eq!(times, ["840 ns", "12 µs", "3.4 ms", "2.1 s"]);
    }

    #[test]
    fn names_from_the_wire_are_readable() {
        assert_eq!(
            wire_name(armada_protocol::messages::FaultCode::TrackingError),
            "tracking error"
        );
    }
}
