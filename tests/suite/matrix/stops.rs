//! Rows 10, 11 and 18: a stop button that is lost, an arm that does not answer, an agent that is
//! restarted while a stop is latched.

use std::time::Duration;

use anyhow::{Context, Result};
use armada_protocol::client::StopOptions;
use armada_protocol::messages::*;
use armada_protocol::method::robot::{Enable, Reset};
use armada_tests::{NetCellOptions, Quality, in_network, monotonic};
use uuid::Uuid;

use crate::support::{Bed, Watch, assert_within, denial, is_commanded};

/// Silence of a source of stops after which the robots stop.
const SILENCE: Duration = Duration::from_millis(500);
/// How often the agents look.
const LOOK: Duration = Duration::from_millis(20);
/// The button that both arms ask.
const BUTTON: &str = "stop:\n  sources: [{ name: door_1, level: L1 }]\n";

#[test]
fn stops_hold_over_lost_buttons_silent_arms_and_restarts() -> Result<()> {
    in_network("failure matrix, stops", async |network| {
        let mut bed = Bed::start(network, NetCellOptions::default()).await?;
        row_11_stop_ack_missing(&bed).await.context("row 11")?;
        row_18_agent_restart_while_latched(&mut bed).await.context("row 18")
    })
}

#[test]
fn a_stop_button_whose_link_is_lost_stops_its_scope() -> Result<()> {
    in_network("failure matrix, stop button", async |network| {
        let options = NetCellOptions {
            edit_robot: with_button,
            hosts: vec!["button"],
            stopped_at_start: true,
            ..NetCellOptions::default()
        };
        let bed = Bed::start(network, options).await?;
        row_10_remote_stop_button_loses_its_link(&bed).await.context("row 10")
    })
}

/// Agents, challenge, 500 ms: L1, latched; button fresh and released, and a reset.
async fn row_10_remote_stop_button_loses_its_link(bed: &Bed) -> Result<()> {
    // Never heard is as good as pressed.
    for robot in bed.robots() {
        let status = bed.status_when(robot, "it is stopped", |s| s.stop.is_some()).await?;
        let latch = status.stop.context("just seen")?;
        assert!(latch.stops.iter().any(|stop| stop.source == "door_1"), "{latch:#?}");
        let refused = denial(bed.client.call::<Reset>(robot, latch.reset_params()).await);
        assert_eq!(refused.code, DenialCode::NotReady, "{refused}");
        assert!(refused.message.contains("door_1"), "{refused}");
    }
    let mut button = bed.cell.spawn(
        "button",
        "button",
        &["stop-button", "--name", "door_1", "--stdin-level", "--repeat", "never"],
    )?;
    button.write_line("released")?;
    let fresh = |status: &RobotStatus| !status.stop_sources.iter().any(|source| source.pressed);
    for robot in bed.robots() {
        let heard = bed.status_when(robot, "the button is heard", fresh).await;
        let status = heard.with_context(|| button.printed())?;
        assert!(status.stop.is_some(), "that it is released clears nothing");
    }
    bed.make_ready().await?;
    let mut watch = Watch::of(&bed.client, &bed.left).await?;
    let id = bed.move_both(Coupling::TimeSynced, 6.0).await?;
    let cut = monotonic();
    bed.cell.network.set_host("button", Quality::CUT)?;
    for robot in bed.robots() {
        let status = bed.status_when(robot, "it is stopped", |s| s.stop.is_some()).await?;
        let latch = status.stop.context("just seen")?;
        assert_eq!(latch.level, StopLevel::L1, "{latch:#?}");
        assert!(latch.stops.iter().any(|stop| stop.source == "door_1"), "{latch:#?}");
        bed.end_of(robot, id).await?;
    }
    let stop = |event: &Event| event.kind == EventKind::Stop && event.stamp_ns > cut;
    let stopped = watch.event_when("the stop", stop).await?.stamp_ns;
    assert_within("row 10: link lost to stop", cut, stopped, SILENCE + LOOK);
    let age = stopped.saturating_since(cut);
    assert!(age > SILENCE / 2, "not before it was silent for long: {age:?}");
    let off = |status: &RobotStatus| {
        status.stop.as_ref().is_some_and(|latch| latch.stage == StopStage::DrivesOff)
    };
    bed.status_when(&bed.left, "its drives are off", off).await?;
    watch.assert_ramped();
    // While it is not heard no reset is granted; afterwards one is needed.
    let latch = bed.client.robot_status(&bed.left).await?.stop.context("latched")?;
    let refused = denial(bed.client.call::<Reset>(&bed.left, latch.reset_params()).await);
    assert!(refused.message.contains("door_1"), "{refused}");
    bed.cell.network.set_host("button", Quality::default())?;
    let status = bed.status_when(&bed.left, "the button is heard", fresh).await?;
    assert!(status.stop.is_some(), "that it is heard clears nothing");
    bed.make_ready().await?;
    bed.work_again().await?;
    // Whoever presses it stops both.
    button.write_line("pressed")?;
    for robot in bed.robots() {
        bed.status_when(robot, "it is stopped", |status| status.stop.is_some()).await?;
    }
    Ok(())
}

