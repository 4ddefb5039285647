//! Waiting until every robot is online and can be commanded.

use std::time::Duration;

use anyhow::bail;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    CellRobotStatus, CellStatus, CommandMode, ControllerState, DenialCode, Presence,
};
use tokio::time::{Instant, sleep};

use super::preflight::Cell;
use crate::clock;
use crate::commands::status::advice;
use crate::output::Progress;

/// Pause between looks.
const PAUSE: Duration = Duration::from_millis(100);

/// Connects, and waits for the robots; returns what is missing when the time is over.
///
/// # Errors
/// If not even the gateway answers in time.
pub(super) async fn wait(
    cell: &Cell,
    limit: Duration,
    connected: &mut Option<Client>,
) -> anyhow::Result<Vec<String>> {
    let deadline = Instant::from_std(clock::now() + limit);
    let mut progress = Progress::new();
    let mut last = None;
    loop {
        match look(cell, connected).await {
            Ok(status) => {
                let missing = missing(&status);
                if missing.is_empty() {
                    return Ok(missing);
                }
                progress.show(&format!("waiting for {}", missing.join("; ")));
                last = Some(missing);
            }
            Err(error) if is_only_early(&error) => progress.show("waiting for the gateway"),
            Err(error) => return Err(error.into()),
        }
        if clock::now() >= deadline.into_std() {
            match last {
                Some(missing) => return Ok(missing),
                None => bail!("the gateway did not answer within {} s", limit.as_secs_f64()),
            }
        }
        sleep(PAUSE).await;
    }
}

/// Whether an answer may yet come: a gateway that begins has no status at first.
fn is_only_early(error: &ClientError) -> bool {
    match error {
        ClientError::NobodyThere { .. }
        | ClientError::NoReply { .. }
        | ClientError::Timeout { .. } => true,
        ClientError::Denied(denial) => denial.code == DenialCode::NotReady,
        _ => false,
    }
}

async fn look(cell: &Cell, connected: &mut Option<Client>) -> Result<CellStatus, ClientError> {
    if let Some(client) = connected {
        return client.cell_status().await;
    }
    let client = cell.connect(cell.config.listen.clone()).await?;
    connected.insert(client).cell_status().await
}

/// One line for each robot that cannot be commanded.
fn missing(status: &CellStatus) -> Vec<String> {
    let waiting = status.robots.iter().filter(|(_, robot)| !is_ready(robot));
    waiting
        .map(|(name, robot)| {
            let why = advice::of(name, robot);
            if why.is_empty() { format!("{name}: not ready yet") } else { why.join("; ") }
        })
        .collect()
}

fn is_ready(robot: &CellRobotStatus) -> bool {
    let commandable = !matches!(robot.command_mode, None | Some(CommandMode::InvalidState));
    robot.presence == Presence::Online
        && commandable
        && robot.controller_state == Some(ControllerState::MotorOn)
        && robot.faults.is_empty()
        && robot.stop.is_none()
        && robot.state_age_ms.is_some()
}

#[cfg(test)]
mod tests {
    use armada_model::MonoTime;
    use armada_protocol::messages::{CellVerdict, Denial};
    use uuid::Uuid;

    use super::*;

    #[test]
    fn a_gateway_that_is_starting_is_waited_for_and_one_that_refuses_is_not() {
        let denied = |code| ClientError::Denied(Denial::new(code, "no"));
        assert!(is_only_early(&denied(DenialCode::NotReady)));
        assert!(!is_only_early(&denied(DenialCode::Internal)));
    }

    #[test]
    fn a_robot_that_is_not_ready_is_told_with_the_reason() {
        let ready = CellRobotStatus {
            presence: Presence::Online,
            command_mode: Some(CommandMode::Halt),
            controller_state: Some(ControllerState::MotorOn),
            state_age_ms: Some(3.0),
            ..CellRobotStatus::default()
        };
        let off =
            CellRobotStatus { controller_state: Some(ControllerState::MotorOff), ..ready.clone() };
        let silent = CellRobotStatus { state_age_ms: None, ..ready.clone() };
        let robots = [("a", ready), ("b", off), ("c", silent)]
            .map(|(name, robot)| (name.parse().expect("a name"), robot));
        let status = CellStatus {
            cell: "test".to_owned(),
            boot_id: Uuid::nil(),
            seqno: 0,
            stamp_ns: MonoTime::ZERO,
            verdict: CellVerdict::Degraded,
            robots: robots.into_iter().collect(),
            motions: vec![],
        };
        let expected = ["b: drives are off: `armada enable b`", "c: not ready yet"];
        assert_eq!(missing(&status), expected);
    }
}
