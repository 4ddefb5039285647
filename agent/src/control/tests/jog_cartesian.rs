//! Jogs of tools on the robots of the project, with a robot that follows at once.

use std::sync::Arc;
use std::time::Duration;

use armada_model::{Chain, JointLimits, JointVector, MonoTime, Pose, RobotModel, Twist};
use armada_protocol::messages::{ActionStatus, CommandMode, JogFrame, OperationalMode};
use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use uuid::Uuid;

use crate::control::{
    Equipment, EquippedChain, Granted, Input, JogCartesianOrder, JogJointOrder, JogOrder,
    LoopEvent, LoopRequest, LoopState, MAX_CHAINS, MotionReport, Order, Output, Params, Refusal,
    TwistTarget, step,
};
use crate::drivers::{Feedback, LoadSetting};

const PERIOD: Duration = Duration::from_millis(2);
const SIX: &str = include_str!("../../../../config/robots/six_axis_arm.urdf");
const SEVEN: &str = include_str!("../../../../config/robots/seven_axis_arm.urdf");
const SIX_READY: [f64; 6] = [0.3, -1.2, 1.6, -1.4, -1.57, 0.4];
const SEVEN_READY: [f64; 7] = [0.2, -0.5, 0.3, -2.0, 0.2, 1.7, 0.5];

/// An arm in mode jog.
struct Arm {
    params: Params,
    state: LoopState,
    now: MonoTime,
    feedback: Feedback,
    /// With its tool.
    chain: Chain,
    sent: Vec<JointVector>,
    events: Vec<LoopEvent>,
    last: Option<Output>,
}

fn tool() -> Pose {
    let turn = UnitQuaternion::from_euler_angles(0.3, -0.4, 0.5);
    Pose::from_isometry(nalgebra::Isometry3::from_parts(
        nalgebra::Translation3::new(0.02, -0.05, 0.12),
        turn,
    ))
}

fn mount() -> Pose {
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0);
    Pose::from_isometry(nalgebra::Isometry3::from_parts(
        nalgebra::Translation3::new(1.0, 2.0, 0.0),
        turn,
    ))
}

impl Arm {
    fn new(urdf: &str, ready: &[f64]) -> Self {
        let model = RobotModel::from_urdf(urdf, "arm.urdf").expect("a robot description");
        let chain = Chain::new(&model, "base_link", "tool0").expect("a chain");
        let limits = chain
            .variables()
            .iter()
            .map(|variable| JointLimits { acceleration: Some(5.0), ..variable.limits });
        let equipped = EquippedChain {
            chain: chain.clone(),
            tcp: tool(),
            base_in_world: mount(),
            joints: (0..chain.len()).collect(),
            load: LoadSetting::default(),
        };
        let chains = vec![equipped.clone(), equipped];
        let params = Params {
            equipment: Arc::new(Equipment { config_seqno: 1, chains }),
            ..Params::for_joints(limits.collect(), PERIOD).expect("few joints")
        };
        let state = LoopState::new(&params).expect("sensible");
        let now = MonoTime::from_nanos(1_000_000_000);
        let position = JointVector::from_slice(ready).expect("finite");
        let feedback = Feedback {
            enabled: true,
            ready: true,
            operational_mode: OperationalMode::Cobot,
            ..Feedback::of(now, position)
        };
        let chain = chain.with_tool(&tool());
        let (sent, events) = (Vec::new(), Vec::new());
        let mut arm = Self { params, state, now, feedback, chain, sent, events, last: None };
        arm.tick(None);
        arm.ask(Order::SetMode(CommandMode::Jog)).expect("granted");
        arm
    }

    fn tick(&mut self, order: Option<Order>) {
        self.now = self.now + PERIOD;
        self.feedback.stamp = self.now;
        let mut input = Input::at(self.now);
        input.feedback = Some(self.feedback);
        input.requests = order.into_iter().map(|order| LoopRequest::new(1, order)).collect();
        let output = step(&self.params, &mut self.state, &mut input);
        if let Some(command) = output.command {
            self.feedback.joint_position = command.joint_position;
            self.sent.push(command.joint_position);
        }
        self.events.extend(output.events.iter().copied());
        self.last = Some(output);
    }

    fn ticks(&mut self, count: usize) {
        for _ in 0..count {
            self.tick(None);
        }
    }

    fn ask(&mut self, order: Order) -> Result<Granted, Refusal> {
        self.tick(Some(order));
        let events = &self.last.as_ref().expect("a tick").events;
        let answer = events.iter().find_map(|event| match event {
            LoopEvent::Answer { result, .. } => Some(*result),
            _ => None,
        });
        answer.expect("an answer in the same tick")
    }

