//! Asking for a motion and waiting for its end.

use std::time::Duration;

use anyhow::{Context as _, bail};
use armada_protocol::client::{Client, ClientError, Subscription};
use armada_protocol::messages::{
    ActionStatus, CellMotionStatus, CommandMode, Coupling, Denial, DenialCode, Empty, MotionStatus,
    PartStatus, RobotState, RobotStatus, SetModeParams,
};
use armada_protocol::method::robot::{Halt, SetMode};
use armada_protocol::{RobotName, keys};
use serde_json::Value;
use tokio::time::{Instant, sleep, timeout, timeout_at};
use uuid::Uuid;

use crate::clock;
use crate::output::{Progress, bar, note};
use crate::signals::Signals;
use crate::words;

/// How long a robot may take to come to a halt.
const HALT_TIMEOUT: Duration = Duration::from_secs(5);
/// Pause between looks at something that is about to change.
const LOOK_PAUSE: Duration = Duration::from_millis(50);
/// Silence after which a motion's status is asked for: its last message may have been lost.
const STATUS_SILENCE: Duration = Duration::from_millis(700);
/// Silence about a motion after which waiting for it is given up.
const LONGEST_SILENCE: Duration = Duration::from_secs(10);

/// Whose motion it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Mover {
    /// One robot's, at its agent.
    Robot(RobotName),
    /// Several robots', at the gateway.
    Cell,
}

/// Status of a motion, of one or several robots.
#[derive(Clone, Debug)]
pub(crate) struct MotionView {
    /// Where it stands.
    pub(crate) status: ActionStatus,
    /// Time along its own clock \[s\].
    pub(crate) elapsed_s: f64,
    /// Length of its own clock \[s\].
    pub(crate) duration_s: f64,
    /// Why it failed or was cancelled.
    pub(crate) reason: Option<Denial>,
    /// Each robot's part, if it has several.
    pub(crate) parts: Vec<(RobotName, PartStatus)>,
    /// How it keeps them together, if it has several.
    pub(crate) together: Option<Together>,
    /// The whole message, for `--json`.
    pub(crate) message: Value,
}

/// How the robots of a motion are kept together, as far as that was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Together {
    coupling: Coupling,
    start_skew_ms: Option<f64>,
    max_divergence_ms: Option<f64>,
}

impl Together {
    /// In words: `time_synced, divergence 0.8 ms`.
    fn words(&self) -> String {
        let mut words = words::coupling(self.coupling).to_owned();
        if let Some(skew) = self.start_skew_ms {
            words.push_str(&format!(", start skew {} ms", words::tidy(skew, 2)));
        }
        if let Some(divergence) = self.max_divergence_ms {
            words.push_str(&format!(", divergence {} ms", words::tidy(divergence, 2)));
        }
        words
    }
}

/// How waiting for a motion ended.
#[derive(Debug)]
pub(crate) enum Waited {
    /// The motion reached its terminal status.
    Ended(Box<MotionView>),
    /// This signal came before.
    Interrupted(&'static str),
}

/// Follows the status of one motion, from before it is asked for.
#[derive(Debug)]
pub(crate) struct Follower {
    mover: Mover,
    id: Uuid,
    updates: Updates,
}

#[derive(Debug)]
enum Updates {
    Robot(Subscription<MotionStatus>),
    Cell(Subscription<CellMotionStatus>),
}

impl Follower {
    /// Subscribes to the status of the motion that will have `id`.
    pub(crate) async fn subscribe(
        client: &Client,
        mover: Mover,
        id: Uuid,
    ) -> Result<Self, ClientError> {
        let updates = match &mover {
            Mover::Robot(robot) => {
                let key = keys::ROBOT_MOTION.with(&[robot.as_str(), &id.to_string()]);
                Updates::Robot(client.subscribe(&key, 16).await?)
            }
            Mover::Cell => {
                let key = keys::CELL_MOTION.with(&[&id.to_string()]);
                Updates::Cell(client.subscribe(&key, 16).await?)
            }
        };
        Ok(Self { mover, id, updates })
    }