/// Requester, deadline of standstill: incomplete by name; the stop is repeated, and gets through to
/// the arm when that answers again.
async fn row_11_stop_ack_missing(bed: &Bed) -> Result<()> {
    bed.move_both(Coupling::Independent, 6.0).await?;
    bed.cell.agents["right_arm"].freeze()?;
    let request = stop_request();
    let robots = bed.robots().map(Clone::clone).to_vec();
    let options = StopOptions { expected: robots, timeout: Duration::from_secs(3) };
    let stopped = monotonic();
    let report = bed.client.stop(request.clone(), options).await?;
    assert_eq!(report.verdict, StopVerdict::Incomplete, "{report:#?}");
    assert_eq!(report.missing, std::slice::from_ref(&bed.right), "{report:#?}");
    let left = report.acks.iter().find(|ack| ack.robot == bed.left).context("left_arm")?;
    assert!(left.stage >= StopStage::Standstill, "{left:#?}");
    let stop_time = Duration::from_millis(400);
    assert_within("row 11: stop to the other's standstill", stopped, left.stamp_ns, stop_time);
    // The controller has stopped the arm by itself; a person learns which to look after.
    let (printed, code) = bed.cell.run(&["stop", "--timeout", "2"])?;
    assert!(code != 0 && printed.contains("right_arm"), "{code}: {printed}");
    bed.cell.agents["right_arm"].thaw()?;
    let report = bed.client.stop(
        request,
        StopOptions {
            expected: bed.robots().map(Clone::clone).to_vec(),
            timeout: Duration::from_secs(10),
        },
    );
    let report = report.await?;
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:#?}");
    let status = bed.client.robot_status(&bed.right).await?;
    assert!(status.stop.is_some() && status.motion.is_none(), "{status:#?}");
    bed.make_ready().await?;
    bed.work_again().await
}

/// The latch is on disk: still latched after a restart, until a reset that lists all of it.
async fn row_18_agent_restart_while_latched(bed: &mut Bed) -> Result<()> {
    let request = stop_request();
    let robots = bed.robots().map(Clone::clone).to_vec();
    let options = StopOptions { expected: robots, timeout: Duration::from_secs(5) };
    let report = bed.client.stop(request.clone(), options).await?;
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:#?}");
    let boot = bed.client.robot_status(&bed.left).await?.boot_id;
    let agent = bed.cell.agent("left_arm")?;
    agent.kill()?;
    agent.start()?;
    let restarted = |status: &RobotStatus| {
        status.boot_id != boot && status.controller_state != ControllerState::Undefined
    };
    let status = bed.status_when(&bed.left, "it is back", restarted).await?;
    let latch = status.stop.clone().with_context(|| format!("not latched: {status:#?}"))?;
    let ids: Vec<Uuid> = latch.stops.iter().map(|stop| stop.stop_id).collect();
    assert!(ids.contains(&request.stop_id), "{latch:#?}");
    assert!(latch.stops.iter().any(|stop| stop.source == "agent_lost"), "{latch:#?}");
    let mut watch = Watch::of(&bed.client, &bed.left).await?;
    let refused = denial(bed.client.call::<Enable>(&bed.left, Empty {}).await);
    assert_eq!(refused.code, DenialCode::Stopped);
    let mut lacking = latch.reset_params();
    lacking.stop_ids.retain(|id| *id != request.stop_id);
    let refused = denial(bed.client.call::<Reset>(&bed.left, lacking.clone()).await);
    assert_eq!(refused.code, DenialCode::InvalidArgument, "{refused}");
    // The number of that attempt is used up: a copy of a reset is worth nothing.
    let replayed = ResetParams { stop_ids: ids, ..lacking };
    let refused = denial(bed.client.call::<Reset>(&bed.left, replayed).await);
    assert_eq!(refused.code, DenialCode::StaleSequence, "{refused}");
    bed.reset_stop(&bed.left).await?;
    let state = watch.state_when("a state", |_| true, |_| true).await?;
    assert!(!is_commanded(&state), "a reset moves nothing");
    bed.make_ready().await?;
    bed.work_again().await
}

/// A robot file with the button, whether or not it says more about stops.
fn with_button(file: String) -> String {
    match file.contains("\nstop:\n") {
        true => file.replace("\nstop:\n", &format!("\n{BUTTON}")),
        false => file + "\n" + BUTTON,
    }
}

fn stop_request() -> StopRequest {
    StopRequest {
        stop_id: Uuid::now_v7(),
        source: "test".to_owned(),
        level: StopLevel::L2,
        scope: StopScope::Cell,
        reason: "test".to_owned(),
        seq: 0,
    }
}
