use std::sync::Arc;
use std::time::Duration;

use armada_model::{
    CompiledTrajectory, JointLimits, JointTrajectory, JointVector, MonoTime, MotionLimits,
    TrajectoryOptions, Waypoint,
};
use armada_protocol::messages::{CommandMode, Coupling, OperationalMode};
use arrayvec::ArrayVec;
use uuid::Uuid;

use super::*;
use crate::control::{
    FollowOrder, GroupOrder, GroupSay, GroupWord, Input, JogOrder, LoopRequest, LoopState,
    MAX_SAID, MAX_WORDS, Order, Params, Say, Word, step,
};
use crate::drivers::Feedback;

const PERIOD: Duration = Duration::from_millis(4);

fn params() -> Params {
    let joint = JointLimits {
        lower: Some(-2.0),
        upper: Some(2.0),
        velocity: 1.0,
        acceleration: Some(4.0),
        jerk: None,
        effort: None,
    };
    Params::for_joints(vec![joint; 2], PERIOD).expect("two joints")
}

fn joints(value: f64) -> JointVector {
    JointVector::from_slice(&[value, -value]).expect("finite")
}

/// Half a radian in two seconds.
fn trajectory() -> Arc<CompiledTrajectory> {
    let names = ["a", "b"];
    let waypoint = |time_from_start_s, value: f64| Waypoint {
        time_from_start_s,
        joint_position: vec![value, -value],
        ..Waypoint::default()
    };
    let wanted = JointTrajectory {
        joint_names: names.map(str::to_owned).to_vec(),
        waypoints: vec![waypoint(0.0, 0.0), waypoint(2.0, 0.5)],
        ..JointTrajectory::default()
    };
    let limits = MotionLimits::new(&params().limits).expect("complete");
    let options = TrajectoryOptions::default();
    let compiled = CompiledTrajectory::compile(&wanted, &names, &limits, &options);
    Arc::new(compiled.expect("legal"))
}

/// A loop whose robot is where it was told to be, on tape.
struct Recorded {
    params: Params,
    state: LoopState,
    tape: Tape,
    shelf: Shelf,
    now: MonoTime,
    position: JointVector,
    tick: u64,
}

impl Recorded {
    fn new(seconds: f64) -> Self {
        let params = params();
        let state = LoopState::new(&params).expect("sensible");
        let (tape, shelf) = Tape::new(&state, PERIOD.as_secs_f64(), seconds);
        let (now, position) = (MonoTime::from_nanos(1), joints(0.0));
        Self { params, state, tape, shelf, now, position, tick: 0 }
    }

    fn tick(&mut self, orders: impl IntoIterator<Item = Order>) {
        self.tick_with(orders, ArrayVec::new());
    }

    /// A tick in which partners say something; returns what is said to them.
    fn tick_with(
        &mut self,
        orders: impl IntoIterator<Item = Order>,
        words: ArrayVec<GroupWord, MAX_WORDS>,
    ) -> ArrayVec<GroupSay, MAX_SAID> {
        self.now = self.now + PERIOD;
        self.tick += 1;
        let mut input = Input {
            feedback: Some(Feedback {
                enabled: true,
                ready: true,
                operational_mode: OperationalMode::Cobot,
                ..Feedback::of(self.now, self.position)
            }),
            requests: orders.into_iter().map(|o| LoopRequest::new(self.tick, o)).collect(),
            group: words,
            ..Input::at(self.now)
        };
        self.tape.before(&self.state, &input);
        let output = step(&self.params, &mut self.state, &mut input);
        self.tape.after(&input, &output);
        if let Some(command) = output.command {
            self.position = command.joint_position;
        }
        output.group
    }

    /// Ticks with another goal every 100 ticks, the shelf tidied every 50.
    fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            let goal = joints((self.tick as f64 * 0.7).sin());
            let order = match self.tick {
                20 => Some(Order::SetMode(CommandMode::Jog)),
                tick if tick > 20 && tick % 100 == 0 => Some(Order::Jog(JogOrder {
                    id: Uuid::from_u128(u128::from(tick)),
                    joint_position: goal,
                    max_velocity: JointVector::from_slice(&[0.9, 0.9]).expect("finite"),
                })),
                _ => None,
            };
            self.tick(order);
            if self.tick.is_multiple_of(50) {
                assert!(!self.shelf.tidy(), "nobody asked to save");
            }
        }
    }

    fn save(&mut self) -> Recording {
        self.tape.save();
        self.tick([]);
        assert!(self.shelf.tidy(), "a save was asked for");
        let segments = self.shelf.segments().cloned().collect();
        let robot = "left_arm".parse().expect("a name");
        Recording::new(robot, "asked for".to_owned(), self.params.clone(), segments)
    }
}

