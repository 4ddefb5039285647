//! The demo: a motion again and again.

use std::time::Duration;

use armada_protocol::client::{Client, ClientError, Subscription};
use armada_protocol::keys;
use armada_protocol::messages::{ActionStatus, CellRobotStatus, CellStatus};

use super::preflight::Cell;
use crate::clock;
use crate::commands::run::{self, Plan};
use crate::motion::{Follower, MotionView, end_line, progress_line};
use crate::output::{Progress, note};

/// Silence about the motion after which the demo ends.
const LONGEST_SILENCE: Duration = Duration::from_secs(5);

/// Runs the motion until it ends otherwise than complete; returns why it did. Never returns if
/// there is no motion or no cell that is ready for it.
///
/// It does not begin again by itself: after a stop and a reset nothing may move unasked.
pub(super) async fn run(cell: &Cell, client: Option<Client>) -> String {
    let (Some(plan), Some(client)) = (&cell.demo, client) else {
        return std::future::pending().await;
    };
    note(format_args!("demo: {} until Ctrl-C", plan.title()));
    match repeat(plan, &client).await {
        Ok(why) => why,
        Err(error) => format!("{error:#}"),
    }
}

async fn repeat(plan: &Plan, client: &Client) -> anyhow::Result<String> {
    let statuses = client.subscribe::<CellStatus>(&keys::CELL_STATUS.any(), 1).await?;
    for round in 1_u64.. {
        run::approach(client, plan).await?;
        let title = format!("{} #{round}", plan.title());
        let (_, follower) = run::start(client, plan).await?;
        let view = follow(&follower, client, &statuses, &title).await?;
        if view.status != ActionStatus::Complete {
            return Ok(end_line(&title, &view));
        }
    }
    Ok("all rounds are done".to_owned())
}

async fn follow(
    follower: &Follower,
    client: &Client,
    statuses: &Subscription<CellStatus>,
    title: &str,
) -> anyhow::Result<MotionView> {
    let mut progress = Progress::new();
    let mut rates = String::new();
    let mut heard = clock::now();
    loop {
        tokio::select! {
            update = follower.next(client) => match update {
                Ok(view) if view.status.is_terminal() => return Ok(view),
                Ok(view) => {
                    heard = clock::now();
                    progress.show(&format!("{}{rates}", progress_line(title, &view)));
                }
                Err(ClientError::NoReply { .. } | ClientError::Timeout { .. })
                    if heard.elapsed() < LONGEST_SILENCE => {}
                Err(error) => return Err(error.into()),
            },
            status = statuses.next() => {
                if let Ok((_, status)) = status {
                    rates = loop_rates(status.robots.values());
                }
            }
        }
    }
}

/// Rates of the control loops, in the order of the robots' names.
fn loop_rates<'a>(robots: impl Iterator<Item = &'a CellRobotStatus>) -> String {
    let rate = |robot: &CellRobotStatus| {
        robot.control_loop.map_or_else(|| "-".to_owned(), |timing| format!("{:.0}", timing.rate_hz))
    };
    format!("  loops {} Hz", robots.map(rate).collect::<Vec<_>>().join("/"))
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::LoopStatistics;

    use super::*;

    #[test]
    fn loop_rates_are_told_for_every_robot() {
        let timing = LoopStatistics { rate_hz: 499.7, ..LoopStatistics::default() };
        let known = CellRobotStatus { control_loop: Some(timing), ..CellRobotStatus::default() };
        let robots = [known, CellRobotStatus::default()];
        assert_eq!(loop_rates(robots.iter()), "  loops 500/- Hz");
    }
}
