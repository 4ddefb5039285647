//! A tick of the control loop touches no heap, in any mode.
//!
//! A global allocator counts what this thread asks of it, and what it gives back: to free memory
//! may block as long as to get it.

#![expect(clippy::expect_used, reason = "a test fails by panicking")]
#![expect(unsafe_code, reason = "a global allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use armada_agent::control::{
    Equipment, EquipmentOrder, EquippedChain, FollowOrder, GroupWord, HomeOrder, Input,
    JogCartesianOrder, JogJointOrder, JogOrder, LoopAbilities, LoopRequest, LoopState, MAX_CHAINS,
    MAX_WORDS, Order, Output, Params, StreamSample, StreamValues, TwistTarget, step,
};
use armada_agent::drivers::{DriverRequest, Feedback, JointSet, LoadSetting};
use armada_agent::recorder::{Shelf, Tape};
use armada_model::{
    Chain, CompiledTrajectory, JointLimits, JointTrajectory, JointVector, MAX_JOINTS, MonoTime,
    MotionLimits, Pose, RobotModel, TrajectoryOptions, Twist, Waypoint,
};
use armada_protocol::messages::{
    CommandMode, HomeMethod, JogFrame, OperationalMode, Queue, StopLevel, StreamHeader,
};
use arrayvec::ArrayVec;
use uuid::Uuid;

#[path = "no_alloc/group.rs"]
mod group;

const JOINTS: usize = 7;
const PERIOD: Duration = Duration::from_millis(1);

struct Counting;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    // A thread that is ending has no counter any more, and runs no tick.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
}

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as the caller promises.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn all(value: f64) -> JointVector {
    JointVector::from_slice(&[value; JOINTS]).expect("finite")
}

fn params() -> Params {
    let joint = JointLimits {
        lower: Some(-2.9),
        upper: Some(2.9),
        velocity: 2.0,
        acceleration: Some(5.0),
        jerk: None,
        effort: None,
    };
    Params {
        start_tolerance: all(0.05),
        tracking_tolerance: all(0.05),
        tracking_lag: PERIOD,
        request_timeout: Duration::from_millis(200),
        enable_on_start: true,
        home: vec![Some(0.1); JOINTS],
        abilities: LoopAbilities { homing: true, ..LoopAbilities::default() },
        equipment: Arc::new(equipment()),
        ..Params::for_joints(vec![joint; JOINTS], PERIOD).expect("few joints")
    }
}

/// The chain of the seven-axis arm of the project.
fn equipment() -> Equipment {
    let text = include_str!("../../config/robots/seven_axis_arm.urdf");
    let model = RobotModel::from_urdf(text, "arm.urdf").expect("a robot description");
    let chain = EquippedChain {
        chain: Chain::new(&model, "base_link", "tool0").expect("a chain"),
        tcp: Pose::from_translation(0.0, 0.0, 0.1),
        base_in_world: Pose::default(),
        joints: (0..JOINTS).collect(),
        load: LoadSetting::default(),
    };
    Equipment { config_seqno: 1, chains: vec![chain] }
}

fn trajectory(from: f64, to: f64) -> Arc<CompiledTrajectory> {
    let names: Vec<String> = (0..JOINTS).map(|joint| format!("joint_{joint}")).collect();
    let row = |time_from_start_s, value| Waypoint {
        time_from_start_s,
        joint_position: vec![value; JOINTS],
        ..Waypoint::default()
    };
    let waypoints = (0..=20).map(|k| {
        let share = f64::from(k) / 20.0;
        row(share, from + (to - from) * share * share * (3.0 - 2.0 * share))
    });
    let wanted = JointTrajectory {
        joint_names: names.clone(),
        waypoints: waypoints.collect(),
        ..JointTrajectory::default()
    };
    let limits = MotionLimits::new(&params().limits).expect("complete");
    let options = TrajectoryOptions::default();
    let compiled = CompiledTrajectory::compile(&wanted, &names, &limits, &options);
    Arc::new(compiled.expect("legal"))
}

