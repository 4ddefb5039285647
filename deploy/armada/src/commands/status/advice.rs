//! What is wrong with a robot and what to do next, in words.

use armada_protocol::RobotName;
use armada_protocol::messages::{
    CellRobotStatus, CommandMode, ControllerState, Fault, LatchedStop, Presence, ResetNeeds,
    ResetZone, WhyCode,
};

use crate::words;

/// One line for each thing that keeps the robot from moving; none if all is well.
pub(crate) fn of(robot: &RobotName, status: &CellRobotStatus) -> Vec<String> {
    match status.presence {
        Presence::NeverSeen => {
            return vec![format!(
                "{robot}: its agent has not been seen: start it (`armada agent ROBOT.yaml`)"
            )];
        }
        Presence::Lost => {
            return vec![format!(
                "{robot}: its agent is gone; the arm ramps to standstill by itself: look at the \
                 agent's log and start it again"
            )];
        }
        Presence::Online => {}
    }
    let mut lines: Vec<String> =
        status.faults.iter().map(|fault| fault_line(robot, fault)).collect();
    if let Some(stop) = &status.stop {
        lines.extend(stop.stops.iter().map(|stop| stop_line(robot, stop)));
        lines.push(format!("{robot}: when it is safe to go on: {}", reset(robot, &stop.reset)));
    }
    // Stops, faults and drives are told above and below, with what a person types.
    let others = status.why.iter().filter(|why| is_told_as_it_is(why.code));
    lines.extend(others.map(|why| format!("{robot}: {}", why.message)));
    if lines.is_empty() {
        lines.extend(not_commanded(robot, status));
    }
    lines
}

/// What a person types to clear a stop, with what has to be done before.
pub(crate) fn reset(robot: &RobotName, needs: &ResetNeeds) -> String {
    let at_arm = needs.zone == ResetZone::Manual && !needs.acknowledged;
    let first = if at_arm { "acknowledge it at the arm, and then " } else { "" };
    let key = if needs.signed { " --key-file FILE" } else { "" };
    format!("{first}`armada reset {robot}{key}`")
}

/// Whether a reason is not one of those that have a line of their own.
const fn is_told_as_it_is(code: WhyCode) -> bool {
    match code {
        WhyCode::StopSource | WhyCode::Local | WhyCode::Waiting | WhyCode::DegradedLink => true,
        WhyCode::NotConnected
        | WhyCode::Stopped
        | WhyCode::Faulted
        | WhyCode::DrivesOff
        | WhyCode::DrivenBy
        | WhyCode::LeaseStale
        | WhyCode::Moving
        | WhyCode::Halted
        | WhyCode::Ready => false,
    }
}

fn fault_line(robot: &RobotName, fault: &Fault) -> String {
    let code = words::wire_name(fault.code);
    format!("{robot}: fault, {code}: {}; {}", fault.message, words::remedy(robot, fault))
}

fn stop_line(robot: &RobotName, stop: &LatchedStop) -> String {
    let reason = if stop.reason.is_empty() { "no reason given" } else { &stop.reason };
    format!("{robot}: stopped ({:?}) by {}: {reason}", stop.level, stop.source)
}

fn not_commanded(robot: &RobotName, status: &CellRobotStatus) -> Option<String> {
    match (status.command_mode, status.controller_state) {
        (_, Some(ControllerState::MotorOff)) => {
            Some(format!("{robot}: drives are off: `armada enable {robot}`"))
        }
        (_, Some(ControllerState::EmergencyStop)) => {
            Some(format!("{robot}: emergency stop: release it at the robot"))
        }
        (Some(CommandMode::InvalidState), state) => {
            let state = state.map_or("unknown", words::controller);
            Some(format!("{robot}: cannot be commanded, its controller is in {state}"))
        }
        (None, _) => Some(format!("{robot}: online, but has not told its status yet")),
        (Some(_), _) => None,
    }
}

#[cfg(test)]
mod tests {
    use armada_model::MonoTime;
    use armada_protocol::messages::{ClearBy, FaultCode, StopLatch, StopLevel, StopStage, Why};
    use uuid::Uuid;

    use super::*;

