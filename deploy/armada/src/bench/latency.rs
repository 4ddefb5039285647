//! How long a state takes from its tick to a subscriber in another process.

use std::sync::mpsc;
use std::time::Duration;

use anyhow::Context as _;
use armada_agent::runtime::monotonic;
use armada_model::MonoTime;
use armada_protocol::client::Client;
use armada_protocol::keys;
use armada_protocol::messages::RobotState;
use clap::Args;
use serde_json::json;
use tokio::time::sleep;

use super::arm::{Arm, Controller, connect};
use super::child::Child;
use super::figures::{QUANTILES, quantiles};
use super::machine::Machine;
use super::part::Part;
use super::raw::{self, zenoh_error};
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec, free_endpoint};
use super::{CommonArgs, RepeatArgs, Side, TimeArgs, turns};
use crate::output::Progress;

/// Time for connections and caches before a measurement.
const WARM_UP: Duration = Duration::from_secs(1);
/// Rate of the control loop \[Hz\].
const LOOP_RATE_HZ: u32 = 1000;

/// Arguments of `armada bench latency`.
#[derive(Args, Clone, Debug)]
pub(super) struct LatencyArgs {
    /// Rate of the state, 1 to 1000
    #[arg(long, value_name = "HZ", default_value_t = 100,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(LOOP_RATE_HZ)))]
    rate: u32,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    repeat: RepeatArgs,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// A sample with the time at which Zenoh handed it over.
type Arrival = (MonoTime, Vec<u8>);

/// Measures both publishers, pair by pair.
pub(super) async fn measure(args: LatencyArgs) -> anyhow::Result<Report> {
    let machine = Machine::now();
    let mut bench = Bench::start(args, machine).await?;
    let mut progress = Progress::new();
    for pair in 0..bench.args.repeat.pairs {
        for side in turns(pair) {
            progress.show(&format!("pair {} of {}: {side}", pair + 1, bench.args.repeat.pairs));
            match side {
                Side::Ours => bench.measure_agent().await?,
                Side::Reference => bench.measure_raw().await?,
            }
        }
    }
    drop(progress);
    bench.finish().await
}

struct Bench {
    args: LatencyArgs,
    machine: Machine,
    controller: Controller,
    /// Size of a state.
    bytes: usize,
    samples: usize,
    /// From the deadline of the tick to the subscriber.
    ours: Vec<[f64; 4]>,
    /// The same of the reference.
    raw_due: Vec<[f64; 4]>,
    /// Of the reference, from before the put.
    raw_put: Vec<[f64; 4]>,
    _folder: Folder,
}

impl Bench {
    async fn start(args: LatencyArgs, machine: Machine) -> anyhow::Result<Self> {
        let folder = Folder::make()?;
        let spec = RobotSpec {
            name: "arm".parse()?,
            period: Duration::from_secs(1) / LOOP_RATE_HZ,
            state_rate_hz: args.rate,
            priority: args.common.policy.priority(),
        };
        let controller = Controller::start(&folder, &spec).await?;
        Ok(Self {
            args,
            machine,
            controller,
            bytes: 0,
            samples: 0,
            ours: Vec::new(),
            raw_due: Vec::new(),
            raw_put: Vec::new(),
            _folder: folder,
        })
    }

    async fn measure_agent(&mut self) -> anyhow::Result<()> {
        let time = self.args.time.seconds;
        let arm = Arm::start(&self.controller).await?;
        self.machine.scheduled("armada", &arm.agent.ready.scheduling);
        arm.swing(WARM_UP + time * 2).await?;
        let client = connect(vec![arm.endpoint.clone()]).await?;
        let arrivals = receive(&client, &keys::ROBOT_STATE.of(&arm.name), time).await?;
        client.close();
        arm.end().await?;
        let mut latencies = Vec::new();
        for (received, payload) in &arrivals {
            let state: RobotState = serde_json::from_slice(payload).context("a state")?;
            latencies.push(received.saturating_since(state.stamp_ns).as_secs_f64() * 1e6);
            self.bytes = payload.len();
        }
        self.samples += arrivals.len();
        self.ours.push(quantiles(&mut latencies).context("no state was received")?);
        Ok(())
    }

    async fn measure_raw(&mut self) -> anyhow::Result<()> {
        let endpoint = free_endpoint()?;
        let part = Part::RawState {
            period: Duration::from_secs(1) / self.args.rate,
            priority: self.args.common.policy.priority(),
            endpoint: endpoint.clone(),
            bytes: self.bytes,
        };
        let child = Child::start(&part).await?;
        self.machine.scheduled("raw put", &child.ready.scheduling);
        let client = connect(vec![endpoint]).await?;
        let arrivals = receive(&client, raw::KEY, self.args.time.seconds).await?;
        client.close();
        child.end().await?;
        let since = |index: usize| {
            let age = |(received, payload): &Arrival| {
                let stamp = MonoTime::from_nanos(*raw::stamps(payload)?.get(index)?);
                Some(received.saturating_since(stamp).as_secs_f64() * 1e6)
            };
            let mut ages: Vec<f64> = arrivals.iter().filter_map(age).collect();
            quantiles(&mut ages).context("the reference was not received")
        };
        let (due, put) = (since(0)?, since(1)?);
        self.raw_due.push(due);
        self.raw_put.push(put);
        Ok(())
    }

    async fn finish(self) -> anyhow::Result<Report> {
        self.controller.end().await?;
        let args = &self.args;
        let settings = json!({
            "rate_hz": args.rate,
            "seconds": args.time.seconds.as_secs_f64(),
            "pairs": args.repeat.pairs,
            "payload_bytes": self.bytes,
        });
        let mut report = Report::new("latency", settings, self.machine);
        let columns = QUANTILES.map(|(name, _)| name);
        let title = format!("deadline to subscriber, {} Hz, {} bytes, µs", args.rate, self.bytes);
        let section = Section::new(title, columns)
            .row("armada, 7 joints on a trajectory", &self.ours)
            .row("raw put", &self.raw_due)
            .ratio();
        report.section(section);
        let section = Section::new("put to subscriber, µs", columns).row("raw put", &self.raw_put);
        report.section(section);
        report.note(
            "armada: from the deadline of the tick that the state is of; it includes the wake-up, \
             feedback, step, the set-point's way out, the hand-over to the publisher, the poses of \
             the chain, JSON and the put",
        );
        report.note(
            "raw put: from the deadline of a thread that sleeps to it, with the scheduling of the \
             control loop, and puts at once: it includes the wake-up and the put",
        );
        report.note(
            "both: received in Zenoh's callback in this process, not decoded; the emulated \
             controller runs beside both",
        );
        report.note(format!("{} states received", self.samples));
        Ok(report)
    }
}

/// What comes on a key in `time`, after a warm-up.
async fn receive(client: &Client, key: &str, time: Duration) -> anyhow::Result<Vec<Arrival>> {
    // Bounded by the time of the measurement.
    let (sender, receiver) = mpsc::channel();
    let subscriber = client
        .session()
        .declare_subscriber(key)
        .callback(move |sample| {
            // Its reader has what it wanted.
            let _ = sender.send((monotonic(), sample.payload().to_bytes().into_owned()));
        })
        .await
        .map_err(zenoh_error)?;
    sleep(WARM_UP).await;
    while receiver.try_recv().is_ok() {}
    sleep(time).await;
    subscriber.undeclare().await.map_err(zenoh_error)?;
    Ok(receiver.try_iter().collect())
}
