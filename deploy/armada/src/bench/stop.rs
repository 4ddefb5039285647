//! How long a stop takes, from the client's call to the standstill of every robot.

use std::time::Duration;

use anyhow::Context as _;
use armada_agent::runtime::monotonic;
use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::client::Client;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys;
use armada_protocol::messages::{StopAck, StopLevel, StopRequest, StopScope, StopStage};
use armada_protocol::method::robot::Reset;
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
use super::part::{Ask, Part};
use super::raw::{self, zenoh_error};
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec, free_endpoint};
use crate::output::Progress;

/// Stages that are measured, with their names.
const STAGES: [(StopStage, &str); 3] = [
    (StopStage::Received, "A1 received"),
    (StopStage::Commanded, "A2 commanded"),
    (StopStage::Standstill, "A3 standstill"),
];
/// Size of the reference's answer, about that of an acknowledgement \[bytes\].
const ANSWER_BYTES: usize = 200;
/// Acknowledgements that wait to be looked at.
const QUEUE: usize = 4096;
/// How long a robot may take to stand still.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest motion between two stops.
const MOTION: Duration = Duration::from_secs(60);
/// Period of the control loops of a few arms, and of many.
const PERIODS: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(2)];
/// So many arms are a few.
const FEW: u32 = 4;

/// Arguments of `armada bench stop`.
#[derive(Args, Clone, Debug)]
pub(super) struct StopArgs {
    /// Stops, each with a query of the reference beside it
    #[arg(long, value_name = "NUMBER", default_value_t = 50,
        value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rounds: u32,
    /// Arms, each with an agent process of its own; loops of more than four run at 500 Hz
    #[arg(long, value_name = "NUMBER", default_value_t = 2,
        value_parser = clap::value_parser!(u32).range(1..=64))]
    arms: u32,
    /// Messages a second that the arms are flooded with meanwhile
    #[arg(long, value_name = "HZ", default_value_t = 0,
        value_parser = clap::value_parser!(u32).range(0..=100_000))]
    flood: u32,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

impl StopArgs {
    const fn period(&self) -> Duration {
        if self.arms > FEW { PERIODS[1] } else { PERIODS[0] }
    }
}

/// Stops moving robots again and again.
pub(super) async fn measure(args: StopArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let mut bench = Bench::start(&args, &mut machine).await?;
    let mut times = Times::default();
    let mut progress = Progress::new();
    let (begin, before) = (monotonic(), bench.flooded().await?);
    for round in 0..args.rounds {
        progress.show(&format!("stop {} of {}", round + 1, args.rounds));
        bench.round(round, &mut times).await?;
    }
    drop(progress);
    let time = monotonic().saturating_since(begin);
    let sent = bench.flooded().await?.zip(before).map(|(after, before)| after - before);
    let flooded = sent.map(|sent| f64::from(sent) / time.as_secs_f64());
    bench.end().await?;
    let settings = json!({
        "rounds": args.rounds, "arms": args.arms, "flood_hz": args.flood,
        "flooded_hz": flooded, "period_ms": args.period().as_secs_f64() * 1e3,
    });
    let mut report = times.report(Report::new("stop", settings, machine));
    if let Some(rate_hz) = flooded {
        report.note(format!("flooded with {rate_hz:.0} puts a second, all arms together"));
    }
    Ok(report)
}

struct Bench {
    arms: Vec<Arm>,
    controllers: Vec<Controller>,
    answerer: Child,
    flood: Option<Child>,
    client: Client,
    acks: mpsc::Receiver<(MonoTime, StopAck)>,
    _folder: Folder,
}

