//! How soon whoever drives a robot has lost it when a person takes it.

use std::time::Duration;

use anyhow::{Context as _, ensure};
use armada_agent::runtime::monotonic;
use armada_model::MonoTime;
use armada_protocol::client::Client;
use armada_protocol::keys;
use armada_protocol::messages::{
    AcquireLeaseParams, ActionStatus, CommandMode, Empty, Event, EventKind,
    ExecuteTrajectoryParams, LeaseParams, MotionStatus, Role, SetModeParams, TakeLeaseParams,
};
use armada_protocol::method::robot::{
    AcquireLease, ExecuteTrajectory, Halt, ReleaseLease, SetMode, TakeLease,
};
use armada_protocol::qos::Channel;
use clap::Args;
use serde_json::json;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::CommonArgs;
use super::arm::{Arm, Controller, connect, when_at_rest};
use super::child::Child;
use super::figures::{QUANTILES, quantiles};
use super::machine::Machine;
use super::part::Part;
use super::raw::{self, zenoh_error};
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec, free_endpoint, ready_position};
use super::swing::swing;
use crate::output::Progress;

/// Period of the control loop.
const PERIOD: Duration = Duration::from_millis(2);
/// How long leases last.
const TTL_MS: u64 = 20_000;
/// Longest motion between two takes.
const MOTION: Duration = Duration::from_secs(20);
/// How long anything may take.
const PATIENCE: Duration = Duration::from_secs(20);
/// Size of an answer of the reference, about that of a grant \[bytes\].
const ANSWER_BYTES: usize = 100;
/// Words that wait to be looked at.
const QUEUE: usize = 256;

/// Arguments of `armada bench lease`.
#[derive(Args, Clone, Debug)]
pub(super) struct LeaseArgs {
    /// Takes, each with a query of the reference beside it
    #[arg(long, value_name = "NUMBER", default_value_t = 50,
        value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rounds: u32,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// Takes a moving robot from its holder again and again.
pub(super) async fn measure(args: LeaseArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let mut bench = Bench::start(&args, &mut machine).await?;
    let mut times = Times::default();
    let mut progress = Progress::new();
    for round in 0..args.rounds {
        progress.show(&format!("take {} of {}", round + 1, args.rounds));
        bench.round(round, &mut times).await?;
    }
    drop(progress);
    bench.end().await?;
    let settings = json!({ "rounds": args.rounds, "period_ms": PERIOD.as_secs_f64() * 1e3 });
    Ok(times.report(Report::new("lease", settings, machine)))
}

/// What the holder is told, with the time at which Zenoh handed it over.
enum Told {
    Lease(MonoTime, Event),
    Motion(MonoTime, Box<MotionStatus>),
}

struct Bench {
    arm: Arm,
    controller: Controller,
    answerer: Child,
    /// Drives the robot.
    holder: Client,
    /// Takes it.
    person: Client,
    told: mpsc::Receiver<Told>,
    _folder: Folder,
}

impl Bench {
    async fn start(args: &LeaseArgs, machine: &mut Machine) -> anyhow::Result<Self> {
        let folder = Folder::make()?;
        let spec = RobotSpec {
            name: "arm".parse()?,
            period: PERIOD,
            state_rate_hz: 100,
            priority: args.common.policy.priority(),
        };
        let controller = Controller::start(&folder, &spec).await?;
        let arm = Arm::start(&controller).await?;
        machine.scheduled("agent", &arm.agent.ready.scheduling);
        let endpoint = free_endpoint()?;
        let part = Part::RawReply { endpoint: endpoint.clone(), bytes: ANSWER_BYTES };
        let answerer = Child::start(&part).await?;
        let holder = connect(vec![arm.endpoint.clone()]).await?;
        let person = connect(vec![arm.endpoint.clone(), endpoint]).await?;
        let told = listen(&holder, &arm).await?;
        Ok(Self { arm, controller, answerer, holder, person, told, _folder: folder })
    }

    /// The holder moves the robot, the person takes it, and gives it back.
    async fn round(&mut self, round: u32, times: &mut Times) -> anyhow::Result<()> {
        let motion = self.drive().await?;
        // At another place of the loop's period each time.
        sleep(Duration::from_micros(200_000 + u64::from(round % 50) * 370)).await;
        if round.is_multiple_of(2) {
            times.raw.push(self.query().await?);
        }
        while self.told.try_recv().is_ok() {}
        let (name, reason) = (self.arm.name.clone(), "measurement".to_owned());
        let params = TakeLeaseParams { ttl_ms: TTL_MS, role: Role::Operator, reason };
        let begin = monotonic();
        let grant = self.person.call::<TakeLease>(&name, params).await?;
        let granted = monotonic();
        let (event, status) = self.hear(motion).await?;
        ensure!(status.1.status != ActionStatus::Complete, "the motion was over before the take");
        times.granted.push(since(begin, granted));
        times.revoked.push(since(begin, event.1));
        times.heard.push(since(begin, event.0));
        times.told.push(since(begin, status.0));
        times.ended.push(since(begin, status.1.stamp_ns));
        if !round.is_multiple_of(2) {
            times.raw.push(self.query().await?);
        }
        let params = LeaseParams { lease: grant.lease };
        self.person.call::<ReleaseLease>(&name, params).await?;
        Ok(())
    }

