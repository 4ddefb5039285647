//! Rows 8, 9, 13, 14 and 15: what happens at a robot, its controller and its tools.

use std::time::Duration;

use anyhow::{Context, Result};
use armada_model::Pose;
use armada_protocol::client::Client;
use armada_protocol::messages::*;
use armada_protocol::method::cell;
use armada_protocol::method::robot::{
    AttachTool, DetachTool, ExecuteTrajectory, Reset, ResetErrors,
};
use armada_tests::{NetCellOptions, Quality, in_network, monotonic, wait_for};

use crate::support::{Bed, LOSS, PERIOD, Watch, assert_within, denial, speed};

/// Silence of a controller that is a loss of communication, in the robot files.
const COMMUNICATION_TIMEOUT: Duration = Duration::from_millis(100);

#[test]
fn controllers_that_fail_tools_that_change_and_blocked_joints_end_what_they_must() -> Result<()> {
    in_network("failure matrix, robots", async |network| {
        let bed = Bed::start(network, NetCellOptions::default()).await?;
        row_08_vendor_communication_lost(&bed).await.context("row 8")?;
        row_09_emergency_stop_of_the_controller(&bed).await.context("row 9")?;
        row_13_model_revision_mismatch(&bed).await.context("row 13")?;
        row_14_change_of_tool_half_done(&bed).await.context("row 14")?;
        row_15_tracking_error(&bed).await.context("row 15")
    })
}

/// Agent, at most 250 ms: fault, group abort; latched; `reset_errors` when it is heard again.
async fn row_08_vendor_communication_lost(bed: &Bed) -> Result<()> {
    let id = bed.move_both(Coupling::TimeSynced, 5.0).await?;
    let [_, mut right] = bed.watch_both().await?;
    let frozen = monotonic();
    bed.cell.emulators["left_arm"].freeze()?;
    let faulted = |status: &RobotStatus| !status.faults.is_empty();
    let status = bed.status_when(&bed.left, "the fault", faulted).await?;
    let fault = status.faults.first().context("just seen")?;
    assert_eq!(fault.code, FaultCode::CommunicationLost);
    assert_within("row 8: silence to fault", frozen, fault.since_ns, COMMUNICATION_TIMEOUT);
    assert_partner_ends(bed, ("row 8", &mut right), id, fault.since_ns).await?;
    let end = bed.end_of(&bed.left, id).await?;
    assert_eq!(end.reason.map(|r| r.code), Some(DenialCode::CommunicationLost));
    // Latched: that it is heard again changes nothing.
    bed.cell.emulators["left_arm"].thaw()?;
    let heard = |s: &RobotStatus| !s.flags.contains(RobotFlags::COMMUNICATION_FAILURE);
    let status = bed.status_when(&bed.left, "it is heard", heard).await?;
    assert!(!status.faults.is_empty() && status.command_mode == CommandMode::InvalidState);
    bed.granted::<ResetErrors>(&bed.left, Empty {}).await?;
    bed.make_ready().await?;
    bed.work_again().await
}

