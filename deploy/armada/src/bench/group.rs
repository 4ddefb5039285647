//! How well two arms keep together, and how soon one stops when the other is lost.
//!
//! Each arm has an agent process of its own, with a direct link to the other. What a gateway does is
//! done here: prepare both, then commit both to one instant; all of them read the same clock, so what
//! is measured is of the agents alone.

use std::time::Duration;

use anyhow::{Context as _, ensure};
use armada_agent::runtime::monotonic;
use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::keys;
use armada_protocol::messages::{
    ActionStatus, CommitParams, Coupling, GroupAbort, GroupParams, MotionStatus, PrepareParams,
    RobotStatus,
};
use armada_protocol::method::robot::{Commit, Prepare};
use armada_protocol::qos::Channel;
use clap::Args;
use serde_json::json;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::CommonArgs;
use super::arm::{Arm, Controller, connect};
use super::child::Child;
use super::figures::{QUANTILES, quantiles};
use super::machine::Machine;
use super::part::Part;
use super::raw::{self, zenoh_error};
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec, free_endpoint, ready_position};
use super::swing::swing;
use crate::output::Progress;

/// The arms.
const ROBOTS: [&str; 2] = ["left_arm", "right_arm"];
/// Period of their control loops.
const PERIOD: Duration = Duration::from_millis(2);
/// Silence of a partner after which an arm stops.
const LOSS: Duration = Duration::from_millis(60);
/// From the commit to the common start.
const LEAD: Duration = Duration::from_millis(200);
/// Length of each motion.
const MOTION: Duration = Duration::from_secs(2);
/// How long anything may take.
const PATIENCE: Duration = Duration::from_secs(20);
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(10);
/// Size of an answer of the reference \[bytes\].
const ANSWER_BYTES: usize = 200;
/// Aborts that wait to be looked at.
const QUEUE: usize = 64;

/// Arguments of `armada bench group`.
#[derive(Args, Clone, Debug)]
pub(super) struct GroupArgs {
    /// Motions to their end, and as many with a partner that is lost
    #[arg(long, value_name = "NUMBER", default_value_t = 20,
        value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rounds: u32,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// Moves two arms together again and again; in every second motion one of them freezes.
pub(super) async fn measure(args: GroupArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let mut bench = Bench::start(&args, &mut machine).await?;
    let mut times = Times::default();
    let mut progress = Progress::new();
    for round in 0..args.rounds {
        progress.show(&format!("motion {} of {}", round + 1, args.rounds));
        bench.together(&mut times).await?;
        bench.lost(round, &mut times).await?;
    }
    drop(progress);
    bench.end().await?;
    let settings = json!({
        "rounds": args.rounds, "robots": ROBOTS, "period_ms": PERIOD.as_secs_f64() * 1e3,
        "loss_ms": LOSS.as_millis(),
    });
    Ok(times.report(Report::new("group", settings, machine)))
}

struct Bench {
    arms: Vec<Arm>,
    controllers: Vec<Controller>,
    answerer: Child,
    client: Client,
    aborts: mpsc::Receiver<(MonoTime, GroupAbort)>,
    _folder: Folder,
}

impl Bench {
    async fn start(args: &GroupArgs, machine: &mut Machine) -> anyhow::Result<Self> {
        let folder = Folder::make()?;
        let (mut controllers, mut arms) = (Vec::new(), Vec::<Arm>::new());
        for name in ROBOTS {
            let spec = RobotSpec {
                name: name.parse()?,
                period: PERIOD,
                state_rate_hz: 100,
                priority: args.common.policy.priority(),
            };
            let controller = Controller::start(&folder, &spec).await?;
            let others = arms.iter().map(|arm| arm.endpoint.clone()).collect();
            let arm = Arm::start_linked(&controller, others).await?;
            machine.scheduled(name, &arm.agent.ready.scheduling);
            controllers.push(controller);
            arms.push(arm);
        }
        let endpoint = free_endpoint()?;
        let part = Part::RawReply { endpoint: endpoint.clone(), bytes: ANSWER_BYTES };
        let answerer = Child::start(&part).await?;
        let mut endpoints: Vec<String> = arms.iter().map(|arm| arm.endpoint.clone()).collect();
        endpoints.push(endpoint);
        let client = connect(endpoints).await?;
        let aborts = receive_aborts(&client).await?;
        Ok(Self { arms, controllers, answerer, client, aborts, _folder: folder })
    }

