//! Ten thousand random sequences of commands, faults and stops through the loop and the emulated
//! controller: no set-point is ever outside the limits.

use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, JointTrajectory, MotionLimits, TrajectoryOptions, Waypoint,
};
use armada_protocol::messages::{
    CommandMode, HomeMethod, Queue, StopLevel, StreamHeader,
};
use uuid::Uuid;

use super::*;
use crate::control::{
    FollowOrder, HomeOrder, Input, JogJointOrder, JogOrder, LoopRequest, LoopState, Order, Params,
    Snapshot, StreamSample, StreamValues, step,
};
use crate::drivers::JointSet;

const SEQUENCES: u32 = 10_000;
/// Room for the tolerance that trajectories are accepted with, and for rounding.
const ROOM: f64 = 1.0 + 1e-5;

/// A loop with the emulated controller behind it.
struct Cell {
    pair: Pair,
    params: Params,
    state: LoopState,
    stop: Option<StopLevel>,
    dice: Noise,
    ids: u128,
    lease: Option<Uuid>,
    samples: u64,
    snapshot: Option<Snapshot>,
    /// The set-points of the last two ticks, as long as the stream lives.
    sent: Vec<JointVector>,
    commands: u64,
    moved: u64,
}

impl Cell {
    fn new() -> Self {
        let limits = setup(1).joints.iter().map(|joint| joint.limits).collect();
        let params = Params {
            home: vec![Some(0.1), Some(0.01)],
            ..Params::for_joints(limits, PERIOD).expect("two joints")
        };
        Self {
            pair: Pair::new(EmulatorConfig::default()),
            state: LoopState::new(&params).expect("sensible"),
            params,
            stop: None,
            dice: Noise::new(4),
            ids: 0,
            lease: None,
            samples: 0,
            snapshot: None,
            sent: Vec::new(),
            commands: 0,
            moved: 0,
        }
    }

    fn below(&mut self, count: u32) -> u32 {
        ((self.dice.uniform() * f64::from(count)) as u32).min(count - 1)
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.dice.uniform()
    }

    /// Values that are now and then beyond what the joints may do.
    fn values(&mut self, turn: f64, slide: f64) -> JointVector {
        let values = [self.between(-turn, turn), self.between(-slide, slide)];
        JointVector::from_slice(&values).expect("finite")
    }

    fn id(&mut self) -> Uuid {
        // Now and then one that was used before.
        self.ids += u128::from(self.below(8) > 0);
        Uuid::from_u128(self.ids)
    }

    fn order(&mut self) -> Order {
        use CommandMode::{Halt, Homing, Jog, PositionCommand, Trajectory, VelocityCommand};
        let modes = [Halt, Jog, Trajectory, PositionCommand, VelocityCommand, Homing];
        match self.below(18) {
            0..=2 => Order::SetMode(modes[self.below(6) as usize]),
            3 => Order::Halt,
            4 => Order::Enable,
            5 if self.below(4) == 0 => Order::Disable,
            5 | 6 => Order::ResetErrors,
            7 => Order::Jog(JogOrder {
                id: self.id(),
                joint_position: self.values(3.2, 0.55),
                max_velocity: JointVector::from_slice(&[1.5, 0.15]).expect("finite"),
            }),
            8 => Order::JogJoint(JogJointOrder {
                id: self.id(),
                joint_velocity: self.values(2.2, 0.22),
                timeout: Duration::from_millis(u64::from(self.below(120)) + 20),
                renews: false,
            }),
            9..=11 => self.follow(),
            12 => Order::Cancel(Uuid::from_u128(self.ids)),
            13 => Order::Pause(Uuid::from_u128(self.ids)),
            14 => Order::Resume(Uuid::from_u128(self.ids)),
            15 => Order::SetSpeedRatio(self.between(0.01, 1.0)),
            16 => {
                let lease = Uuid::from_u128(1 << 64 | u128::from(self.below(3)));
                self.lease = Some(lease);
                let ttl = Duration::from_millis(300);
                Order::AcquireLease { lease, ttl, role: Default::default() }
            }
            _ => Order::Home(HomeOrder {
                id: self.id(),
                groups: std::array::from_fn(|group| match group {
                    0 => JointSet::first(2),
                    _ => JointSet::NONE,
                }),
                method: HomeMethod::MoveToHome,
            }),
        }
    }

    /// A legal trajectory from where the robot is held to anywhere, or a jog if there is none.
    fn follow(&mut self) -> Order {
        let held = self.snapshot.map(|snapshot| snapshot.joint_position_command);
        let from = held.filter(|held| held.len() == 2).unwrap_or_default();
        let (to, via) = (self.values(2.9, 0.48), self.between(0.3, 0.7));
        let duration_s = self.between(0.2, 3.0);
        let row = |share: f64| Waypoint {
            time_from_start_s: share * duration_s,
            joint_position: from.iter().zip(to.iter()).map(|(a, b)| a + share * (b - a)).collect(),
            ..Waypoint::default()
        };
        let trajectory = JointTrajectory {
            joint_names: vec!["turn".to_owned(), "slide".to_owned()],
            waypoints: vec![row(0.0), row(via), row(1.0)],
            ..JointTrajectory::default()
        };
        let limits = MotionLimits::new(&self.params.limits).expect("complete");
        let options = TrajectoryOptions::default();
        let names = ["turn", "slide"];
        match CompiledTrajectory::compile(&trajectory, &names, &limits, &options) {
            Ok(compiled) => {
                let queues =
                    [Queue::Refuse, Queue::Append, Queue::AppendBlended, Queue::Replace];
                let queue = queues[self.below(4) as usize];
                let id = self.id();
                Order::Follow(FollowOrder { queue, ..FollowOrder::at_once(id, Arc::new(compiled)) })
            }
            Err(_) => Order::SetMode(CommandMode::Trajectory),
        }
    }

