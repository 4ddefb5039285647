//! One step of the control loop: its time, and what it asks of the heap.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, ensure};
use armada_agent::config::RobotConfig;
use armada_agent::control::{
    FollowOrder, Input, JogOrder, LoopRequest, LoopState, Order, Output, Params, step,
};
use armada_agent::drivers::{DriverRequest, Feedback};
use armada_agent::runtime::monotonic;
use armada_model::{
    CompiledTrajectory, JointTrajectory, JointVector, MonoTime, MotionLimits, TrajectoryOptions,
};
use armada_protocol::messages::{CommandMode, OperationalMode, RobotFlags, StopLevel};
use clap::Args;
use serde_json::json;
use uuid::Uuid;

use super::allocations;
use super::figures::{QUANTILES, quantiles};
use super::machine::Machine;
use super::report::{Report, Section};
use super::robot_file::{self, Folder, JOINTS, RobotSpec, ready_position};
use super::swing::{long_swing, swing};

/// Period of the loop.
const PERIOD: Duration = Duration::from_millis(1);
/// Waypoints of the trajectory that is followed.
const WAYPOINTS: u32 = 1001;
/// Ticks of a motion before it is stopped, at about its highest speed.
const TICKS_TO_SPEED: usize = 400;

/// Arguments of `armada bench step`.
#[derive(Args, Clone, Debug)]
pub(super) struct StepArgs {
    /// Repetitions of the measurement
    #[arg(long, value_name = "NUMBER", default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    repetitions: u32,
    /// Steps of each kind in a repetition
    #[arg(long, value_name = "NUMBER", default_value_t = 20_000,
        value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    steps: u32,
    /// Print JSON, for scripts
    #[arg(long)]
    pub(super) json: bool,
}

/// What the robot does in a step.
#[derive(Clone, Copy, Debug)]
enum Doing {
    Trajectory,
    Jog,
    Hold,
    StopRamp,
}

const KINDS: [Doing; 4] = [Doing::Trajectory, Doing::Jog, Doing::Hold, Doing::StopRamp];

impl Doing {
    const fn title(self) -> &'static str {
        match self {
            Self::Trajectory => "trajectory of 1001 waypoints",
            Self::Jog => "jog",
            Self::Hold => "hold",
            Self::StopRamp => "ramp of a stop",
        }
    }
}

/// Measures steps of every kind.
pub(super) fn measure(args: &StepArgs) -> anyhow::Result<Report> {
    let settings = json!({ "repetitions": args.repetitions, "steps": args.steps });
    let mut report = Report::new("step", settings, Machine::now());
    let columns = QUANTILES.map(|(name, _)| name).into_iter().chain(["allocations"]);
    let mut section = Section::new("one step at 7 joints, µs", columns);
    let params = params()?;
    for doing in KINDS {
        let repetitions = (0..args.repetitions)
            .map(|_| Rig::new(&params)?.measure(doing, args.steps))
            .collect::<anyhow::Result<Vec<_>>>()?;
        section = section.row(doing.title(), &repetitions);
    }
    report.section(section);
    report.note(format!(
        "each step is timed alone; reading the clock twice is part of it: {:.3} µs at p50",
        clock_cost()
    ));
    report.note("allocations: calls of the allocator in all steps of the row, to free memory too");
    Ok(report)
}

fn params() -> anyhow::Result<Params> {
    let folder = Folder::make()?;
    let spec =
        RobotSpec { name: "arm".parse()?, period: PERIOD, state_rate_hz: 100, priority: None };
    let config = RobotConfig::load(&robot_file::write(&folder, &spec)?)?;
    let (_, model) = config.read_urdf()?;
    Ok(config.params(&model)?)
}

fn clock_cost() -> f64 {
    let cost = |_| {
        let begin = black_box(monotonic());
        monotonic().saturating_since(begin).as_secs_f64() * 1e6
    };
    let mut costs: Vec<f64> = (0..10_000).map(cost).collect();
    quantiles(&mut costs).map_or(0.0, |[p50, ..]| p50)
}

/// A loop whose robot is always where it was told to be a tick ago.
struct Rig<'a> {
    params: &'a Params,
    state: LoopState,
    now: MonoTime,
    feedback: Feedback,
    /// Where it goes to and fro.
    middle: JointVector,
    stop: Option<StopLevel>,
    last: Duration,
    calls: u64,
}

impl<'a> Rig<'a> {
    /// A robot that stands still with its drives on.
    fn new(params: &'a Params) -> anyhow::Result<Self> {
        let now = MonoTime::from_nanos(1);
        let middle = ready_position()?;
        let feedback = Feedback {
            joint_velocity: middle.map_indexed(|_, _| 0.0),
            operational_mode: OperationalMode::Cobot,
            ..Feedback::of(now, middle)
        };
        let state = LoopState::new(params)?;
        let (last, stop) = (Duration::ZERO, None);
        let mut rig = Self { params, state, now, feedback, middle, stop, last, calls: 0 };
        rig.tick(None);
        rig.tick(Some(Order::Enable));
        let output = (0..100).map(|_| rig.tick(None)).last().context("no tick")?;
        let flags = output.snapshot.flags;
        ensure!(flags.contains(RobotFlags::ENABLED), "the loop does not start: {flags:?}");
        Ok(rig)
    }