    /// One motion to its end.
    async fn together(&self, times: &mut Times) -> anyhow::Result<()> {
        let id = self.begin().await?;
        let mut starts = Vec::new();
        for arm in &self.arms {
            let end = ended(arm, id).await?;
            ensure!(end.status == ActionStatus::Complete, "{}: {}", arm.name, words(&end));
            starts.extend(end.started_ns);
            let quality = end.group.context("no quality of the group is told")?;
            times.divergence.push(quality.max_divergence_ms);
            times.silence.push(quality.max_silence_ms);
        }
        let (first, last) = (starts.iter().min(), starts.iter().max());
        let (first, last) = first.zip(last).context("no start is told")?;
        times.skew.push(ms(last.saturating_since(*first)));
        let took = raw::round_trip(self.client.session(), Channel::Stream, vec![0; ANSWER_BYTES]);
        times.raw.push(ms(took.await?));
        Ok(())
    }

    /// One motion in which an arm's agent freezes.
    async fn lost(&mut self, round: u32, times: &mut Times) -> anyhow::Result<()> {
        let id = self.begin().await?;
        let turn = usize::from(round % 2 == 1);
        let (frozen, other) = match self.arms.as_slice() {
            [left, right] if turn == 0 => (left, right),
            [left, right] => (right, left),
            _ => anyhow::bail!("two arms are needed"),
        };
        let is_moving = |status: &RobotStatus| {
            status.motion.as_ref().is_some_and(|m| m.id == id && m.elapsed_s > 0.2)
        };
        other.status_when("moving", is_moving).await?;
        // At another place between two heartbeats each time.
        sleep(Duration::from_micros(u64::from(round % 20) * 1_070)).await;
        let begin = monotonic();
        frozen.agent.freeze()?;
        let aborted = first_abort(&mut self.aborts, id, &other.name).await;
        frozen.agent.thaw()?;
        times.abort.push(ms(aborted?.saturating_since(begin)));
        let end = ended(other, id).await?;
        times.ended.push(ms(end.stamp_ns.saturating_since(begin)));
        let quality = end.group.context("no quality of the group is told")?;
        times.lost_silence.push(quality.max_silence_ms);
        ended(frozen, id).await?;
        Ok(())
    }

    /// Starts a motion of both arms.
    async fn begin(&self) -> anyhow::Result<Uuid> {
        let id = Uuid::now_v7();
        let mut boots = Vec::new();
        let mut slope = f64::INFINITY;
        for arm in &self.arms {
            arm.make_ready().await?;
            arm.at_rest().await?;
            let trajectory = swing(arm.position().await?, ready_position()?, MOTION);
            let mut params = PrepareParams::alone(Some(id), trajectory);
            params.group = Some(self.group(&arm.name));
            let prepared = arm.client.call::<Prepare>(&arm.name, params).await?;
            let readiness = prepared.group.context("the agent knows no groups")?;
            slope = slope.min(readiness.rate_slope_s);
            boots.push(arm.client.robot_status(&arm.name).await?.boot_id);
        }
        let start_ns = monotonic() + LEAD;
        for (arm, boot_id) in self.arms.iter().zip(boots) {
            let rate_slope_s = Some(slope);
            let params = CommitParams { motion_id: id, boot_id, start_ns, rate_slope_s };
            arm.client.call::<Commit>(&arm.name, params).await?;
        }
        Ok(id)
    }

