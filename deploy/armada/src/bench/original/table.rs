//! Both sides as a table, with what issue 4 aims at.

use serde_json::json;

use super::arms::{Many, Sides};
use super::figures::Figures;
use super::venv::Versions;
use super::{OriginalArgs, RATES_HZ, WAYPOINTS};
use crate::bench::figures::Spread;
use crate::bench::machine::Machine;
use crate::bench::report::{Report, Section};
use crate::bench::scale::bounds_text;

/// Name of the row with what shall be reached.
const AIM: &str = "aim, at most";
/// Missed periods with every core busy \[%\].
const MISSED_AIM: f64 = 1.0;
/// Latency at the 99th percentile, as a part of the original's.
const LATENCY_AIM: f64 = 1.0 / 3.0;
/// Processor time, as a part of the original's.
const PROCESSOR_AIM: f64 = 0.1;
/// Acceptance of a trajectory, and time to the first motion \[ms\].
const TIME_AIM_MS: f64 = 5.0;
/// Arms at 100 Hz that miss less than half of the periods.
const ARMS_AIM: u32 = 100;

/// The report of a run; `sides` are ours and the original, pair by pair.
pub(super) fn report(
    args: &OriginalArgs,
    machine: Machine,
    versions: &Versions,
    sides: [&[Figures]; 2],
    many: &Sides,
) -> Report {
    let settings = json!({
        "pairs": args.pairs,
        "seconds": args.seconds.as_secs_f64(),
        "rounds": args.rounds,
        "original": versions,
    });
    let mut report = Report::new("original", settings, machine);
    loops(&mut report, sides);
    times(&mut report, sides);
    report.section(missed_periods(many));
    report.section(processor_of_many(many));
    for (name, side) in [("armada", &many.ours), ("original", &many.original)] {
        let shares: Vec<_> = side.iter().map(|many| (many.arms, many.missed_share)).collect();
        report.note(format!("{name} at 100 Hz: {}", bounds_text(&shares)));
    }
    many.failures.iter().for_each(|failure| report.note(failure));
    for note in NOTES {
        report.note(note);
    }
    report
}

/// What a reader must know.
const NOTES: [&str; 6] = [
    "one arm of 7 joints that holds its position, and one subscriber of its state, which is sent \
     at every tick unless said otherwise",
    "latency: from the deadline of a tick until a client in another process has its state, decoded",
    "processor: the agent without its emulated controller; the original with its simulated arm, \
     which costs next to nothing",
    "first set-point: of the original when its driver gets it; of ours when a client gets the \
     state that tells it, which is later",
    "the original is given as many processes as there are cores for its arms, ours is one",
    "request: armada reads the clock of the agent, the original its command mode",
];

fn loops(report: &mut Report, sides: [&[Figures]; 2]) {
    let columns = ["period error p50, µs", "p99, µs", "missed periods, %"];
    let title = |load| format!("loop at {} Hz, {load}", RATES_HZ[1]);
    let idle = Section::new(title("nothing else started"), columns);
    report.section(compared(idle, sides, |figures| figures.idle.to_vec()));
    let busy = Section::new(title("every core busy"), columns);
    let busy = compared(busy, sides, |figures| figures.busy.to_vec());
    report.section(busy.row(AIM, &[[f64::NAN, f64::NAN, MISSED_AIM]]));
}

fn times(report: &mut Report, sides: [&[Figures]; 2]) {
    let [_, original] = sides;
    let columns = RATES_HZ.map(|rate| [format!("{rate} Hz p50"), format!("{rate} Hz p99")]);
    let section = Section::new("state, from deadline to client, µs", columns.as_flattened());
    let latency = |figures: &Figures| figures.latency_us.as_flattened().to_vec();
    let aim = aims(original, latency, [f64::NAN, LATENCY_AIM]);
    report.section(compared(section, sides, latency).row(AIM, &[aim]));

    let section = Section::new("request that reads one value, to its answer, µs", ["p50", "p99"]);
    report.section(compared(section, sides, |figures| figures.round_trip_us.to_vec()));

    let [slow, fast] = RATES_HZ;
    let columns =
        [format!("{slow} Hz"), format!("{fast} Hz"), format!("{fast} Hz, state {slow} Hz")];
    let section = Section::new("processor of one arm, % of one processor", columns);
    let percent = |figures: &Figures| figures.processor_percent.to_vec();
    let aim = aims(original, percent, [PROCESSOR_AIM]);
    report.section(compared(section, sides, percent).row(AIM, &[aim]));

    let columns = WAYPOINTS.map(|n| [format!("{n} waypoints p50"), format!("{n} waypoints p99")]);
    let section = Section::new("execute_trajectory, to its answer, ms", columns.as_flattened());
    let section = compared(section, sides, |figures| figures.accept_ms.as_flattened().to_vec());
    report.section(section.row(AIM, &[[TIME_AIM_MS; 4]]));

    let title = "execute_trajectory, to the first other set-point at 1000 Hz, ms";
    let section = Section::new(title, ["p50", "p99"]);
    let section = compared(section, sides, |figures| figures.first_motion_ms.to_vec());
    report.section(section.row(AIM, &[[TIME_AIM_MS; 2]]));
}

