//! The condition of a cell, from the gateway or from each agent.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::bail;
use armada_protocol::client::{Client, ClientError, utc_ns};
use armada_protocol::messages::{
    CellRobotStatus, CellVerdict, CommandMode, Presence, RobotState, RobotStatus,
};
use armada_protocol::{RobotName, keys};
use tokio::time::{Instant, sleep_until};

use super::{Origin, Report};
use crate::cell_address::CellAddress;
use crate::clock;

/// How long states are listened to, to measure their rate.
const LISTEN: Duration = Duration::from_millis(400);
/// States kept while listening: those of sixteen robots at 1 kHz.
const CAPACITY: usize = 8192;

/// Asks the gateway, or each agent if it does not answer.
///
/// # Errors
/// If nobody answers at all.
pub(crate) async fn gather(client: &Client, address: &CellAddress) -> anyhow::Result<Report> {
    match client.cell_status().await {
        Ok(status) => Ok(status.into()),
        Err(ClientError::NoReply { .. } | ClientError::Timeout { .. }) => {
            from_agents(client, address).await
        }
        Err(error) => Err(error.into()),
    }
}

async fn from_agents(client: &Client, address: &CellAddress) -> anyhow::Result<Report> {
    let states = client.subscribe::<RobotState>(&keys::ROBOT_STATE.any(), CAPACITY).await?;
    let alive = client.robots_alive().await?;
    let mut robots: BTreeMap<RobotName, CellRobotStatus> =
        address.robots.iter().map(|robot| (robot.clone(), CellRobotStatus::default())).collect();
    for robot in alive {
        let status = client.robot_status(&robot).await.ok();
        robots.insert(robot, status.map_or_else(CellRobotStatus::default, online));
    }
    if robots.is_empty() {
        bail!("neither the gateway nor any agent answers");
    }
    let end = Instant::from_std(clock::now() + LISTEN);
    sleep_until(end).await;
    let mut heard: BTreeMap<RobotName, (u32, RobotState)> = BTreeMap::new();
    while let Ok(Some((key, state))) = states.try_next() {
        let Some(robot) = keys::robot_of(&key) else { continue };
        let count = heard.get(&robot).map_or(0, |(count, _)| *count);
        heard.insert(robot, (count + 1, state));
    }
    for (robot, (count, state)) in heard {
        add_state(robots.entry(robot).or_default(), count, state);
    }
    let verdict = verdict(&robots);
    Ok(Report { origin: Origin::Agents, cell: None, verdict, robots, motions: Vec::new() })
}

fn online(status: RobotStatus) -> CellRobotStatus {
    CellRobotStatus {
        presence: Presence::Online,
        command_mode: Some(status.command_mode),
        controller_state: Some(status.controller_state),
        stop: status.stop,
        faults: status.faults,
        authority: Some(status.authority),
        lease: status.lease,
        why: status.why,
        queued: u32::try_from(status.queued.len()).unwrap_or(u32::MAX),
        speed_ratio: Some(status.speed_ratio),
        control_loop: Some(status.control_loop),
        ..CellRobotStatus::default()
    }
}

fn add_state(robot: &mut CellRobotStatus, count: u32, state: RobotState) {
    // Both wall clocks are needed here, for no offset is measured: for display only.
    robot.state_age_ms = Some(utc_ns().saturating_sub(state.utc_ns) as f64 / 1e6);
    robot.state_rate_hz = f64::from(count) / LISTEN.as_secs_f64();
    robot.tcp = state.tcp;
}

/// The verdict of the gateway's rules, without its knowledge of motions.
fn verdict(robots: &BTreeMap<RobotName, CellRobotStatus>) -> CellVerdict {
    let in_trouble = |robot: &CellRobotStatus| {
        robot.presence != Presence::Online
            || !robot.faults.is_empty()
            || (robot.stop.is_none()
                && matches!(robot.command_mode, None | Some(CommandMode::InvalidState)))
    };
    if robots.values().any(in_trouble) {
        CellVerdict::Degraded
    } else if robots.values().any(|robot| robot.stop.is_some()) {
        CellVerdict::Stopped
    } else {
        CellVerdict::Ready
    }
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::{StopLatch, StopLevel, StopStage};

    use super::*;

    fn robot(mode: CommandMode, stop: bool) -> CellRobotStatus {
        let latch = StopLatch {
            level: StopLevel::L2,
            stops: vec![],
            stage: StopStage::Standstill,
            reset: Default::default(),
        };
        CellRobotStatus {
            presence: Presence::Online,
            command_mode: Some(mode),
            stop: stop.then_some(latch),
            ..CellRobotStatus::default()
        }
    }

    fn verdict_of(robots: Vec<CellRobotStatus>) -> CellVerdict {
        let names = ["left_arm", "right_arm"].map(|name| name.parse().expect("a name"));
        verdict(&names.into_iter().zip(robots).collect())
    }

    #[test]
    fn trouble_comes_before_a_stop_and_a_stop_before_ready() {
        let halt = || robot(CommandMode::Halt, false);
        let stopped = || robot(CommandMode::Halt, true);
        assert_eq!(verdict_of(vec![halt(), halt()]), CellVerdict::Ready);
        assert_eq!(verdict_of(vec![halt(), stopped()]), CellVerdict::Stopped);
        let lost = CellRobotStatus::default();
        assert_eq!(verdict_of(vec![lost, stopped()]), CellVerdict::Degraded);
        let invalid = robot(CommandMode::InvalidState, false);
        assert_eq!(verdict_of(vec![halt(), invalid]), CellVerdict::Degraded);
    }
}
