//! Values in words and units for people.

use armada_model::{JointType, Pose, Twist};
use armada_protocol::RobotName;
use armada_protocol::messages::{
    ActionStatus, AuthorityState, CellVerdict, ClearBy, CommandMode, ControllerState, Coupling,
    Denial, Fault, Lease, LoopStatistics, MotionProgress, OperationalMode, Presence, Role,
    SchedulingPolicy, StopLatch, StopSourceStatus, StopStage, StreamStatistics,
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

/// Who may command, in one cell of a table: `planner (program) 3.2 s`.
pub(crate) fn authority(state: Option<AuthorityState>, lease: Option<&Lease>) -> String {
    match (state, lease) {
        (Some(AuthorityState::Local), _) => "the pendant".to_owned(),
        (Some(AuthorityState::Inhibited), _) => "nobody, it is stopped".to_owned(),
        (_, Some(lease)) => self::lease(lease),
        (Some(_), None) => "anybody".to_owned(),
        (None, None) => "-".to_owned(),
    }
}

/// A lease with its holder: `planner (program) 3.2 s, and gripper-ui`.
pub(crate) fn lease(lease: &Lease) -> String {
    let Lease { holder, stale, remaining_ms, delegates, .. } = lease;
    let left = if *stale { "has run out".to_owned() } else { seconds_left(*remaining_ms) };
    let mut text = format!("{holder} ({}) {left}", role(lease.role));
    for delegate in delegates {
        text.push_str(&format!(", and {}", delegate.holder));
    }
    text
}

/// A time that is left: `3.2 s`.
pub(crate) fn seconds_left(remaining_ms: u64) -> String {
    format!("{:.1} s", remaining_ms as f64 / 1e3)
}

/// As what somebody commands.
pub(crate) const fn role(role: Role) -> &'static str {
    match role {
        Role::Program => "program",
        Role::Operator => "operator",
        Role::Supervisor => "supervisor",
    }
}

/// How closely robots are tied together.
pub(crate) const fn coupling(coupling: Coupling) -> &'static str {
    match coupling {
        Coupling::Independent => "independent",
        Coupling::TimeSynced => "time_synced",
        Coupling::Rigid => "rigid",
    }
}

/// A source of stops: `door_1 released, heard 42 ms ago`.
pub(crate) fn stop_source(source: &StopSourceStatus) -> String {
    let name = &source.source;
    let state = if source.pressed { "PRESSED or silent" } else { "released" };
    let heard = source
        .age_ms
        .map_or_else(|| "never heard".to_owned(), |age| format!("heard {age:.0} ms ago"));
    format!("{name} {state}, {heard}")
}

/// How fast a frame moves: `0.120 m/s 0.50 rad/s`; nothing if it is not known.
pub(crate) fn speed(twist: Option<&Twist>) -> String {
    twist.map_or_else(String::new, |twist| {
        let (linear, angular) = (twist.linear.norm(), twist.angular.norm());
        format!("{} m/s {} rad/s", tidy(linear, 3), tidy(angular, 2))
    })
}

/// What a stream of commands does: `stream: 500 taken, 2 dropped, newest 4 ms old`.
pub(crate) fn stream(stream: &StreamStatistics) -> String {
    let StreamStatistics { taken, dropped, limited, age_ms, starved, .. } = *stream;
    let limited = if limited > 0 { format!(", {limited} limited") } else { String::new() };
    let starved = if starved { ", STARVED: the robot comes to rest" } else { "" };
    let link = link_quality(stream);
    format!(
        "stream: {taken} taken, {dropped} dropped{limited}, newest {age_ms:.0} ms old{link}{starved}"
    )
}

/// What its link does to a stream; nothing if the link is good.
fn link_quality(stream: &StreamStatistics) -> String {
    let StreamStatistics { jitter_ms, loss, allowed, .. } = *stream;
    let mut text = String::new();
    if jitter_ms >= 0.05 || loss > 0.0 {
        text = format!(", jitter {} ms, loss {} %", tidy(jitter_ms, 1), tidy(loss * 1e2, 1));
    }
    if allowed <= 0.0 {
        text.push_str(", REFUSED: its link is too bad");
    } else if allowed < 1.0 {
        text.push_str(&format!(", SLOWED to {:.0} % because of its link", allowed * 1e2));
    }
    text
}

