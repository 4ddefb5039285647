//! A trajectory of several robots, taken apart and checked before anybody is asked.

use std::collections::{BTreeMap, BTreeSet};

use armada_model::JointTrajectory;
use armada_protocol::RobotName;
use armada_protocol::messages::{CommandMode, Denial, DenialCode, RobotStatus};

use super::robot::RobotRecord;

/// Splits `trajectory`, whose joints are named `robot/joint`, into one trajectory per robot.
///
/// Refuses names that are no such names, robots and joints the cell does not have, joints that are
/// missing or doubled, rows of wrong length, and robots whose agents are not there.
pub(super) fn split(
    trajectory: &JointTrajectory,
    robots: &BTreeMap<RobotName, RobotRecord>,
) -> Result<BTreeMap<RobotName, JointTrajectory>, Denial> {
    let mut columns: BTreeMap<RobotName, (Vec<usize>, Vec<String>)> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    for (column, name) in trajectory.joint_names.iter().enumerate() {
        if !seen.insert(name) {
            let message = format!("joint_names has {name} more than once");
            return Err(invalid(message).with("joint", name.as_str()));
        }
        let (robot, joint) = robot_and_joint(name, robots)?;
        let (numbers, names) = columns.entry(robot).or_default();
        numbers.push(column);
        names.push(joint.to_owned());
    }
    if columns.is_empty() {
        return Err(invalid("joint_names is empty").with("field", "joint_names"));
    }
    let mut parts = BTreeMap::new();
    for (robot, (numbers, names)) in columns {
        check_joints(&robot, &names, robots)?;
        let part =
            trajectory.select(&numbers, names).map_err(|error| invalid(error.to_string()))?;
        parts.insert(robot, part);
    }
    Ok(parts)
}

fn robot_and_joint<'n>(
    name: &'n str,
    robots: &BTreeMap<RobotName, RobotRecord>,
) -> Result<(RobotName, &'n str), Denial> {
    let (robot_text, joint) = name.split_once('/').ok_or_else(|| {
        let message = format!("joint_names has {name:?}, expected ROBOT/JOINT");
        invalid(message).with("joint", name)
    })?;
    let robot = robots.keys().find(|robot| robot.as_str() == robot_text).ok_or_else(|| {
        let known = robots.keys().map(RobotName::as_str).collect::<Vec<_>>().join(", ");
        let message = format!("the cell has no robot {robot_text:?}, it has {known}");
        invalid(message).with("robot", robot_text).with("joint", name)
    })?;
    Ok((robot.clone(), joint))
}

fn check_joints(
    robot: &RobotName,
    names: &[String],
    robots: &BTreeMap<RobotName, RobotRecord>,
) -> Result<(), Denial> {
    let record = robots.get(robot).filter(|record| record.is_online());
    let record = record.ok_or_else(|| offline(robot))?;
    let known = record.joints.as_ref().ok_or_else(|| {
        of(robot, DenialCode::NotReady, "its description has not been received yet, try again")
    })?;
    if let Some(unknown) = names.iter().find(|name| !known.contains(name)) {
        let message = format!("it has no joint {unknown:?}, it has {}", known.join(", "));
        let denial = of(robot, DenialCode::InvalidArgument, &message);
        return Err(denial.with("joint", format!("{robot}/{unknown}")));
    }
    if let Some(missing) = known.iter().find(|joint| !names.contains(joint)) {
        let message = format!("joint_names lacks its joint {missing}: every joint must be named");
        let denial = of(robot, DenialCode::InvalidArgument, &message);
        return Err(denial.with("joint", format!("{robot}/{missing}")));
    }
    Ok(())
}

/// Whether the robot must change to mode `trajectory` first.
///
/// Refuses a robot with a latched stop, with faults, or in a mode that is neither `halt` nor
/// `trajectory`.
pub(super) fn must_change_mode(robot: &RobotName, status: &RobotStatus) -> Result<bool, Denial> {
    if let Some(latch) = &status.stop {
        let by = latch.stops.first().map_or("", |stop| stop.source.as_str());
        let message =
            format!("a stop of level {:?} by {by:?} is latched, reset it first", latch.level);
        let ids: Vec<_> = latch.stops.iter().map(|stop| stop.stop_id.to_string()).collect();
        return Err(of(robot, DenialCode::Stopped, &message).with("stop_ids", ids));
    }
    if let Some(fault) = status.faults.first() {
        let message = format!("a fault is latched, clear it with reset_errors: {}", fault.message);
        return Err(of(robot, DenialCode::Faulted, &message));
    }
    match status.command_mode {
        CommandMode::Halt => Ok(true),
        CommandMode::Trajectory => Ok(false),
        CommandMode::InvalidState => {
            let next = status.next.join("; ");
            let hint = if next.is_empty() { "no reason is known".to_owned() } else { next };
            Err(of(robot, DenialCode::NotReady, &format!("it cannot be commanded: {hint}")))
        }
        mode => {
            let message = format!("its mode is {}, halt it first", mode_name(mode));
            Err(of(robot, DenialCode::WrongMode, &message).with("command_mode", mode_name(mode)))
        }
    }
}

fn mode_name(mode: CommandMode) -> String {
    serde_json::to_value(mode)
        .ok()
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_default()
}

/// The denial of a robot whose agent is not there.
pub(super) fn offline(robot: &RobotName) -> Denial {
    of(robot, DenialCode::Unreachable, "its agent is not on the bus")
}

/// A denial because of one robot.
pub(super) fn of(robot: &RobotName, code: DenialCode, message: &str) -> Denial {
    Denial::new(code, format!("{robot}: {message}")).with("robot", robot.as_str())
}

/// The same denial, saying which robot's agent it is of.
pub(super) fn by(robot: &RobotName, denial: Denial) -> Denial {
    let message = format!("{robot}: {}", denial.message);
    Denial { message, ..denial }.with("robot", robot.as_str())
}

fn invalid(message: impl Into<String>) -> Denial {
    Denial::new(DenialCode::InvalidArgument, message)
}
