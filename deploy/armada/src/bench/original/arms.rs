//! Many arms at 100 Hz, by their number.

use std::path::Path;
use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::sleep;

use super::robot::{Server, Ticks};
use super::{OriginalArgs, RATES_HZ, WARM_UP};
use crate::bench::fleet::Fleet;
use crate::bench::robot_file::{Folder, RobotSpec};
use crate::bench::scale::Numbers;
use crate::bench::wakes::Regularity;
use crate::bench::{Side, turns};
use crate::output::Progress;

/// What many arms did.
#[derive(Clone, Copy, Debug)]
pub(super) struct Many {
    /// How many.
    pub(super) arms: u32,
    /// Share of the periods without a tick, 0 to 1.
    pub(super) missed_share: f64,
    /// Processor time of one arm, as a share of one processor.
    pub(super) cpu_share: f64,
}

/// Both sides, in rising numbers of arms.
#[derive(Debug, Default)]
pub(super) struct Sides {
    pub(super) ours: Vec<Many>,
    pub(super) original: Vec<Many>,
    /// Numbers of arms that could not be measured, and why.
    pub(super) failures: Vec<String>,
}

/// Measures both, number by number, until each misses half of the periods.
pub(super) async fn measure(
    args: &OriginalArgs,
    python: &Path,
    progress: &mut Progress,
) -> anyhow::Result<Sides> {
    let mut sides = Sides::default();
    let mut ours = Numbers::new(&args.arms, args.most);
    let mut original = Numbers::new(&args.arms, args.most);
    for round in 0.. {
        let before = sides.ours.len() + sides.original.len();
        for side in turns(round) {
            let (numbers, done) = match side {
                Side::Ours => (&mut ours, &mut sides.ours),
                Side::Reference => (&mut original, &mut sides.original),
            };
            let Some(arms) = numbers.next_after(done.last().map(|last| last.missed_share)) else {
                continue;
            };
            progress.show(&format!("{arms} arms: {side}"));
            let measured = match side {
                Side::Ours => of_ours(args, arms).await,
                Side::Reference => of_original(args, python, arms).await,
            };
            match measured {
                Ok(many) => done.push(many),
                // A machine with too many arms may not even get as far as starting them.
                Err(error) => {
                    sides.failures.push(format!("{side}: {arms} arms not measured: {error:#}"));
                    numbers.end();
                }
            }
        }
        if sides.ours.len() + sides.original.len() == before {
            break;
        }
    }
    Ok(sides)
}

/// All arms in one agent process, their controllers in another.
async fn of_ours(args: &OriginalArgs, arms: u32) -> anyhow::Result<Many> {
    let folder = Folder::make()?;
    let spec = RobotSpec {
        name: "arm".parse()?,
        period: period(),
        state_rate_hz: RATES_HZ[0],
        priority: args.common.policy.priority(),
    };
    let mut fleet = Fleet::start(&folder, &spec, arms).await?;
    let (loops, _) = fleet.measure(args.seconds).await?;
    fleet.end().await?;
    Ok(Many { arms, missed_share: loops.missed_share, cpu_share: loops.cpu_share })
}

/// The arms in as many processes as there are cores, since one process of Python uses only one.
async fn of_original(args: &OriginalArgs, python: &Path, arms: u32) -> anyhow::Result<Many> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut servers = Vec::new();
    for share in split(arms, u32::try_from(cores).unwrap_or(u32::MAX)) {
        servers.push(Server::start(python, share, period()).await?);
    }
    sleep(WARM_UP).await;
    let time = args.seconds;
    let mut measuring: JoinSet<anyhow::Result<(Server, Ticks)>> = JoinSet::new();
    for mut server in servers {
        measuring.spawn(async move {
            let ticks = server.ticks(time).await?;
            Ok((server, ticks))
        });
    }
    let (mut wakes, mut cpu_share) = (Vec::new(), 0.0);
    for measured in measuring.join_all().await {
        let (server, ticks) = measured?;
        server.end().await?;
        cpu_share += ticks.cpu_share / f64::from(arms);
        wakes.extend(ticks.loops.iter().map(|ticks| ticks.wakes(period())));
    }
    let missed_share = Regularity::of_all(&wakes, period(), time).missed_share();
    Ok(Many { arms, missed_share, cpu_share })
}

fn period() -> Duration {
    Duration::from_secs(1) / RATES_HZ[0]
}

/// Numbers of arms of the processes, as equal as can be, without empty ones.
fn split(arms: u32, processes: u32) -> Vec<u32> {
    let processes = processes.clamp(1, arms.max(1));
    (0..processes).map(|i| arms / processes + u32::from(i < arms % processes)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arms_are_split_evenly_over_processes() {
        assert_eq!(split(7, 3), [3, 2, 2]);
        assert_eq!(split(2, 4), [1, 1]);
        assert_eq!(split(16, 1), [16]);
    }
}