    /// Speed of the tool in the base's axes, between the last two set-points, and where that is.
    fn tool_speed(&self) -> (Twist, UnitQuaternion<f64>) {
        let [.., before, after] = self.sent.as_slice() else { panic!("two set-points") };
        let speed = after.map_indexed(|joint, x| (x - before[joint]) / PERIOD.as_secs_f64());
        let middle = after.map_indexed(|joint, x| 0.5 * (x + before[joint]));
        let (pose, jacobian) = self.chain.forward_and_jacobian(&middle).expect("fits");
        (jacobian.twist(&speed), pose.rotation)
    }

    fn joint_speed(&self) -> JointVector {
        let [.., before, after] = self.sent.as_slice() else { panic!("two set-points") };
        after.map_indexed(|joint, x| (x - before[joint]) / PERIOD.as_secs_f64())
    }

    fn reports(&self, id: u128) -> Vec<MotionReport> {
        let of = |event: &LoopEvent| match event {
            LoopEvent::Motion(report) if report.id == Uuid::from_u128(id) => Some(*report),
            _ => None,
        };
        self.events.iter().filter_map(of).collect()
    }

    fn is_limited(&self) -> bool {
        self.last.as_ref().expect("a tick").snapshot.limited_setpoints > 0
    }
}

fn target(frame: JogFrame, linear: [f64; 3], angular: [f64; 3]) -> TwistTarget {
    let twist = Twist::new(Vector3::from(linear), Vector3::from(angular));
    TwistTarget { chain: 0, twist, frame }
}

fn jog(id: u128, target: TwistTarget, timeout_s: f64) -> Order {
    let mut twists = [None; MAX_CHAINS];
    twists[0] = Some(target);
    Order::JogCartesian(JogCartesianOrder {
        id: Uuid::from_u128(id),
        twists,
        timeout: Duration::from_secs_f64(timeout_s),
        renews: false,
    })
}

/// Largest part of `a` that is not along `b`, of the length of `a`.
fn aside(a: &Twist, b: &Twist) -> f64 {
    let (a, b) = (a.to_vector(), b.to_vector().normalize());
    (a - b * a.dot(&b)).norm() / a.norm()
}

/// `wanted` in the base's axes when the tool stands at `turn`.
fn in_base(target: &TwistTarget, turn: &UnitQuaternion<f64>) -> Twist {
    match target.frame {
        JogFrame::Base => target.twist,
        JogFrame::Tool => target.twist.in_frame(turn),
        JogFrame::World => target.twist.in_frame(&mount().isometry().rotation.inverse()),
    }
}

fn goes_as_wanted(urdf: &str, ready: &[f64], target: TwistTarget) {
    let mut arm = Arm::new(urdf, ready);
    arm.ask(jog(1, target, 0.6)).expect("granted");
    for tick in 0..290 {
        arm.tick(None);
        let (speed, turn) = arm.tool_speed();
        let wanted = in_base(&target, &turn);
        let full = wanted.to_vector().norm();
        if speed.to_vector().norm() > 0.1 * full {
            assert!(aside(&speed, &wanted) < 0.02, "{target:?} tick {tick}: {speed:?}");
        }
        if tick > 120 {
            let error = (speed.to_vector() - wanted.to_vector()).norm() / full;
            assert!(error < 0.01, "{target:?} tick {tick}: {error} off");
        }
    }
    arm.ticks(300);
    let statuses: Vec<_> = arm.reports(1).iter().map(|report| report.status).collect();
    assert_eq!(statuses, [ActionStatus::Running, ActionStatus::Complete]);
    assert!(arm.joint_speed().iter().all(|speed| *speed == 0.0));
    assert!(!arm.is_limited());
}

#[test]
fn the_tool_goes_as_wanted_in_the_axes_of_base_tool_and_world() {
    for frame in [JogFrame::Base, JogFrame::Tool, JogFrame::World] {
        for (linear, angular) in [
            ([0.1, 0.0, 0.0], [0.0; 3]),
            ([0.0, -0.06, 0.05], [0.0; 3]),
            ([0.0; 3], [0.0, 0.2, -0.3]),
            ([0.03, 0.05, 0.0], [0.1, 0.0, 0.3]),
        ] {
            goes_as_wanted(SIX, &SIX_READY, target(frame, linear, angular));
            goes_as_wanted(SEVEN, &SEVEN_READY, target(frame, linear, angular));
        }
    }
}

