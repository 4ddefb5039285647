//! How much of a processor an agent and its emulator take.

use std::time::Duration;

use armada_agent::runtime::monotonic;
use armada_protocol::keys;
use clap::Args;
use serde_json::json;
use tokio::time::sleep;

use super::arm::{Arm, Controller, connect};
use super::child::Child;
use super::machine::Machine;
use super::part::{Ask, Part};
use super::raw::zenoh_error;
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec};
use super::{CommonArgs, RepeatArgs, TimeArgs};
use crate::output::Progress;

/// Rates of the control loop \[Hz\].
const RATES_HZ: [u32; 2] = [100, 1000];
/// Rate of the state \[Hz\].
const STATE_RATE_HZ: u32 = 100;
/// Time for connections before a measurement.
const WARM_UP: Duration = Duration::from_secs(1);

/// Arguments of `armada bench cpu`.
#[derive(Args, Clone, Debug)]
pub(super) struct CpuArgs {
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    repeat: RepeatArgs,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// Processor time of one rate, in percent of one processor.
struct Shares {
    /// Agent: without a subscriber of the state, and with one.
    agent: [f64; 2],
    /// Emulator, the same.
    emulator: [f64; 2],
    /// A loop that does nothing.
    bare: [f64; 1],
}

/// Measures both rates, time after time.
pub(super) async fn measure(args: CpuArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let folder = Folder::make()?;
    let mut shares: Vec<Vec<Shares>> = RATES_HZ.map(|_| Vec::new()).into();
    let mut progress = Progress::new();
    for pair in 0..args.repeat.pairs {
        for (rate, shares) in RATES_HZ.into_iter().zip(&mut shares) {
            progress.show(&format!("{} of {}: {rate} Hz", pair + 1, args.repeat.pairs));
            shares.push(measure_rate(&args, &folder, rate, &mut machine).await?);
        }
    }
    drop(progress);
    let settings = json!({
        "state_rate_hz": STATE_RATE_HZ,
        "seconds": args.time.seconds.as_secs_f64(),
        "repetitions": args.repeat.pairs,
    });
    let mut report = Report::new("cpu", settings, machine);
    for (rate, shares) in RATES_HZ.into_iter().zip(&shares) {
        let title = format!("loop of {rate} Hz, % of one processor");
        let row = |share: fn(&Shares) -> &[f64]| shares.iter().map(share).collect::<Vec<_>>();
        let section = Section::new(title, ["no subscriber", "one subscriber"])
            .row("agent, 7 joints on a trajectory", &row(|shares| &shares.agent))
            .row("emulator", &row(|shares| &shares.emulator))
            .row("bare loop", &row(|shares| &shares.bare));
        report.section(section);
    }
    report.note(format!("user and system time of each process; state at {STATE_RATE_HZ} Hz"));
    Ok(report)
}

async fn measure_rate(
    args: &CpuArgs,
    folder: &Folder,
    rate: u32,
    machine: &mut Machine,
) -> anyhow::Result<Shares> {
    let (time, period) = (args.time.seconds, Duration::from_secs(1) / rate);
    let priority = args.common.policy.priority();
    let spec = RobotSpec { name: "arm".parse()?, period, state_rate_hz: STATE_RATE_HZ, priority };
    let mut controller = Controller::start(folder, &spec).await?;
    let mut arm = Arm::start(&controller).await?;
    machine.scheduled("armada", &arm.agent.ready.scheduling);
    arm.swing((WARM_UP + time) * 3).await?;
    let alone = measure_arm(&mut arm, &mut controller, time).await?;
    let subscriber = connect(vec![arm.endpoint.clone()]).await?;
    let key = keys::ROBOT_STATE.of(&arm.name);
    let session = subscriber.session();
    let state = session.declare_subscriber(key).callback(drop).await.map_err(zenoh_error)?;
    let watched = measure_arm(&mut arm, &mut controller, time).await?;
    drop(state);
    subscriber.close();
    arm.end().await?;
    controller.end().await?;

    let mut bare = Child::start(&Part::BareLoops { loops: 1, period, priority }).await?;
    machine.scheduled("bare loop", &bare.ready.scheduling);
    let begin = (monotonic(), bare.ask::<f64>(Ask::CpuTime).await?);
    sleep(time).await;
    let end = (monotonic(), bare.ask::<f64>(Ask::CpuTime).await?);
    bare.end().await?;
    let bare = (end.1 - begin.1) / end.0.saturating_since(begin.0).as_secs_f64() * 100.0;
    Ok(Shares { agent: [alone[0], watched[0]], emulator: [alone[1], watched[1]], bare: [bare] })
}

/// Shares of agent and emulator over `time`, after a warm-up \[%\].
async fn measure_arm(
    arm: &mut Arm,
    controller: &mut Controller,
    time: Duration,
) -> anyhow::Result<[f64; 2]> {
    sleep(WARM_UP).await;
    let begin = monotonic();
    let (agent, emulator) =
        (arm.agent.ask::<f64>(Ask::CpuTime).await?, controller.cpu_time().await?);
    sleep(time).await;
    let wall = monotonic().saturating_since(begin).as_secs_f64();
    let agent = arm.agent.ask::<f64>(Ask::CpuTime).await? - agent;
    let emulator = controller.cpu_time().await? - emulator;
    Ok([agent, emulator].map(|used| used / wall * 100.0))
}