/// A loop whose robot is always where it was told to be a tick ago.
struct Rig {
    params: Params,
    state: LoopState,
    now: MonoTime,
    feedback: Option<Feedback>,
    stop: Option<StopLevel>,
    /// Samples of the next tick.
    stream: ArrayVec<StreamSample, 8>,
    /// Words of partners of the next tick.
    words: ArrayVec<GroupWord, MAX_WORDS>,
    /// What writes the ticks down, and what takes it off its hands.
    tape: Option<(Tape, Shelf)>,
    calls: u64,
    ticks: u64,
}

impl Rig {
    fn new() -> Self {
        let params = params();
        let state = LoopState::new(&params).expect("sensible");
        let now = MonoTime::from_nanos(1);
        let feedback = Feedback {
            joint_velocity: all(0.0),
            operational_mode: OperationalMode::Cobot,
            ..Feedback::of(now, all(0.0))
        };
        Self {
            params,
            state,
            now,
            feedback: Some(feedback),
            stop: None,
            stream: ArrayVec::new(),
            words: ArrayVec::new(),
            tape: None,
            calls: 0,
            ticks: 0,
        }
    }

    /// One tick, which becomes the only owner of what `orders` hold.
    fn tick<const N: usize>(&mut self, orders: [Order; N]) -> Output {
        self.now = self.now + PERIOD;
        if let Some(feedback) = &mut self.feedback {
            feedback.stamp = self.now;
        }
        let requests = (0u64..).zip(orders);
        let mut input = Input {
            now: self.now,
            feedback: self.feedback,
            stop: self.stop,
            loop_error: false,
            requests: requests
                .map(|(ticket, order)| LoopRequest::new(ticket, order))
                .collect::<ArrayVec<_, 8>>(),
            stream: self.stream.take(),
            group: self.words.take(),
        };
        let before = CALLS.get();
        if let Some((tape, _)) = &mut self.tape {
            tape.before(&self.state, &input);
        }
        let output = black_box(step(&self.params, &mut self.state, black_box(&mut input)));
        if let Some((tape, _)) = &mut self.tape {
            tape.after(&input, &output);
        }
        self.calls += CALLS.get() - before;
        if let Some((_, shelf)) = &mut self.tape {
            shelf.tidy();
        }
        self.ticks += 1;
        self.obey(&output);
        output
    }

    fn obey(&mut self, output: &Output) {
        let Some(feedback) = &mut self.feedback else {
            return;
        };
        if let Some(command) = output.command {
            feedback.joint_velocity = command.joint_position.map_indexed(|joint, x| {
                (x - feedback.joint_position[joint]) / PERIOD.as_secs_f64()
            });
            feedback.joint_position = command.joint_position;
        } else {
            feedback.joint_velocity = all(0.0);
        }
        match output.driver_request {
            Some(DriverRequest::Enable) => (feedback.enabled, feedback.ready) = (true, true),
            Some(DriverRequest::Disable) => (feedback.enabled, feedback.ready) = (false, false),
            Some(DriverRequest::ResetErrors) => feedback.error_code = 0,
            Some(DriverRequest::Home(joints)) => {
                (feedback.homing, feedback.homed) = (joints, JointSet::NONE);
            }
            Some(DriverRequest::StopMotion) => feedback.homing = JointSet::NONE,
            // Not among the abilities of this controller.
            Some(_) | None => {}
        }
    }

    fn ticks(&mut self, count: usize) -> Output {
        for _ in 1..count {
            self.tick([]);
        }
        self.tick([])
    }

    #[track_caller]
    fn expect_mode(&mut self, mode: CommandMode) {
        let output = self.tick([]);
        assert_eq!(output.snapshot.command_mode, mode);
        assert_eq!(self.calls, 0, "calls of the allocator after {} ticks", self.ticks);
    }

    fn held(&self) -> f64 {
        self.feedback.as_ref().expect("heard").joint_position[0]
    }
}

