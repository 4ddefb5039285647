//! A cell comes up and says what it is.

use anyhow::Result;
use armada_protocol::keys;
use armada_protocol::messages::{CellFrames, RobotState};
use armada_tests::{Cell, CellOptions, DEADLINE, wait_for};

#[tokio::test(flavor = "multi_thread")]
async fn every_robot_has_its_own_processes_and_is_ready() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    for robot in cell.robots()? {
        assert_ne!(cell.agent_pid(robot.as_str())?, cell.emulator_pid(robot.as_str())?);
        let info = client.robot_info(&robot).await?;
        assert_eq!(info.robot, robot);
        assert!(!info.urdf.is_empty());
    }
    assert_eq!(cell.processes()?.len(), 7, "an agent and an emulator each, and the gateway");
    let info = client.cell_info().await?;
    assert_eq!(info.robots.len(), 3);
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_status_command_shows_every_robot_to_people_and_to_scripts() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let (table, code) = cell.run(&["status"])?;
    assert_eq!(code, 0, "{table}");
    for word in ["left_arm", "right_arm", "torso", "online", "halt"] {
        assert!(table.contains(word), "{word} is not in:\n{table}");
    }
    let (json, code) = cell.run(&["status", "--json"])?;
    assert_eq!(code, 0, "{json}");
    let status: serde_json::Value = serde_json::from_str(&json)?;
    assert_eq!(status["verdict"], "ready");
    for robot in cell.robots()? {
        assert_eq!(status["robots"][robot.as_str()]["presence"], "online", "{json}");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_link_of_every_robot_has_a_pose_in_the_world() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let frames = client.subscribe::<CellFrames>(&keys::CELL_FRAMES.any(), 8).await?;
    let full = wait_for("all frames", DEADLINE, async || {
        let (_, message) = frames.next().await.ok()?;
        message.full.then_some(message)
    })
    .await?;
    let left = full.frames.get("left_arm/base_link").expect("the left arm's root");
    assert!((left.position() - nalgebra::Vector3::new(0.0, 0.45, 0.75)).norm() < 1e-9);
    for link in ["left_arm/tool0", "right_arm/tool0", "torso/carriage"] {
        assert!(full.frames.contains_key(link), "{link} is not in {:?}", full.frames.keys());
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_state_comes_once_whether_routed_or_straight() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    for client in [cell.routed_client().await?, cell.client().await?] {
        let states = client.subscribe::<RobotState>(&keys::ROBOT_STATE.any(), 1024).await?;
        let mut last = std::collections::BTreeMap::new();
        let read = async {
            for _ in 0..300 {
                let (key, state) = states.next().await?;
                let before = last.insert(key.clone(), state.seqno);
                assert!(before.is_none_or(|before| before < state.seqno), "{key} came twice");
            }
            anyhow::Ok(())
        };
        tokio::time::timeout(DEADLINE, read).await??;
        assert_eq!(last.len(), 3, "{:?}", last.keys());
    }
    Ok(())
}
