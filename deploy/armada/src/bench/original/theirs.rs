//! The original's side: a server with a simulated arm, and a client, each a Python process.

use std::path::Path;
use std::time::Duration;

use anyhow::bail;
use armada_model::JointTrajectory;
use tokio::time::sleep;

use super::figures::{Figures, Typical, regularity, typical};
use super::robot::{Client, Server};
use super::{MOTION_WAYPOINTS, OriginalArgs, RATES_HZ, WARM_UP, WAYPOINTS, keep_busy};
use crate::bench::robot_file::ready_position;
use crate::bench::swing::long_swing;
use crate::bench::wakes::Regularity;

/// Looks for the beginning of a motion, each a request to the server.
const LOOKS: u32 = 2000;
/// Pause between two of them.
const LOOK: Duration = Duration::from_millis(5);

/// Measures one arm, at one rate after the other.
pub(super) async fn measure(args: &OriginalArgs, python: &Path) -> anyhow::Result<Figures> {
    let mut figures = Figures::default();
    let [slow, fast] = RATES_HZ;
    let mut arm = Theirs::start(python, slow).await?;
    let held = arm.hold(args.seconds).await?;
    arm.end().await?;
    (figures.latency_us[0], figures.processor_percent[0]) = (held.latency_us, held.percent);

    let mut arm = Theirs::start(python, fast).await?;
    let held = arm.hold(args.seconds).await?;
    (figures.latency_us[1], figures.processor_percent[1]) = (held.latency_us, held.percent);
    figures.idle = regularity(held.regularity);
    arm.client.state_every(fast / slow).await?;
    figures.processor_percent[2] = arm.hold(args.seconds).await?.percent;
    arm.client.state_every(1).await?;
    let busy = keep_busy().await?;
    figures.busy = regularity(arm.hold(args.seconds).await?.regularity);
    busy.end().await?;
    figures.round_trip_us = typical(&mut arm.client.round_trips(args.rounds * 10).await?);
    for (waypoints, figure) in WAYPOINTS.into_iter().zip(&mut figures.accept_ms) {
        let times = arm.client.accept(&trajectory(waypoints)?, args.rounds).await?;
        *figure = typical(&mut { times });
    }
    let mut times = Vec::new();
    for _ in 0..args.rounds {
        times.push(arm.first_motion().await?);
    }
    figures.first_motion_ms = typical(&mut times);
    arm.end().await?;
    Ok(figures)
}

/// From where the arm starts.
fn trajectory(waypoints: u32) -> anyhow::Result<JointTrajectory> {
    let home = ready_position()?;
    Ok(long_swing(home, home, waypoints))
}

/// An arm that holds its position, and a client that receives its state.
struct Theirs {
    server: Server,
    client: Client,
}

/// What an arm did while it held its position.
struct Held {
    regularity: Regularity,
    latency_us: Typical,
    /// Processor time of the server \[%\].
    percent: f64,
}

impl Theirs {
    async fn start(python: &Path, rate: u32) -> anyhow::Result<Self> {
        let server = Server::start(python, 1, Duration::from_secs(1) / rate).await?;
        let client = Client::connect(python, &server).await?;
        sleep(WARM_UP).await;
        Ok(Self { server, client })
    }

    async fn hold(&mut self, time: Duration) -> anyhow::Result<Held> {
        let period = self.server.period();
        let (ticks, arrivals) =
            tokio::try_join!(self.server.ticks(time), self.client.listen(time))?;
        let [of_arm] = ticks.loops.as_slice() else { bail!("the server has not one arm") };
        let latency = |(number, received): &(u64, armada_model::MonoTime)| {
            let deadline = of_arm.deadline(*number, period)?;
            Some(received.saturating_since(deadline).as_secs_f64() * 1e6)
        };
        let mut latencies: Vec<f64> = arrivals.iter().filter_map(latency).collect();
        Ok(Held {
            regularity: Regularity::of(&of_arm.wakes(period), period),
            latency_us: typical(&mut latencies),
            percent: ticks.cpu_share * 100.0,
        })
    }

    /// From the request for a trajectory until the driver sees another set-point \[ms\].
    async fn first_motion(&mut self) -> anyhow::Result<f64> {
        self.server.go_home().await?;
        let sent = self.client.begin(&trajectory(MOTION_WAYPOINTS)?).await?;
        for _ in 0..LOOKS {
            if let Some(moved) = self.server.moved().await? {
                self.client.end_motion().await?;
                return Ok(moved.saturating_since(sent).as_secs_f64() * 1e3);
            }
            sleep(LOOK).await;
        }
        bail!("the original does not begin a motion");
    }

    async fn end(self) -> anyhow::Result<()> {
        self.client.end().await?;
        self.server.end().await
    }
}