impl Bench {
    async fn start(args: &StopArgs, machine: &mut Machine) -> anyhow::Result<Self> {
        let folder = Folder::make()?;
        let (mut controllers, mut arms) = (Vec::new(), Vec::new());
        for index in 1..=args.arms {
            let spec = RobotSpec {
                name: format!("arm_{index}").parse()?,
                period: args.period(),
                state_rate_hz: 100,
                priority: args.common.policy.priority(),
            };
            let controller = Controller::start(&folder, &spec).await?;
            let arm = Arm::start(&controller).await?;
            machine.scheduled("agents", &arm.agent.ready.scheduling);
            controllers.push(controller);
            arms.push(arm);
        }
        let endpoint = free_endpoint()?;
        let part = Part::RawReply { endpoint: endpoint.clone(), bytes: ANSWER_BYTES };
        let answerer = Child::start(&part).await?;
        let mut endpoints: Vec<String> = arms.iter().map(|arm| arm.endpoint.clone()).collect();
        let flood = start_flood(args.flood, &arms, &endpoints).await?;
        endpoints.push(endpoint);
        let client = connect(endpoints).await?;
        let acks = receive_acks(&client).await?;
        Ok(Self { arms, controllers, answerer, flood, client, acks, _folder: folder })
    }

    /// Everybody moves, one query of the reference, one stop, by turns; then a reset.
    async fn round(&mut self, round: u32, times: &mut Times) -> anyhow::Result<()> {
        for arm in &self.arms {
            arm.make_ready().await?;
            arm.swing(MOTION).await?;
        }
        // At another place of the swing and of the loops' periods each time.
        sleep(Duration::from_micros(200_000 + u64::from(round % 50) * 3_170)).await;
        let request = stop_request();
        let payload = WireEncoding::Json.encode(&request)?;
        if round.is_multiple_of(2) {
            times.raw.push(self.query(payload.clone()).await?);
        }
        let begin = monotonic();
        publish(&self.client, payload.clone()).await?;
        self.collect(&request, begin, times).await?;
        if !round.is_multiple_of(2) {
            times.raw.push(self.query(payload).await?);
        }
        for arm in &self.arms {
            if let Some(latch) = arm.client.robot_status(&arm.name).await?.stop {
                arm.client.call::<Reset>(&arm.name, latch.reset_params()).await?;
            }
        }
        Ok(())
    }

    async fn query(&self, payload: Vec<u8>) -> anyhow::Result<f64> {
        let took = raw::round_trip(self.client.session(), Channel::Stop, payload).await?;
        Ok(took.as_secs_f64() * 1e3)
    }

    /// Takes acknowledgements until every robot stands still.
    async fn collect(
        &mut self,
        request: &StopRequest,
        begin: MonoTime,
        times: &mut Times,
    ) -> anyhow::Result<()> {
        let mut slowest = None;
        let mut seen: Vec<(RobotName, StopStage)> = Vec::new();
        while seen.len() < self.arms.len() * STAGES.len() {
            let next = timeout(PATIENCE, self.acks.recv()).await;
            let missing = || format!("after {PATIENCE:?} only {seen:?} have been acknowledged");
            let (received, ack) = next.ok().flatten().with_context(missing)?;
            let key = (ack.robot.clone(), ack.stage);
            let measured = STAGES.iter().any(|(stage, _)| *stage == ack.stage);
            if ack.stop_id != request.stop_id || !measured || seen.contains(&key) {
                continue;
            }
            let at_client = received.saturating_since(begin).as_secs_f64() * 1e3;
            let by_stamp = ack.stamp_ns.saturating_since(begin).as_secs_f64() * 1e3;
            if ack.stage == StopStage::Received {
                slowest = Some(at_client);
            }
            let since_received = ack.since_received_ms;
            times.acks.push(Ack { stage: ack.stage, at_client, by_stamp, since_received });
            seen.push(key);
        }
        times.received.extend(slowest);
        Ok(())
    }

    /// How often the flood has put so far.
    async fn flooded(&mut self) -> anyhow::Result<Option<u32>> {
        match &mut self.flood {
            Some(flood) => Ok(Some(flood.ask(Ask::Sent).await?)),
            None => Ok(None),
        }
    }

    async fn end(self) -> anyhow::Result<()> {
        self.client.close();
        if let Some(flood) = self.flood {
            flood.end().await?;
        }
        for arm in self.arms {
            arm.end().await?;
        }
        for controller in self.controllers {
            controller.end().await?;
        }
        self.answerer.end().await
    }
}