/// Agent via the controller, one state period: group abort, latched; release and reset.
async fn row_09_emergency_stop_of_the_controller(bed: &Bed) -> Result<()> {
    let id = bed.move_both(Coupling::TimeSynced, 5.0).await?;
    let [mut watch, mut right] = bed.watch_both().await?;
    bed.cell.inject("left_arm", "estop")?;
    let pressed = |state: &RobotState| state.flags.contains(RobotFlags::ESTOP);
    let state = watch.state_when("it is pressed", |_| true, pressed).await?;
    let faulted = |status: &RobotStatus| !status.faults.is_empty();
    let status = bed.status_when(&bed.left, "the fault", faulted).await?;
    let fault = status.faults.iter().find(|fault| fault.code == FaultCode::EmergencyStop);
    let fault = fault.with_context(|| format!("{status:#?}"))?;
    // The tick that first reports it has latched it.
    assert!(fault.since_ns <= state.stamp_ns, "{fault:#?}");
    assert_partner_ends(bed, ("row 9", &mut right), id, fault.since_ns).await?;
    let latched = |status: &RobotStatus| {
        let stops = status.stop.as_ref().map(|latch| &latch.stops);
        stops.is_some_and(|stops| stops.iter().any(|stop| stop.source == "controller"))
    };
    let status = bed.status_when(&bed.left, "a stop of the controller", latched).await?;
    let latch = status.stop.context("just seen")?;
    assert!(latch.level >= StopLevel::L1, "{latch:#?}");
    let refused = denial(bed.client.call::<Reset>(&bed.left, latch.reset_params()).await);
    assert!(refused.message.contains("emergency stop"), "{refused}");
    // Its release alone changes nothing.
    bed.cell.inject("left_arm", "estop_release")?;
    let released = |s: &RobotStatus| s.flags.contains(RobotFlags::ESTOP_RELEASED);
    let status = bed.status_when(&bed.left, "it is released", released).await?;
    assert!(status.stop.is_some() && !status.faults.is_empty(), "{status:#?}");
    let refused = bed.client.call::<ExecuteTrajectory>(&bed.left, still(bed).await?).await;
    assert!(matches!(denial(refused).code, DenialCode::Stopped | DenialCode::Faulted));
    bed.make_ready().await?;
    bed.work_again().await
}

/// Agent at prepare, one cycle: refused by name, nobody moves; with the right revision it is done.
async fn row_13_model_revision_mismatch(bed: &Bed) -> Result<()> {
    let before = revision(&bed.client, bed).await?;
    bed.granted::<AttachTool>(&bed.left, tool("gripper")).await?;
    assert!(revision(&bed.client, bed).await? > before);
    let mut watch = Watch::of(&bed.client, &bed.right).await?;
    let began = monotonic();
    let trajectory = bed.both(0.1, 0.8).await?;
    let params = |rev| CellExecuteTrajectory {
        model_revs: [(bed.left.clone(), rev)].into(),
        ..CellExecuteTrajectory::new(None, trajectory.clone())
    };
    let refused = bed.client.call_cell::<cell::ExecuteTrajectory>(params(before)).await;
    let refused = denial(refused);
    assert_eq!(refused.code, DenialCode::StaleModel, "{refused}");
    assert!(refused.message.contains("left_arm"), "{refused}");
    watch.assert_still(began).await?;
    // The model read anew, the motion is granted.
    let right = params(revision(&bed.client, bed).await?);
    let accepted = bed.client.call_cell::<cell::ExecuteTrajectory>(right).await?;
    let end = bed.end_of(&bed.left, accepted.motion_id).await?;
    assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
    Ok(())
}

/// The answer to a change of tool is lost. It is done once or not at all, whoever asks again learns
/// which, and a motion that was planned without it is refused.
async fn row_14_change_of_tool_half_done(bed: &Bed) -> Result<()> {
    let remote = bed.cell.client_of("tool changer", &["left_arm"]).await?;
    let observer = bed.cell.client_of("observer", &["gateway"]).await?;
    let before = revision(&bed.client, bed).await?;
    let request = DetachParams { chain: Some("arm".to_owned()), ..DetachParams::default() };
    let slow = Quality::slow(Duration::from_millis(150), Duration::ZERO);
    bed.cell.network.set_link("client", "left_arm", slow)?;
    let ask = remote.call::<DetachTool>(&bed.left, request.clone());
    let cut = async {
        // The request has passed, its answer has not.
        let done = async || (revision(&observer, bed).await.ok()? > before).then_some(());
        let done = wait_for("it is done", Duration::from_secs(20), done).await;
        bed.cell.network.set_link("client", "left_arm", Quality::CUT)?;
        done
    };
    let (asked, cut) = tokio::join!(ask, cut);
    cut?;
    bed.cell.network.set_link("client", "left_arm", Quality::default())?;
    drop(asked);
    let again = denial(observer.call::<DetachTool>(&bed.left, request).await);
    assert_eq!(again.code, DenialCode::NotAttached, "{again}");
    assert_eq!(revision(&bed.client, bed).await?, before + 1, "done once");
    let trajectory = bed.both(0.1, 0.8).await?;
    let params = CellExecuteTrajectory {
        model_revs: [(bed.left.clone(), before)].into(),
        ..CellExecuteTrajectory::new(None, trajectory)
    };
    let refused = denial(bed.client.call_cell::<cell::ExecuteTrajectory>(params).await);
    assert_eq!(refused.code, DenialCode::StaleModel, "{refused}");
    observer.close();
    remote.close();
    bed.work_again().await
}