fn jog(id: u128, goal: f64) -> Order {
    let (joint_position, max_velocity) = (all(goal), all(1.5));
    Order::Jog(JogOrder { id: Uuid::from_u128(id), joint_position, max_velocity })
}

fn jog_joint(id: u128, speed: f64) -> Order {
    Order::JogJoint(JogJointOrder {
        id: Uuid::from_u128(id),
        joint_velocity: all(speed),
        timeout: Duration::from_millis(300),
        renews: false,
    })
}

fn jog_tool(id: u128, speed: f64, frame: JogFrame) -> Order {
    let linear = nalgebra::Vector3::new(speed, 0.5 * speed, -speed);
    let mut twists = [None; MAX_CHAINS];
    twists[0] = Some(TwistTarget { chain: 0, twist: Twist::new(linear, linear), frame });
    let (id, timeout) = (Uuid::from_u128(id), Duration::from_millis(500));
    Order::JogCartesian(JogCartesianOrder { id, twists, timeout, renews: false })
}

fn home(id: u128, method: HomeMethod) -> Order {
    let mut groups = [JointSet::NONE; MAX_JOINTS];
    (groups[0], groups[1]) = (JointSet::first(3), JointSet::NONE.with(5));
    Order::Home(HomeOrder { id: Uuid::from_u128(id), groups, method })
}

fn follow(id: u128, trajectory: &Arc<CompiledTrajectory>, start: Option<MonoTime>) -> Order {
    let (id, trajectory) = (Uuid::from_u128(id), Arc::clone(trajectory));
    Order::Follow(FollowOrder { start, ..FollowOrder::at_once(id, trajectory) })
}

fn set_mode(mode: CommandMode) -> Order {
    Order::SetMode(mode)
}

#[test]
fn the_counter_counts() {
    let before = CALLS.get();
    drop(black_box(Box::new(1)));
    assert_eq!(CALLS.get() - before, 2, "one for the box, one for its end");
}

#[test]
fn start_up_and_halt_allocate_nothing() {
    let mut rig = Rig::new();
    let feedback = rig.feedback.take();
    rig.ticks(10);
    rig.feedback = feedback;
    rig.ticks(10);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn jogs_their_change_of_goal_and_their_cancel_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog(1, 1.0)]);
    rig.ticks(300);
    rig.tick([jog(2, -1.0), jog(3, 9.0), jog(4, 0.5)]);
    rig.ticks(100);
    let moving = rig.tick([Order::Cancel(Uuid::from_u128(4))]);
    assert!(moving.command.is_some_and(|command| command.joint_velocity[0] != 0.0));
    rig.ticks(2000);
    rig.expect_mode(CommandMode::Jog);
}

#[test]
fn jogs_at_a_speed_into_limits_and_singularities_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog_joint(1, 1.0)]);
    for _ in 0..20 {
        rig.tick([jog_joint(1, 1.5), jog_joint(2, 9.0)]);
        rig.ticks(200);
    }
    rig.tick([jog(3, 0.5)]);
    rig.ticks(3000);
    // At 0.5 each and at 0, where the arm is stretched.
    for (id, frame) in [(4, JogFrame::Base), (5, JogFrame::Tool), (6, JogFrame::World)] {
        for speed in [0.1, 2.0, -2.0] {
            rig.tick([jog_tool(id, speed, frame)]);
            rig.ticks(400);
        }
    }
    rig.tick([jog(7, 0.0)]);
    rig.ticks(5000);
    rig.tick([jog_tool(8, 0.5, JogFrame::Base)]);
    rig.ticks(2000);
    rig.expect_mode(CommandMode::Jog);
}