    fn group(&self, robot: &RobotName) -> GroupParams {
        let names = self.arms.iter().map(|arm| arm.name.clone());
        GroupParams {
            partners: names.filter(|name| name != robot).collect(),
            coupling: Coupling::TimeSynced,
            loss_ms: u64::try_from(LOSS.as_millis()).unwrap_or(u64::MAX),
            max_divergence_ms: 50.0,
            model_rev: None,
        }
    }

    async fn end(self) -> anyhow::Result<()> {
        self.client.close();
        for arm in self.arms {
            arm.end().await?;
        }
        for controller in self.controllers {
            controller.end().await?;
        }
        self.answerer.end().await
    }
}

/// Aborts of groups with the time at which Zenoh handed them over.
async fn receive_aborts(client: &Client) -> anyhow::Result<mpsc::Receiver<(MonoTime, GroupAbort)>> {
    let (sender, receiver) = mpsc::channel(QUEUE);
    client
        .session()
        .declare_subscriber(keys::GROUP_ABORT.any())
        .callback(move |sample| {
            let received = monotonic();
            // One that cannot be read or taken is missing, which ends the measurement.
            if let Ok(abort) = serde_json::from_slice(&sample.payload().to_bytes()) {
                let _ = sender.try_send((received, abort));
            }
        })
        .background()
        .await
        .map_err(zenoh_error)?;
    Ok(receiver)
}

async fn first_abort(
    aborts: &mut mpsc::Receiver<(MonoTime, GroupAbort)>,
    id: Uuid,
    robot: &RobotName,
) -> anyhow::Result<MonoTime> {
    loop {
        let next = timeout(PATIENCE, aborts.recv()).await;
        let (received, abort) = next.ok().flatten().with_context(|| format!("{robot} goes on"))?;
        if abort.motion_id == id && abort.robot == *robot {
            return Ok(received);
        }
    }
}

/// How an arm's part of a motion ended.
async fn ended(arm: &Arm, id: Uuid) -> anyhow::Result<MotionStatus> {
    let looking = async {
        loop {
            let status = arm.client.motion(&arm.name, id).await;
            if let Some(status) = status.ok().filter(|status| status.status.is_terminal()) {
                return status;
            }
            sleep(LOOK).await;
        }
    };
    timeout(PATIENCE, looking).await.with_context(|| format!("{}: no end is told", arm.name))
}

fn words(status: &MotionStatus) -> String {
    let reason = status.reason.as_ref().map(ToString::to_string);
    format!("motion {:?}: {}", status.status, reason.unwrap_or_default())
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[derive(Default)]
struct Times {
    skew: Vec<f64>,
    divergence: Vec<f64>,
    silence: Vec<f64>,
    /// From the freezing of an agent to the abort of the other, as it comes to the client.
    abort: Vec<f64>,
    /// From the freezing to the end of the other arm's motion, after which it has its ramp to rest.
    ended: Vec<f64>,
    lost_silence: Vec<f64>,
    raw: Vec<f64>,
}

impl Times {
    fn report(mut self, mut report: Report) -> Report {
        let columns = QUANTILES.map(|(name, _)| name);
        let figures = |times: &mut Vec<f64>| [quantiles(times).unwrap_or_default()];
        report.section(
            Section::new("two arms on a common path, ms", columns)
                .row("difference of their starts", &figures(&mut self.skew))
                .row("largest difference of phase", &figures(&mut self.divergence))
                .row("longest silence of the partner", &figures(&mut self.silence))
                .row("raw query and reply", &figures(&mut self.raw)),
        );
        report.section(
            Section::new("agent frozen to the partner's reaction, ms", columns)
                .row("silence when it aborted", &figures(&mut self.lost_silence))
                .row("abort, at the client", &figures(&mut self.abort))
                .row("end of its motion, by its stamp", &figures(&mut self.ended)),
        );
        let bound = LOSS + PERIOD;
        report.note(format!("aim: abort at most {} ms after the loss", bound.as_millis()));
        report.note("agents, client and controllers read the same clock of this machine");
        report
    }
}
