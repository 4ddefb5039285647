//! Moves that are left to the controller, over Zenoh and its datagrams.

use anyhow::{Context, Result};
use armada_model::Pose;
use armada_protocol::client::{Client, StopOptions};
use armada_protocol::messages::{ActionStatus, Executor, MotionKind, MotionStatus, StopVerdict};
use armada_tests::{Cell, CellOptions, DEADLINE, wait_for};
use uuid::Uuid;

use crate::support::{done, json, part_when, stop_request};

/// Robots whose controllers move by themselves, and are left to it.
const DELEGATING: CellOptions = CellOptions {
    demo: false,
    robot_files: &[("delegate: never", "delegate: auto"), ("own_moves: false", "own_moves: true")],
};

/// Pose of the tool of the left arm, moved in the base's axes.
fn shifted(cell: &Cell, x: f64, y: f64, z: f64) -> Result<String> {
    let tcp = serde_json::from_value(json(cell, &["tcp", "left_arm"])?["tcp"].clone())?;
    Ok(serde_json::to_string(&(Pose::from_translation(x, y, z) * tcp))?)
}

fn ended(message: serde_json::Value) -> Result<MotionStatus> {
    serde_json::from_value(message.clone()).with_context(|| message.to_string())
}

/// Starts a move of the left arm and waits until the controller makes it.
async fn begun(cell: &Cell, client: &Client, how: &[&str]) -> Result<Uuid> {
    let start = ["move", "left_arm", "--no-wait", "--speed", "0.05"];
    let accepted = json(cell, &[&start[..], how].concat())?;
    let id = accepted["motion_id"].as_str().context("an identity")?.parse()?;
    let robot = "left_arm".parse()?;
    let running = |m: &MotionStatus| m.status == ActionStatus::Running;
    let motion = part_when(client, &robot, id, running).await?;
    assert_eq!(motion.executor, Executor::Controller, "{motion:#?}");
    Ok(id)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_controller_makes_moves_to_joints_poses_and_along_lines() -> Result<()> {
    let cell = Cell::start(DELEGATING).await?;
    let move_to = |option: &str, pose: &str| {
        let message = json(&cell, &["move", "left_arm", option, pose, "--speed", "0.5"])?;
        ended(message)
    };
    let home = ended(json(&cell, &["move", "left_arm", "--home"])?)?;
    let by_joints = move_to("--pose", &shifted(&cell, -0.1, 0.15, 0.1)?)?;
    let goal = shifted(&cell, 0.05, -0.1, -0.05)?;
    let straight = move_to("--linear", &goal)?;
    for (end, kind) in [
        (home, MotionKind::MoveJoint),
        (by_joints, MotionKind::MovePose),
        (straight, MotionKind::MoveLinear),
    ] {
        assert_eq!((end.status, end.kind), (ActionStatus::Complete, kind), "{end:#?}");
        assert_eq!(end.executor, Executor::Controller, "{end:#?}");
    }
    let (goal, is): (Pose, Pose) =
        (serde_json::from_str(&goal)?, serde_json::from_str(&shifted(&cell, 0.0, 0.0, 0.0)?)?);
    let (distance, angle) = is.distance(&goal);
    assert!(distance < 1e-3 && angle < 1e-3, "{distance} m, {angle} rad off");
    // The loop takes over where the controller left the arm.
    done(&cell, &["move", "left_arm", "--joints", "wrist_3_joint=0.3"])?;
    let message = json(&cell, &["move", "left_arm", "--home", "--executor", "agent"])?;
    assert_eq!(ended(message)?.executor, Executor::Agent);
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn moves_of_the_controller_are_paused_resumed_and_cancelled() -> Result<()> {
    let cell = Cell::start(DELEGATING).await?;
    let (client, robot) = (cell.client().await?, "left_arm".parse()?);
    let goal = shifted(&cell, -0.1, 0.2, 0.1)?;
    let id = begun(&cell, &client, &["--linear", &goal]).await?;
    done(&cell, &["pause", "left_arm"])?;
    let paused = |m: &MotionStatus| m.status == ActionStatus::Paused;
    part_when(&client, &robot, id, paused).await?;
    done(&cell, &["resume", "left_arm"])?;
    part_when(&client, &robot, id, |m| m.status == ActionStatus::Running).await?;
    done(&cell, &["cancel", "left_arm"])?;
    let end = part_when(&client, &robot, id, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Cancelled, "{end:#?}");
    let message = json(&cell, &["move", "left_arm", "--linear", &goal])?;
    assert_eq!(ended(message)?.status, ActionStatus::Complete);
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_ends_a_move_of_the_controller_at_measured_standstill() -> Result<()> {
    let cell = Cell::start(DELEGATING).await?;
    let (client, robot) = (cell.client().await?, "left_arm".parse()?);
    let goal = shifted(&cell, -0.1, 0.2, 0.1)?;
    let id = begun(&cell, &client, &["--pose", &goal]).await?;
    let options = StopOptions { expected: cell.robots()?, timeout: DEADLINE };
    let report = client.stop(stop_request(), options).await?;
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:#?}");
    let end = part_when(&client, &robot, id, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Failed, "{end:#?}");
    done(&cell, &["reset", "--yes"])?;
    let clear = async || client.robot_status(&robot).await.ok()?.stop.is_none().then_some(());
    wait_for("the stop is reset", DEADLINE, clear).await?;
    let message = json(&cell, &["move", "left_arm", "--pose", &goal])?;
    assert_eq!(ended(message)?.status, ActionStatus::Complete);
    Ok(())
}
