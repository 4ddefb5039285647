//! A loop with a simulated controller behind it; every tick is watched for the invariants.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, JointLimits, JointTrajectory, JointVector, MonoTime, MotionLimits,
    TrajectoryOptions, Waypoint,
};
use armada_protocol::messages::{
    ActionStatus, CommandMode, FaultCode, Queue, StopLevel, StopStage,
};
use arrayvec::ArrayVec;
use proptest::test_runner::{Config as ProptestConfig, RngSeed};
use uuid::Uuid;

pub(super) use super::plant::Plant;
use crate::control::{
    FollowOrder, Granted, GroupWord, Input, JogOrder, LoopEvent, LoopRequest, LoopState,
    MAX_REQUESTS, MAX_SAMPLES, MAX_WORDS, MotionReport, Order, Output, Params, Refusal, Retired,
    StreamSample, step,
};
use crate::drivers::{Feedback, SetPoint};

pub(super) const PERIOD: Duration = Duration::from_millis(4);
pub(super) const JOINTS: usize = 3;

pub(super) fn joints(values: [f64; JOINTS]) -> JointVector {
    JointVector::from_slice(&values).expect("finite")
}

pub(super) fn params() -> Params {
    let joint = |lower, upper, velocity, acceleration| JointLimits {
        lower,
        upper,
        velocity,
        acceleration: Some(acceleration),
        jerk: None,
        effort: None,
    };
    let limits = vec![
        joint(Some(-2.0), Some(2.0), 1.5, 4.0),
        joint(Some(-1.0), Some(3.0), 1.0, 6.0),
        joint(None, None, 2.0, 5.0),
    ];
    Params {
        communication_timeout: Duration::from_millis(40),
        start_tolerance: joints([0.05; JOINTS]),
        tracking_tolerance: joints([0.02; JOINTS]),
        // What is sent at one tick is seen at the next at the earliest.
        tracking_lag: PERIOD * (Plant::LAG as u32 + 1),
        standstill_velocity: joints([0.01; JOINTS]),
        standstill_hold: Duration::from_millis(100),
        request_timeout: Duration::from_millis(200),
        ..Params::for_joints(limits, PERIOD).expect("three joints")
    }
}

pub(super) fn trajectory(rows: &[(f64, [f64; JOINTS])]) -> Arc<CompiledTrajectory> {
    trajectory_within(&[], rows)
}

/// A trajectory that asks for a tolerance of position at every waypoint.
pub(super) fn trajectory_within(
    position_tolerance: &[f64],
    rows: &[(f64, [f64; JOINTS])],
) -> Arc<CompiledTrajectory> {
    trajectory_with(position_tolerance, &[], rows)
}

/// A trajectory that asks for tolerances of position and velocity at every waypoint.
pub(super) fn trajectory_with(
    position_tolerance: &[f64],
    velocity_tolerance: &[f64],
    rows: &[(f64, [f64; JOINTS])],
) -> Arc<CompiledTrajectory> {
    let names = ["a", "b", "c"];
    let waypoints = rows.iter().map(|(time, row)| Waypoint {
        time_from_start_s: *time,
        joint_position: row.to_vec(),
        position_tolerance: position_tolerance.to_vec(),
        velocity_tolerance: velocity_tolerance.to_vec(),
        ..Waypoint::default()
    });
    let trajectory = JointTrajectory {
        joint_names: names.map(str::to_owned).to_vec(),
        waypoints: waypoints.collect(),
        ..JointTrajectory::default()
    };
    let limits = MotionLimits::new(&params().limits).expect("complete limits");
    let options = TrajectoryOptions::default();
    let compiled = CompiledTrajectory::compile(&trajectory, &names, &limits, &options);
    Arc::new(compiled.expect("a legal trajectory"))
}

/// What was sent before, to judge what is sent now.
#[derive(Default)]
pub(super) struct Watch {
    sent: Option<(JointVector, JointVector)>,
    epoch: u64,
    /// Ticks that are left until a stopped robot has to stand.
    stop_ticks: Option<f64>,
    /// How much longer it may take because it stops together with others \[s\].
    pub(super) common_s: f64,
    open: HashSet<u64>,
    motions: HashMap<Uuid, Option<ActionStatus>>,
    pub(super) most_events: usize,
}

