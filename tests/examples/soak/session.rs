//! The soak itself: motion after motion, failure after failure.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::client::LeaseKeeper;
use armada_protocol::messages::*;
use armada_tests::{NetCellOptions, Network, monotonic, wait_for};
use uuid::Uuid;

use crate::chance::Chance;
use crate::failure::{ARMS, Failure};
use crate::memory::Memory;
use crate::support::{Bed, LOSS, PERIOD, RAMP, RESERVE, is_commanded};

/// Length of each motion \[s\].
const MOTION_S: f64 = 3.0;
/// How long it may take until a lease is free again.
const SETTLED: Duration = Duration::from_secs(20);
/// How long the leases last without being renewed: less than the longest failure.
const TTL: Duration = Duration::from_secs(1);
/// A partner that is silent for so long is certainly noticed.
const SILENCE: Duration = Duration::from_millis(300);
/// Growth of a process that is called a leak \[MB/min\].
const LEAK: f64 = 4.0;

/// How many lines of what each process printed are told when something is wrong.
const LAST_LINES: usize = 12;

/// What has happened so far.
#[derive(Debug, Default)]
struct Tally {
    motions: u64,
    complete: u64,
    failures: BTreeMap<String, u64>,
    /// From a partner's silence to the end of the motion.
    longest_to_abort: Duration,
}

/// A cell that is made to fail.
pub(crate) struct Soak {
    bed: Bed,
    chance: Chance,
    memory: Memory,
    tally: Tally,
    began: MonoTime,
}

impl Soak {
    pub(crate) async fn start(network: Network, seed: u64) -> Result<Self> {
        let options = NetCellOptions { state_rate_hz: 100, ..NetCellOptions::default() };
        let bed = Bed::start(network, options).await?;
        let (chance, memory) = (Chance::of(seed), Memory::default());
        Ok(Self { bed, chance, memory, tally: Tally::default(), began: monotonic() })
    }

    /// Goes on for `time`.
    pub(crate) async fn run(&mut self, time: Duration) -> Result<()> {
        self.began = monotonic();
        let mortal = self.chance.of_these(&ARMS);
        while monotonic().saturating_since(self.began) < time {
            let failure = Failure::random(&mut self.chance, mortal);
            let what = format!("motion {}, {failure:?}", self.tally.motions + 1);
            let done = self.round(failure).await;
            done.with_context(|| what).with_context(|| self.last_words())?;
            self.note_memory()?;
        }
        match self.memory.steepest() {
            Some((name, slope)) if slope > LEAK => bail!("{name} grows by {slope:.1} MB/min"),
            _ => Ok(()),
        }
    }

    /// One motion in which something fails at some time, and what a person does after it.
    async fn round(&mut self, failure: Failure) -> Result<()> {
        self.bed.make_ready().await?;
        let keepers = self.leases().await?;
        let id = self.begin(&keepers).await?;
        self.tally.motions += 1;
        let delay = self.chance.below(1500);
        self.pause(delay).await;
        failure.begin(&mut self.bed.cell)?;
        let failed = monotonic();
        let lasts = Failure::duration(&mut self.chance);
        self.watch(id, failure, lasts).await?;
        self.note_memory()?;
        failure.end(&mut self.bed.cell)?;
        *self.tally.failures.entry(failure.to_string()).or_default() += 1;
        let ends = self.ends(id, failure).await?;
        self.note_memory()?;
        if lasts >= SILENCE {
            self.check_in_time(&ends, failure, failed)?;
        }
        let complete = ends.iter().all(|end| end.status == ActionStatus::Complete);
        self.tally.complete += u64::from(complete);
        self.assert_rest().await?;
        for keeper in keepers {
            // A stop or a dead agent may have taken it away.
            drop(keeper.release().await);
        }
        Ok(())
    }

    async fn leases(&self) -> Result<Vec<LeaseKeeper>> {
        let mut keepers = Vec::new();
        for robot in self.bed.robots() {
            let acquire = async || self.bed.client.acquire_lease(robot, TTL).await.ok();
            keepers.push(wait_for("the lease is free", SETTLED, acquire).await?);
        }
        Ok(keepers)
    }

    async fn begin(&self, keepers: &[LeaseKeeper]) -> Result<Uuid> {
        let robots = self.bed.robots().into_iter().cloned();
        let leases: BTreeMap<RobotName, Uuid> =
            robots.zip(keepers.iter().map(LeaseKeeper::lease)).collect();
        let trajectory = self.bed.both(0.1 * MOTION_S, MOTION_S).await?;
        let params =
            CellExecuteTrajectory { leases, ..CellExecuteTrajectory::new(None, trajectory) };
        self.bed.begin("the motion", params).await
    }

    async fn pause(&self, ms: u64) {
        tokio::time::sleep(Duration::from_millis(ms)).await;
    }