#[test]
fn homing_both_ways_and_its_ends_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Homing), home(1, HomeMethod::Controller)]);
    rig.ticks(100);
    for _ in 0..2 {
        let feedback = rig.feedback.as_mut().expect("heard");
        (feedback.homed, feedback.homing) = (JointSet::first(JOINTS), JointSet::NONE);
        rig.ticks(100);
    }
    rig.tick([home(2, HomeMethod::MoveToHome)]);
    rig.ticks(2000);
    rig.tick([home(3, HomeMethod::Controller)]);
    rig.ticks(10);
    rig.tick([Order::Cancel(Uuid::from_u128(3))]);
    rig.ticks(500);
    rig.tick([home(4, HomeMethod::Controller)]);
    rig.ticks(10);
    rig.tick([Order::Halt]);
    rig.ticks(500);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn trajectories_allocate_nothing_and_are_not_freed_in_the_loop() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Trajectory)]);
    let orders = [
        follow(1, &trajectory(0.01, 0.5), None),
        follow(2, &trajectory(0.0, 0.5), None),
        follow(3, &trajectory(0.3, 0.5), None),
    ];
    let mut retired = Vec::new();
    retired.extend(rig.tick(orders).retired);
    for _ in 0..2000 {
        retired.extend(rig.tick([]).retired);
    }
    assert_eq!(retired.len(), 3);
    assert_eq!(rig.held(), 0.5);
    let armed = follow(4, &trajectory(0.5, 0.0), Some(rig.now + PERIOD * 100));
    rig.tick([armed]);
    rig.ticks(600);
    // Given back when the robot has come to rest on it.
    let mut given_back = rig.tick([Order::Halt]).retired.len();
    for _ in 0..1000 {
        given_back += rig.tick([]).retired.len();
    }
    assert_eq!(given_back, 1);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn pauses_speeds_queues_blends_and_replacements_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Trajectory)]);
    let queued = |id, from, to, queue| match follow(id, &trajectory(from, to), None) {
        Order::Follow(order) => Order::Follow(FollowOrder { queue, ..order }),
        other => other,
    };
    let motion = Uuid::from_u128(1);
    let mut retired = Vec::new();
    retired.extend(rig.tick([queued(1, 0.0, 0.4, Queue::Append)]).retired);
    retired.extend(rig.tick([queued(2, 0.4, 0.8, Queue::AppendBlended)]).retired);
    retired.extend(rig.tick([queued(3, 0.8, 0.4, Queue::Append)]).retired);
    for orders in [
        [Order::Pause(motion), Order::SetSpeedRatio(0.5)],
        [Order::Resume(motion), Order::SetSpeedRatio(1.0)],
    ] {
        rig.ticks(200);
        retired.extend(rig.tick(orders).retired);
    }
    for _ in 0..1200 {
        retired.extend(rig.tick([]).retired);
    }
    let here = rig.held();
    retired.extend(rig.tick([queued(4, here, here + 0.3, Queue::Replace)]).retired);
    rig.ticks(300);
    retired.extend(rig.tick([Order::Cancel(Uuid::from_u128(4))]).retired);
    for _ in 0..1200 {
        retired.extend(rig.tick([]).retired);
    }
    assert_eq!(retired.len(), 4);
    rig.expect_mode(CommandMode::Trajectory);
}

#[test]
fn stops_of_every_level_and_their_clearing_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    for level in [StopLevel::L2, StopLevel::L1, StopLevel::L0] {
        rig.tick([Order::Enable]);
        rig.ticks(10);
        rig.tick([set_mode(CommandMode::Trajectory)]);
        let from = rig.held();
        rig.tick([follow(1, &trajectory(from, from + 0.4), None)]);
        rig.ticks(500);
        rig.stop = Some(level);
        rig.ticks(1000);
        rig.stop = None;
        rig.ticks(10);
    }
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn faults_resets_and_disabling_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog(1, 1.0)]);
    rig.ticks(200);
    rig.feedback.as_mut().expect("heard").error_code = 3;
    rig.ticks(300);
    rig.expect_mode(CommandMode::InvalidState);
    rig.tick([Order::ResetErrors]);
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog(2, 1.0)]);
    rig.ticks(200);
    let feedback = rig.feedback.take();
    rig.ticks(200);
    rig.feedback = feedback;
    rig.tick([Order::ResetErrors, Order::Halt]);
    rig.tick([Order::Disable]);
    rig.ticks(200);
    rig.expect_mode(CommandMode::Halt);
}

