//! How long a long trajectory takes from the request to the answer, and where the time goes.

use std::hint::black_box;
use std::time::Duration;

use armada_agent::runtime::monotonic;
use armada_model::{CompiledTrajectory, JointLimits, MotionLimits, TrajectoryOptions};
use armada_protocol::client::Client;
use armada_protocol::codec::{MAX_REQUEST_BYTES, WireEncoding};
use armada_protocol::messages::{CancelParams, PrepareParams, Request};
use armada_protocol::method::robot::{Abort, Prepare};
use armada_protocol::qos::Channel;
use clap::Args;
use serde_json::json;

use super::arm::{Arm, Controller, connect};
use super::child::Child;
use super::figures::{QUANTILES, quantiles};
use super::machine::Machine;
use super::part::Part;
use super::raw;
use super::report::{Report, Section};
use super::robot_file::{Folder, JOINTS, RobotSpec, free_endpoint};
use super::swing::long_swing;
use super::{CommonArgs, RepeatArgs, Side, turns};
use crate::output::Progress;

/// Size of the reference's answer, about that of ours \[bytes\].
const ANSWER_BYTES: usize = 128;

/// Arguments of `armada bench accept`.
#[derive(Args, Clone, Debug)]
pub(super) struct AcceptArgs {
    /// Waypoints of the trajectory, each of 7 joints
    #[arg(long, value_name = "NUMBER", default_value_t = 1001,
        value_parser = clap::value_parser!(u32).range(11..=20_000))]
    waypoints: u32,
    /// Requests of each side in a pair
    #[arg(long, value_name = "NUMBER", default_value_t = 100,
        value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rounds: u32,
    #[command(flatten)]
    repeat: RepeatArgs,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// Measures both, pair by pair.
pub(super) async fn measure(args: AcceptArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let folder = Folder::make()?;
    let spec = RobotSpec {
        name: "arm".parse()?,
        period: Duration::from_millis(1),
        state_rate_hz: 100,
        priority: args.common.policy.priority(),
    };
    let controller = Controller::start(&folder, &spec).await?;
    let arm = Arm::start(&controller).await?;
    machine.scheduled("armada", &arm.agent.ready.scheduling);
    let from = arm.position().await?;
    let params = PrepareParams::alone(None, long_swing(from, from, args.waypoints));
    let payload = WireEncoding::Json.encode(&Request::new("bench", params.clone()))?;
    let endpoint = free_endpoint()?;
    let part = Part::RawReply { endpoint: endpoint.clone(), bytes: ANSWER_BYTES };
    let answerer = Child::start(&part).await?;
    let reference = connect(vec![endpoint]).await?;

    let (mut ours, mut raw) = (Vec::new(), Vec::new());
    let mut progress = Progress::new();
    for pair in 0..args.repeat.pairs {
        for side in turns(pair) {
            progress.show(&format!("pair {} of {}: {side}", pair + 1, args.repeat.pairs));
            match side {
                Side::Ours => ours.push(prepare(&arm, &params, args.rounds).await?),
                Side::Reference => raw.push(query(&reference, &payload, args.rounds).await?),
            }
        }
    }
    drop(progress);
    reference.close();
    answerer.end().await?;
    arm.end().await?;
    controller.end().await?;
    let parts = Parts::measure(&params, &payload, args.rounds)?;
    Ok(report(&args, machine, payload.len(), [ours, raw], &parts))
}

fn report(
    args: &AcceptArgs,
    machine: Machine,
    bytes: usize,
    [ours, raw]: [Vec<[f64; 4]>; 2],
    parts: &Parts,
) -> Report {
    let settings = json!({
        "waypoints": args.waypoints,
        "joints": JOINTS.len(),
        "payload_bytes": bytes,
        "rounds": args.rounds,
        "pairs": args.repeat.pairs,
    });
    let mut report = Report::new("accept", settings, machine);
    let columns = QUANTILES.map(|(name, _)| name);
    let title = format!("{} waypoints x 7 joints, {bytes} bytes, ms", args.waypoints);
    let section = Section::new(title, columns)
        .row("armada, request to answer", &ours)
        .row("raw query of that size", &raw)
        .ratio()
        .row("alone: encode, client", &[parts.encode])
        .row("alone: decode, agent", &[parts.decode])
        .row("alone: validate and compile, agent", &[parts.compile]);
    report.section(section);
    report.note(
        "prepare, then abort, so that nothing has to move: the same as execute_trajectory without \
         the wait for the next tick",
    );
    report.note("the parts were measured alone, in this process, with warm caches");
    report
}

async fn prepare(arm: &Arm, params: &PrepareParams, rounds: u32) -> anyhow::Result<[f64; 4]> {
    let mut times = Vec::new();
    for _ in 0..rounds {
        let params = params.clone();
        let begin = monotonic();
        let prepared = arm.client.call::<Prepare>(&arm.name, params).await?;
        times.push(monotonic().saturating_since(begin).as_secs_f64() * 1e3);
        let motion_id = prepared.motion_id;
        arm.client.call::<Abort>(&arm.name, CancelParams { motion_id }).await?;
    }
    Ok(quantiles(&mut times).unwrap_or_default())
}

async fn query(reference: &Client, payload: &[u8], rounds: u32) -> anyhow::Result<[f64; 4]> {
    let mut times = Vec::new();
    for _ in 0..rounds {
        let took = raw::round_trip(reference.session(), Channel::Rpc, payload.to_vec()).await?;
        times.push(took.as_secs_f64() * 1e3);
    }
    Ok(quantiles(&mut times).unwrap_or_default())
}

/// What is done to a request, each alone \[ms\].
struct Parts {
    encode: [f64; 4],
    decode: [f64; 4],
    compile: [f64; 4],
}

impl Parts {
    fn measure(params: &PrepareParams, payload: &[u8], rounds: u32) -> anyhow::Result<Self> {
        let limits = MotionLimits::new(&[LIMITS; JOINTS.len()])?;
        let (names, options) = (JOINTS.map(str::to_owned), TrajectoryOptions::default());
        let request = Request::new("bench", params.clone());
        Ok(Self {
            encode: timed(rounds, || Ok(WireEncoding::Json.encode(&request)?))?,
            decode: timed(rounds, || {
                let request: Request<PrepareParams> =
                    WireEncoding::Json.decode(payload, MAX_REQUEST_BYTES)?;
                Ok(request)
            })?,
            compile: timed(rounds, || {
                let trajectory = &params.trajectory;
                Ok(CompiledTrajectory::compile(trajectory, &names, &limits, &options)?)
            })?,
        })
    }
}

/// Limits that the trajectory keeps; which ones does not change what there is to compute.
const LIMITS: JointLimits = JointLimits {
    lower: Some(-3.2),
    upper: Some(3.2),
    velocity: 2.0,
    acceleration: Some(10.0),
    jerk: None,
    effort: None,
};

fn timed<T>(rounds: u32, mut work: impl FnMut() -> anyhow::Result<T>) -> anyhow::Result<[f64; 4]> {
    let mut times = Vec::new();
    for _ in 0..rounds {
        let begin = monotonic();
        let done = black_box(work()?);
        times.push(monotonic().saturating_since(begin).as_secs_f64() * 1e3);
        drop(done);
    }
    Ok(quantiles(&mut times).unwrap_or_default())
}
