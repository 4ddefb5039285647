//! How many arms one agent process can run at 100 Hz, beside as many loops that do nothing.

use std::time::Duration;

use clap::Args;
use serde_json::json;

use super::CommonArgs;
use super::fleet::{Fleet, LoopFigures, measure_bare};
use super::machine::Machine;
use super::report::{Report, Section};
use super::robot_file::{Folder, RobotSpec};
use crate::cell_address::parse_seconds;
use crate::output::Progress;

/// Share of missed periods at which a machine has more arms than it can run.
const TOO_MANY: f64 = 0.5;

/// Arguments of `armada bench scale`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  armada bench scale
  armada bench scale --arms 8,16 --most 64 --seconds 2 --json

All arms run in one agent process, each with a loop thread of its own; their emulated controllers
run in a second process on the same machine, and real datagrams go between them. The arms hold their
position with their drives on. After the numbers of arms that were asked for, the last is doubled
until half of all periods are missed, or so many can no longer be started. The machine is fully used then: expect that nothing else runs
well, least of all under SCHED_FIFO.")]
pub(super) struct ScaleArgs {
    /// Rate of the control loops and of the states, 10 to 1000
    #[arg(long, value_name = "HZ", default_value_t = 100,
        value_parser = clap::value_parser!(u32).range(10..=1000))]
    rate: u32,
    /// Numbers of arms to measure
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', default_value = "16,32,64,100",
        value_parser = clap::value_parser!(u32).range(1..=2000))]
    arms: Vec<u32>,
    /// Largest number of arms to try
    #[arg(long, value_name = "NUMBER", default_value_t = 800,
        value_parser = clap::value_parser!(u32).range(1..=2000))]
    most: u32,
    /// Time of each measurement
    #[arg(long, value_name = "SECONDS", default_value = "5", value_parser = parse_seconds)]
    seconds: Duration,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

/// What was measured of one number of arms.
struct Step {
    arms: u32,
    armada: LoopFigures,
    /// Share of one processor that the controller of one arm takes.
    emulator: f64,
    bare: LoopFigures,
}

/// Measures one number of arms after the other.
pub(super) async fn measure(args: ScaleArgs) -> anyhow::Result<Report> {
    let mut machine = Machine::now();
    let spec = RobotSpec {
        name: "arm".parse()?,
        period: Duration::from_secs(1) / args.rate,
        state_rate_hz: args.rate,
        priority: args.common.policy.priority(),
    };
    let mut progress = Progress::new();
    let (mut steps, mut failure) = (Vec::new(), None);
    let mut numbers = Numbers::new(&args.arms, args.most);
    while let Some(arms) = numbers.next_after(steps.last().map(|s: &Step| s.armada.missed_share)) {
        progress.show(&format!("{arms} arms"));
        match measure_step(&spec, arms, args.seconds, &mut machine).await {
            Ok(step) => steps.push(step),
            // A machine with too many arms may not even get as far as starting them.
            Err(error) if !steps.is_empty() => {
                failure = Some(format!("{arms} arms could not be measured: {error:#}"));
                break;
            }
            Err(error) => return Err(error),
        }
    }
    drop(progress);
    let mut report = report(&args, machine, &steps);
    failure.into_iter().for_each(|failure| report.note(failure));
    Ok(report)
}

async fn measure_step(
    spec: &RobotSpec,
    arms: u32,
    time: Duration,
    machine: &mut Machine,
) -> anyhow::Result<Step> {
    let folder = Folder::make()?;
    let mut fleet = Fleet::start(&folder, spec, arms).await?;
    machine.scheduled("armada", fleet.scheduling());
    let (armada, emulator) = fleet.measure(time).await?;
    fleet.end().await?;
    let (bare, scheduling) = measure_bare(spec, arms, time).await?;
    machine.scheduled("bare loops", &scheduling);
    Ok(Step { arms, armada, emulator, bare })
}

/// The next numbers of arms: those asked for, then twice the last until too many.
pub(super) struct Numbers {
    asked: std::vec::IntoIter<u32>,
    last: u32,
    most: u32,
}