/// The loop, its plant, and its clock.
pub(super) struct Rig {
    pub(super) params: Params,
    pub(super) state: LoopState,
    pub(super) now: MonoTime,
    pub(super) plant: Plant,
    pub(super) stop: Option<StopLevel>,
    pub(super) resets: u16,
    pub(super) loop_error: bool,
    pub(super) events: Vec<LoopEvent>,
    pub(super) retired: Vec<Arc<CompiledTrajectory>>,
    pub(super) commands: Vec<SetPoint>,
    pub(super) last: Option<Output>,
    /// Samples of streams for the next ticks, and the number of the last.
    pub(super) samples: Vec<StreamSample>,
    pub(super) sample_seq: u64,
    /// Words of partners for the next ticks.
    pub(super) words: Vec<GroupWord>,
    requests: Vec<LoopRequest>,
    tickets: u64,
    pub(super) watch: Watch,
}

impl Rig {
    /// A robot whose drives are on, before its first tick.
    pub(super) fn new() -> Self {
        Self::with(params())
    }

    pub(super) fn with(params: Params) -> Self {
        let state = LoopState::new(&params).expect("sensible parameters");
        Self {
            params,
            state,
            now: MonoTime::from_nanos(1_000_000_000),
            plant: Plant::new(joints([0.0; JOINTS])),
            stop: None,
            resets: 0,
            loop_error: false,
            events: Vec::new(),
            retired: Vec::new(),
            commands: Vec::new(),
            last: None,
            samples: Vec::new(),
            sample_seq: 0,
            words: Vec::new(),
            requests: Vec::new(),
            tickets: 0,
            watch: Watch::default(),
        }
    }

    /// A robot in `mode`, entered from halt.
    pub(super) fn in_mode(mode: CommandMode) -> Self {
        Self::in_mode_with(params(), mode)
    }

    /// The same with other parameters.
    pub(super) fn in_mode_with(params: Params, mode: CommandMode) -> Self {
        let mut rig = Self::with(params);
        rig.tick();
        if mode != CommandMode::Halt {
            assert!(rig.ask(Order::SetMode(mode)).is_ok());
        }
        assert_eq!(rig.mode(), mode);
        rig
    }

    /// Hands in an order for the next tick; returns its ticket.
    pub(super) fn order(&mut self, order: Order) -> u64 {
        self.order_under(None, order)
    }

    /// As [`Self::order`], under a lease.
    pub(super) fn order_under(&mut self, lease: Option<Uuid>, order: Order) -> u64 {
        self.tickets += 1;
        self.watch.open.insert(self.tickets);
        self.requests.push(LoopRequest { lease, ..LoopRequest::new(self.tickets, order) });
        self.tickets
    }

    /// As [`Self::order`], by somebody who waits until an instant.
    pub(super) fn order_until(&mut self, until: MonoTime, order: Order) -> u64 {
        let ticket = self.order(order);
        if let Some(last) = self.requests.last_mut() {
            last.until = Some(until);
        }
        ticket
    }

    /// Orders and runs one tick; the answer must come in it.
    pub(super) fn ask(&mut self, order: Order) -> Result<Granted, Refusal> {
        let ticket = self.order(order);
        self.tick();
        self.answer(ticket).expect("an answer in the same tick")
    }

    /// As [`Self::ask`], under a lease.
    pub(super) fn ask_under(&mut self, lease: Uuid, order: Order) -> Result<Granted, Refusal> {
        let ticket = self.order_under(Some(lease), order);
        self.tick();
        self.answer(ticket).expect("an answer in the same tick")
    }

    /// Orders and runs until the answer has come.
    pub(super) fn ask_and_wait(&mut self, order: Order) -> Result<Granted, Refusal> {
        let ticket = self.order(order);
        self.until("the answer", |rig| rig.answer(ticket).is_some());
        self.answer(ticket).expect("waited for")
    }

    pub(super) fn answer(&self, ticket: u64) -> Option<Result<Granted, Refusal>> {
        self.events.iter().find_map(|event| match event {
            LoopEvent::Answer { ticket: of, result } if *of == ticket => Some(*result),
            _ => None,
        })
    }

    pub(super) fn jog(&mut self, id: u128, goal: [f64; JOINTS]) -> Result<Granted, Refusal> {
        self.ask(jog(id, goal))
    }

    pub(super) fn follow(
        &mut self,
        id: u128,
        trajectory: &Arc<CompiledTrajectory>,
    ) -> Result<Granted, Refusal> {
        self.ask(follow(id, trajectory))
    }

    /// One period passes.
    pub(super) fn tick(&mut self) -> Output {
        self.late_tick(1)
    }

    pub(super) fn ticks(&mut self, count: usize) {
        for _ in 0..count {
            self.tick();
        }
    }

    /// Ticks until `condition`, which must be within five seconds of the invented clock.
    pub(super) fn until(&mut self, what: &str, condition: impl Fn(&Self) -> bool) {
        for _ in 0..1250 {
            self.tick();
            if condition(self) {
                return;
            }
        }
        panic!("{what} did not come; events: {:#?}", self.events);
    }

