//! What comes from the robot, and what is asked of it.

use std::time::{Duration, Instant};

use anyhow::Context as _;
use armada_protocol::client::{Client, ClientError, Subscription};
use armada_protocol::messages::{Empty, RobotState, RobotStatus, StopLevel};
use armada_protocol::method::robot::Halt;
use armada_protocol::{RobotName, keys};

use super::model::Model;
use crate::cell_address::CellAddress;
use crate::clock;
use crate::commands::stop;

/// Time for the robot to be measured to stand still.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);
/// Pause before the description is asked for again.
const INFO_PAUSE: Duration = Duration::from_secs(1);

/// A robot's state and status as they come.
#[derive(Debug)]
pub(super) struct Feed {
    pub(super) model: Model,
    start: Instant,
    asked_info: Option<Instant>,
    client: Client,
    address: CellAddress,
    states: Subscription<RobotState>,
    statuses: Subscription<RobotStatus>,
}

/// What asks the robot, apart from the feed, so that drawing goes on meanwhile.
#[derive(Clone, Debug)]
pub(super) struct Asker {
    client: Client,
    address: CellAddress,
    robot: RobotName,
}

impl Feed {
    /// Subscribes to a robot, and asks what it is.
    ///
    /// # Errors
    /// If no agent answers by that name.
    pub(super) async fn subscribe(
        client: Client,
        address: CellAddress,
        robot: RobotName,
    ) -> anyhow::Result<Self> {
        let states = client.subscribe(&keys::ROBOT_STATE.of(&robot), 2048).await?;
        let statuses = client.subscribe(&keys::ROBOT_STATUS.of(&robot), 16).await?;
        let mut model = Model::new(robot.clone());
        model.take_info(client.robot_info(&robot).await?);
        model.status = client.robot_status(&robot).await.ok();
        let start = clock::now();
        Ok(Self { model, start, asked_info: None, client, address, states, statuses })
    }

    /// Takes everything that has come.
    ///
    /// # Errors
    /// If the session is closed.
    pub(super) async fn update(&mut self) -> anyhow::Result<()> {
        let now = self.now();
        while let Some(state) = next_valid(&self.states)? {
            self.model.take_state(now, state);
        }
        while let Some(status) = next_valid(&self.statuses)? {
            self.model.take_status(status);
        }
        let asked_lately = self.asked_info.is_some_and(|asked| asked.elapsed() < INFO_PAUSE);
        if self.model.needs_info() && !asked_lately {
            self.asked_info = Some(clock::now());
            if let Ok(info) = self.client.robot_info(&self.model.robot).await {
                self.model.take_info(info);
            }
        }
        Ok(())
    }

    /// Time since the feed began.
    pub(super) fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// What asks the robot.
    pub(super) fn asker(&self) -> Asker {
        Asker {
            client: self.client.clone(),
            address: self.address.clone(),
            robot: self.model.robot.clone(),
        }
    }
}

impl Asker {
    /// Ramps the robot to standstill; returns what to tell.
    pub(super) async fn halt(self) -> String {
        match self.client.call::<Halt>(&self.robot, Empty {}).await {
            Ok(_) => "halting".to_owned(),
            Err(error) => format!("halt: {}", super::super::modes::words_of(&error)),
        }
    }

    /// Stops the robot and keeps it stopped; returns what to tell.
    pub(super) async fn stop(self) -> String {
        let reason = "key s in armada watch".to_owned();
        let request = stop::request(vec![self.robot.clone()], StopLevel::L2, reason);
        match stop::stop(&self.client, &self.address, request, STOP_TIMEOUT).await {
            Ok(outcome) => outcome.lines().join("   "),
            Err(error) => format!("STOP NOT SENT: {error}"),
        }
    }
}

/// The next message; one that is not valid is passed over.
fn next_valid<T: serde::de::DeserializeOwned>(
    subscription: &Subscription<T>,
) -> anyhow::Result<Option<T>> {
    loop {
        match subscription.try_next() {
            Ok(Some((_, message))) => return Ok(Some(message)),
            Ok(None) => return Ok(None),
            Err(ClientError::Codec(_)) => {}
            Err(error) => return Err(error).context("the session is closed"),
        }
    }
}