/// Streams to a new lease in `mode`, with wrong samples and gaps among the good ones.
fn stream(rig: &mut Rig, lease: Uuid, mode: CommandMode, values: impl Fn(f64) -> StreamValues) {
    rig.tick([Order::AcquireLease { lease, ttl: Duration::from_secs(60) }]);
    // Orders of this rig name no lease, so the mode comes first where one is held.
    let mut snapshot = rig.ticks(500).snapshot;
    assert_eq!(snapshot.command_mode, mode);
    for seq in 1..1000u64 {
        let (epoch, state_seqno) = (snapshot.epoch, snapshot.seqno);
        let header = StreamHeader { lease, epoch, seq, state_seqno };
        let values = values((seq as f64 * 0.01).sin());
        let wrong = StreamHeader { epoch: 0, ..header };
        if seq % 100 > 60 {
            rig.stream.push(StreamSample { header: wrong, values });
        } else if seq % 3 == 0 {
            rig.stream.push(StreamSample { header, values });
            rig.stream.push(StreamSample { header, values });
        }
        snapshot = rig.tick([]).snapshot;
    }
    assert!(snapshot.stream.is_some_and(|stream| stream.taken > 100));
    assert!(snapshot.dropped_samples.sequence > 100 && snapshot.dropped_samples.epoch > 100);
}

#[test]
fn streams_of_positions_and_speeds_allocate_nothing() {
    let joints = JointSet::first(JOINTS);
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::PositionCommand)]);
    let position = |at: f64| StreamValues::Position {
        joints,
        position: all(4.0 * at),
        velocity: JointVector::EMPTY,
    };
    stream(&mut rig, Uuid::from_u128(1), CommandMode::PositionCommand, position);
    rig.tick([Order::ReleaseLease(Uuid::from_u128(1)), Order::Halt]);
    rig.ticks(1000);
    rig.tick([set_mode(CommandMode::VelocityCommand)]);
    let velocity = |at: f64| StreamValues::Velocity { joints, velocity: all(3.0 * at) };
    stream(&mut rig, Uuid::from_u128(2), CommandMode::VelocityCommand, velocity);
    rig.tick([Order::ReleaseLease(Uuid::from_u128(2)), Order::Halt]);
    rig.ticks(1000);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn the_recorder_allocates_nothing_and_frees_nothing_whatever_it_takes_down() {
    let mut rig = Rig::new();
    rig.tape = Some(Tape::new(&rig.state, PERIOD.as_secs_f64(), 4.0));
    rig.ticks(5);
    for round in 0..8 {
        rig.tick([set_mode(CommandMode::Trajectory)]);
        let path = trajectory(0.0, 0.2);
        rig.tick([follow(100 + 3 * round, &path, None)]);
        drop(path);
        rig.ticks(700);
        rig.tick([Order::Halt]);
        rig.ticks(300);
        rig.tick([set_mode(CommandMode::Jog)]);
        rig.tick([jog(101 + 3 * round, 0.0)]);
        rig.ticks(900);
        if let Some((tape, _)) = &mut rig.tape {
            tape.save();
        }
        rig.tick([Order::Halt]);
        rig.ticks(300);
    }
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn other_tools_and_values_allocate_nothing_and_are_not_freed_in_the_loop() {
    let mut rig = Rig::new();
    rig.ticks(500);
    for config_seqno in 2..6 {
        let mut equipment = equipment();
        equipment.config_seqno = config_seqno;
        let order = EquipmentOrder {
            equipment: Arc::new(equipment),
            load: Some((0, LoadSetting::default())),
            replaces: config_seqno - 1,
        };
        let output = rig.tick([Order::SetEquipment(order)]);
        assert_eq!(output.retired.len(), 1, "the old tools come back");
        assert_eq!(output.snapshot.config_seqno, config_seqno);
        rig.ticks(10);
    }
    rig.expect_mode(CommandMode::Halt);
}