impl Numbers {
    /// Numbers up to `most`; `asked` in rising order.
    pub(super) fn new(asked: &[u32], most: u32) -> Self {
        let mut asked: Vec<u32> = asked.iter().copied().filter(|&arms| arms <= most).collect();
        asked.sort_unstable();
        asked.dedup();
        Self { asked: asked.into_iter(), last: 0, most }
    }

    /// No more numbers.
    pub(super) fn end(&mut self) {
        self.last = self.most;
    }

    /// The next number, after a measurement with this share of missed periods; `None` when half
    /// were missed or the most was measured.
    pub(super) fn next_after(&mut self, missed_share: Option<f64>) -> Option<u32> {
        if missed_share.is_some_and(|share| share >= TOO_MANY) || self.last == self.most {
            return None;
        }
        let doubled = self.last.saturating_mul(2).clamp(1, self.most);
        self.last = self.asked.next().unwrap_or(doubled);
        Some(self.last)
    }
}

/// The most arms with less than half of the periods missed, of numbers and shares in rising order;
/// and the first number with half or more, if there is one.
pub(super) fn bounds(steps: &[(u32, f64)]) -> (u32, Option<u32>) {
    let below = steps.iter().take_while(|(_, share)| *share < TOO_MANY);
    let first = steps.iter().find(|(_, share)| *share >= TOO_MANY);
    (below.last().map_or(0, |(arms, _)| *arms), first.map(|(arms, _)| *arms))
}

/// What [`bounds`] found, in words.
pub(super) fn bounds_text(steps: &[(u32, f64)]) -> String {
    match bounds(steps) {
        (below, Some(first)) => {
            format!("half of the periods are missed between {below} and {first} arms")
        }
        (below, None) => format!("less than half of the periods are missed up to {below} arms"),
    }
}

fn report(args: &ScaleArgs, machine: Machine, steps: &[Step]) -> Report {
    let settings = json!({
        "rate_hz": args.rate,
        "seconds": args.seconds.as_secs_f64(),
        "most": args.most,
    });
    let mut report = Report::new("scale", settings, machine);
    for step in steps {
        let row = |f: &LoopFigures| [[f.missed_share * 100.0, f.error_p99_us, f.cpu_share * 100.0]];
        let title = format!("{} arms at {} Hz", step.arms, args.rate);
        let columns = ["missed periods, %", "period error p99, µs", "processor an arm, %"];
        let section = Section::new(title, columns)
            .row("armada, one agent process", &row(&step.armada))
            .row("bare loops, one process", &row(&step.bare))
            .ratio()
            .row("emulators, one process", &[[f64::NAN, f64::NAN, step.emulator * 100.0]]);
        report.section(section);
    }
    let shares: Vec<_> = steps.iter().map(|step| (step.arms, step.armada.missed_share)).collect();
    report.note(bounds_text(&shares));
    report.note(
        "missed: periods without a tick, of all loops; processor: user and system time of the \
         process, in percent of one processor, divided by the arms; nobody subscribes",
    );
    report.note("the emulated controllers run on the same processors");
    report
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_asked_for_and_then_doubled_until_half_is_missed() {
        let mut numbers = Numbers::new(&[32, 16, 32, 500], 300);
        let mut tried = Vec::new();
        while let Some(arms) = numbers.next_after(tried.last().map(|_| 0.49)) {
            tried.push(arms);
        }
        assert_eq!(tried, [16, 32, 64, 128, 256, 300]);
        let mut numbers = Numbers::new(&[16], 300);
        assert_eq!(numbers.next_after(None), Some(16));
        assert_eq!(numbers.next_after(Some(0.1)), Some(32));
        assert_eq!(numbers.next_after(Some(0.5)), None);
        let mut numbers = Numbers::new(&[16, 32], 300);
        assert_eq!(numbers.next_after(None), Some(16));
        numbers.end();
        assert_eq!(numbers.next_after(Some(0.1)), None);
    }

    #[test]
    fn bounds_are_the_numbers_about_the_half() {
        assert_eq!(bounds(&[(16, 0.0), (32, 0.4), (64, 0.7)]), (32, Some(64)));
        assert_eq!(bounds(&[(16, 0.0), (32, 0.4)]), (32, None));
        assert_eq!(bounds(&[(16, 0.9)]), (0, Some(16)));
        assert_eq!(bounds(&[]), (0, None));
    }
}