    /// Waits for the next status; after a silence it is asked for.
    pub(crate) async fn next(&self, client: &Client) -> Result<MotionView, ClientError> {
        let next = async {
            match &self.updates {
                Updates::Robot(updates) => updates.next().await.map(|(_, status)| status.into()),
                Updates::Cell(updates) => updates.next().await.map(|(_, status)| status.into()),
            }
        };
        match timeout(STATUS_SILENCE, next).await {
            Ok(update) => update,
            Err(_) => self.ask(client).await,
        }
    }

    async fn ask(&self, client: &Client) -> Result<MotionView, ClientError> {
        match &self.mover {
            Mover::Robot(robot) => client.motion(robot, self.id).await.map(Into::into),
            Mover::Cell => client.cell_motion(self.id).await.map(Into::into),
        }
    }

    /// Waits until the motion has ended or a signal comes, with its progress on standard error.
    ///
    /// # Errors
    /// If it has not ended within `limit`; without a limit, if nothing is heard of it for long.
    pub(crate) async fn wait(
        &self,
        client: &Client,
        title: &str,
        limit: Option<Duration>,
        signals: &mut Signals,
    ) -> anyhow::Result<Waited> {
        tokio::select! {
            signal = signals.next() => Ok(Waited::Interrupted(signal)),
            view = self.end(client, title, limit) => Ok(Waited::Ended(Box::new(view?))),
        }
    }

    /// As [`Self::wait`], but signals are for the caller to see.
    ///
    /// # Errors
    /// As [`Self::wait`].
    pub(crate) async fn end(
        &self,
        client: &Client,
        title: &str,
        limit: Option<Duration>,
    ) -> anyhow::Result<MotionView> {
        let mut progress = Progress::new();
        let mut deadline = Instant::from_std(clock::now() + limit.unwrap_or(LONGEST_SILENCE));
        loop {
            match timeout_at(deadline, self.next(client)).await {
                Err(_) => {
                    bail!("{title}: no end in time; it may still be moving, see `armada status`")
                }
                Ok(Ok(view)) if view.status.is_terminal() => return Ok(view),
                Ok(Ok(view)) => {
                    progress.show(&progress_line(title, &view));
                    if limit.is_none() {
                        deadline = Instant::from_std(clock::now() + LONGEST_SILENCE);
                    }
                }
                // Asked again until the deadline: an agent or a link may be back by then.
                Ok(Err(ClientError::NoReply { .. } | ClientError::Timeout { .. })) => {
                    progress.show(&format!("{title}: no status"));
                    sleep(LOOK_PAUSE).await;
                }
                Ok(Err(error)) => return Err(error).context(title.to_owned()),
            }
        }
    }