    /// The loop wakes after `periods`, the plant having gone on without it.
    pub(super) fn late_tick(&mut self, periods: u32) -> Output {
        self.now = self.now + self.params.period * periods;
        for _ in 1..periods {
            self.plant.go_on();
        }
        let count = self.requests.len().min(MAX_REQUESTS);
        let waiting = self.samples.len().min(MAX_SAMPLES);
        let mut input = Input {
            now: self.now,
            feedback: self.plant.feedback(self.now),
            stop: self.stop,
            resets: self.resets,
            loop_error: self.loop_error,
            requests: self.requests.drain(..count).collect::<ArrayVec<_, MAX_REQUESTS>>(),
            stream: self.samples.drain(..waiting).collect::<ArrayVec<_, MAX_SAMPLES>>(),
            group: self
                .words
                .drain(..self.words.len().min(MAX_WORDS))
                .collect::<ArrayVec<_, MAX_WORDS>>(),
        };
        let output = step(&self.params, &mut self.state, &mut input);
        assert!(input.requests.is_empty(), "requests were left in the input");
        assert!(input.stream.is_empty(), "samples were left in the input");
        self.watch.check(&self.params, self.stop, input.feedback.as_ref(), &output);
        self.plant.take(output.command.as_ref(), output.driver_request);
        self.events.extend(output.events.iter().copied());
        self.retired.extend(output.retired.iter().filter_map(|retired| match retired {
            Retired::Trajectory(trajectory) => Some(Arc::clone(trajectory)),
            Retired::Equipment(_) => None,
        }));
        self.commands.extend(output.command);
        self.last = Some(output.clone());
        output
    }

    pub(super) fn mode(&self) -> CommandMode {
        self.last.as_ref().expect("a tick").snapshot.command_mode
    }

    pub(super) fn epoch(&self) -> u64 {
        self.last.as_ref().expect("a tick").snapshot.epoch
    }

    /// Whether the last two set-points are equal, or none is sent.
    pub(super) fn command_rests(&self) -> bool {
        self.watch.sent.is_none_or(|(_, velocity)| velocity.iter().all(|v| *v == 0.0))
    }

    pub(super) fn fault_codes(&self) -> Vec<FaultCode> {
        self.events
            .iter()
            .filter_map(|event| match event {
                LoopEvent::FaultLatched(fault) => Some(fault.code),
                _ => None,
            })
            .collect()
    }

    pub(super) fn stages(&self) -> Vec<StopStage> {
        self.events
            .iter()
            .filter_map(|event| match event {
                LoopEvent::StopStage(stage) => Some(*stage),
                _ => None,
            })
            .collect()
    }

    pub(super) fn reports(&self, id: u128) -> Vec<MotionReport> {
        self.events
            .iter()
            .filter_map(|event| match event {
                LoopEvent::Motion(report) if report.id == Uuid::from_u128(id) => Some(*report),
                _ => None,
            })
            .collect()
    }

    pub(super) fn statuses(&self, id: u128) -> Vec<ActionStatus> {
        self.reports(id).iter().map(|report| report.status).collect()
    }

    pub(super) fn ended(&self, id: u128) -> Option<MotionReport> {
        self.reports(id).last().copied().filter(|report| report.status.is_terminal())
    }

    /// Trajectories in the last output, which the rig keeps a copy of.
    pub(super) fn last_retired(&self) -> usize {
        self.last.as_ref().map_or(0, |output| output.retired.len())
    }

    pub(super) fn most_events(&self) -> usize {
        self.watch.most_events
    }

    /// Lets everything come to its end: then each request is answered, and each motion ended.
    pub(super) fn finish(&mut self) {
        self.ticks(self.requests.len() / MAX_REQUESTS + 1);
        self.order(Order::Halt);
        self.ticks(300);
        assert!(self.watch.open.is_empty(), "tickets {:?} were not answered", self.watch.open);
        let running: Vec<_> = self
            .watch
            .motions
            .iter()
            .filter(|(_, status)| status.is_some_and(|status| !status.is_terminal()))
            .collect();
        assert!(running.is_empty(), "motions {running:?} did not end");
    }
}

/// How stories against a model are tried: many, long, and the same at each run.
pub(super) fn long_stories(seed: u64) -> ProptestConfig {
    ProptestConfig {
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        max_shrink_time: 30_000,
        ..ProptestConfig::with_cases(500)
    }
}

pub(super) fn jog(id: u128, goal: [f64; JOINTS]) -> Order {
    Order::Jog(JogOrder {
        id: Uuid::from_u128(id),
        joint_position: joints(goal),
        max_velocity: joints([1.0, 1.0, 1.0]),
    })
}