fn compared(section: Section, sides: [&[Figures]; 2], of: fn(&Figures) -> Vec<f64>) -> Section {
    let [ours, original] = sides.map(|side| side.iter().map(of).collect::<Vec<_>>());
    section.row("armada", &ours).row("original", &original).ratio()
}

/// Parts, one a column and then again, of the medians of the original.
fn aims(
    original: &[Figures],
    of: fn(&Figures) -> Vec<f64>,
    parts: impl IntoIterator<Item = f64, IntoIter: Clone>,
) -> Vec<f64> {
    let rows: Vec<_> = original.iter().map(of).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or_default();
    let median = |column| {
        let values: Vec<_> = rows.iter().filter_map(|row| row.get(column).copied()).collect();
        Spread::of(&values).map_or(f64::NAN, |spread| spread.median)
    };
    let parts = parts.into_iter().cycle();
    (0..columns).map(median).zip(parts).map(|(median, part)| median * part).collect()
}

fn missed_periods(sides: &Sides) -> Section {
    let aim = |&number: &u32| if number <= ARMS_AIM { 50.0 } else { f64::NAN };
    let aim: Vec<_> = numbers(sides).iter().map(aim).collect();
    let title = "many arms at 100 Hz, missed periods, %";
    by_number(title, sides, |many| many.missed_share * 100.0).row(AIM, &[aim])
}

fn processor_of_many(sides: &Sides) -> Section {
    let title = "many arms at 100 Hz, processor of one arm, % of one processor";
    by_number(title, sides, |many| many.cpu_share * 100.0).ratio()
}

/// A figure of both sides by the number of arms.
fn by_number(title: &str, sides: &Sides, of: fn(&Many) -> f64) -> Section {
    let numbers = numbers(sides);
    let row = |side: &[Many]| {
        let figure = |number| side.iter().find(|many| many.arms == number).map_or(f64::NAN, of);
        [numbers.iter().copied().map(figure).collect::<Vec<_>>()]
    };
    let columns: Vec<_> = numbers.iter().map(|number| format!("{number} arms")).collect();
    Section::new(title, &columns)
        .row("armada", &row(&sides.ours))
        .row("original", &row(&sides.original))
}

/// Numbers of arms that either side was measured with.
fn numbers(sides: &Sides) -> Vec<u32> {
    let mut numbers: Vec<u32> =
        sides.ours.iter().chain(&sides.original).map(|many| many.arms).collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    fn original(p99: f64) -> Figures {
        Figures { latency_us: [[100.0, p99], [300.0, 2.0 * p99]], ..Figures::default() }
    }

    #[test]
    fn an_aim_that_is_a_part_of_the_original_is_of_its_median() {
        let pairs = [original(600.0), original(900.0), original(90.0)];
        let latency = |figures: &Figures| figures.latency_us.as_flattened().to_vec();
        let aim = aims(&pairs, latency, [f64::NAN, 0.5]);
        assert!(aim[0].is_nan() && aim[2].is_nan());
        assert_eq!((aim[1], aim[3]), (300.0, 600.0));
    }

    #[test]
    fn numbers_of_arms_that_only_one_side_was_measured_with_stay_empty_for_the_other() {
        let many = |arms, missed_share| Many { arms, missed_share, cpu_share: 0.01 };
        let sides = Sides {
            ours: vec![many(16, 0.0), many(200, 0.25)],
            original: vec![many(16, 0.5)],
            failures: Vec::new(),
        };
        let lines: Vec<_> = missed_periods(&sides).to_string().lines().map(str::to_owned).collect();
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&lines[1]), ["16", "arms", "200", "arms"]);
        assert_eq!(words(&lines[2]), ["armada", "0", "25.0"]);
        assert_eq!(words(&lines[3]), ["original", "50.0", "-"]);
        assert!(lines[4].trim().ends_with('-'), "the aim is for 100 arms: {lines:?}");
    }
}
