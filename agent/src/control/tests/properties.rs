//! Random interleavings of orders, faults, stops and gaps. The rig judges every tick; here it is
//! only decided what happens.

use std::sync::Arc;
use std::time::Duration;

use armada_model::CompiledTrajectory;
use armada_protocol::messages::{CommandMode, Queue, StopLevel};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use uuid::Uuid;

use super::rig::{JOINTS, PERIOD, Rig, follow_with, jog, joints, params, queued, trajectory};
use crate::control::{MAX_EVENTS, Order, Params};

/// Something that happens to the loop.
#[derive(Clone, Debug)]
enum Act {
    Ticks(usize),
    Late(u32),
    SetMode(CommandMode),
    Halt,
    Enable,
    Disable,
    Reset,
    Jog([f64; JOINTS]),
    Follow { start: Option<i64>, epoch: bool },
    Queue { how: Queue, aside: f64 },
    Pause { back: u128, paused: bool },
    Ratio(f64),
    Cancel { back: u128 },
    Stop(Option<StopLevel>),
    Silent(bool),
    Blocked(bool),
    Error(u32),
    EmergencyStop(bool),
    Drives { enabled: bool, ready: bool },
    Obeys(Option<u32>),
    LoopError(bool),
    Push(f64),
    MeasuresVelocity(bool),
    Recover,
}

fn act() -> impl Strategy<Value = Act> {
    let modes = prop_oneof![
        4 => Just(CommandMode::Jog),
        4 => Just(CommandMode::Trajectory),
        1 => Just(CommandMode::Halt),
        1 => Just(CommandMode::Homing),
    ];
    let goal = prop::array::uniform3(-2.2..2.2f64);
    let levels = prop_oneof![
        1 => Just(Some(StopLevel::L2)),
        1 => Just(Some(StopLevel::L1)),
        1 => Just(Some(StopLevel::L0)),
        3 => Just(None),
    ];
    prop_oneof![
        12 => (1..60usize).prop_map(Act::Ticks),
        2 => (2..9u32).prop_map(Act::Late),
        8 => modes.prop_map(Act::SetMode),
        2 => Just(Act::Halt),
        3 => Just(Act::Enable),
        2 => Just(Act::Disable),
        4 => Just(Act::Reset),
        8 => goal.prop_map(Act::Jog),
        8 => (prop::option::of(-3..80i64), any::<bool>())
            .prop_map(|(start, epoch)| Act::Follow { start, epoch }),
        6 => (queue(), -0.04..0.04f64).prop_map(|(how, aside)| Act::Queue { how, aside }),
        4 => (0..3u128, any::<bool>())
            .prop_map(|(back, paused)| Act::Pause { back, paused }),
        3 => prop_oneof![Just(1.0), Just(0.01), 0.01..1.0f64].prop_map(Act::Ratio),
        3 => (0..3u128).prop_map(|back| Act::Cancel { back }),
        4 => levels.prop_map(Act::Stop),
        1 => any::<bool>().prop_map(Act::Silent),
        1 => any::<bool>().prop_map(Act::Blocked),
        1 => (0..2u32).prop_map(Act::Error),
        1 => any::<bool>().prop_map(Act::EmergencyStop),
        1 => (any::<bool>(), any::<bool>())
            .prop_map(|(enabled, ready)| Act::Drives { enabled, ready }),
        1 => prop::option::of(1..80u32).prop_map(Act::Obeys),
        1 => any::<bool>().prop_map(Act::LoopError),
        1 => (-0.3..0.3f64).prop_map(Act::Push),
        1 => any::<bool>().prop_map(Act::MeasuresVelocity),
        6 => Just(Act::Recover),
    ]
}

fn queue() -> impl Strategy<Value = Queue> {
    prop_oneof![
        Just(Queue::Refuse),
        Just(Queue::Append),
        Just(Queue::AppendBlended),
        Just(Queue::Replace),
    ]
}

struct Story {
    rig: Rig,
    /// Where the trajectory ordered last ends.
    tail: Option<armada_model::JointVector>,
    motions: u128,
    follows: usize,
}

