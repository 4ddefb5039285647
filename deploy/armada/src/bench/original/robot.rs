//! The two processes of the original: a server of arms, and a client of one.

use std::path::Path;
use std::time::Duration;

use armada_agent::runtime::Wake;
use armada_model::{JointTrajectory, MonoTime};
use serde::Deserialize;
use serde_json::{Value, json};

use super::SCRIPT;
use crate::bench::python::Python;

/// Arms in one process, each with a loop of its own.
pub(super) struct Server {
    python: Python,
    period: Duration,
    /// Where it listens.
    port: u16,
}

#[derive(Deserialize)]
struct Listening {
    port: u16,
}

/// What loops did over a time.
#[derive(Debug, Deserialize)]
pub(super) struct Ticks {
    /// Processor time of the process, as a share of one processor.
    pub(super) cpu_share: f64,
    /// Each loop.
    pub(super) loops: Vec<TicksOfOne>,
}

/// What one loop did.
#[derive(Debug, Deserialize)]
pub(super) struct TicksOfOne {
    /// First deadline of the loop.
    phase_ns: u64,
    /// Number of the state that the first of these ticks made.
    first: u64,
    /// When each tick began.
    ns: Vec<u64>,
}

impl TicksOfOne {
    /// The ticks in their order, each with the newest deadline that had passed, which is what the
    /// loop of an agent takes for its tick.
    pub(super) fn wakes(&self, period: Duration) -> Vec<Wake> {
        self.ns.iter().map(|&ns| self.wake(ns, period)).collect()
    }

    /// Deadline of the tick that made the state of a number; `None` if it is not among these.
    pub(super) fn deadline(&self, number: u64, period: Duration) -> Option<MonoTime> {
        let index = usize::try_from(number.checked_sub(self.first)?).ok()?;
        Some(self.wake(*self.ns.get(index)?, period).deadline)
    }

    fn wake(&self, ns: u64, period: Duration) -> Wake {
        let period = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX).max(1);
        let since = ns.saturating_sub(self.phase_ns);
        let deadline = MonoTime::from_nanos(self.phase_ns + since / period * period);
        Wake { deadline, woke: MonoTime::from_nanos(ns) }
    }
}

impl Server {
    /// Starts `arms` with loops of a period.
    pub(super) async fn start(program: &Path, arms: u32, period: Duration) -> anyhow::Result<Self> {
        let arguments = ["serve".to_owned(), arms.to_string(), period.as_secs_f64().to_string()];
        let (python, ready) = Python::start::<Listening>(program, SCRIPT, &arguments).await?;
        Ok(Self { python, period, port: ready.port })
    }

    /// What the loops do over `time` from now.
    pub(super) async fn ticks(&mut self, time: Duration) -> anyhow::Result<Ticks> {
        self.python.ask(&json!({ "ask": "wakes", "seconds": time.as_secs_f64() })).await
    }

    /// Puts the first arm back where it started and forgets its motion.
    pub(super) async fn go_home(&mut self) -> anyhow::Result<()> {
        self.python.ask::<Value>(&json!({ "ask": "to_home" })).await.map(drop)
    }

    /// When the driver of the first arm saw the first set-point that differs from its start.
    pub(super) async fn moved(&mut self) -> anyhow::Result<Option<MonoTime>> {
        #[derive(Deserialize)]
        struct Moved {
            ns: Option<u64>,
        }
        let moved: Moved = self.python.ask(&json!({ "ask": "moved" })).await?;
        Ok(moved.ns.map(MonoTime::from_nanos))
    }

    /// Period of its loops.
    pub(super) const fn period(&self) -> Duration {
        self.period
    }

    /// Ends it.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        self.python.end().await
    }
}

/// A client of the first arm of a server; the state is sent to it at every tick.
pub(super) struct Client(Python);

impl Client {
    /// Connects.
    pub(super) async fn connect(program: &Path, server: &Server) -> anyhow::Result<Self> {
        let arguments = ["client".to_owned(), server.port.to_string()];
        let (python, _) = Python::start::<Value>(program, SCRIPT, &arguments).await?;
        Ok(Self(python))
    }

    /// States over `time` from now: number, and when it was handed over.
    pub(super) async fn listen(&mut self, time: Duration) -> anyhow::Result<Vec<(u64, MonoTime)>> {
        #[derive(Deserialize)]
        struct Arrivals {
            arrivals: Vec<(u64, u64)>,
        }
        let ask = json!({ "ask": "listen", "seconds": time.as_secs_f64() });
        let Arrivals { arrivals } = self.0.ask(&ask).await?;
        Ok(arrivals.into_iter().map(|(number, ns)| (number, MonoTime::from_nanos(ns))).collect())
    }