#[test]
fn one_joint_at_its_velocity_limit_slows_the_tool_and_keeps_its_direction() {
    let mut arm = Arm::new(SIX, &SIX_READY);
    // At reduced speed the joints do not race through the workspace before it is looked at.
    arm.feedback.operational_mode = OperationalMode::ManualReducedSpeed;
    let fast = target(JogFrame::Base, [0.0, 3.0, 0.0], [0.0; 3]);
    arm.ask(jog(1, fast, 3.0)).expect("granted");
    arm.ticks(150);
    let limits = arm.params.reduced.clone();
    let mut at_limit = 0;
    for _ in 0..100 {
        arm.tick(None);
        let (speed, _) = arm.tool_speed();
        assert!(aside(&speed, &fast.twist) < 0.05, "{speed:?}");
        let speeds = arm.joint_speed();
        let share = speeds.iter().zip(&limits).map(|(speed, limit)| speed.abs() / limit.velocity);
        at_limit += usize::from(share.fold(0.0, f64::max) > 0.98);
    }
    assert!(at_limit > 80, "in {at_limit} of 100 ticks a joint is at its limit");
    assert!(!arm.is_limited());
}

#[test]
fn near_a_singularity_it_is_damped_and_no_joint_races() {
    // The elbow is all but stretched, and the tool is to go on outwards.
    let mut arm = Arm::new(SIX, &[0.0, -1.0, 0.15, -1.0, -1.57, 0.0]);
    arm.ask(jog(1, target(JogFrame::Base, [0.3, 0.0, -0.3], [0.0; 3]), 3.0)).expect("granted");
    let mut fastest: f64 = 0.0;
    for _ in 0..1400 {
        arm.tick(None);
        fastest = arm.joint_speed().iter().fold(fastest, |fastest, speed| fastest.max(speed.abs()));
    }
    let limits = arm.params.limits.iter().map(|limit| limit.velocity).fold(0.0, f64::max);
    assert!(fastest <= limits * (1.0 + 1e-6), "{fastest}");
    assert!(!arm.is_limited() && arm.reports(1).len() == 1, "{:?}", arm.reports(1));
    let back = target(JogFrame::Base, [-0.2, 0.0, 0.2], [0.0; 3]);
    arm.ask(jog(1, back, 1.0)).expect("granted");
    arm.ticks(300);
    assert!(arm.tool_speed().0.linear.norm() > 0.05, "it comes back: {:?}", arm.tool_speed());
}

#[test]
fn the_tool_rests_when_a_joint_is_at_its_position_limit_and_goes_back() {
    let mut arm = Arm::new(SEVEN, &SEVEN_READY);
    // Turning about the tool's own axis turns the last joint alone, nearly.
    let turn = Twist::new(Vector3::zeros(), Vector3::z() * 0.8);
    let turn = turn.in_frame(&tool().isometry().rotation.inverse());
    let turn = TwistTarget { chain: 0, twist: turn, frame: JogFrame::Tool };
    arm.ask(jog(1, turn, 9.0)).expect("granted");
    arm.ticks(4000);
    assert!(arm.joint_speed().iter().all(|speed| speed.abs() < 1e-6), "{:?}", arm.joint_speed());
    let at = arm.sent.last().expect("sent");
    let near = at.iter().zip(&arm.params.limits).any(|(x, limit)| {
        let (lower, upper) = (limit.lower.expect("given"), limit.upper.expect("given"));
        (upper - x).min(x - lower) < 1e-4
    });
    assert!(near, "a joint is at a limit: {at:?}");
    assert_eq!(arm.reports(1).len(), 1, "the motion goes on");
    let back = TwistTarget { twist: turn.twist.scaled(-0.5), ..turn };
    arm.ask(jog(1, back, 0.5)).expect("granted");
    arm.ticks(100);
    assert!(aside(&arm.tool_speed().0, &in_base(&back, &arm.tool_speed().1)) < 0.02);
    arm.ticks(600);
    assert_eq!(arm.reports(1).last().expect("ended").status, ActionStatus::Complete);
    assert!(!arm.is_limited());
}

#[test]
fn chains_that_are_not_there_or_share_joints_are_refused() {
    let mut arm = Arm::new(SIX, &SIX_READY);
    let there = target(JogFrame::Base, [0.1, 0.0, 0.0], [0.0; 3]);
    let missing = TwistTarget { chain: 2, ..there };
    assert_eq!(arm.ask(jog(1, missing, 0.5)), Err(Refusal::NoSuchChain { chain: 2 }));
    let Order::JogCartesian(mut order) = jog(1, there, 0.5) else { panic!("a jog") };
    order.twists[1] = Some(TwistTarget { chain: 1, ..there });
    let answer = arm.ask(Order::JogCartesian(order));
    assert!(matches!(answer, Err(Refusal::NotSupported(_))), "{answer:?}");
    order.twists[1] = Some(there);
    let answer = arm.ask(Order::JogCartesian(order));
    assert!(matches!(answer, Err(Refusal::NotSupported(_))), "twice the same: {answer:?}");
    arm.feedback.operational_mode = OperationalMode::Auto;
    let expected = Err(Refusal::OperationalMode(OperationalMode::Auto));
    assert_eq!(arm.ask(jog(1, there, 0.5)), expected);
    assert!(arm.reports(1).is_empty());
}