/// Agent, one cycle: on-path stop, trajectory and queue removed; a new operation after the repair.
async fn row_15_tracking_error(bed: &Bed) -> Result<()> {
    let robot = &bed.left;
    let mut watch = Watch::of(&bed.client, robot).await?;
    let id = bed.move_one(&bed.client, robot, 4.0, LeaseLoss::StopOnPath).await?;
    watch.state_when("it moves", |_| true, |state| speed(state) > 0.2).await?;
    bed.cell.inject("left_arm", "block_joint=0")?;
    let end = bed.end_of(robot, id).await?;
    assert_eq!(end.status, ActionStatus::Failed, "{end:#?}");
    let status = bed.status_when(robot, "the fault", |status| !status.faults.is_empty()).await?;
    let fault = &status.faults[0];
    assert_eq!(fault.code, FaultCode::TrackingError);
    assert_eq!(fault.joint.as_deref(), Some("shoulder_pan_joint"));
    // Seen in the cycle in which it happened: in a later one it would have been further away.
    let cycle = watch.seen.iter().map(speed).fold(0.0, f64::max) * PERIOD.as_secs_f64();
    let beyond = fault.value.abs() - fault.limit;
    assert!((0.0..=2.0 * cycle + 1e-3).contains(&beyond), "{fault:#?}");
    let rest = watch.rest(fault.since_ns).await?;
    assert_within("row 15: fault to rest", fault.since_ns, rest, Duration::from_millis(200));
    watch.assert_ramped();
    assert!(status.motion.is_none() && status.queued.is_empty(), "{status:#?}");
    assert!(status.stop.is_none(), "a fault, no stop");
    // That the joint is free again moves nothing; the path that was left is gone.
    bed.cell.inject("left_arm", "unblock")?;
    let freed = monotonic();
    watch.assert_still(freed).await?;
    bed.make_ready().await?;
    watch.assert_still(freed).await?;
    bed.work_again().await
}

/// The right arm's part ends because of the left one's fault at `since`, in time, without a latch.
async fn assert_partner_ends(
    bed: &Bed,
    (row, watch): (&str, &mut Watch),
    id: uuid::Uuid,
    since: armada_model::MonoTime,
) -> Result<()> {
    let end = bed.end_of(&bed.right, id).await?;
    assert!(matches!(end.status, ActionStatus::Failed | ActionStatus::Cancelled), "{end:#?}");
    let reason = end.reason.clone().with_context(|| format!("{end:#?}"))?;
    // By its own ears, or by the gateway's, whichever was quicker.
    let by_itself = reason.message.contains(bed.left.as_str());
    assert!(by_itself || end.status == ActionStatus::Cancelled, "for its partner: {reason}");
    assert_within(&format!("{row}: fault to the partner's abort"), since, end.stamp_ns, LOSS);
    watch.assert_rests(row, end.stamp_ns).await?;
    let status = bed.client.robot_status(&bed.right).await?;
    assert!(status.stop.is_none() && status.faults.is_empty(), "no latch: {status:#?}");
    Ok(())
}

async fn revision(client: &Client, bed: &Bed) -> Result<u64> {
    let look = async || Some(client.robot_info(&bed.left).await.ok()?.model_rev);
    wait_for("the revision", Duration::from_secs(20), look).await
}

async fn still(bed: &Bed) -> Result<ExecuteTrajectoryParams> {
    Ok(ExecuteTrajectoryParams::at_once(None, bed.one(&bed.left, 0.1, 1.0).await?))
}

fn tool(name: &str) -> AttachToolParams {
    let tool = ToolInfo {
        name: name.to_owned(),
        uuid: None,
        tool_type: ToolType::default(),
        tcp: Pose::default(),
        inertia: Inertia { mass_kg: 0.9, ..Inertia::default() },
        description: String::new(),
    };
    AttachToolParams { tool: Some(tool), ..AttachToolParams::default() }
}
