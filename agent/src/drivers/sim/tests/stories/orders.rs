//! What the stories ask for.

use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, JointTrajectory, JointVector, MotionLimits, Pose, TrajectoryOptions, Twist,
    Waypoint,
};
use armada_protocol::messages::{
    CommandMode, HomeMethod, JogFrame, LeaseLoss, MotionKind, Queue, StreamHeader,
};
use uuid::Uuid;

use super::super::*;
use super::Cell;
use crate::control::{
    DelegateOrder, FollowOrder, JogCartesianOrder, JogJointOrder, JogOrder, MAX_CHAINS, Order,
    StreamSample, StreamValues, TwistTarget,
};
use crate::drivers::{DelegatedGoal, DelegatedMove, JointSet};

impl Cell {
    pub(super) fn below(&mut self, count: u32) -> u32 {
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

    /// Positions near where the robot is held, or anywhere; now and then out of its limits.
    fn somewhere(&mut self, turn: f64, slide: f64) -> JointVector {
        let (from, far) = (self.held(), self.values(turn, slide));
        let share = if self.below(3) == 0 { 1.0 } else { 0.1 };
        from.map_indexed(|joint, value| value + share * (far[joint] - value))
    }

    pub(super) fn id(&mut self) -> Uuid {
        // Now and then one that was used before.
        self.ids += u128::from(self.below(8) > 0);
        Uuid::from_u128(self.ids)
    }

    /// Mostly the motion in progress.
    fn some_motion(&mut self) -> Uuid {
        let current = self.snapshot.and_then(|snapshot| snapshot.motion);
        match current {
            Some(motion) if self.below(4) > 0 => motion.id,
            _ => Uuid::from_u128(self.ids),
        }
    }

    pub(super) fn order(&mut self) -> Order {
        use CommandMode::{Halt, Homing, Jog, PositionCommand, Trajectory, VelocityCommand};
        let modes = [Halt, Jog, Trajectory, PositionCommand, VelocityCommand, Homing];
        match self.below(26) {
            0..=3 => Order::SetMode(modes[self.below(6) as usize]),
            4 => Order::Halt,
            5 => Order::Enable,
            6 if self.below(4) == 0 => Order::Disable,
            6 | 7 => Order::ResetErrors,
            8 => Order::Jog(JogOrder {
                id: self.id(),
                joint_position: self.somewhere(3.2, 0.55),
                max_velocity: JointVector::from_slice(&[1.5, 0.15]).expect("finite"),
            }),
            9 => Order::JogJoint(JogJointOrder {
                id: self.id(),
                joint_velocity: self.values(2.2, 0.22),
                timeout: self.dead_man(),
                renews: false,
            }),
            10 => self.jog_tool(),
            11..=13 => self.follow(),
            14..=16 => self.delegate(),
            17 => Order::Cancel(self.some_motion()),
            18 | 19 => Order::Pause(self.some_motion()),
            20 | 21 => Order::Resume(self.some_motion()),
            22 => Order::SetSpeedRatio(self.between(0.01, 1.0)),
            23 => {
                let lease = Uuid::from_u128(1 << 64 | u128::from(self.below(3)));
                self.lease = Some(lease);
                Order::AcquireLease { lease, ttl: Duration::from_millis(100), role: Default::default() }
            }
            24 => Order::Home(self.home(HomeMethod::Controller)),
            _ => Order::Home(self.home(HomeMethod::MoveToHome)),
        }
    }

    /// Goes to the mode that an order needs, or tries it without.
    pub(super) fn enter_its_mode(&mut self, order: &Order) {
        let mode = match order {
            Order::Jog(_) | Order::JogJoint(_) | Order::JogCartesian(_) => CommandMode::Jog,
            Order::Follow(_) | Order::Delegate(_) => CommandMode::Trajectory,
            Order::Home(_) => CommandMode::Homing,
            _ => return,
        };
        let is_in_it = self.snapshot.is_some_and(|snapshot| snapshot.command_mode == mode);
        if !is_in_it && self.below(4) > 0 {
            self.tick(Some(Order::Halt));
            self.until(150, |cell| {
                let commanded = cell.snapshot.map(|snapshot| snapshot.joint_velocity_command);
                commanded.is_some_and(|speeds| speeds.iter().all(|&speed| speed == 0.0))
            });
            let count = self.below(40);
            self.ticks(count);
            self.tick(Some(Order::SetMode(mode)));
        }
    }

    fn dead_man(&mut self) -> Duration {
        Duration::from_millis(u64::from(self.below(120)) + 20)
    }

    fn jog_tool(&mut self) -> Order {
        let frames = [JogFrame::Base, JogFrame::Tool, JogFrame::World];
        let mut speed = || self.between(-0.4, 0.4);
        // Most of it is in the plane that the tool can move in.
        let linear = nalgebra::Vector3::new(speed(), speed(), 0.0);
        let angular = nalgebra::Vector3::new(0.0, 0.0, speed());
        let frame = frames[self.below(3) as usize];
        let mut twists = [None; MAX_CHAINS];
        twists[0] = Some(TwistTarget { chain: 0, twist: Twist::new(linear, angular), frame });
        let (id, timeout) = (self.id(), self.dead_man());
        Order::JogCartesian(JogCartesianOrder { id, twists, timeout, renews: false })
    }

    /// A move of the controller's own, near or far; now and then one that it cannot make.
    fn delegate(&mut self) -> Order {
        let from = self.held();
        let to = self.somewhere(3.1, 0.52);
        let along = JointVector::from_slice(&[from[0], to[1]]).expect("finite");
        let (kind, goal) = match self.below(3) {
            0 => (MotionKind::MoveJoint, DelegatedGoal::Joint(to)),
            1 => (MotionKind::MovePose, DelegatedGoal::Pose { chain: 0, pose: self.tool_at(&to) }),
            _ => {
                let pose = self.tool_at(&along);
                (MotionKind::MoveLinear, DelegatedGoal::Linear { chain: 0, pose })
            }
        };
        let order = DelegatedMove {
            number: 0,
            goal,
            speed: self.between(0.1, 1.0),
            blend_radius_m: self.between(0.0, 0.05),
            // One that waits for another which never comes.
            connect: self.below(12) == 0,
        };
        let queue = if self.below(8) == 0 { Queue::Append } else { Queue::Refuse };
        let (id, on_lease_loss) = (self.id(), LeaseLoss::StopOnPath);
        Order::Delegate(DelegateOrder { id, kind, order, queue, on_lease_loss })
    }

    /// The tool at these positions, now and then out of its plane.
    fn tool_at(&mut self, joints: &JointVector) -> Pose {
        let above = if self.below(12) == 0 { 0.3 } else { 0.0 };
        let tool = Pose::from_isometry(self.chain.forward(joints).expect("two joints"));
        Pose::from_translation(0.0, 0.0, above) * tool
    }

    /// Where the robot is held.
    fn held(&self) -> JointVector {
        let held = self.snapshot.map(|snapshot| {
            let commanded = snapshot.joint_position_command;
            if commanded.is_empty() { snapshot.joint_position } else { commanded }
        });
        let zeros = JointVector::from_slice(&[0.0; 2]).expect("finite");
        held.filter(|held| held.len() == 2).unwrap_or(zeros)
    }

    /// A legal trajectory from where the robot is held to anywhere, or a jog if there is none.
    fn follow(&mut self) -> Order {
        let from = self.held();
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
                let queues = [Queue::Refuse, Queue::Append, Queue::AppendBlended, Queue::Replace];
                let queue = queues[self.below(4) as usize];
                let id = self.id();
                Order::Follow(FollowOrder { queue, ..FollowOrder::at_once(id, Arc::new(compiled)) })
            }
            Err(_) => Order::SetMode(CommandMode::Trajectory),
        }
    }

    pub(super) fn sample(&mut self) -> Option<StreamSample> {
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
}