#[test]
fn the_speed_ratio_slows_the_tool() {
    let mut arm = Arm::new(SIX, &SIX_READY);
    arm.state.speed_ratio = 0.25;
    arm.ask(jog(1, target(JogFrame::Base, [0.0, 0.1, 0.0], [0.0; 3]), 2.0)).expect("granted");
    arm.ticks(250);
    let speed = arm.tool_speed().0.linear.norm();
    assert!((speed - 0.025).abs() < 2e-4, "{speed}");
}

/// An order of a random story.
#[derive(Clone, Debug)]
enum Act {
    To([f64; 6]),
    Joints([f64; 6]),
    Tool(u8, [f64; 3], [f64; 3]),
}

fn act() -> impl Strategy<Value = (Act, usize)> {
    let act = prop_oneof![
        2 => prop::array::uniform6(-2.5..2.5f64).prop_map(Act::To),
        2 => prop::array::uniform6(-2.0..2.0f64).prop_map(Act::Joints),
        3 => (0..3u8, prop::array::uniform3(-0.8..0.8f64), prop::array::uniform3(-1.5..1.5f64))
            .prop_map(|(frame, linear, angular)| Act::Tool(frame, linear, angular)),
    ];
    (act, 1..250usize)
}

fn order(id: u128, act: &Act) -> Order {
    let (id, timeout) = (Uuid::from_u128(id), Duration::from_millis(300));
    let vector = |values: &[f64]| JointVector::from_slice(values).expect("finite");
    match act {
        Act::To(goal) => Order::Jog(JogOrder {
            id,
            joint_position: vector(goal),
            max_velocity: JointVector::EMPTY,
        }),
        Act::Joints(speed) => Order::JogJoint(JogJointOrder {
            id,
            joint_velocity: vector(speed),
            timeout,
            renews: false,
        }),
        Act::Tool(frame, linear, angular) => {
            let frame = [JogFrame::Base, JogFrame::Tool, JogFrame::World][usize::from(*frame)];
            jog(id.as_u128(), target(frame, *linear, *angular), 0.3)
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(41),
        failure_persistence: None,
        ..ProptestConfig::with_cases(40)
    })]

    #[test]
    fn whatever_jogs_follow_each_other_all_limits_hold_in_differences(
        acts in prop::collection::vec(act(), 1..10),
    ) {
        let mut arm = Arm::new(SIX, &SIX_READY);
        for (id, (act, ticks)) in (1u128..).zip(&acts) {
            // A goal too near a limit at speed is refused; then the old jog goes on.
            let _ = arm.ask(order(id, act));
            arm.ticks(*ticks);
        }
        arm.ticks(3000);
        prop_assert!(!arm.is_limited(), "the limiter had nothing to do");
        prop_assert!(arm.joint_speed().iter().all(|speed| *speed == 0.0), "it has come to rest");
        let period_s = PERIOD.as_secs_f64();
        let slopes = |values: &[f64]| -> Vec<f64> {
            values.windows(2).map(|pair| (pair[1] - pair[0]) / period_s).collect()
        };
        let peak = |values: &[f64]| values.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        for (joint, limits) in arm.params.limits.iter().enumerate() {
            let x: Vec<f64> = arm.sent.iter().map(|sent| sent[joint]).collect();
            prop_assert!(x.iter().all(|x| limits.lower.is_none_or(|lower| *x >= lower - 1e-7)));
            prop_assert!(x.iter().all(|x| limits.upper.is_none_or(|upper| *x <= upper + 1e-7)));
            let v = slopes(&x);
            prop_assert!(peak(&v) <= limits.velocity * (1.0 + 1e-6), "{}", peak(&v));
            let a = slopes(&v);
            prop_assert!(peak(&a) <= 5.0 * (1.0 + 1e-4), "joint {joint}: {}", peak(&a));
            // 5 rad/s² are reached in 50 ms.
            let jerk = peak(&slopes(&a));
            prop_assert!(jerk <= 100.0 * 1.02, "joint {joint}: {jerk}");
        }
    }
}
