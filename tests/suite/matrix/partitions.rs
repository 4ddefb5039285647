//! Rows 4, 5, 6, 7 and 12: gateways, agents and links that die while arms move together.

use std::time::Duration;

use anyhow::{Context, Result};
use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::*;
use armada_protocol::method::cell;
use armada_tests::{NetCellOptions, Quality, in_network, monotonic, wait_for};
use uuid::Uuid;

use crate::support::{Bed, LOSS, PERIOD, RESERVE, Watch, assert_within, denial};

#[test]
fn arms_in_a_common_motion_stop_together_when_agents_or_links_die() -> Result<()> {
    in_network("failure matrix, partners", async |network| {
        let mut bed = Bed::start(network, NetCellOptions::default()).await?;
        row_07_network_partition(&bed).await.context("row 7")?;
        row_12_clock_not_known_well_enough(&mut bed).await.context("row 12")?;
        row_06_one_agent_dies(&mut bed).await.context("row 6")
    })
}

#[test]
fn arms_in_a_common_motion_go_on_without_gateway_or_router() -> Result<()> {
    in_network("failure matrix, gateway", async |network| {
        let mut bed = Bed::start(network, NetCellOptions::default()).await?;
        row_04_gateway_dies_while_a_group_runs(&mut bed).await.context("row 4")?;
        row_05_router_dies(&mut bed).await.context("row 5")
    })
}

/// An end client holds the leases and keeps them at the agents: the group goes on. A new gateway
/// reads how things are and adopts nothing.
async fn row_04_gateway_dies_while_a_group_runs(bed: &mut Bed) -> Result<()> {
    let ttl = Duration::from_secs(2);
    let keepers = [
        bed.client.acquire_lease(&bed.left, ttl).await?,
        bed.client.acquire_lease(&bed.right, ttl).await?,
    ];
    let leases = bed.robots().into_iter().cloned().zip(keepers.iter().map(|k| k.lease()));
    let params = CellExecuteTrajectory {
        leases: leases.collect(),
        ..CellExecuteTrajectory::new(None, bed.both(0.4, 4.0).await?)
    };
    let accepted = bed.client.call_cell::<cell::ExecuteTrajectory>(params).await?;
    bed.until_moving(accepted.motion_id).await?;
    bed.cell.gateway.kill()?;
    for robot in bed.robots() {
        let end = bed.end_of(robot, accepted.motion_id).await?;
        assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
    }
    assert!(!keepers.iter().any(|keeper| keeper.is_lost()), "no lease hangs on the gateway");
    for keeper in keepers {
        keeper.release().await?;
    }
    bed.cell.gateway.start()?;
    let back = async || {
        let status = bed.client.cell_status().await.ok()?;
        (status.verdict == CellVerdict::Ready).then_some(status)
    };
    let status = wait_for("the gateway is back", Duration::from_secs(30), back).await?;
    assert!(status.motions.is_empty(), "it adopts nothing: {status:#?}");
    bed.work_again().await
}

/// The direct link of the agents keeps the group together; when that goes too, both abort.
async fn row_05_router_dies(bed: &mut Bed) -> Result<()> {
    let id = bed.move_both(Coupling::TimeSynced, 6.0).await?;
    let killed = monotonic();
    bed.cell.gateway.kill()?;
    let mut watches = bed.watch_both().await?;
    let watch = &mut watches[0];
    let later = killed + Duration::from_secs(2);
    let state = watch.state_when("time passes", |_| true, |state| state.stamp_ns > later).await?;
    assert!(state.motion.is_some_and(|motion| motion.id == id), "it goes on: {state:#?}");
    let cut = monotonic();
    bed.cell.network.set_link("left_arm", "right_arm", Quality::CUT)?;
    for (robot, watch) in bed.robots().into_iter().zip(&mut watches) {
        assert_aborted(bed, "row 5", (robot, watch), id, cut).await?;
    }
    bed.cell.network.set_link("left_arm", "right_arm", Quality::default())?;
    bed.cell.gateway.start()?;
    bed.work_again().await
}

/// The partner, 60 ms: group abort. The dead agent's arm is stopped by its controller, and latched
/// when its agent is back.
async fn row_06_one_agent_dies(bed: &mut Bed) -> Result<()> {
    let id = bed.move_both(Coupling::TimeSynced, 6.0).await?;
    let boot = bed.client.robot_status(&bed.left).await?.boot_id;
    let [_, mut right] = bed.watch_both().await?;
    let killed = monotonic();
    bed.cell.agent("left_arm")?.kill()?;
    assert_aborted(bed, "row 6", (&bed.right, &mut right), id, killed).await?;
    bed.cell.agent("left_arm")?.start()?;
    let restarted = |status: &RobotStatus| {
        status.boot_id != boot && status.stop.is_some() && status.motion.is_none()
    };
    let status = bed.status_when(&bed.left, "it is back and stopped", restarted).await?;
    let latch = status.stop.context("just seen")?;
    assert!(latch.stops.iter().any(|stop| stop.source == "agent_lost"), "{latch:#?}");
    let stands = |status: &RobotStatus| {
        status.stop.as_ref().is_some_and(|latch| latch.stage >= StopStage::Standstill)
    };
    bed.status_when(&bed.left, "its arm is measured to stand", stands).await?;
    bed.make_ready().await?;
    bed.work_again().await
}

