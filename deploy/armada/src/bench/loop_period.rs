//! How regularly the control loop wakes, against a loop that does nothing else.

use std::time::Duration;

use clap::Args;
use serde_json::json;
use tokio::time::sleep;

use super::arm::{Arm, Controller};
use super::child::Child;
use super::figures::{QUANTILES, quantiles};
use super::machine::Machine;
use super::part::{Ask, Part};
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec};
use super::wakes::Regularity;
use super::{CommonArgs, RepeatArgs, Side, TimeArgs, turns};
use crate::output::Progress;

/// Time for caches and connections before a measurement.
const WARM_UP: Duration = Duration::from_secs(1);

/// Arguments of `armada bench loop`.
#[derive(Args, Clone, Debug)]
pub(super) struct LoopArgs {
    /// Rate of the control loop, 50 to 2000
    #[arg(long, value_name = "HZ", default_value_t = 1000,
        value_parser = clap::value_parser!(u32).range(50..=2000))]
    rate: u32,
    #[command(flatten)]
    time: TimeArgs,
    /// Keep every core busy with threads of ordinary priority, beside both
    #[arg(long)]
    load: bool,
    #[command(flatten)]
    repeat: RepeatArgs,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// Measures the period error of both loops, pair by pair.
pub(super) async fn measure(args: LoopArgs) -> anyhow::Result<Report> {
    let machine = Machine::now();
    let mut bench = Bench::start(args, machine).await?;
    let (mut ours, mut reference) = (Vec::new(), Vec::new());
    let mut progress = Progress::new();
    for pair in 0..bench.args.repeat.pairs {
        for side in turns(pair) {
            progress.show(&format!("pair {} of {}: {side}", pair + 1, bench.args.repeat.pairs));
            match side {
                Side::Ours => ours.push(figures(bench.measure_agent(pair).await?)),
                Side::Reference => reference.push(figures(bench.measure_bare().await?)),
            }
        }
    }
    drop(progress);
    bench.finish(&ours, &reference).await
}

struct Bench {
    args: LoopArgs,
    period: Duration,
    machine: Machine,
    /// Motions that did not last through a measurement.
    ended: Vec<String>,
    controller: Controller,
    busy: Option<Child>,
    _folder: Folder,
}

impl Bench {
    async fn start(args: LoopArgs, machine: Machine) -> anyhow::Result<Self> {
        let folder = Folder::make()?;
        let period = Duration::from_secs(1) / args.rate;
        let spec = RobotSpec {
            name: "arm".parse()?,
            period,
            state_rate_hz: args.rate.min(100),
            priority: args.common.policy.priority(),
        };
        let controller = Controller::start(&folder, &spec).await?;
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let busy = match args.load {
            true => Some(Child::start(&Part::Busy { threads }).await?),
            false => None,
        };
        Ok(Self { args, period, machine, ended: Vec::new(), controller, busy, _folder: folder })
    }

    async fn measure_agent(&mut self, pair: u32) -> anyhow::Result<Regularity> {
        let time = self.args.time.seconds;
        let mut arm = Arm::start(&self.controller).await?;
        self.machine.scheduled("armada", &arm.agent.ready.scheduling);
        // Longer than the measurement, for the time that asking takes.
        let motion = arm.swing(WARM_UP + time * 2).await?;
        sleep(WARM_UP).await;
        let regularity = arm.agent.ask(Ask::Wakes(time)).await?;
        if let Some(why) = arm.why_ended(motion).await? {
            self.ended
                .push(format!("pair {}: the robot did not move all the time: {why}", pair + 1));
        }
        arm.end().await?;
        Ok(regularity)
    }

    async fn measure_bare(&mut self) -> anyhow::Result<Regularity> {
        let priority = self.args.common.policy.priority();
        let mut child =
            Child::start(&Part::BareLoops { loops: 1, period: self.period, priority }).await?;
        self.machine.scheduled("bare loop", &child.ready.scheduling);
        sleep(WARM_UP).await;
        let regularity = child.ask(Ask::Wakes(self.args.time.seconds)).await?;
        child.end().await?;
        Ok(regularity)
    }

    async fn finish(self, ours: &[[f64; 5]], reference: &[[f64; 5]]) -> anyhow::Result<Report> {
        self.controller.end().await?;
        if let Some(busy) = self.busy {
            busy.end().await?;
        }
        let settings = json!({
            "rate_hz": self.args.rate,
            "seconds": self.args.time.seconds.as_secs_f64(),
            "pairs": self.args.repeat.pairs,
            "load": self.args.load,
        });
        let mut report = Report::new("loop", settings, self.machine);
        let load = if self.args.load { "every core busy" } else { "nothing else started" };
        let title = format!("period error at {} Hz, µs; {load}", self.args.rate);
        let columns = QUANTILES.map(|(name, _)| name).into_iter().chain(["missed periods"]);
        let section = Section::new(title, columns)
            .row("armada, 7 joints on a trajectory", ours)
            .row("bare loop", reference)
            .ratio();
        report.section(section);
        report.note("error |wake - wake before - period| of every pair of wake-ups in a row");
        report.note(
            "the emulated controller runs beside both, with a priority below theirs; the agent \
             also publishes its state",
        );
        self.ended.into_iter().for_each(|note| report.note(note));
        Ok(report)
    }
}

#[expect(clippy::cast_precision_loss, reason = "missed periods are few")]
fn figures(mut regularity: Regularity) -> [f64; 5] {
    let [p50, p99, p999, max] = quantiles(&mut regularity.errors_us).unwrap_or_default();
    [p50, p99, p999, max, regularity.missed as f64]
}
