//! Our side: an agent with an emulated controller, each a process, and this one as the client.

use std::time::Duration;

use anyhow::Context as _;
use armada_agent::runtime::monotonic;
use armada_model::{JointVector, MonoTime};
use armada_protocol::client::Client;
use armada_protocol::keys;
use armada_protocol::messages::{CancelParams, ExecuteTrajectoryParams, RobotState};
use armada_protocol::method::robot::{Cancel, ExecuteTrajectory};
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use uuid::Uuid;
use zenoh::pubsub::Subscriber;

use super::figures::{Figures, Typical, regularity, typical};
use super::{MOTION_WAYPOINTS, OriginalArgs, RATES_HZ, WARM_UP, WAYPOINTS, keep_busy};
use crate::bench::arm::{Arm, Controller, connect};
use crate::bench::machine::Machine;
use crate::bench::part::Ask;
use crate::bench::raw::zenoh_error;
use crate::bench::robot_file::{Folder, RobotSpec, ready_position};
use crate::bench::swing::long_swing;
use crate::bench::wakes::Regularity;

/// States that wait to be looked at.
const QUEUE: usize = 1 << 16;
/// How long a state may be awaited.
const PATIENCE: Duration = Duration::from_secs(10);
/// Less than this is no motion \[rad\].
const STILL: f64 = 1e-9;

/// Measures one arm, at one rate after the other.
pub(super) async fn measure(args: &OriginalArgs, machine: &mut Machine) -> anyhow::Result<Figures> {
    let mut figures = Figures::default();
    let [slow, fast] = RATES_HZ;
    let mut arm = Ours::start(args, Rates { control_hz: slow, state_hz: slow }).await?;
    let held = arm.hold(args.seconds).await?;
    arm.end().await?;
    (figures.latency_us[0], figures.processor_percent[0]) = (held.latency_us, held.percent);

    let mut arm = Ours::start(args, Rates { control_hz: fast, state_hz: slow }).await?;
    figures.processor_percent[2] = arm.hold(args.seconds).await?.percent;
    arm.end().await?;

    let mut arm = Ours::start(args, Rates { control_hz: fast, state_hz: fast }).await?;
    machine.scheduled("armada", &arm.arm.agent.ready.scheduling);
    let held = arm.hold(args.seconds).await?;
    (figures.latency_us[1], figures.processor_percent[1]) = (held.latency_us, held.percent);
    figures.idle = regularity(held.regularity);
    let busy = keep_busy().await?;
    figures.busy = regularity(arm.hold(args.seconds).await?.regularity);
    busy.end().await?;
    figures.round_trip_us = arm.round_trips(args.rounds * 10).await?;
    for (waypoints, figure) in WAYPOINTS.into_iter().zip(&mut figures.accept_ms) {
        let motions = arm.motions(waypoints, args.rounds).await?;
        *figure = typical(&mut motions.iter().map(|motion| motion.accepted_ms).collect::<Vec<_>>());
    }
    let motions = arm.motions(MOTION_WAYPOINTS, args.rounds).await?;
    figures.first_motion_ms =
        typical(&mut motions.iter().map(|motion| motion.moved_ms).collect::<Vec<_>>());
    arm.end().await?;
    Ok(figures)
}

/// How often an arm does what \[Hz\].
#[derive(Clone, Copy)]
struct Rates {
    control_hz: u32,
    state_hz: u32,
}

/// An arm that holds its position, and a subscriber of its state.
struct Ours {
    arm: Arm,
    controller: Controller,
    watcher: Client,
    _subscriber: Subscriber<()>,
    states: mpsc::Receiver<(MonoTime, RobotState)>,
    _folder: Folder,
}

/// What an arm did while it held its position.
struct Held {
    regularity: Regularity,
    latency_us: Typical,
    /// Processor time of the agent \[%\].
    percent: f64,
}

/// What was measured of one motion.
struct Motion {
    /// Until the answer came \[ms\].
    accepted_ms: f64,
    /// Until a state with another set-point came \[ms\].
    moved_ms: f64,
}

