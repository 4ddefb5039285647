//! Motions that are paused, resumed, cancelled and queued from the command line.

use anyhow::{Context, Result};
use armada_model::JointTrajectory;
use armada_protocol::messages::{ActionStatus, RobotState};
use armada_tests::{Cell, CellOptions, DEADLINE, wait_for};
use tempfile::TempDir;
use uuid::Uuid;

use crate::support::{done, json, left_arm, part_when, refused};

/// A trajectory as a file for `armada run`.
fn file(folder: &TempDir, name: &str, trajectory: &JointTrajectory) -> Result<String> {
    let path = folder.path().join(name);
    std::fs::write(&path, serde_json::to_vec(trajectory)?)?;
    Ok(path.to_str().context("a path of letters")?.to_owned())
}

/// Starts a trajectory of the left arm without waiting for its end.
fn run(cell: &Cell, file: &str, how: &[&str]) -> Result<Uuid> {
    let start = ["run", file, "--robot", "left_arm", "--no-wait"];
    id_of(&json(cell, &[&start[..], how].concat())?)
}

fn id_of(message: &serde_json::Value) -> Result<Uuid> {
    Ok(message["motion_id"].as_str().context("an identity")?.parse()?)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_rests_on_its_path_while_it_is_paused_and_is_resumed_or_cancelled() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let (client, folder) = (cell.client().await?, tempfile::tempdir()?);
    let robot = "left_arm".parse()?;
    let printed = refused(&cell, &["pause", "left_arm"])?;
    assert!(printed.contains("no motion in progress"), "{printed}");
    let there = file(&folder, "there.json", &left_arm(0.0, 1.0, 8.0))?;
    let motion = run(&cell, &there, &[])?;
    let printed = done(&cell, &["pause", "left_arm"])?;
    assert!(printed.contains(&motion.to_string()), "{printed}");
    let paused = |m: &armada_protocol::messages::MotionStatus| m.status == ActionStatus::Paused;
    let held = part_when(&client, &robot, motion, paused).await?;
    assert!(held.elapsed_s < 8.0, "{held:#?}");
    let states = client.subscribe::<RobotState>("robots/left_arm/state", 1).await?;
    let at_rest = async || {
        let (_, state) = states.next().await.ok()?;
        (state.joint_velocity_command_rad_s[0] == 0.0).then_some(state)
    };
    let state = wait_for("the arm stands", DEADLINE, at_rest).await?;
    assert!((0.0..1.0).contains(&state.joint_position_command_rad[0]), "{state:#?}");
    done(&cell, &["resume", "left_arm"])?;
    let end = part_when(&client, &robot, motion, |m| m.status.is_terminal()).await?;
    assert_eq!((end.status, end.elapsed_s), (ActionStatus::Complete, 8.0), "{end:#?}");
    let back = file(&folder, "back.json", &left_arm(1.0, 0.0, 20.0))?;
    let motion = run(&cell, &back, &[])?;
    done(&cell, &["cancel", "left_arm"])?;
    let end = part_when(&client, &robot, motion, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Cancelled, "{end:#?}");
    let printed = refused(&cell, &["resume", "left_arm", &motion.to_string()])?;
    assert!(printed.contains("not_attached"), "{printed}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn trajectories_are_queued_behind_one_another_or_take_the_place_of_all() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let (client, folder) = (cell.client().await?, tempfile::tempdir()?);
    let robot = "left_arm".parse()?;
    let motions = [left_arm(0.0, 0.4, 8.0), left_arm(0.4, 0.8, 1.5), left_arm(0.8, 0.3, 1.5)];
    let names = ["first", "second", "third"];
    let files = names.iter().zip(&motions).map(|(name, motion)| file(&folder, name, motion));
    let files = files.collect::<Result<Vec<_>>>()?;
    let first = run(&cell, &files[0], &[])?;
    // It must not be over before the others wait behind it.
    done(&cell, &["pause", "left_arm"])?;
    let second = run(&cell, &files[1], &["--queue", "append"])?;
    let third = run(&cell, &files[2], &["--queue", "blended"])?;
    let status = client.robot_status(&robot).await?;
    assert_eq!(status.queued, [second, third], "{status:#?}");
    let printed = refused(&cell, &["run", &files[1], "--robot", "left_arm", "--queue", "append"])?;
    assert!(printed.contains("tolerance"), "it begins elsewhere: {printed}");
    done(&cell, &["cancel", "left_arm", &third.to_string()])?;
    done(&cell, &["resume", "left_arm"])?;
    for (motion, expected) in [
        (first, ActionStatus::Complete),
        (second, ActionStatus::Complete),
        (third, ActionStatus::Cancelled),
    ] {
        let end = part_when(&client, &robot, motion, |m| m.status.is_terminal()).await?;
        assert_eq!(end.status, expected, "{end:#?}");
    }
    replaced(&cell, &folder).await
}

/// One that takes the place of another, and one that is refused because that goes on.
async fn replaced(cell: &Cell, folder: &TempDir) -> Result<()> {
    let (client, robot) = (cell.client().await?, "left_arm".parse()?);
    let slow = file(folder, "slow.json", &left_arm(0.8, 0.0, 20.0))?;
    let other = file(folder, "other.json", &left_arm(0.8, 1.2, 3.0))?;
    let replaced = run(cell, &slow, &[])?;
    let refusal = refused(cell, &["run", &other, "--robot", "left_arm", "--no-approach"])?;
    assert!(refusal.contains("busy"), "{refusal}");
    let replacing = run(cell, &other, &["--queue", "replace"])?;
    let end = part_when(&client, &robot, replaced, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Cancelled, "{end:#?}");
    let end = part_when(&client, &robot, replacing, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
    Ok(())
}
