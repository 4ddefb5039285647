//! Halting robots and waiting until they are measured to stand still.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{Empty, RobotState};
use armada_protocol::method::robot::Halt;
use armada_protocol::{RobotName, keys};
use tokio::task::JoinSet;
use tokio::time::timeout_at;

use crate::clock;
use crate::output::note;

/// Speed below which a joint stands still \[rad/s or m/s\].
const STILL: f64 = 0.01;
/// How long every joint must be below it.
const HOLD: Duration = Duration::from_millis(100);
/// How long robots may take to come to standstill.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Halts the robots, waits for their standstill and tells about it; returns those that are not
/// known to stand still.
pub(crate) async fn halt_and_report(client: &Client, robots: &[RobotName]) -> Vec<RobotName> {
    // All at once: one that does not answer must not keep the others moving.
    let mut halts = JoinSet::new();
    for robot in robots.iter().cloned() {
        let client = client.clone();
        halts.spawn(async move {
            let halted = client.call::<Halt>(&robot, Empty {}).await;
            (robot, halted)
        });
    }
    while let Some(halted) = halts.join_next().await {
        if let Ok((robot, Err(error))) = halted {
            note(format_args!("{robot}: halt: {error}"));
        }
    }
    let moving = match wait_for(client, robots).await {
        Ok(moving) => moving,
        Err(error) => {
            note(format_args!("states cannot be read: {error}"));
            robots.to_vec()
        }
    };
    if moving.is_empty() {
        note("every robot stands still, by measurement");
    } else {
        let names: Vec<_> = moving.iter().map(RobotName::as_str).collect();
        note(format_args!("NOT KNOWN TO STAND STILL: {}: go and look", names.join(", ")));
    }
    moving
}

/// Waits until every robot is measured to stand still; returns those that are not in time.
async fn wait_for(client: &Client, robots: &[RobotName]) -> Result<Vec<RobotName>, ClientError> {
    let states = client.subscribe::<RobotState>(&keys::ROBOT_STATE.any(), 256).await?;
    let mut watched = Watched::new(robots);
    let deadline = tokio::time::Instant::from_std(clock::now() + TIMEOUT);
    while !watched.all_still() {
        match timeout_at(deadline, states.next()).await {
            Ok(Ok((key, state))) => watched.take(clock::now(), &key, &state),
            // A message that cannot be read proves nothing.
            Ok(Err(ClientError::Codec(_))) => {}
            Ok(Err(error)) => return Err(error),
            Err(_) => break,
        }
    }
    Ok(watched.moving())
}

/// Since when each robot stands still.
struct Watched {
    still_since: BTreeMap<RobotName, Option<Instant>>,
    now: Option<Instant>,
}

impl Watched {
    fn new(robots: &[RobotName]) -> Self {
        Self { still_since: robots.iter().map(|robot| (robot.clone(), None)).collect(), now: None }
    }

    fn take(&mut self, now: Instant, key: &str, state: &RobotState) {
        let Some(robot) = keys::robot_of(key) else { return };
        let Some(since) = self.still_since.get_mut(&robot) else { return };
        self.now = Some(now);
        if is_still(state) {
            since.get_or_insert(now);
        } else {
            *since = None;
        }
    }

    fn all_still(&self) -> bool {
        self.moving().is_empty()
    }

    fn moving(&self) -> Vec<RobotName> {
        let held = |since: &Option<Instant>| {
            since.is_some_and(|since| self.now.is_some_and(|now| now - since >= HOLD))
        };
        let moving = self.still_since.iter().filter(|(_, since)| !held(since));
        moving.map(|(robot, _)| robot.clone()).collect()
    }
}

/// Whether nothing moves: by measured speeds, or by commanded ones where there are no others.
fn is_still(state: &RobotState) -> bool {
    let velocity = if state.joint_velocity_rad_s.is_empty() {
        &state.joint_velocity_command_rad_s
    } else {
        &state.joint_velocity_rad_s
    };
    state.motion.is_none() && velocity.iter().all(|velocity| velocity.abs() < STILL)
}

#[cfg(test)]
mod tests {
    use armada_model::{JointVector, MonoTime};
    use armada_protocol::messages::{CommandMode, ControllerState, OperationalMode, RobotFlags};
    use uuid::Uuid;

    use super::*;

    fn state(velocity: f64) -> RobotState {
        RobotState {
            stamp_ns: MonoTime::ZERO,
            utc_ns: 0,
            boot_id: Uuid::nil(),
            seqno: 0,
            epoch: 0,
            command_mode: CommandMode::Halt,
            operational_mode: OperationalMode::Auto,
            controller_state: ControllerState::MotorOn,
            flags: RobotFlags::NONE,
            joint_position_rad: JointVector::EMPTY,
            joint_velocity_rad_s: JointVector::from_slice(&[velocity]).expect("finite"),
            joint_effort_nm: JointVector::EMPTY,
            joint_position_command_rad: JointVector::EMPTY,
            joint_velocity_command_rad_s: JointVector::EMPTY,
            tcp: vec![],
            motion: None,
            speed_ratio: 1.0,
            config_seqno: 0,
        }
    }

    #[test]
    fn a_robot_stands_still_only_after_the_hold_time() {
        let robot: RobotName = "torso".parse().expect("a name");
        let start = clock::now();
        let mut watched = Watched::new(std::slice::from_ref(&robot));
        assert!(!watched.all_still());
        for (ms, velocity, still) in [
            (0, 0.0, false),
            (60, 0.0, false),
            (80, 0.5, false),
            (90, 0.0, false),
            (200, 0.0, true),
        ] {
            watched.take(start + Duration::from_millis(ms), "robots/torso/state", &state(velocity));
            assert_eq!(watched.all_still(), still, "at {ms} ms");
        }
    }

    #[test]
    fn another_robot_proves_nothing() {
        let robot: RobotName = "torso".parse().expect("a name");
        let mut watched = Watched::new(std::slice::from_ref(&robot));
        let start = clock::now();
        watched.take(start, "robots/left_arm/state", &state(0.0));
        watched.take(start + HOLD, "robots/left_arm/state", &state(0.0));
        assert_eq!(watched.moving(), [robot]);
    }
}
