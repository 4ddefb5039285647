//! Many arms in one agent process, their controllers in another.

use std::time::Duration;

use armada_agent::runtime::monotonic;
use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::keys;
use armada_protocol::messages::{RobotFlags, RobotState};
use tokio::time::{sleep, timeout};

use anyhow::Context as _;

use super::arm::connect;
use super::child::Child;
use super::figures::quantiles;
use super::part::{Ask, Part};
use super::robot_file::{self, Folder, RobotSpec, free_endpoint};
use super::wakes::Regularity;

/// How long the arms may take to switch their drives on.
const PATIENCE: Duration = Duration::from_secs(20);
/// Time for caches and connections before a measurement.
const WARM_UP: Duration = Duration::from_secs(1);

/// What loops of one process did over a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LoopFigures {
    /// Share of the periods without a tick, 0 to 1.
    pub(super) missed_share: f64,
    /// 99th percentile of the period error \[µs\].
    pub(super) error_p99_us: f64,
    /// Processor time of the process for each loop, as a share of one processor.
    pub(super) cpu_share: f64,
}

/// Arms of one agent.
pub(super) struct Fleet {
    agent: Child,
    emulators: Child,
    arms: u32,
}

impl Fleet {
    /// Starts `arms` of which `spec` says all but the name, and waits until their drives are on.
    pub(super) async fn start(
        folder: &Folder,
        spec: &RobotSpec,
        arms: u32,
    ) -> anyhow::Result<Self> {
        let robots = robot_file::write_fleet(folder, spec, arms)?;
        let emulators = Child::start(&Part::Emulator { robots: robots.clone() }).await?;
        let endpoint = free_endpoint()?;
        let part = Part::Agent { robots, endpoint: endpoint.clone(), connect: Vec::new() };
        let agent = Child::start(&part).await?;
        let client = connect(vec![endpoint]).await?;
        let enabled = timeout(PATIENCE, wait_until_enabled(&client, arms)).await;
        enabled.with_context(|| format!("not all of {arms} arms are enabled"))??;
        client.close();
        Ok(Self { agent, emulators, arms })
    }

    /// How the control loops are scheduled.
    pub(super) fn scheduling(&self) -> &str {
        &self.agent.ready.scheduling
    }

    /// What the control loops do over `time`, after a warm-up, and the share of one processor that
    /// the controller of one arm takes.
    pub(super) async fn measure(&mut self, time: Duration) -> anyhow::Result<(LoopFigures, f64)> {
        sleep(WARM_UP).await;
        let begin = (monotonic(), self.emulators.ask::<f64>(Ask::CpuTime).await?);
        let loops = measure_loops(&mut self.agent, self.arms, time).await?;
        let end = (monotonic(), self.emulators.ask::<f64>(Ask::CpuTime).await?);
        let emulator = (end.1 - begin.1) / end.0.saturating_since(begin.0).as_secs_f64();
        Ok((loops, emulator / f64::from(self.arms)))
    }

    /// Ends them all.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        self.agent.end().await?;
        self.emulators.end().await
    }
}

/// What as many loops that do nothing do over `time`, after a warm-up; with their scheduling.
pub(super) async fn measure_bare(
    spec: &RobotSpec,
    loops: u32,
    time: Duration,
) -> anyhow::Result<(LoopFigures, String)> {
    let part = Part::BareLoops { loops, period: spec.period, priority: spec.priority };
    let mut child = Child::start(&part).await?;
    sleep(WARM_UP).await;
    let figures = measure_loops(&mut child, loops, time).await?;
    let scheduling = child.ready.scheduling.clone();
    child.end().await?;
    Ok((figures, scheduling))
}

async fn measure_loops(
    child: &mut Child,
    loops: u32,
    time: Duration,
) -> anyhow::Result<LoopFigures> {
    let begin = (monotonic(), child.ask::<f64>(Ask::CpuTime).await?);
    let mut regularity: Regularity = child.ask(Ask::Wakes(time)).await?;
    let end = (monotonic(), child.ask::<f64>(Ask::CpuTime).await?);
    let used = (end.1 - begin.1) / end.0.saturating_since(begin.0).as_secs_f64();
    let [_, error_p99_us, ..] = quantiles(&mut regularity.errors_us).unwrap_or_default();
    Ok(LoopFigures {
        missed_share: regularity.missed_share(),
        error_p99_us,
        cpu_share: used / f64::from(loops),
    })
}

async fn wait_until_enabled(client: &Client, arms: u32) -> anyhow::Result<()> {
    let states =
        client.subscribe::<RobotState>(&keys::ROBOT_STATE.any(), arms as usize * 4).await?;
    let mut enabled = std::collections::BTreeSet::<RobotName>::new();
    while enabled.len() < arms as usize {
        let (key, state) = states.next().await?;
        if state.flags.contains(RobotFlags::ENABLED) {
            enabled.extend(keys::robot_of(&key));
        }
    }
    Ok(())
}
