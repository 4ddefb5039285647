//! A motion of one robot that was accepted: waiting for its end, or not.

use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{Accepted, ActionStatus, CancelParams, DenialCode, Empty};
use armada_protocol::method::Method;
use armada_protocol::method::robot::{Cancel, Halt};
use clap::Args;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::exit::Exit;
use crate::motion::{Follower, MotionView, Mover, Waited, end_line};
use crate::output::{Output, note};
use crate::signals::Signals;

/// Time to come to standstill after Ctrl-C.
const RAMP_TIMEOUT: Duration = Duration::from_secs(5);

/// Whether to wait for the end of a motion.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct WaitArgs {
    /// Wait for the end of the motion; this is the default
    #[arg(long, overrides_with = "no_wait")]
    wait: bool,
    /// Return as soon as the motion is accepted; Ctrl-C does not end it any more
    #[arg(long)]
    pub(crate) no_wait: bool,
}

/// What a signal does to a motion that is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OnSignal {
    /// The robot ramps to standstill and leaves its mode for `halt`.
    Halt,
    /// The motion ends with a ramp; the mode stays.
    Cancel,
}

/// A motion that was accepted.
#[derive(Debug)]
pub(crate) struct Started {
    robot: RobotName,
    accepted: Accepted,
    follower: Follower,
    on_signal: OnSignal,
}

impl Started {
    /// Asks for the motion that will have `id`.
    ///
    /// # Errors
    /// As [`Client::call`].
    pub(crate) async fn ask<M: Method<Answer = Accepted>>(
        client: &Client,
        robot: &RobotName,
        id: Uuid,
        params: M::Params,
        on_signal: OnSignal,
    ) -> Result<Self, ClientError> {
        let follower = Follower::subscribe(client, Mover::Robot(robot.clone()), id).await?;
        let accepted = client.call::<M>(robot, params).await?;
        Ok(Self { robot: robot.clone(), accepted, follower, on_signal })
    }

    /// Whose motion it is.
    pub(crate) const fn robot(&self) -> &RobotName {
        &self.robot
    }

    /// Waits for its end, with its progress on standard error; signals are for the caller to see.
    ///
    /// # Errors
    /// As [`Follower::end`].
    pub(crate) async fn end(&self, client: &Client) -> anyhow::Result<MotionView> {
        self.follower.end(client, self.robot.as_str(), None).await
    }

    /// Waits for its end or not, as asked for, and prints what became of it.
    ///
    /// # Errors
    /// As [`Follower::wait`].
    pub(crate) async fn conclude(
        self,
        client: &Client,
        wait: WaitArgs,
        cell: &CellArgs,
        signals: &mut Signals,
    ) -> anyhow::Result<Exit> {
        let out = cell.output();
        if wait.no_wait {
            return self.report_accepted(&out);
        }
        self.finish(client, cell.timeout, &out, signals).await
    }

    fn report_accepted(&self, out: &Output) -> anyhow::Result<Exit> {
        if out.is_json() {
            out.json(&self.accepted)?;
        } else {
            out.line(accepted_line(&self.robot, &self.accepted))?;
        }
        Ok(Exit::Success)
    }

    /// Waits for its end and prints it; a signal ends it with a ramp.
    ///
    /// # Errors
    /// As [`Follower::wait`].
    pub(crate) async fn finish(
        self,
        client: &Client,
        limit: Option<Duration>,
        out: &Output,
        signals: &mut Signals,
    ) -> anyhow::Result<Exit> {
        match self.follower.wait(client, self.robot.as_str(), limit, signals).await? {
            Waited::Ended(view) => report_end(self.robot.as_str(), &view, out),
            Waited::Interrupted(signal) => {
                self.interrupt(client, signal, out).await?;
                Ok(Exit::Interrupted)
            }
        }
    }

    /// Ends the motion with a ramp and tells whether it has ended.
    ///
    /// # Errors
    /// If the robot does not take it.
    pub(crate) async fn interrupt(
        &self,
        client: &Client,
        signal: &str,
        out: &Output,
    ) -> anyhow::Result<()> {
        match self.on_signal {
            OnSignal::Halt => {
                note(format_args!("{signal}: halting {}", self.robot));
                client.call::<Halt>(&self.robot, Empty {}).await?;
            }
            OnSignal::Cancel => {
                note(format_args!("{signal}: cancelling the motion of {}", self.robot));
                cancel(client, &self.robot, self.accepted.motion_id).await?;
            }
        }
        match self.follower.wait_for_end(client, RAMP_TIMEOUT).await {
            Some(view) => report_end(self.robot.as_str(), &view, out).map(|_| ()),
            None => {
                note(format_args!("{}: no end of the motion in time: go and look", self.robot));
                Ok(())
            }
        }
    }
}

/// Cancels a motion; one that has ended by itself meanwhile is no error.
async fn cancel(client: &Client, robot: &RobotName, motion_id: Uuid) -> Result<(), ClientError> {
    match client.call::<Cancel>(robot, CancelParams { motion_id }).await {
        Err(ClientError::Denied(denial)) if denial.code == DenialCode::NotAttached => Ok(()),
        other => other.map(|_| ()),
    }
}

/// A motion that is not waited for: `torso: motion 0192…, 2.1 s`.
pub(crate) fn accepted_line(title: impl std::fmt::Display, accepted: &Accepted) -> String {
    let Accepted { motion_id, duration_s, .. } = accepted;
    if *duration_s > 0.0 {
        format!("{title}: motion {motion_id}, {duration_s:.1} s")
    } else {
        format!("{title}: motion {motion_id}")
    }
}

/// Prints how a motion ended.
pub(crate) fn report_end(title: &str, view: &MotionView, out: &Output) -> anyhow::Result<Exit> {
    if out.is_json() {
        out.json(&view.message)?;
    } else {
        out.line(end_line(title, view))?;
    }
    let complete = view.status == ActionStatus::Complete;
    Ok(if complete { Exit::Success } else { Exit::Failure })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_that_is_not_known_is_not_told() {
        let accepted = Accepted { motion_id: Uuid::nil(), duration_s: 0.0, epoch: 1, status: None };
        let id = Uuid::nil();
        assert_eq!(accepted_line("torso", &accepted), format!("torso: motion {id}"));
        let timed = Accepted { duration_s: 2.06, ..accepted };
        assert_eq!(accepted_line("torso", &timed), format!("torso: motion {id}, 2.1 s"));
    }
}