/// What a motion in progress does besides going on as planned; nothing if that is all.
pub(crate) fn pace(motion: &MotionProgress, speed_ratio: f64) -> String {
    let mut words = Vec::new();
    if motion.paused {
        words.push("paused".to_owned());
    }
    if speed_ratio < 1.0 {
        words.push(format!("speed ratio {speed_ratio}"));
    }
    if (motion.rate - speed_ratio).abs() > 0.005 {
        words.push(format!("rate {}", tidy(motion.rate, 2)));
    }
    if motion.queued > 0 {
        words.push(format!("{} queued", motion.queued));
    }
    words.join(", ")
}

/// What clears a fault, and what a person is to do first: that of the agent, which knows best.
pub(crate) fn remedy(robot: &RobotName, fault: &Fault) -> String {
    let command = match fault.clear {
        ClearBy::Halt => format!("`armada halt {robot}` clears it"),
        ClearBy::ResetErrors => format!("`armada reset-errors {robot}` clears it"),
        ClearBy::Controller => {
            format!("at the controller, and then `armada reset-errors {robot}`")
        }
    };
    if fault.remedy.is_empty() { command } else { format!("{}; {command}", fault.remedy) }
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
    fn a_motion_as_planned_needs_no_words_and_any_other_has_them() {
        let planned = MotionProgress {
            id: uuid::Uuid::nil(),
            elapsed_s: 1.0,
            duration_s: 2.0,
            waypoint: 0,
            rate: 1.0,
            paused: false,
            queued: 0,
        };
        assert_eq!(pace(&planned, 1.0), "");
        assert_eq!(pace(&MotionProgress { rate: 0.5, ..planned }, 0.5), "speed ratio 0.5");
        let paused = MotionProgress { rate: 0.0, paused: true, queued: 2, ..planned };
        assert_eq!(pace(&paused, 0.5), "paused, speed ratio 0.5, rate 0.00, 2 queued");
    }

    #[test]
    fn a_starved_stream_is_told_as_such() {
        let stream_of = |starved| StreamStatistics {
            taken: 9,
            dropped: 1,
            limited: 0,
            age_ms: 4.4,
            starved,
            jitter_ms: 0.4,
            loss: 0.0,
            state_age_ms: 8.0,
            allowed: 1.0,
        };
        assert_eq!(
            stream(&stream_of(false)),
            "stream: 9 taken, 1 dropped, newest 4 ms old, jitter 0.4 ms, loss 0.0 %"
        );
        assert!(stream(&stream_of(true)).ends_with("STARVED: the robot comes to rest"));
    }

    #[test]
    fn a_link_that_slows_a_stream_is_told_and_a_good_one_is_not() {
        let on = |jitter_ms, loss, allowed| {
            let (taken, dropped, limited, age_ms, starved) = (9, 0, 0, 4.0, false);
            stream(&StreamStatistics {
                taken,
                dropped,
                limited,
                age_ms,
                starved,
                jitter_ms,
                loss,
                state_age_ms: 0.0,
                allowed,
            })
        };
        assert_eq!(on(0.0, 0.0, 1.0), "stream: 9 taken, 0 dropped, newest 4 ms old");
        assert!(
            on(6.0, 0.05, 0.5)
                .ends_with("jitter 6.0 ms, loss 5.0 %, SLOWED to 50 % because of its link")
        );
        assert!(on(30.0, 0.2, 0.0).ends_with("REFUSED: its link is too bad"));
    }

    #[test]
    fn who_may_command_is_told_with_role_and_delegates() {
        let text = include_str!("../../../protocol/golden/robot_status.json");
        let status: armada_protocol::messages::RobotStatus =
            serde_json::from_str(text).expect("the golden sample");
        let lease = status.lease.as_ref();
        assert_eq!(authority(Some(status.authority), lease), "nobody, it is stopped");
        let held = "planner (operator) 0.8 s, and gripper-ui";
        assert_eq!(authority(Some(AuthorityState::Held), lease), held);
        assert_eq!(authority(None, lease), held);
        assert_eq!(authority(Some(AuthorityState::Local), lease), "the pendant");
        assert_eq!(authority(Some(AuthorityState::Free), None), "anybody");
        assert_eq!(authority(None, None), "-");
        assert_eq!(
            stop_source(&status.stop_sources[0]),
            "door_1 PRESSED or silent, heard 42 ms ago"
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