    /// The holder gets the lease and moves the robot.
    async fn drive(&self) -> anyhow::Result<Uuid> {
        let name = &self.arm.name;
        self.holder.call::<Halt>(name, Empty {}).await?;
        let params = AcquireLeaseParams { ttl_ms: TTL_MS, role: Role::Program };
        let grant = self.holder.call::<AcquireLease>(name, params).await?;
        let held = self.holder.under(grant.lease);
        let mode = SetModeParams { mode: CommandMode::Trajectory };
        when_at_rest(async || held.call::<SetMode>(name, mode).await).await?;
        let trajectory = swing(self.arm.position().await?, ready_position()?, MOTION);
        let params = ExecuteTrajectoryParams::at_once(None, trajectory);
        Ok(held.call::<ExecuteTrajectory>(name, params).await?.motion_id)
    }

    /// What the holder hears: that the lease is another's, and the end of its motion. Of the first
    /// the time of its receipt and the agent's stamp.
    async fn hear(
        &mut self,
        motion: Uuid,
    ) -> anyhow::Result<((MonoTime, MonoTime), (MonoTime, Box<MotionStatus>))> {
        let (mut lease, mut end) = (None, None);
        while lease.is_none() || end.is_none() {
            let told = timeout(PATIENCE, self.told.recv()).await.ok().flatten();
            match told.context("the holder is told nothing")? {
                Told::Lease(at, event) => {
                    lease.get_or_insert((at, event.stamp_ns));
                }
                Told::Motion(at, status) if status.id == motion && status.status.is_terminal() => {
                    end.get_or_insert((at, status));
                }
                Told::Motion(..) => {}
            }
        }
        lease.zip(end).context("both were heard")
    }

    async fn query(&self) -> anyhow::Result<f64> {
        let payload = vec![0; ANSWER_BYTES];
        let took = raw::round_trip(self.person.session(), Channel::Rpc, payload).await?;
        Ok(took.as_secs_f64() * 1e3)
    }

    async fn end(self) -> anyhow::Result<()> {
        self.holder.close();
        self.person.close();
        self.arm.end().await?;
        self.controller.end().await?;
        self.answerer.end().await
    }
}

/// Listens as the holder does.
async fn listen(holder: &Client, arm: &Arm) -> anyhow::Result<mpsc::Receiver<Told>> {
    let (sender, receiver) = mpsc::channel(QUEUE);
    let of_motions = sender.clone();
    holder
        .session()
        .declare_subscriber(keys::ROBOT_EVENTS.of(&arm.name))
        .callback(move |sample| {
            let received = monotonic();
            let read = serde_json::from_slice::<Event>(&sample.payload().to_bytes());
            // What cannot be read or taken is missing, which ends the measurement.
            if let Some(event) = read.ok().filter(|event| event.kind == EventKind::Lease) {
                let _ = sender.try_send(Told::Lease(received, event));
            }
        })
        .background()
        .await
        .map_err(zenoh_error)?;
    holder
        .session()
        .declare_subscriber(keys::ROBOT_MOTION.with(&[arm.name.as_str()]))
        .callback(move |sample| {
            let received = monotonic();
            if let Ok(status) = serde_json::from_slice(&sample.payload().to_bytes()) {
                let _ = of_motions.try_send(Told::Motion(received, Box::new(status)));
            }
        })
        .background()
        .await
        .map_err(zenoh_error)?;
    Ok(receiver)
}

fn since(begin: MonoTime, end: MonoTime) -> f64 {
    end.saturating_since(begin).as_secs_f64() * 1e3
}

/// Times since the person asked \[ms\].
#[derive(Default)]
struct Times {
    granted: Vec<f64>,
    revoked: Vec<f64>,
    heard: Vec<f64>,
    told: Vec<f64>,
    ended: Vec<f64>,
    raw: Vec<f64>,
}

impl Times {
    fn report(mut self, mut report: Report) -> Report {
        let columns = QUANTILES.map(|(name, _)| name);
        let figures = |times: &mut Vec<f64>| [quantiles(times).unwrap_or_default()];
        report.section(
            Section::new("take_lease of a robot that somebody moves, ms", columns)
                .row("the holder has lost it, by the loop's stamp", &figures(&mut self.revoked))
                .row("the holder is told", &figures(&mut self.heard))
                .row("the holder is told of the end of its motion", &figures(&mut self.told))
                .row("its motion has ended, by the loop's stamp", &figures(&mut self.ended))
                .row("the person is granted it", &figures(&mut self.granted))
                .row("raw query and reply", &figures(&mut self.raw))
                .ratio(),
        );
        report.note("aim: lost at most one round trip and one period after it was asked for");
        report.note("agent and clients read the same clock of this machine");
        report
    }
}