    /// Quantiles of the time of `steps` steps \[µs\], and their calls of the allocator.
    fn measure(mut self, doing: Doing, steps: u32) -> anyhow::Result<[f64; 5]> {
        let steps = usize::try_from(steps)?;
        let mut times = Vec::with_capacity(steps);
        self.calls = 0;
        while times.len() < steps {
            let counted = times.len();
            match doing {
                Doing::Hold => self.note(&mut times, steps, |_| true),
                Doing::Jog => self.jog(&mut times, steps),
                Doing::Trajectory => {
                    let from = self.feedback.joint_position;
                    self.follow(&long_swing(from, self.middle, WAYPOINTS))?;
                    self.note(&mut times, steps, moves);
                }
                Doing::StopRamp => self.stop(&mut times, steps)?,
            }
            ensure!(times.len() > counted, "the robot does not do what is measured: {doing:?}");
        }
        let [p50, p99, p999, max] = quantiles(&mut times).context("no step")?;
        #[expect(clippy::cast_precision_loss, reason = "calls are few")]
        Ok([p50, p99, p999, max, self.calls as f64])
    }

    /// Notes the time of steps as long as `goes_on` holds.
    fn note(&mut self, times: &mut Vec<f64>, steps: usize, goes_on: impl Fn(&Output) -> bool) {
        while times.len() < steps {
            let before = self.calls;
            let output = self.tick(None);
            if !goes_on(&output) {
                // Of another kind: neither its time nor what it freed counts here.
                self.calls = before;
                break;
            }
            times.push(self.last.as_secs_f64() * 1e6);
        }
    }

    fn jog(&mut self, times: &mut Vec<f64>, steps: usize) {
        self.tick(Some(Order::SetMode(CommandMode::Jog)));
        let middle = self.middle;
        let far = |joint, x: f64| {
            let middle: f64 = middle.get(joint).copied().unwrap_or_default();
            if x > middle { middle - 0.2 } else { middle + 0.2 }
        };
        let joint_position = self.feedback.joint_position.map_indexed(far);
        let max_velocity = joint_position.map_indexed(|_, _| 0.5);
        let id = Uuid::now_v7();
        self.tick(Some(Order::Jog(JogOrder { id, joint_position, max_velocity })));
        self.note(times, steps, moves);
    }

    fn follow(&mut self, trajectory: &JointTrajectory) -> anyhow::Result<()> {
        let limits = MotionLimits::new(&self.params.limits)?;
        let names = JOINTS.map(str::to_owned);
        let options = TrajectoryOptions::default();
        let compiled = CompiledTrajectory::compile(trajectory, &names, &limits, &options)?;
        self.tick(Some(Order::SetMode(CommandMode::Trajectory)));
        let trajectory = Arc::new(compiled);
        let order = FollowOrder::at_once(Uuid::now_v7(), trajectory);
        self.tick(Some(Order::Follow(order)));
        Ok(())
    }

    fn stop(&mut self, times: &mut Vec<f64>, steps: usize) -> anyhow::Result<()> {
        self.follow(&swing(self.feedback.joint_position, self.middle, PERIOD))?;
        (0..TICKS_TO_SPEED).for_each(|_| drop(self.tick(None)));
        self.stop = Some(StopLevel::L2);
        self.note(times, steps, |output| {
            output.snapshot.joint_velocity_command.iter().any(|&velocity| velocity != 0.0)
        });
        (0..200).for_each(|_| drop(self.tick(None)));
        self.stop = None;
        (0..10).for_each(|_| drop(self.tick(None)));
        Ok(())
    }

    /// One tick, timed, and its calls of the allocator.
    fn tick(&mut self, order: Option<Order>) -> Output {
        self.now = self.now + PERIOD;
        self.feedback.stamp = self.now;
        let mut input = Input {
            feedback: Some(self.feedback),
            stop: self.stop,
            requests: order.into_iter().map(|order| LoopRequest::new(0, order)).collect(),
            ..Input::at(self.now)
        };
        let (calls, begin) = (allocations::calls(), monotonic());
        let output = black_box(step(self.params, &mut self.state, black_box(&mut input)));
        self.last = monotonic().saturating_since(begin);
        self.calls += allocations::calls() - calls;
        self.obey(&output);
        output
    }

    fn obey(&mut self, output: &Output) {
        if let Some(command) = output.command {
            self.feedback.joint_position = command.joint_position;
            self.feedback.joint_velocity = command.joint_velocity;
        }
        match output.driver_request {
            Some(DriverRequest::Enable) => {
                (self.feedback.enabled, self.feedback.ready) = (true, true);
            }
            Some(DriverRequest::Disable) => {
                (self.feedback.enabled, self.feedback.ready) = (false, false);
            }
            Some(DriverRequest::ResetErrors) => self.feedback.error_code = 0,
            // Not among the abilities of this controller.
            Some(_) | None => {}
        }
    }
}

const fn moves(output: &Output) -> bool {
    output.snapshot.motion.is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_every_kind_are_found_and_allocate_nothing() {
        let params = params().expect("the robot file is valid");
        for doing in KINDS {
            let rig = Rig::new(&params).expect("the loop starts");
            let figures = rig.measure(doing, 1000).expect("measured");
            assert!(figures[0] > 0.0, "{doing:?}");
            assert_eq!(figures[4], 0.0, "{doing:?}");
        }
    }
}