    fn sample(&mut self) -> Option<StreamSample> {
        let (lease, snapshot) = (self.lease?, self.snapshot?);
        self.samples += 1;
        let header = StreamHeader {
            lease,
            epoch: snapshot.epoch,
            seq: self.samples,
            state_seqno: snapshot.seqno,
        };
        let joints = JointSet::from_bits(self.below(4) as u16);
        let values = if snapshot.command_mode == CommandMode::VelocityCommand {
            StreamValues::Velocity { joints, velocity: self.values(8.0, 1.0) }
        } else {
            let (position, velocity) = (self.values(6.0, 1.0), JointVector::EMPTY);
            StreamValues::Position { joints, position, velocity }
        };
        Some(StreamSample { header, values })
    }

    fn harm(&mut self) {
        let harms = [
            "estop", "estop_release", "drives_off", "error=7", "silence_ms=150", "guard_open=1",
            "guard_close=1", "key_switch=auto", "key_switch=manual_reduced_speed",
            "key_switch=cobot", "block_joint=0", "unblock",
        ];
        match self.below(16) as usize {
            12 => self.stop = Some(StopLevel::L2),
            13 => self.stop = Some(StopLevel::L1),
            14 => self.stop = Some(StopLevel::L0),
            15 => self.stop = None,
            which => drop(self.pair.inject(harms[which])),
        }
    }

    fn tick(&mut self, order: Option<Order>) {
        let mut input = Input {
            feedback: self.pair.driver.feedback().copied(),
            stop: self.stop,
            ..Input::at(self.pair.now)
        };
        if let Some(order) = order {
            let lease = self.lease.filter(|_| self.below(10) > 0);
            input.requests.push(LoopRequest { ticket: 0, lease, order });
        }
        if self.below(3) == 0
            && let Some(sample) = self.sample()
        {
            input.stream.push(sample);
        }
        let output = step(&self.params, &mut self.state, &mut input);
        self.check(output.command.as_ref());
        if let Some(request) = output.driver_request {
            self.pair.driver.request(self.pair.now, request);
        }
        if let Some(command) = &output.command {
            self.pair.driver.command(self.pair.now, command);
        }
        self.snapshot = Some(output.snapshot);
        self.pair.tick();
    }

    /// What is sent is inside every limit, by the differences that the controller sees.
    fn check(&mut self, command: Option<&SetPoint>) {
        let Some(command) = command else {
            self.sent.clear();
            return;
        };
        let (period_s, position) = (PERIOD.as_secs_f64(), command.joint_position);
        self.commands += 1;
        for (joint, limits) in self.params.limits.iter().enumerate() {
            let (x, story) = (position[joint], (self.commands, joint));
            let range = limits.lower.expect("given") - 1e-5..=limits.upper.expect("given") + 1e-5;
            assert!(range.contains(&x), "{story:?}: position {x}");
            let Some(last) = self.sent.last() else { continue };
            let speed = (x - last[joint]) / period_s;
            self.moved += u64::from(speed != 0.0);
            assert!(speed.abs() <= limits.velocity * ROOM, "{story:?}: speed {speed}");
            let [.., before, last] = &self.sent[..] else { continue };
            let change = (speed - (last[joint] - before[joint]) / period_s) / period_s;
            let most = limits.acceleration.expect("given") * ROOM;
            assert!(change.abs() <= most, "{story:?}: acceleration {change}");
        }
        self.sent.push(position);
        if self.sent.len() > 2 {
            self.sent.remove(0);
        }
    }

    /// Puts right what the story did, as a person would.
    fn recover(&mut self) {
        self.stop = None;
        self.lease = None;
        for harm in ["unblock", "guard_close=1", "estop_release", "key_switch=cobot"] {
            self.pair.inject(harm);
        }
        for order in [Order::ResetErrors, Order::Enable, Order::Halt] {
            self.tick(Some(order));
            for _ in 0..60 {
                self.tick(None);
            }
        }
    }
}

#[test]
fn ten_thousand_random_sequences_send_no_set_point_outside_the_limits() {
    let mut cell = Cell::new();
    for sequence in 0..SEQUENCES {
        for _ in 0..8 {
            let order = cell.order();
            cell.tick(Some(order));
            for _ in 0..cell.below(30) {
                cell.tick(None);
            }
            if cell.below(40) == 0 {
                cell.harm();
            }
        }
        if sequence.is_multiple_of(2) {
            cell.recover();
        }
    }
    assert!(cell.commands > 300_000, "the robot was commanded: {}", cell.commands);
    assert!(cell.moved > 100_000, "and moved: {}", cell.moved);
}