impl Ours {
    async fn start(args: &OriginalArgs, rates: Rates) -> anyhow::Result<Self> {
        let folder = Folder::make()?;
        let spec = RobotSpec {
            name: "arm".parse()?,
            period: Duration::from_secs(1) / rates.control_hz,
            state_rate_hz: rates.state_hz,
            priority: args.common.policy.priority(),
        };
        let controller = Controller::start(&folder, &spec).await?;
        let arm = Arm::start(&controller).await?;
        let watcher = connect(vec![arm.endpoint.clone()]).await?;
        let (sender, states) = mpsc::channel(QUEUE);
        let subscriber = watcher
            .session()
            .declare_subscriber(keys::ROBOT_STATE.of(&arm.name))
            .callback(move |sample| {
                // Decoded here, as the original hands over its state. One that is lost is missed.
                let state = serde_json::from_slice(&sample.payload().to_bytes());
                if let Ok(state) = state {
                    let _ = sender.try_send((monotonic(), state));
                }
            })
            .await
            .map_err(zenoh_error)?;
        sleep(WARM_UP).await;
        let _subscriber = subscriber;
        Ok(Self { arm, controller, watcher, _subscriber, states, _folder: folder })
    }

    async fn hold(&mut self, time: Duration) -> anyhow::Result<Held> {
        while self.states.try_recv().is_ok() {}
        let begin = (monotonic(), self.arm.agent.ask::<f64>(Ask::CpuTime).await?);
        let regularity = self.arm.agent.ask(Ask::Wakes(time)).await?;
        let end = (monotonic(), self.arm.agent.ask::<f64>(Ask::CpuTime).await?);
        let mut latencies = Vec::new();
        while let Ok((received, state)) = self.states.try_recv() {
            latencies.push(received.saturating_since(state.stamp_ns).as_secs_f64() * 1e6);
        }
        let wall = end.0.saturating_since(begin.0).as_secs_f64();
        let percent = (end.1 - begin.1) / wall * 100.0;
        Ok(Held { regularity, latency_us: typical(&mut latencies), percent })
    }

    async fn round_trips(&self, rounds: u32) -> anyhow::Result<Typical> {
        let mut times = Vec::new();
        for _ in 0..rounds {
            let begin = monotonic();
            self.arm.client.robot_clock(&self.arm.name).await?;
            times.push(monotonic().saturating_since(begin).as_secs_f64() * 1e6);
        }
        Ok(typical(&mut times))
    }

    async fn motions(&mut self, waypoints: u32, rounds: u32) -> anyhow::Result<Vec<Motion>> {
        let mut motions = Vec::new();
        for _ in 0..rounds {
            motions.push(self.motion(waypoints).await?);
        }
        Ok(motions)
    }

    /// Begins a motion, and ends it as soon as it is seen.
    async fn motion(&mut self, waypoints: u32) -> anyhow::Result<Motion> {
        self.arm.status_when("at rest", |status| status.motion.is_none()).await?;
        while self.states.try_recv().is_ok() {}
        let (_, state) = self.next_state().await?;
        let from = state.joint_position_command_rad;
        let trajectory = long_swing(from, ready_position()?, waypoints);
        let params = ExecuteTrajectoryParams::at_once(None, trajectory);
        let sent = monotonic();
        let accepted = self.arm.client.call::<ExecuteTrajectory>(&self.arm.name, params).await?;
        let answered = monotonic();
        let moved = self.first_change(from, sent).await?;
        self.cancel(accepted.motion_id).await?;
        let since = |time: MonoTime| time.saturating_since(sent).as_secs_f64() * 1e3;
        Ok(Motion { accepted_ms: since(answered), moved_ms: since(moved) })
    }

    /// When the first state after `sent` came whose set-point is not `from`.
    async fn first_change(
        &mut self,
        from: JointVector,
        sent: MonoTime,
    ) -> anyhow::Result<MonoTime> {
        loop {
            let (received, state) = self.next_state().await?;
            let command = state.joint_position_command_rad;
            let differs = command.iter().zip(from.iter()).any(|(a, b)| (a - b).abs() > STILL);
            if differs && received > sent {
                return Ok(received);
            }
        }
    }

    async fn next_state(&mut self) -> anyhow::Result<(MonoTime, RobotState)> {
        let state = timeout(PATIENCE, self.states.recv()).await.context("no state comes")?;
        state.context("the subscriber has ended")
    }

    async fn cancel(&self, motion_id: Uuid) -> anyhow::Result<()> {
        self.arm.client.call::<Cancel>(&self.arm.name, CancelParams { motion_id }).await?;
        Ok(())
    }

    async fn end(self) -> anyhow::Result<()> {
        self.watcher.close();
        self.arm.end().await?;
        self.controller.end().await
    }
}