fn read_again(recording: &Recording) -> Recording {
    let mut bytes = Vec::new();
    recording.write(&mut bytes).expect("writes");
    Recording::read(bytes.as_slice()).expect("reads")
}

#[test]
fn a_recording_replays_without_a_difference_after_it_was_a_file() {
    let mut recorded = Recorded::new(10.0);
    recorded.run(1700);
    let recording = read_again(&recorded.save());
    let result = replay(&recording);
    assert_eq!(result.ticks, 1701);
    assert!(result.first_difference.is_none(), "{}", result.first_difference.expect("some"));
}

#[test]
fn a_motion_with_a_partner_replays_without_a_difference() {
    let mut recorded = Recorded::new(10.0);
    recorded.tick([]);
    recorded.tick([Order::SetMode(CommandMode::Trajectory)]);
    let (start, id) = (recorded.now + PERIOD * 60, Uuid::from_u128(1));
    let group = GroupOrder {
        coupling: Coupling::TimeSynced,
        partners: 1,
        loss: PERIOD * 30,
        max_divergence_s: 0.05,
        rate_slope_s: 2.0,
    };
    let order = FollowOrder {
        start: Some(start),
        group: Some(group),
        ..FollowOrder::at_once(id, trajectory())
    };
    let mut said = recorded.tick_with([Order::Follow(order)], ArrayVec::new());
    let mut heartbeats = 0;
    for tick in 0..1500 {
        let words = said.iter().map(|said| GroupWord {
            group: said.group,
            partner: 0,
            at: recorded.now,
            word: match said.say {
                Say::Go => Word::Go,
                Say::Heartbeat(beat) => Word::Heartbeat(beat),
                Say::Abort { from_phase_s, .. } => Word::Abort { from_phase_s },
            },
        });
        heartbeats += words.len();
        let order = match tick {
            200 => Some(Order::Pause(id)),
            700 => Some(Order::Resume(id)),
            _ => None,
        };
        said = recorded.tick_with(order, words.collect());
    }
    assert!(heartbeats > 100, "{heartbeats}");
    let recording = read_again(&recorded.save());
    let words: usize = recording.segments.iter().map(|segment| segment.words.len()).sum();
    assert_eq!(words, heartbeats);
    let result = replay(&recording);
    assert!(result.first_difference.is_none(), "{}", result.first_difference.expect("some"));
}

#[test]
fn at_least_the_seconds_asked_for_are_kept_and_not_much_more() {
    let mut recorded = Recorded::new(10.0);
    recorded.run(20_000);
    let recording = recorded.save();
    let seconds = recording.ticks() as f64 * PERIOD.as_secs_f64();
    assert!((10.0..14.1).contains(&seconds), "{seconds} s");
    assert!(replay(&recording).first_difference.is_none());
}

#[test]
fn segments_follow_each_other_without_a_gap() {
    let mut recorded = Recorded::new(6.0);
    recorded.run(4000);
    let recording = recorded.save();
    let stamps: Vec<_> =
        recording.segments.iter().flat_map(|segment| &segment.ticks).map(|tick| tick.now).collect();
    assert!(stamps.windows(2).all(|pair| pair[1] == pair[0] + PERIOD));
}

#[test]
fn the_first_tick_that_differs_is_found() {
    let mut recorded = Recorded::new(10.0);
    recorded.run(1500);
    let mut recording = recorded.save();
    let tick = &mut recording.segments[1].ticks[77];
    let command = tick.said.command.as_mut().expect("the robot follows");
    command.joint_position[1] = f64::from_bits(command.joint_position[1].to_bits() ^ 1);
    let found = replay(&recording).first_difference.expect("one bit differs");
    assert_eq!(found.tick, recording.segments[0].ticks.len() + 77);
    assert!(found.to_string().contains("joint 1 was sent to"), "{found}");
}

#[test]
fn a_feedback_that_is_changed_shows_as_a_difference() {
    let mut recorded = Recorded::new(10.0);
    recorded.run(900);
    let mut recording = recorded.save();
    let tick = &mut recording.segments[0].ticks[300];
    tick.feedback.as_mut().expect("heard").ready = false;
    let found = replay(&recording).first_difference.expect("not ready in mode jog is a fault");
    assert_eq!(found.tick, 300);
    assert!(found.to_string().contains("mode was Jog, is InvalidState"), "{found}");
}

#[test]
fn a_tape_without_empty_segments_goes_on_without_recording() {
    let mut recorded = Recorded::new(2.0);
    for _ in 0..20_000 {
        recorded.tick([]); // nobody tidies
    }
    while recorded.shelf.tidy() {}
    recorded.run(3000);
    assert!(replay(&recorded.save()).first_difference.is_none());
}

#[test]
fn other_files_are_refused() {
    assert!(matches!(Recording::read(&b"not a recording"[..]), Err(RecordingError::Read(_))));
}