pub(super) fn follow(id: u128, trajectory: &Arc<CompiledTrajectory>) -> Order {
    follow_with(id, trajectory, None, None)
}

/// A trajectory that is to be followed in another way than at once.
pub(super) fn queued(id: u128, trajectory: &Arc<CompiledTrajectory>, queue: Queue) -> Order {
    let (id, trajectory) = (Uuid::from_u128(id), Arc::clone(trajectory));
    Order::Follow(FollowOrder { queue, ..FollowOrder::at_once(id, trajectory) })
}

pub(super) fn follow_with(
    id: u128,
    trajectory: &Arc<CompiledTrajectory>,
    start: Option<MonoTime>,
    epoch: Option<u64>,
) -> Order {
    let (id, trajectory) = (Uuid::from_u128(id), Arc::clone(trajectory));
    Order::Follow(FollowOrder { start, epoch, ..FollowOrder::at_once(id, trajectory) })
}

impl Watch {
    fn check(
        &mut self,
        params: &Params,
        stop: Option<StopLevel>,
        feedback: Option<&Feedback>,
        output: &Output,
    ) {
        assert!(output.snapshot.epoch >= self.epoch, "the epoch went back");
        self.epoch = output.snapshot.epoch;
        let motion_mode = matches!(
            output.snapshot.command_mode,
            CommandMode::Jog | CommandMode::Trajectory | CommandMode::Homing
        );
        assert!(output.snapshot.motion.is_none() || (motion_mode && stop.is_none()));
        self.most_events = self.most_events.max(output.events.len());
        for event in &output.events {
            self.check_event(event);
        }
        if stop == Some(StopLevel::L0) {
            assert_eq!(output.command, None, "a set-point during a stop of level L0");
        }
        let Some(command) = output.command else {
            self.sent = None;
            return;
        };
        let position = command.joint_position;
        assert!(position.is_finite() && command.joint_velocity.is_finite());
        let feedback = feedback.expect("no set-point without feedback");
        assert!(feedback.enabled && feedback.ready, "a set-point that is not followed");
        let zero = position.map_indexed(|_, _| 0.0);
        let (before, speed) = self.sent.unwrap_or((feedback.joint_position, zero));
        let period_s = params.period.as_secs_f64();
        let velocity = position.map_indexed(|joint, x| (x - before[joint]) / period_s);
        for (joint, limits) in params.limits.iter().enumerate() {
            let (x, v, w) = (position[joint], velocity[joint], speed[joint]);
            let lower = limits.lower.unwrap_or(f64::NEG_INFINITY).min(before[joint]);
            let upper = limits.upper.unwrap_or(f64::INFINITY).max(before[joint]);
            assert!(x >= lower - 2e-6 && x <= upper + 2e-6, "joint {joint} at {x}");
            assert!(v.abs() <= limits.velocity * 1.00001, "joint {joint}: velocity {v}");
            let a = (v - w) / period_s;
            let highest = limits.acceleration.expect("given") * 1.00001;
            assert!(a.abs() <= highest, "joint {joint}: acceleration {a} above {highest}");
        }
        self.check_stop(params, stop, &speed, &velocity);
        self.sent = Some((position, velocity));
    }

    /// A stopped robot stands after the time of the plain ramp and a tenth of a second.
    fn check_stop(
        &mut self,
        params: &Params,
        stop: Option<StopLevel>,
        before: &JointVector,
        velocity: &JointVector,
    ) {
        if stop.is_none() {
            self.stop_ticks = None;
            return;
        }
        let ramp = |velocity: &JointVector| {
            let joints = velocity.iter().zip(&params.limits);
            let times = joints.map(|(v, limits)| v.abs() / limits.acceleration.expect("given"));
            times.fold(0.0, f64::max) / params.period.as_secs_f64()
        };
        let allowance = (0.1 + self.common_s) / params.period.as_secs_f64();
        let left = self.stop_ticks.unwrap_or_else(|| ramp(before).ceil() + allowance);
        let left = (left - 1.0).max(0.0);
        assert!(ramp(velocity) <= left + 1e-6, "{} ticks to rest, {left} left", ramp(velocity));
        self.stop_ticks = Some(left);
    }

    fn check_event(&mut self, event: &LoopEvent) {
        match event {
            LoopEvent::Answer { ticket, .. } => {
                assert!(self.open.remove(ticket), "ticket {ticket} was answered once too often");
            }
            LoopEvent::Motion(report) => {
                let before = self.motions.insert(report.id, Some(report.status)).flatten();
                let known = before.is_none_or(|status| !status.is_terminal());
                assert!(known, "motion {} goes on after {before:?}", report.id);
            }
            _ => {}
        }
    }
}