async fn start_flood(
    rate_hz: u32,
    arms: &[Arm],
    endpoints: &[String],
) -> anyhow::Result<Option<Child>> {
    if rate_hz == 0 {
        return Ok(None);
    }
    let robots = arms.iter().map(|arm| arm.name.clone()).collect();
    let part = Part::Flood { endpoints: endpoints.to_vec(), robots, rate_hz };
    Ok(Some(Child::start(&part).await?))
}

fn stop_request() -> StopRequest {
    StopRequest {
        stop_id: Uuid::now_v7(),
        source: "bench".to_owned(),
        level: StopLevel::L2,
        scope: StopScope::Cell,
        reason: "measurement".to_owned(),
        seq: 0,
    }
}

/// The first of the stops that [`Client::stop`] publishes, without its repetitions.
async fn publish(client: &Client, payload: Vec<u8>) -> anyhow::Result<()> {
    client
        .session()
        .put(keys::CELL_STOP.any(), payload)
        .encoding(WireEncoding::Json.to_zenoh())
        .priority(Channel::Stop.priority())
        .congestion_control(Channel::Stop.congestion_control())
        .express(Channel::Stop.express())
        .await
        .map_err(zenoh_error)
}

/// Acknowledgements with the time at which Zenoh handed them over.
async fn receive_acks(client: &Client) -> anyhow::Result<mpsc::Receiver<(MonoTime, StopAck)>> {
    let (sender, receiver) = mpsc::channel(QUEUE);
    client
        .session()
        .declare_subscriber(keys::ROBOT_STOP_ACK.any())
        .callback(move |sample| {
            let received = monotonic();
            // One that cannot be read or taken is missing, which ends the measurement.
            if let Ok(ack) = serde_json::from_slice(&sample.payload().to_bytes()) {
                let _ = sender.try_send((received, ack));
            }
        })
        .background()
        .await
        .map_err(zenoh_error)?;
    Ok(receiver)
}

/// Acknowledgement of a stage \[ms\].
struct Ack {
    stage: StopStage,
    /// From the publication until it came to the client.
    at_client: f64,
    /// From the publication until the agent says that it was reached.
    by_stamp: f64,
    /// From the agent's receipt until it was reached.
    since_received: f64,
}

#[derive(Default)]
struct Times {
    acks: Vec<Ack>,
    /// Until the last robot's first acknowledgement came \[ms\].
    received: Vec<f64>,
    /// Of the reference \[ms\].
    raw: Vec<f64>,
}

impl Times {
    fn report(mut self, mut report: Report) -> Report {
        let columns = QUANTILES.map(|(name, _)| name);
        let figures = |times: &mut Vec<f64>| [quantiles(times).unwrap_or_default()];
        let section = Section::new("published stop to the client's receipt, ms", columns)
            .row("A1 received, the slowest arm", &figures(&mut self.received))
            .row("raw query and reply", &figures(&mut self.raw))
            .ratio();
        report.section(self.add_rows(section, |ack| ack.at_client));
        let section = Section::new("published stop to the agent's stamp, ms", columns);
        report.section(self.add_rows(section, |ack| ack.by_stamp));
        let section = Section::new("the agent's receipt to the agent's stamp, ms", columns);
        report.section(self.add_rows(section, |ack| ack.since_received));
        report.note(
            "one publication each, without the repetitions of the client; rows are of all arms; \
             standstill is measured speed below the threshold for 100 ms, so the ramp and the hold \
             are in it",
        );
        report.note(
            "aims: p99 of A1 at most twice the raw query and reply; A2 at most one period and 2 ms \
             after A1",
        );
        report.note("client and agents read the same clock of this machine");
        report
    }

    fn add_rows(&self, mut section: Section, time: fn(&Ack) -> f64) -> Section {
        for (stage, name) in STAGES {
            let of = |ack: &&Ack| ack.stage == stage;
            let mut times: Vec<f64> = self.acks.iter().filter(of).map(time).collect();
            let figures = [quantiles(&mut times).unwrap_or_default()];
            section = section.row(name, &figures);
        }
        section
    }
}