    fn online() -> CellRobotStatus {
        CellRobotStatus {
            presence: Presence::Online,
            command_mode: Some(CommandMode::Halt),
            controller_state: Some(ControllerState::MotorOn),
            ..CellRobotStatus::default()
        }
    }

    fn advice(status: &CellRobotStatus) -> Vec<String> {
        of(&"left_arm".parse().expect("a name"), status)
    }

    #[test]
    fn a_robot_that_is_well_needs_no_words() {
        assert_eq!(advice(&online()), Vec::<String>::new());
    }

    #[test]
    fn a_fault_is_told_with_its_message_and_the_command_that_clears_it() {
        let fault = |code, clear, remedy: &str| Fault {
            code,
            message: "joint 3: 0.2 rad behind".to_owned(),
            joint: None,
            value: 0.2,
            limit: 0.1,
            clear,
            remedy: remedy.to_owned(),
            recording: None,
            since_ns: MonoTime::ZERO,
        };
        let faults = vec![
            fault(FaultCode::TrackingError, ClearBy::Halt, "look what held the arm"),
            fault(FaultCode::LoopError, ClearBy::ResetErrors, ""),
            fault(FaultCode::GuardStop, ClearBy::Controller, "close the gate"),
        ];
        let lines = advice(&CellRobotStatus { faults, ..online() });
        assert_eq!(
            lines,
            [
                "left_arm: fault, tracking error: joint 3: 0.2 rad behind; look what held the arm; \
                 `armada halt left_arm` clears it",
                "left_arm: fault, loop error: joint 3: 0.2 rad behind; \
                 `armada reset-errors left_arm` clears it",
                "left_arm: fault, guard stop: joint 3: 0.2 rad behind; close the gate; \
                 at the controller, and then `armada reset-errors left_arm`",
            ]
        );
    }

    #[test]
    fn every_latched_stop_is_told_and_then_the_reset() {
        let stop = |source: &str| LatchedStop {
            stop_id: Uuid::nil(),
            source: source.to_owned(),
            level: StopLevel::L1,
            reason: String::new(),
        };
        let stop = StopLatch {
            level: StopLevel::L1,
            stops: vec![stop("a"), stop("b")],
            stage: StopStage::Standstill,
            reset: Default::default(),
        };
        let lines = advice(&CellRobotStatus { stop: Some(stop), ..online() });
        assert_eq!(lines[0], "left_arm: stopped (L1) by a: no reason given");
        assert_eq!(lines[2], "left_arm: when it is safe to go on: `armada reset left_arm`");
    }

    #[test]
    fn what_a_reset_needs_is_told_before_it_is_tried() {
        let robot: RobotName = "left_arm".parse().expect("a name");
        let manual = ResetNeeds { zone: ResetZone::Manual, acknowledged: false, ..<_>::default() };
        assert_eq!(
            reset(&robot, &manual),
            "acknowledge it at the arm, and then `armada reset left_arm`"
        );
        let signed = ResetNeeds { acknowledged: true, signed: true, ..manual };
        assert_eq!(reset(&robot, &signed), "`armada reset left_arm --key-file FILE`");
    }

    #[test]
    fn what_else_keeps_a_robot_is_told_in_the_words_of_its_agent() {
        let why = |code, message: &str| Why {
            code,
            message: message.to_owned(),
            who: None,
            since_ns: None,
        };
        let why = vec![
            why(WhyCode::StopSource, "door_1 is pressed or silent, heard 42 ms ago"),
            why(WhyCode::Halted, "it is in halt"),
        ];
        let lines = advice(&CellRobotStatus { why, ..online() });
        assert_eq!(lines, ["left_arm: door_1 is pressed or silent, heard 42 ms ago"]);
    }

    #[test]
    fn drives_that_are_off_are_told_with_the_command() {
        let status =
            CellRobotStatus { controller_state: Some(ControllerState::MotorOff), ..online() };
        assert_eq!(advice(&status), ["left_arm: drives are off: `armada enable left_arm`"]);
    }

    #[test]
    fn a_robot_that_is_gone_has_only_one_thing_to_tell() {
        let status = CellRobotStatus { presence: Presence::Lost, ..online() };
        assert_eq!(advice(&status).len(), 1);
        assert!(advice(&status)[0].contains("ramps to standstill by itself"));
    }
}