    /// Times of requests that read one value \[µs\].
    pub(super) async fn round_trips(&mut self, rounds: u32) -> anyhow::Result<Vec<f64>> {
        #[derive(Deserialize)]
        struct Times {
            us: Vec<f64>,
        }
        let times: Times = self.0.ask(&json!({ "ask": "round_trips", "rounds": rounds })).await?;
        Ok(times.us)
    }

    /// Asks for the state of every so many ticks, at least 1.
    pub(super) async fn state_every(&mut self, ticks: u32) -> anyhow::Result<()> {
        let ask = json!({ "ask": "state_every", "ticks": ticks });
        self.0.ask::<Value>(&ask).await.map(drop)
    }

    /// Times from the request for a trajectory to the answer \[ms\]; nothing moves.
    pub(super) async fn accept(
        &mut self,
        trajectory: &JointTrajectory,
        rounds: u32,
    ) -> anyhow::Result<Vec<f64>> {
        #[derive(Deserialize)]
        struct Times {
            ms: Vec<f64>,
        }
        let mut ask = asking("accept", trajectory);
        ask["rounds"] = rounds.into();
        let times: Times = self.0.ask(&ask).await?;
        Ok(times.ms)
    }

    /// Begins a motion; when the request was sent.
    pub(super) async fn begin(&mut self, trajectory: &JointTrajectory) -> anyhow::Result<MonoTime> {
        #[derive(Deserialize)]
        struct Sent {
            sent_ns: u64,
        }
        let sent: Sent = self.0.ask(&asking("begin", trajectory)).await?;
        Ok(MonoTime::from_nanos(sent.sent_ns))
    }

    /// Ends the motion that was begun.
    pub(super) async fn end_motion(&mut self) -> anyhow::Result<()> {
        self.0.ask::<Value>(&json!({ "ask": "end" })).await.map(drop)
    }

    /// Ends it.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        self.0.end().await
    }
}

fn asking(what: &str, trajectory: &JointTrajectory) -> Value {
    let waypoints = &trajectory.waypoints;
    let times: Vec<f64> = waypoints.iter().map(|waypoint| waypoint.time_from_start_s).collect();
    let positions: Vec<_> = waypoints.iter().map(|waypoint| &waypoint.joint_position).collect();
    json!({ "ask": what, "times_s": times, "positions": positions })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::wakes::Regularity;

    const PERIOD: Duration = Duration::from_millis(10);

    fn ticks() -> TicksOfOne {
        let ns = [13_000_100, 23_000_300, 49_000_000, 53_000_050].to_vec();
        TicksOfOne { phase_ns: 3_000_000, first: 2, ns }
    }

    #[test]
    fn a_tick_is_of_the_newest_deadline_that_had_passed() {
        let wakes = ticks().wakes(PERIOD);
        let deadlines: Vec<_> = wakes.iter().map(|wake| wake.deadline.as_nanos()).collect();
        assert_eq!(deadlines, [13_000_000, 23_000_000, 43_000_000, 53_000_000]);
        assert_eq!(Regularity::of(&wakes, PERIOD).missed, 1);
    }

    #[test]
    fn the_deadline_of_a_state_is_found_by_its_number() {
        let deadline = |number| ticks().deadline(number, PERIOD).map(MonoTime::as_nanos);
        assert_eq!([2, 5].map(deadline), [Some(13_000_000), Some(53_000_000)]);
        assert_eq!([0, 1, 6].map(deadline), [None; 3]);
    }

    #[test]
    fn a_trajectory_is_asked_for_as_times_and_positions() {
        let waypoint = |time_from_start_s: f64| armada_model::Waypoint {
            time_from_start_s,
            joint_position: vec![time_from_start_s, 1.0],
            ..Default::default()
        };
        let trajectory = JointTrajectory {
            waypoints: [0.0, 0.5].map(waypoint).to_vec(),
            ..JointTrajectory::default()
        };
        let expected = json!({
            "ask": "begin", "times_s": [0.0, 0.5], "positions": [[0.0, 1.0], [0.5, 1.0]],
        });
        assert_eq!(asking("begin", &trajectory), expected);
    }
}