impl Story {
    fn new() -> Self {
        // A tolerance at which the plant follows, also after late wakes, but a block is seen.
        let params = Params { tracking_tolerance: joints([1e-3; JOINTS]), ..params() };
        Self { rig: Rig::with(params), tail: None, motions: 0, follows: 0 }
    }

    fn play(&mut self, act: &Act) {
        let rig = &mut self.rig;
        match *act {
            Act::Ticks(count) => rig.ticks(count),
            Act::Late(periods) => drop(rig.late_tick(periods)),
            Act::SetMode(mode) => drop(rig.order(Order::SetMode(mode))),
            Act::Halt => drop(rig.order(Order::Halt)),
            Act::Enable => drop(rig.order(Order::Enable)),
            Act::Disable => drop(rig.order(Order::Disable)),
            Act::Reset => drop(rig.order(Order::ResetErrors)),
            Act::Jog(goal) => {
                self.motions += 1;
                rig.order(jog(self.motions, goal));
            }
            Act::Follow { start, epoch } => self.follow(start, epoch),
            Act::Queue { how, aside } => self.queue(how, aside),
            Act::Pause { back, paused } => {
                let id = Uuid::from_u128(self.motions.saturating_sub(back));
                rig.order(if paused { Order::Pause(id) } else { Order::Resume(id) });
            }
            Act::Ratio(ratio) => drop(rig.order(Order::SetSpeedRatio(ratio))),
            Act::Cancel { back } => {
                rig.order(Order::Cancel(Uuid::from_u128(self.motions.saturating_sub(back))));
            }
            Act::Stop(level) => rig.stop = level,
            Act::Silent(silent) => rig.plant.silent = silent,
            Act::Blocked(blocked) => rig.plant.blocked = blocked,
            Act::Error(code) => rig.plant.error_code = code,
            Act::EmergencyStop(pressed) => rig.plant.emergency_stop = pressed,
            Act::Drives { enabled, ready } => {
                (rig.plant.enabled, rig.plant.ready) = (enabled, ready);
            }
            Act::Obeys(after) => rig.plant.obeys_after = after,
            Act::LoopError(error) => rig.loop_error = error,
            Act::Push(distance) => {
                rig.plant.position = rig.plant.position.map_indexed(|_, x| x + distance);
            }
            Act::MeasuresVelocity(measures) => rig.plant.reports_velocity = measures,
            Act::Recover => self.recover(),
        }
    }

    /// A trajectory that begins where the robot is held, or would be.
    fn follow(&mut self, start: Option<i64>, epoch: bool) {
        self.motions += 1;
        self.follows += 1;
        let rig = &mut self.rig;
        let start = start.map(|ticks| rig.now.shifted(ticks * PERIOD.as_nanos() as i64));
        let epoch = rig.last.as_ref().filter(|_| epoch).map(|output| output.snapshot.epoch);
        let held = rig.commands.last().map_or(rig.plant.position, |sent| sent.joint_position);
        let path = path_from(held.map_indexed(|_, x| x + 0.003));
        let path = path.unwrap_or_else(|| trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]));
        self.tail = Some(path.end());
        rig.order(follow_with(self.motions, &path, start, epoch));
    }

    /// A trajectory behind the last one, or in its place.
    fn queue(&mut self, how: Queue, aside: f64) {
        let rig = &mut self.rig;
        let held = rig.commands.last().map_or(rig.plant.position, |sent| sent.joint_position);
        let from = self.tail.filter(|_| how != Queue::Replace).unwrap_or(held);
        if let Some(path) = path_from(from.map_indexed(|_, x| x + aside)) {
            self.motions += 1;
            self.follows += 1;
            self.tail = Some(path.end());
            rig.order(queued(self.motions, &path, how));
        }
    }

    fn recover(&mut self) {
        let rig = &mut self.rig;
        rig.plant.recover();
        (rig.stop, rig.loop_error) = (None, false);
        rig.tick();
        for order in [Order::ResetErrors, Order::Enable, Order::SetSpeedRatio(1.0)] {
            rig.order(order);
            rig.ticks(80);
        }
        rig.order(Order::SetMode(CommandMode::Trajectory));
        rig.tick();
    }
}