    /// Looks at what is in reach while something fails: nothing moves without a lease.
    async fn watch(&self, id: Uuid, failure: Failure, time: Duration) -> Result<()> {
        let end = monotonic() + time;
        while monotonic() < end {
            for robot in self.bed.robots() {
                let asked = self.bed.client.robot_status(robot);
                let left = end.saturating_since(monotonic()).max(Duration::from_millis(1));
                let Ok(Ok(status)) = tokio::time::timeout(left, asked).await else { continue };
                let moves = status.motion.as_ref().is_some_and(|motion| motion.id == id);
                let held = status.lease.as_ref().is_some_and(|lease| !lease.stale);
                ensure!(held || !moves, "{failure}: {robot} moves without a lease: {status:#?}");
            }
            self.pause(5).await;
        }
        Ok(())
    }

    /// How each part ended; nothing of an agent that was killed.
    async fn ends(&self, id: Uuid, failure: Failure) -> Result<Vec<MotionStatus>> {
        let mut ends = Vec::new();
        for robot in self.bed.robots() {
            if failure.forgets() == Some(robot.as_str()) {
                continue;
            }
            let end = self.bed.end_of(robot, id).await;
            ends.push(end.with_context(|| format!("{robot}: nobody tells how it ended"))?);
        }
        // All or none: whoever completes it has done so with all others.
        let complete = ends.iter().filter(|end| end.status == ActionStatus::Complete).count();
        let together = complete == 0 || complete == ends.len();
        let late = ends.iter().all(|end| end.elapsed_s > 0.9 * end.duration_s);
        ensure!(together || late, "one goes on without the other: {ends:#?}");
        let alone = failure.forgets().is_some() && complete > 0;
        ensure!(!alone, "it went on to its end without its partner: {ends:#?}");
        Ok(ends)
    }

    /// Whoever moved and hears nothing of its partner any more has aborted in time.
    fn check_in_time(
        &mut self,
        ends: &[MotionStatus],
        failure: Failure,
        failed: MonoTime,
    ) -> Result<()> {
        let moved = |end: &&MotionStatus| {
            end.started_ns.is_some_and(|started| started <= failed) && end.stamp_ns >= failed
        };
        let silenced = |end: &&MotionStatus| failure.silences_partner_of(end.robot.as_str());
        for end in ends.iter().filter(moved).filter(silenced) {
            let took = end.stamp_ns.saturating_since(failed);
            if end.status == ActionStatus::Cancelled {
                // The gateway was quicker, for it heard of the partner's abort; told at rest.
                ensure!(took <= LOSS + PERIOD + RESERVE + RAMP, "{failure}: {took:?}: {end:#?}");
                continue;
            }
            ensure!(took <= LOSS + PERIOD + RESERVE, "{failure}: aborted after {took:?}: {end:#?}");
            self.tally.longest_to_abort = self.tally.longest_to_abort.max(took);
        }
        Ok(())
    }

    /// Every arm is told to stand, and measured to.
    async fn assert_rest(&self) -> Result<()> {
        for robot in self.bed.robots() {
            let mut watch = crate::support::Watch::of(&self.bed.client, robot).await?;
            let from = monotonic();
            let rest = |state: &RobotState| {
                let speeds = state.joint_velocity_rad_s.iter();
                !is_commanded(state) && speeds.fold(0.0_f64, |m, v| m.max(v.abs())) < 0.02
            };
            let after = |state: &RobotState| state.stamp_ns > from;
            watch.state_when("the arm stands", after, rest).await?;
        }
        Ok(())
    }

    fn note_memory(&mut self) -> Result<()> {
        let minutes = monotonic().saturating_since(self.began).as_secs_f64() / 60.0;
        let cell = &self.bed.cell;
        let agents = cell.agents.iter().map(|(name, process)| (name.as_str(), process));
        let all = agents.chain([("gateway", &cell.gateway)]);
        for (name, process) in all.filter(|(_, process)| process.is_running()) {
            self.memory.note(name, process.pid()?, minutes)?;
        }
        Ok(())
    }

    /// Who runs, and what each has printed last.
    fn last_words(&self) -> String {
        let cell = &self.bed.cell;
        let arms = cell.agents.iter().chain(&cell.emulators);
        let all = arms.map(|(name, process)| (name.as_str(), process));
        let told = all.chain([("gateway", &cell.gateway)]).map(|(name, process)| {
            let printed = process.printed();
            let mut lines: Vec<_> = printed.lines().rev().take(LAST_LINES).collect();
            lines.reverse();
            format!("{name}, running: {}\n{}", process.is_running(), lines.join("\n"))
        });
        told.collect::<Vec<_>>().join("\n")
    }

    /// What happened, for people.
    pub(crate) fn summary(&self) -> String {
        let Tally { motions, complete, failures, longest_to_abort } = &self.tally;
        let mut text = format!("{motions} motions, {complete} of them complete");
        for (failure, count) in failures {
            let _ = write!(text, "\n  {count:4} x {failure}");
        }
        let abort = longest_to_abort.as_secs_f64() * 1e3;
        let _ = write!(text, "\nlongest from a partner's silence to the abort: {abort:.0} ms");
        match self.memory.steepest() {
            Some((name, slope)) => {
                let _ = write!(text, "\nfastest growth of memory: {name}, {slope:+.2} MB/min");
            }
            None => text.push_str("\ntoo short to tell whether memory grows"),
        }
        text
    }
}
