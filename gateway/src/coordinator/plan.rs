//! A trajectory of several robots, taken apart and checked before anybody is asked.

use std::collections::{BTreeMap, BTreeSet};

use armada_model::JointTrajectory;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    CellExecuteTrajectory, CommandMode, Denial, DenialCode, GroupReadiness, LeaseLoss,
    OperationalMode, Prepared, RobotStatus,
};

use super::robot::RobotRecord;

/// Longest time a motion may go on without its lease \[s\].
const MAX_CONTINUE_S: f64 = 60.0;
/// Longest way to rest that is believed \[s\].
const MAX_STOP_TIME_S: f64 = 60.0;
/// Greatest lateness of a controller that is made up for \[ms\].
const MAX_LAG_MS: f64 = 1_000.0;

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

/// Refuses what a request says of robots that take no part in it, of revisions that are not those
/// of the robots, and a time to go on that makes no sense.
pub(super) fn check_terms<T>(
    params: &CellExecuteTrajectory,
    parts: &BTreeMap<RobotName, T>,
    robots: &BTreeMap<RobotName, RobotRecord>,
) -> Result<(), Denial> {
    let leases = params.leases.keys().map(|robot| ("leases", robot));
    let named = leases.chain(params.model_revs.keys().map(|robot| ("model_revs", robot)));
    for (field, robot) in named {
        if !parts.contains_key(robot) {
            let message = format!("{field} names {robot}, which takes no part in the motion");
            return Err(invalid(message).with("field", field).with("robot", robot.as_str()));
        }
    }
    for (robot, wanted) in &params.model_revs {
        let known = robots.get(robot).and_then(|record| record.model_rev);
        if let Some(known) = known.filter(|known| known != wanted) {
            return Err(stale_model(robot, known, *wanted));
        }
    }
    if let LeaseLoss::ContinueS(time_s) = params.on_lease_loss
        && !(time_s > 0.0 && time_s <= MAX_CONTINUE_S)
    {
        let message =
            format!("on_lease_loss.continue_s is {time_s}, expected above 0 to {MAX_CONTINUE_S}");
        let denial = Denial::new(DenialCode::OutOfRange, message);
        return Err(denial.with("field", "on_lease_loss").with("limit", MAX_CONTINUE_S));
    }
    Ok(())
}

fn stale_model(robot: &RobotName, known: u64, wanted: u64) -> Denial {
    let message = format!(
        "its tools and payloads are those of revision {known}, the motion is for {wanted}: plan it anew"
    );
    of(robot, DenialCode::StaleModel, &message).with("model_rev", known).with("wanted", wanted)
}

/// What the agent of `robot` says of its part of a motion with partners.
///
/// Refuses an agent that knows nothing of partners, numbers that make no sense, and a description
/// that the gateway has not got, or the motion was not made for.
pub(super) fn readiness(
    robot: &RobotName,
    prepared: &Prepared,
    wanted_rev: Option<u64>,
    known_rev: Option<u64>,
) -> Result<GroupReadiness, Denial> {
    let readiness = prepared.group.ok_or_else(|| {
        let message = "its agent knows nothing of motions with partners, update it";
        of(robot, DenialCode::NotSupported, message)
    })?;
    let numbers = [
        ("stop_time_s", readiness.stop_time_s, MAX_STOP_TIME_S),
        ("rate_slope_s", readiness.rate_slope_s, f64::MAX),
        ("start_travel", readiness.start_travel, f64::MAX),
        ("controller_lag_ms", readiness.controller_lag_ms, MAX_LAG_MS),
    ];
    for (field, value, most) in numbers {
        if !(0.0..=most).contains(&value) {
            let message = format!("its agent answers {field} {value}, expected 0 to {most}");
            let denial = of(robot, DenialCode::OutOfRange, &message);
            return Err(denial.with("field", field).with("value", value).with("limit", most));
        }
    }
    if let Some(wanted) = wanted_rev.filter(|wanted| *wanted != readiness.model_rev) {
        return Err(stale_model(robot, readiness.model_rev, wanted));
    }
    if known_rev.is_some_and(|known| known != readiness.model_rev) {
        let message = "the description of its tools and payloads is on its way, try again";
        return Err(of(robot, DenialCode::NotReady, message));
    }
    Ok(readiness)
}

/// Robots that move within their limits at reduced speed, as their agents take the key switch.
pub(super) fn reduced(robots: &BTreeMap<RobotName, RobotRecord>) -> BTreeSet<RobotName> {
    let is_reduced = |record: &RobotRecord| {
        let mode = record.status.as_ref().map(|status| status.operational_mode);
        matches!(mode, Some(OperationalMode::ManualReducedSpeed | OperationalMode::Undefined))
    };
    let reduced = robots.iter().filter(|(_, record)| is_reduced(record));
    reduced.map(|(robot, _)| robot.clone()).collect()
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

/// Whether nobody knows what became of what was asked.
pub(super) const fn is_unknown(denial: &Denial) -> bool {
    use DenialCode::{CommunicationLost, Timeout, Unreachable};
    matches!(denial.code, Timeout | Unreachable | CommunicationLost)
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