    /// Waits for the terminal status after the motion was asked to end.
    pub(crate) async fn wait_for_end(
        &self,
        client: &Client,
        limit: Duration,
    ) -> Option<MotionView> {
        let end = async {
            loop {
                match self.next(client).await {
                    Ok(view) if view.status.is_terminal() => break view,
                    Ok(_) => {}
                    Err(_) => sleep(LOOK_PAUSE).await,
                }
            }
        };
        timeout(limit, end).await.ok()
    }
}

/// One line on a motion in progress.
pub(crate) fn progress_line(title: &str, view: &MotionView) -> String {
    let fraction = fraction(view.elapsed_s, view.duration_s);
    let mut line = format!(
        "{title} {} {:3.0} % {:.1}/{:.1} s",
        bar(fraction, 24),
        fraction * 100.0,
        view.elapsed_s,
        view.duration_s
    );
    if matches!(view.status, ActionStatus::Paused | ActionStatus::Queued) {
        line.push_str(&format!("  {}", words::action(view.status)));
    }
    for (robot, part) in &view.parts {
        let text = match part.status {
            ActionStatus::Running => format!("  {robot} {:.1} s", part.elapsed_s),
            other => format!("  {robot} {}", words::action(other)),
        };
        line.push_str(&text);
    }
    if let Some(together) = &view.together {
        line.push_str(&format!("  {}", together.words()));
    }
    line
}

/// How much of a motion is done, from 0 to 1.
pub(crate) fn fraction(elapsed_s: f64, duration_s: f64) -> f64 {
    if duration_s > 0.0 { (elapsed_s / duration_s).clamp(0.0, 1.0) } else { 1.0 }
}

/// How a motion ended, in words: `left_arm: complete after 2.1 s`.
pub(crate) fn end_line(title: &str, view: &MotionView) -> String {
    let mut line = format!("{title}: {} after {:.1} s", words::action(view.status), view.elapsed_s);
    if let Some(reason) = &view.reason {
        line.push_str(": ");
        line.push_str(&words::denial(reason));
    }
    if let Some(together) = &view.together {
        line.push_str(&format!(" ({})", together.words()));
    }
    line
}

impl From<MotionStatus> for MotionView {
    fn from(status: MotionStatus) -> Self {
        Self {
            message: serde_json::to_value(&status).unwrap_or_default(),
            status: status.status,
            elapsed_s: status.elapsed_s,
            duration_s: status.duration_s,
            reason: status.reason,
            parts: Vec::new(),
            together: None,
        }
    }
}

impl From<CellMotionStatus> for MotionView {
    fn from(status: CellMotionStatus) -> Self {
        let message = serde_json::to_value(&status).unwrap_or_default();
        let together = Together {
            coupling: status.coupling,
            start_skew_ms: status.start_skew_ms,
            max_divergence_ms: status.max_divergence_ms,
        };
        let longest = status.parts.values().map(|part| part.elapsed_s).fold(0.0, f64::max);
        Self {
            message,
            status: status.status,
            elapsed_s: longest,
            duration_s: status.duration_s,
            reason: status.reason,
            parts: status.parts.into_iter().collect(),
            together: Some(together),
        }
    }
}

/// The next state of a robot.
pub(crate) async fn next_state(
    client: &Client,
    robot: &RobotName,
    limit: Duration,
) -> anyhow::Result<RobotState> {
    let states = client.subscribe::<RobotState>(&keys::ROBOT_STATE.of(robot), 1).await?;
    match timeout(limit, states.next()).await {
        Ok(state) => Ok(state?.1),
        Err(_) => bail!("{robot} sends no state"),
    }
}

/// Brings a robot into `mode`, over `halt` if it is in another one.
///
/// # Errors
/// If it has no way out of `invalid_state` but by a person, refuses, or does not come to a halt.
pub(crate) async fn enter_mode(
    client: &Client,
    robot: &RobotName,
    mode: CommandMode,
) -> anyhow::Result<()> {
    let status = client.robot_status(robot).await?;
    if status.command_mode == mode {
        return Ok(());
    }
    if status.command_mode == CommandMode::InvalidState {
        bail!("{robot} cannot be commanded: {}", why_invalid(&status));
    }
    let path = if status.command_mode == CommandMode::Halt {
        halted(client, robot).await?;
        format!("{robot}: {} -> {}", words::mode(CommandMode::Halt), words::mode(mode))
    } else {
        let epoch = client.call::<Halt>(robot, Empty {}).await?.epoch;
        wait_for_halt(client, robot, epoch).await?;
        format!("{robot}: {} -> halt -> {}", words::mode(status.command_mode), words::mode(mode))
    };
    set_mode_when_still(client, robot, mode).await?;
    note(path);
    Ok(())
}

/// A robot that was halted may still be ramping down: `halt` is a mode, standstill is measured.
async fn set_mode_when_still(
    client: &Client,
    robot: &RobotName,
    mode: CommandMode,
) -> anyhow::Result<()> {
    let deadline = clock::now() + HALT_TIMEOUT;
    loop {
        match client.call::<SetMode>(robot, SetModeParams { mode }).await {
            Err(ClientError::Denied(denial))
                if matches!(denial.code, DenialCode::Busy | DenialCode::WrongMode)
                    && clock::now() < deadline =>
            {
                sleep(LOOK_PAUSE).await;
            }
            Ok(_) => return Ok(()),
            Err(error) => return Err(error).with_context(|| format!("{robot}: mode {mode:?}")),
        }
    }
}

async fn halted(client: &Client, robot: &RobotName) -> anyhow::Result<()> {
    let status = client.robot_status(robot).await?;
    if let Some(motion) = &status.motion
        && !motion.status.is_terminal()
    {
        wait_for_halt(client, robot, status.epoch).await?;
    }
    Ok(())
}

/// Waits until a robot is in `halt` at `epoch` or later, without a motion.
pub(crate) async fn wait_for_halt(
    client: &Client,
    robot: &RobotName,
    epoch: u64,
) -> anyhow::Result<()> {
    let deadline = clock::now() + HALT_TIMEOUT;
    loop {
        let status = client.robot_status(robot).await?;
        let idle = status.motion.as_ref().is_none_or(|motion| motion.status.is_terminal());
        if status.epoch >= epoch && status.command_mode == CommandMode::Halt && idle {
            return Ok(());
        }
        if status.command_mode == CommandMode::InvalidState {
            bail!("{robot} cannot be commanded: {}", why_invalid(&status));
        }
        if clock::now() >= deadline {
            bail!("{robot} did not come to a halt within {} s", HALT_TIMEOUT.as_secs());
        }
        sleep(LOOK_PAUSE).await;
    }
}

fn why_invalid(status: &RobotStatus) -> String {
    let mut reasons: Vec<String> =
        status.faults.iter().map(|fault| fault.message.clone()).collect();
    if status.stop.is_some() {
        reasons.push("a stop is latched".to_owned());
    }
    if reasons.is_empty() {
        reasons.push(format!("controller is in {}", words::controller(status.controller_state)));
    }
    reasons.extend(status.next.iter().cloned());
    reasons.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(status: ActionStatus) -> MotionView {
        MotionView {
            status,
            elapsed_s: 1.0,
            duration_s: 4.0,
            reason: None,
            parts: Vec::new(),
            together: None,
            message: Value::Null,
        }
    }

    #[test]
    fn progress_tells_share_and_times() {
        let line = progress_line("left_arm", &view(ActionStatus::Running));
        assert_eq!(line, "left_arm ██████░░░░░░░░░░░░░░░░░░  25 % 1.0/4.0 s");
    }

    #[test]
    fn a_motion_that_is_paused_or_waits_is_told_as_such() {
        let ends_with =
            |status, words: &str| progress_line("left_arm", &view(status)).ends_with(words);
        assert!(ends_with(ActionStatus::Paused, "1.0/4.0 s  paused"));
        assert!(ends_with(ActionStatus::Queued, "1.0/4.0 s  waiting for its start"));
    }

    #[test]
    fn an_end_has_its_reason_and_code() {
        let mut view = view(ActionStatus::Failed);
        view.reason = Some(Denial::new(DenialCode::Stopped, "a stop came"));
        assert_eq!(end_line("torso", &view), "torso: failed after 1.0 s: a stop came (stopped)");
    }

    #[test]
    fn a_motion_of_several_robots_tells_how_it_kept_them_together() {
        let text = include_str!("../../../protocol/golden/cell_motion_status.json");
        let status: CellMotionStatus = serde_json::from_str(text).expect("the golden sample");
        let view = MotionView::from(status);
        let words = "time_synced, start skew 0.25 ms, divergence 0.75 ms";
        assert!(progress_line("lift", &view).ends_with(words));
        let end = MotionView { status: ActionStatus::Complete, ..view };
        assert_eq!(end_line("lift", &end), format!("lift: complete after 0.5 s ({words})"));
    }

    #[test]
    fn a_motion_without_length_is_done() {
        assert_eq!(fraction(0.0, 0.0), 1.0);
        assert_eq!(fraction(5.0, 4.0), 1.0);
    }
}