/// Both sides, 60 ms: both abort, no latch, and a new motion is prepared when the link is back.
async fn row_07_network_partition(bed: &Bed) -> Result<()> {
    let id = bed.move_both(Coupling::TimeSynced, 6.0).await?;
    let [mut left, mut right] = bed.watch_both().await?;
    let cut = monotonic();
    bed.cell.network.set_host("left_arm", Quality::CUT)?;
    assert_aborted(bed, "row 7, one side", (&bed.right, &mut right), id, cut).await?;
    bed.cell.network.set_host("left_arm", Quality::default())?;
    // What the other side did meanwhile it tells by its own stamps.
    assert_aborted(bed, "row 7, other side", (&bed.left, &mut left), id, cut).await?;
    bed.work_again().await
}

/// A gateway that can know an agent's clock only badly: new groups are refused by name, robots that
/// are not tied together go, and with the clock known again all do. (A group that runs while a clock
/// gets worse takes the drift of half a minute; the gateway's own tests do that.)
async fn row_12_clock_not_known_well_enough(bed: &mut Bed) -> Result<()> {
    bed.cell.gateway.kill()?;
    let slow = Quality::slow(Duration::from_millis(25), Duration::ZERO);
    bed.cell.network.set_link("gateway", "left_arm", slow)?;
    bed.cell.gateway.start()?;
    let known = async || {
        let status = bed.client.cell_status().await.ok()?;
        let bound = status.robots.get(&bed.left)?.clock_bound_ns?;
        (status.verdict == CellVerdict::Ready).then_some(bound)
    };
    let bound = wait_for("the clock is measured", Duration::from_secs(30), known).await?;
    assert!(bound > 20_000_000, "{bound} ns over a link that takes 25 ms");
    let trajectory = bed.both(0.1, 0.8).await?;
    let params = CellExecuteTrajectory::new(None, trajectory);
    let refused = denial(bed.client.call_cell::<cell::ExecuteTrajectory>(params.clone()).await);
    assert_eq!(refused.code, DenialCode::NotReady, "{refused}");
    assert!(refused.message.contains("left_arm"), "{refused}");
    let loose = CellExecuteTrajectory { coupling: Coupling::Independent, ..params };
    let id = bed.begin("robots that are not tied together", loose).await?;
    for robot in bed.robots() {
        let end = bed.end_of(robot, id).await?;
        assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
        let status = bed.client.robot_status(robot).await?;
        assert!(status.stop.is_none() && status.faults.is_empty(), "no latch: {status:#?}");
    }
    bed.cell.network.set_link("gateway", "left_arm", Quality::default())?;
    bed.work_again().await
}

/// One robot's part was aborted because its partner was silent since `lost`, in time, without a
/// latch, and it stands.
async fn assert_aborted(
    bed: &Bed,
    row: &str,
    (robot, watch): (&RobotName, &mut Watch),
    id: Uuid,
    lost: MonoTime,
) -> Result<()> {
    let end = bed.end_of(robot, id).await?;
    let reason = end.reason.clone().with_context(|| format!("{end:#?}"))?;
    assert!(matches!(end.status, ActionStatus::Failed | ActionStatus::Cancelled), "{end:#?}");
    assert_eq!(reason.code, DenialCode::CommunicationLost, "{reason}");
    // By the agent's own measure it waited as long as it has to, and one cycle at most.
    let silence = end.group.context("it had a partner")?.max_silence_ms;
    let [least, longest] = [LOSS, LOSS + PERIOD + RESERVE].map(|time| time.as_secs_f64() * 1e3);
    assert!((least..=longest).contains(&silence), "{silence} ms of silence");
    let what = format!("{row}: lost to the abort of {robot}");
    assert_within(&what, lost, end.stamp_ns, LOSS + PERIOD);
    watch.assert_rests(row, end.stamp_ns).await?;
    let status = bed.status_when(robot, "it is seen", |status| status.motion.is_none()).await?;
    assert!(status.stop.is_none() && status.faults.is_empty(), "no latch: {status:#?}");
    Ok(())
}
