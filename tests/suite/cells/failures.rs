//! Processes die; what is left stands still and says so.

use std::time::Duration;

use anyhow::Result;
use armada_protocol::client::StopOptions;
use armada_protocol::messages::{
    ActionStatus, CellStatus, CellVerdict, DenialCode, Presence, RobotState, StopVerdict,
};
use armada_protocol::{RobotName, keys};
use armada_tests::{Cell, CellOptions, DEADLINE, kill, monotonic, wait_for};

use crate::support::{both_arms, execute, motion_when, stop_request};

/// Time in which a cell says that a robot's agent is gone.
const NOTICE: Duration = Duration::from_millis(1500);

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_that_dies_is_reported_and_its_partner_stops() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let motion = execute(&client, both_arms(2.0, 6.0)).await?.motion_id;
    motion_when(&client, motion, |m| m.parts.values().all(|part| part.elapsed_s > 0.5)).await?;
    let left: RobotName = "left_arm".parse()?;
    let statuses = client.subscribe::<CellStatus>(&keys::CELL_STATUS.any(), 64).await?;
    let killed = monotonic();
    kill(cell.agent_pid("left_arm")?)?;
    let gone = |status: &CellStatus| {
        status.robots.get(&left).is_some_and(|robot| robot.presence == Presence::Lost)
    };
    let told = async {
        loop {
            let (_, status) = statuses.next().await?;
            if gone(&status) {
                return anyhow::Ok(status);
            }
        }
    };
    let status = tokio::time::timeout(DEADLINE, told).await??;
    assert_eq!(status.verdict, CellVerdict::Degraded);
    // Processes of one machine share its clock.
    let took = status.stamp_ns.saturating_since(killed);
    assert!(took <= NOTICE, "told after {took:?}");
    let end = motion_when(&client, motion, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Failed, "{end:#?}");
    let right = "right_arm".parse()?;
    let part = client.motion(&right, motion).await?;
    // The partner's agent noticed it by itself.
    assert_eq!(part.status, ActionStatus::Failed, "{part:#?}");
    assert!(part.elapsed_s < 6.0);
    let reason = part.reason.expect("a reason");
    assert_eq!(reason.code, DenialCode::CommunicationLost, "{reason}");
    assert_eq!(reason.details["partner"], "left_arm", "{reason}");
    // Whoever names no robot is told of those that the gateway knows.
    let options = StopOptions { expected: Vec::new(), timeout: Duration::from_secs(2) };
    let report = client.stop(stop_request(), options).await?;
    assert_eq!(report.verdict, StopVerdict::Incomplete, "{report:#?}");
    assert_eq!(report.missing, [left], "{report:#?}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn invariant_09_arms_stop_on_command_when_the_gateway_which_is_the_router_is_dead()
-> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let motion = execute(&client, both_arms(2.0, 6.0)).await?.motion_id;
    motion_when(&client, motion, |m| m.parts.values().all(|part| part.elapsed_s > 0.5)).await?;
    kill(cell.gateway_pid()?)?;
    let (printed, code) = tokio::task::block_in_place(|| cell.run(&["stop", "--json"]))?;
    assert_eq!(code, 0, "{printed}");
    assert!(printed.contains("\"complete\""), "{printed}");
    for robot in cell.robots()? {
        let status = client.robot_status(&robot).await?;
        assert!(status.stop.is_some(), "{robot} is not stopped");
        assert!(status.motion.is_none(), "{robot} is in motion");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_reaches_standstill_everywhere_and_a_reset_lets_the_cell_go_on() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let motion = execute(&client, both_arms(2.0, 6.0)).await?.motion_id;
    motion_when(&client, motion, |m| m.parts.values().all(|part| part.elapsed_s > 0.5)).await?;
    let options = StopOptions { expected: cell.robots()?, timeout: Duration::from_secs(5) };
    let report = client.stop(stop_request(), options).await?;
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:#?}");
    let end = motion_when(&client, motion, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Failed);
    let stopped = |s: &CellStatus| s.verdict == CellVerdict::Stopped;
    cell.status_when(&client, "the cell is stopped", DEADLINE, stopped).await?;
    let refused = execute(&client, both_arms(0.1, 1.0)).await.expect_err("stopped");
    assert!(refused.to_string().contains("stopped"), "{refused:#}");
    let (printed, code) = tokio::task::block_in_place(|| cell.run(&["reset", "--yes"]))?;
    assert_eq!(code, 0, "{printed}");
    let ready = |s: &CellStatus| s.verdict == CellVerdict::Ready;
    cell.status_when(&client, "the cell is ready", DEADLINE, ready).await?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_controller_that_dies_is_a_fault_of_its_robot_only() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    kill(cell.emulator_pid("torso")?)?;
    let torso = "torso".parse()?;
    let faulted = |status: &CellStatus| {
        status.robots.get(&torso).is_some_and(|robot| !robot.faults.is_empty())
    };
    let status = cell.status_when(&client, "the torso has a fault", DEADLINE, faulted).await?;
    assert_eq!(status.verdict, CellVerdict::Degraded);
    let accepted = execute(&client, both_arms(0.2, 1.0)).await?;
    let end = motion_when(&client, accepted.motion_id, |m| m.status.is_terminal()).await?;
    assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_that_stops_running_is_lost_and_comes_back() -> Result<()> {
    let cell = Cell::start(CellOptions::default()).await?;
    let client = cell.client().await?;
    let states = client.subscribe::<RobotState>("robots/torso/state", 1).await?;
    states.next().await?;
    let pid = cell.agent_pid("torso")?;
    armada_tests::signal(pid, rustix::process::Signal::STOP)?;
    let torso = "torso".parse()?;
    let presence = |status: &CellStatus, wanted| {
        status.robots.get(&torso).is_some_and(|robot| robot.presence == wanted)
    };
    let lost = |s: &CellStatus| presence(s, Presence::Lost);
    cell.status_when(&client, "the torso is lost", DEADLINE, lost).await?;
    armada_tests::signal(pid, rustix::process::Signal::CONT)?;
    let back = |s: &CellStatus| presence(s, Presence::Online);
    cell.status_when(&client, "the torso is back", DEADLINE, back).await?;
    let fresh = async || states.next().await.ok();
    wait_for("its state comes again", DEADLINE, fresh).await?;
    Ok(())
}