fn path_from(start: armada_model::JointVector) -> Option<Arc<CompiledTrajectory>> {
    let row: [f64; JOINTS] = (*start).try_into().ok()?;
    let [a, b, c] = row;
    let inside = a.abs() < 1.9 && b.abs() < 0.9;
    inside.then(|| {
        let (a2, b2) = (a - a.signum() * 0.2, b - b.signum() * 0.1);
        trajectory(&[(0.0, row), (0.7, [a2, b2, c + 0.3]), (1.3, [a2, b2, c])])
    })
}

fn config() -> ProptestConfig {
    ProptestConfig {
        rng_seed: RngSeed::Fixed(20),
        failure_persistence: None,
        max_shrink_time: Duration::from_secs(30).as_millis() as u32,
        ..ProptestConfig::with_cases(600)
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn every_request_is_answered_once_and_every_motion_ends_once(
        acts in prop::collection::vec(act(), 1..60),
    ) {
        let mut story = Story::new();
        for act in &acts {
            story.play(act);
        }
        story.rig.finish();
        prop_assert_eq!(story.rig.retired.len(), story.follows, "trajectories given back");
        prop_assert!(story.rig.most_events() <= MAX_EVENTS);
        let limited = story.rig.last.as_ref().map(|output| output.snapshot.limited_setpoints);
        prop_assert_eq!(limited, Some(0), "the limiter had nothing to do");
    }

    #[test]
    fn after_any_story_the_robot_can_be_recovered_and_moved(
        acts in prop::collection::vec(act(), 1..40),
    ) {
        let mut story = Story::new();
        for act in &acts {
            story.play(act);
        }
        story.rig.finish();
        story.rig.stop = None;
        story.rig.tick();
        story.recover();
        let rig = &mut story.rig;
        rig.ask(Order::Halt).expect("no fault is left");
        rig.until("standstill", |rig| rig.command_rests());
        rig.ticks(300);
        rig.ask(Order::SetMode(CommandMode::Jog)).expect("a robot that is ready");
        let id = story.motions + 1;
        rig.jog(id, [0.1, 0.2, 0.3]).expect("granted");
        rig.until("the end", |rig| rig.ended(id).is_some());
        let sent = rig.commands.last().expect("sent").joint_position;
        prop_assert_eq!(sent, joints([0.1, 0.2, 0.3]));
    }
}

#[test]
fn the_worst_tick_has_room_for_its_events() {
    // All that can be said at once: faults with a motion in progress, a stop, waiting answers,
    // and eight requests that each have the most to say.
    let mut most = 0;
    for loop_error in [false, true] {
        for fault in [false, true] {
            for stop in [None, Some(StopLevel::L2), Some(StopLevel::L0)] {
                for orders in 0..3 {
                    most = most.max(worst_tick(loop_error, fault, stop, orders));
                }
            }
        }
    }
    assert!(most >= 17, "the test looks for large numbers, not {most}");
    assert!(most <= MAX_EVENTS);
}

fn worst_tick(loop_error: bool, fault: bool, stop: Option<StopLevel>, orders: u8) -> usize {
    let mut rig = Rig::in_mode(CommandMode::Jog);
    rig.order(jog(100, [1.0, 0.0, 0.0]));
    rig.ticks(100);
    rig.loop_error = loop_error;
    if fault {
        (rig.plant.error_code, rig.plant.emergency_stop, rig.plant.ready) = (1, true, false);
    }
    rig.stop = stop;
    for id in 1..=8 {
        let changing = [Order::Halt, Order::SetMode(CommandMode::Jog), jog(id, [0.5, 0.0, 0.0])];
        rig.order(match orders {
            0 => jog(id, [0.1, 0.0, 0.0]),
            1 => changing[id as usize % 3].clone(),
            _ => Order::ResetErrors,
        });
    }
    rig.tick();
    rig.most_events()
}
