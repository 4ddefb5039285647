//! Commands to the default cell, and motions of it.

use std::f64::consts::FRAC_PI_2;

use anyhow::{Context, Result};
use armada_model::{JointTrajectory, Waypoint};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    Accepted, CellExecuteTrajectory, CellMotionStatus, DenialCode, MotionStatus, StopLevel,
    StopRequest, StopScope,
};
use armada_protocol::method::cell::ExecuteTrajectory;
use armada_tests::{Cell, DEADLINE, wait_for};
use uuid::Uuid;

/// Runs a command that has to succeed; returns what it printed.
pub(crate) fn done(cell: &Cell, arguments: &[&str]) -> Result<String> {
    let (printed, code) = cell.run(arguments)?;
    assert_eq!(code, 0, "{arguments:?}: {printed}");
    Ok(printed)
}

/// Runs a command that has to fail; returns what it printed.
pub(crate) fn refused(cell: &Cell, arguments: &[&str]) -> Result<String> {
    let (printed, code) = cell.run(arguments)?;
    assert_ne!(code, 0, "{arguments:?}: {printed}");
    Ok(printed)
}

/// Runs a command that has to succeed with `--json`; returns what it printed.
pub(crate) fn json(cell: &Cell, arguments: &[&str]) -> Result<serde_json::Value> {
    let printed = done(cell, &[arguments, &["--json"]].concat())?;
    let mut values = serde_json::Deserializer::from_str(&printed).into_iter();
    values.next().context("no JSON")?.with_context(|| printed.clone())
}

const ARM: [(&str, f64); 6] = [
    ("shoulder_pan_joint", 0.0),
    ("shoulder_lift_joint", -FRAC_PI_2),
    ("elbow_joint", FRAC_PI_2),
    ("wrist_1_joint", -FRAC_PI_2),
    ("wrist_2_joint", -FRAC_PI_2),
    ("wrist_3_joint", 0.0),
];

/// Turns the first joint of the left arm from `from` to `to`, the others as at the start.
pub(crate) fn left_arm(from: f64, to: f64, duration_s: f64) -> JointTrajectory {
    let waypoint = |time_from_start_s, first| {
        let mut joint_position: Vec<f64> = ARM.iter().map(|(_, at)| *at).collect();
        joint_position[0] = first;
        Waypoint { time_from_start_s, joint_position, ..Waypoint::default() }
    };
    JointTrajectory {
        joint_names: ARM.iter().map(|(joint, _)| (*joint).to_owned()).collect(),
        waypoints: vec![waypoint(0.0, from), waypoint(duration_s, to)],
        ..JointTrajectory::default()
    }
}

/// Turns the first joint of both arms from where they start, by `angle_rad` in `duration_s`.
pub(crate) fn both_arms(angle_rad: f64, duration_s: f64) -> JointTrajectory {
    let joints = ["left_arm", "right_arm"]
        .iter()
        .flat_map(|arm| ARM.iter().map(move |(joint, at)| (format!("{arm}/{joint}"), *at)));
    let (joint_names, start): (Vec<_>, Vec<_>) = joints.unzip();
    let mut goal = start.clone();
    goal[0] += angle_rad;
    goal[6] += angle_rad;
    let waypoint = |time_from_start_s, joint_position| Waypoint {
        time_from_start_s,
        joint_position,
        ..Waypoint::default()
    };
    JointTrajectory {
        joint_names,
        waypoints: vec![waypoint(0.0, start), waypoint(duration_s, goal)],
        ..JointTrajectory::default()
    }
}

/// Starts a motion of several robots, as soon as clocks and links of a busy machine allow it.
pub(crate) async fn execute(client: &Client, trajectory: JointTrajectory) -> Result<Accepted> {
    use DenialCode::{CommunicationLost, NotReady, Timeout};
    let ask = async || {
        let params = CellExecuteTrajectory::new(None, trajectory.clone());
        match client.call_cell::<ExecuteTrajectory>(params).await {
            Err(ClientError::Denied(denial))
                if matches!(denial.code, CommunicationLost | NotReady | Timeout) =>
            {
                None
            }
            answer => Some(answer),
        }
    };
    Ok(wait_for("the motion is accepted", DEADLINE, ask).await??)
}

/// The status of a cell's motion as soon as it satisfies `condition`.
pub(crate) async fn motion_when(
    client: &Client,
    id: Uuid,
    condition: impl Fn(&CellMotionStatus) -> bool,
) -> Result<CellMotionStatus> {
    let look = async || client.cell_motion(id).await.ok().filter(|motion| condition(motion));
    wait_for("the motion is as expected", DEADLINE, look).await
}

/// The status of one robot's motion as soon as it satisfies `condition`.
pub(crate) async fn part_when(
    client: &Client,
    robot: &RobotName,
    id: Uuid,
    condition: impl Fn(&MotionStatus) -> bool,
) -> Result<MotionStatus> {
    let look = async || client.motion(robot, id).await.ok().filter(|motion| condition(motion));
    wait_for("the motion is as expected", DEADLINE, look).await
}

pub(crate) fn stop_request() -> StopRequest {
    StopRequest {
        stop_id: Uuid::now_v7(),
        source: "test".to_owned(),
        level: StopLevel::L2,
        scope: StopScope::Cell,
        reason: "test".to_owned(),
        seq: 0,
    }
}
