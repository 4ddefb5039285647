//! Moves of the controller's own: goals by forward kinematics, limits, blends, pauses, restarts.

use armada_model::{Chain, Pose, RobotModel};
use armada_protocol::messages::OperationalMode;

use super::super::ReportsTip;
use super::*;
use crate::drivers::{
    DelegatedGoal, DelegatedMove, DelegatedReport, DelegatedStatus, MAX_REPORTED_TIPS, TipFrame,
};

const URDF: &str = include_str!("../../../../../config/robots/six_axis_arm.urdf");
const HOME: [f64; 6] = [0.0, -1.571, 1.571, -1.571, -1.571, 0.0];
const ACCELERATION: f64 = 5.0;

fn chain() -> Chain {
    let model = RobotModel::from_urdf(URDF, "six_axis_arm.urdf").expect("a robot");
    Chain::new(&model, "base_link", "tool0").expect("a chain")
}

/// The six-axis arm of the default cell.
pub(super) fn arm(nonce: u64) -> DriverSetup {
    let chain = chain();
    let joint = |variable: &armada_model::ChainVariable| JointInfo {
        name: variable.name.clone(),
        joint_type: variable.joint_type,
        limits: JointLimits { acceleration: Some(ACCELERATION), ..variable.limits },
        reduced: ReducedLimits { velocity: 0.25, acceleration: 1.0 },
        home: None,
    };
    DriverSetup {
        joints: chain.variables().iter().map(joint).collect(),
        chains: vec![Some(chain)],
        period: PERIOD,
        boot_nonce: NonZeroU64::new(nonce).expect("nonce is not zero"),
    }
}

/// An emulated arm that moves by itself, without noise, in the posture `HOME`.
pub(super) fn config() -> EmulatorConfig {
    let chain = chain();
    let names = chain.variables().iter().map(|variable| variable.name.clone());
    EmulatorConfig { own_moves: true, initial_rad: names.zip(HOME).collect(), ..quiet() }
}

fn enabled() -> Pair {
    let mut pair = Pair::of(arm, config(), Weather::default());
    pair.enable();
    pair
}

fn joints(change: [f64; 6]) -> JointVector {
    let home = JointVector::from_slice(&HOME).expect("finite");
    home.map_indexed(|joint, value| value + change[joint])
}

fn tool_at(joints: &JointVector) -> Pose {
    Pose::from_isometry(chain().forward(joints).expect("fits"))
}

/// `HOME` moved in the base's axes.
fn shifted(x: f64, y: f64, z: f64) -> Pose {
    Pose::from_translation(x, y, z) * tool_at(&joints([0.0; 6]))
}

const fn to(number: u32, goal: DelegatedGoal) -> DelegatedMove {
    DelegatedMove { number, goal, speed: 1.0, blend_radius_m: 0.0, connect: false }
}

fn linear(number: u32, pose: Pose) -> DelegatedMove {
    to(number, DelegatedGoal::Linear { chain: 0, pose })
}

fn report(pair: &Pair) -> DelegatedReport {
    pair.feedback().delegated.expect("a report")
}

/// Runs until the move of this number has the status, and gives all positions on the way.
fn watch(pair: &mut Pair, number: u32, status: DelegatedStatus) -> Vec<JointVector> {
    let mut seen = vec![pair.feedback().joint_position];
    for _ in 0..20_000 {
        pair.tick();
        seen.push(pair.feedback().joint_position);
        let newest = pair.feedback().delegated;
        if newest.is_some_and(|report| report.number == number && report.status == status) {
            return seen;
        }
    }
    panic!("never {status:?}: {:?}", pair.feedback());
}

/// Highest speed and acceleration of any joint in reported positions.
fn peaks(seen: &[JointVector]) -> (f64, f64) {
    let dt = PERIOD.as_secs_f64();
    let velocities: Vec<JointVector> = seen
        .windows(2)
        .map(|pair| pair[1].map_indexed(|joint, value| (value - pair[0][joint]) / dt))
        .collect();
    let velocity = velocities.iter().flat_map(|v| v.iter()).fold(0.0, |top: f64, v| top.max(v.abs()));
    let acceleration =
        velocities.windows(2).map(|pair| pair[1].max_abs_difference(&pair[0]) / dt).fold(0.0, f64::max);
    (velocity, acceleration)
}

#[test]
fn a_joint_move_ends_at_its_goal_within_the_limits_and_at_the_speed_asked_for() {
    let mut pair = enabled();
    let goal = joints([1.0, 0.3, -0.4, 0.2, 0.0, 0.5]);
    let wanted = DelegatedMove { speed: 0.5, ..to(7, DelegatedGoal::Joint(goal)) };
    pair.request(DriverRequest::Move(wanted));
    let seen = watch(&mut pair, 7, DelegatedStatus::Done);
    assert!(pair.feedback().joint_position.max_abs_difference(&goal) < 1e-4);
    assert_eq!(report(&pair).progress, 1.0);
    let (velocity, acceleration) = peaks(&seen);
    let limit = 0.5 * chain().variables()[0].limits.velocity;
    assert!((0.9 * limit..=1.01 * limit).contains(&velocity), "{velocity} of {limit} rad/s");
    assert!(acceleration <= 1.2 * ACCELERATION, "{acceleration} rad/s²");
    assert_eq!(pair.feedback().error_code, 0);
}

#[test]
fn progress_rises_from_zero_to_one() {
    let mut pair = enabled();
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([0.5; 6])))));
    pair.until("running", 0.2, |feedback| feedback.delegated.is_some());
    let mut before = 0.0;
    while report(&pair).status == DelegatedStatus::Running {
        assert!(report(&pair).progress >= before);
        before = report(&pair).progress;
        pair.tick();
    }
    assert_eq!((report(&pair).status, report(&pair).progress), (DelegatedStatus::Done, 1.0));
    assert!(before > 0.95);
}

#[test]
fn a_move_to_a_pose_puts_the_tool_there() {
    let mut pair = enabled();
    let pose = shifted(-0.1, 0.15, 0.1);
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Pose { chain: 0, pose })));
    watch(&mut pair, 1, DelegatedStatus::Done);
    let (distance, angle) = tool_at(&pair.feedback().joint_position).distance(&pose);
    assert!(distance < 2e-4 && angle < 2e-4, "{distance} m, {angle} rad off");
}

#[test]
fn a_straight_move_leads_the_tool_along_a_line() {
    let mut pair = enabled();
    let pose = shifted(-0.1, 0.2, 0.1);
    let from = tool_at(&joints([0.0; 6]));
    pair.request(DriverRequest::Move(DelegatedMove { speed: 0.3, ..linear(1, pose) }));
    let seen = watch(&mut pair, 1, DelegatedStatus::Done);
    let way = pose.position() - from.position();
    for position in &seen {
        let offset = tool_at(position).position() - from.position();
        let beside = (offset - way * (offset.dot(&way) / way.norm_squared())).norm();
        assert!(beside < 2e-3, "{beside} m beside the line");
    }
    let (distance, angle) = tool_at(&pair.feedback().joint_position).distance(&pose);
    assert!(distance < 2e-4 && angle < 2e-4, "{distance} m, {angle} rad off");
}

#[test]
fn a_tool_that_was_told_is_what_goes_to_the_pose_and_what_is_reported() {
    let tcp = EmulatorConfig { reports_tip: ReportsTip::Tcp, ..config() };
    let mut pair = Pair::of(arm, tcp, Weather::default());
    pair.enable();
    let tool = Pose::from_translation(0.0, 0.0, 0.1);
    let pose = shifted(0.0, 0.1, 0.05);
    pair.request(DriverRequest::SetTool { chain: 0, tool });
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Pose { chain: 0, pose })));
    watch(&mut pair, 1, DelegatedStatus::Done);
    let reached = tool_at(&pair.feedback().joint_position) * tool;
    assert!(reached.distance(&pose).0 < 2e-4, "{:?}", reached.distance(&pose));
    let tips: [_; MAX_REPORTED_TIPS] = pair.feedback().tips;
    let tip = tips[0].expect("a tip");
    assert_eq!((tip.chain, tip.frame, tips[1]), (0, TipFrame::Tcp, None));
    assert!(tip.pose.distance(&reached).0 < 1e-9);
}

#[test]
fn moves_wait_for_the_last_they_connect_to_and_pass_the_corner_within_the_radius() {
    let mut pair = enabled();
    let (corner, end) = (shifted(0.0, 0.2, 0.0), shifted(0.0, 0.2, 0.2));
    let first = DelegatedMove { blend_radius_m: 0.05, connect: true, ..linear(1, corner) };
    pair.request(DriverRequest::Move(first));
    pair.run(0.5);
    assert_eq!(report(&pair).status, DelegatedStatus::Waiting);
    assert_eq!(pair.feedback().joint_position, joints([0.0; 6]));
    pair.request(DriverRequest::Move(linear(2, end)));
    let seen = watch(&mut pair, 2, DelegatedStatus::Done);
    let nearest = seen.iter().map(|q| tool_at(q).distance(&corner).0).fold(f64::INFINITY, f64::min);
    // 3/8 r sin(45°) from the corner, and not through it.
    assert!((0.005..0.05).contains(&nearest), "passed at {nearest} m");
    let dt = PERIOD.as_secs_f64();
    let slowest_near_corner = seen
        .windows(2)
        .filter(|pair| tool_at(&pair[0]).distance(&corner).0 < 0.04)
        .map(|pair| tool_at(&pair[0]).distance(&tool_at(&pair[1])).0 / dt)
        .fold(f64::INFINITY, f64::min);
    assert!(slowest_near_corner > 0.05, "no stop: {slowest_near_corner} m/s");
    assert!(tool_at(&pair.feedback().joint_position).distance(&end).0 < 2e-4);
}

#[test]
fn joint_moves_are_blended_too_and_without_radius_the_corner_is_reached() {
    for (radius, reached) in [(0.1, false), (0.0, true)] {
        let mut pair = enabled();
        let corner = joints([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let end = joints([0.5, 0.5, 0.0, 0.0, 0.0, 0.0]);
        let first = to(1, DelegatedGoal::Joint(corner));
        let first = DelegatedMove { blend_radius_m: radius, connect: true, ..first };
        pair.request(DriverRequest::Move(first));
        pair.request(DriverRequest::Move(to(2, DelegatedGoal::Joint(end))));
        let seen = watch(&mut pair, 2, DelegatedStatus::Done);
        let nearest = seen.iter().map(|q| q.max_abs_difference(&corner)).fold(f64::INFINITY, f64::min);
        assert_eq!(nearest < 5e-3, reached, "radius {radius}: passed at {nearest} rad");
        assert!(pair.feedback().joint_position.max_abs_difference(&end) < 1e-4);
    }
}

#[test]
fn pause_resume_and_speed_keep_to_the_path() {
    let mut pair = enabled();
    let goal = joints([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(goal))));
    pair.run(0.2);
    pair.request(DriverRequest::PauseMotion);
    pair.until("paused", 0.2, |f| {
        f.delegated.is_some_and(|report| report.status == DelegatedStatus::Paused)
    });
    pair.run(1.0);
    let rest = pair.position();
    pair.run(0.5);
    assert!((pair.position() - rest).abs() < 1e-9 && rest > 0.05 && rest < 0.9, "at {rest}");
    pair.request(DriverRequest::SetSpeedRatio(0.1));
    pair.request(DriverRequest::ResumeMotion);
    pair.until("running", 0.2, |f| {
        f.delegated.is_some_and(|report| report.status == DelegatedStatus::Running)
    });
    let seen = watch(&mut pair, 1, DelegatedStatus::Done);
    let (velocity, _) = peaks(&seen);
    let limit = chain().variables()[0].limits.velocity;
    assert!(velocity <= 0.11 * limit, "{velocity} rad/s");
    assert!(pair.feedback().joint_position.max_abs_difference(&goal) < 1e-4);
}

#[test]
fn a_stop_ends_at_rest_on_the_way_and_overtakes_what_waits() {
    let mut pair = enabled();
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([1.0; 6])))));
    pair.run(0.3);
    pair.request(DriverRequest::Move(to(2, DelegatedGoal::Joint(joints([0.0; 6])))));
    pair.request(DriverRequest::StopMotion);
    let seen = watch(&mut pair, 1, DelegatedStatus::Stopped);
    assert!(peaks(&seen).1 <= 1.2 * ACCELERATION);
    let rest = pair.feedback().joint_position;
    pair.run(1.0);
    assert!(pair.feedback().joint_position.max_abs_difference(&rest) < 1e-2);
    assert_eq!(report(&pair).number, 1, "the second one never left");
    pair.request(DriverRequest::Move(to(3, DelegatedGoal::Joint(joints([0.0; 6])))));
    watch(&mut pair, 3, DelegatedStatus::Done);
}

#[test]
fn a_move_that_does_not_connect_waits_for_the_end_of_the_one_before() {
    let mut pair = enabled();
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([0.5; 6])))));
    pair.run(0.1);
    pair.request(DriverRequest::Move(to(2, DelegatedGoal::Joint(joints([0.0; 6])))));
    pair.run(0.1);
    assert_eq!((report(&pair).number, report(&pair).status), (2, DelegatedStatus::Waiting));
    let seen = watch(&mut pair, 2, DelegatedStatus::Done);
    let nearest = seen.iter().map(|q| q.max_abs_difference(&joints([0.5; 6])));
    assert!(nearest.fold(f64::INFINITY, f64::min) < 1e-3, "the first was made");
}

#[test]
fn what_cannot_be_done_is_refused_with_its_error_and_moves_nothing() {
    let far = Pose::from_translation(5.0, 0.0, 0.0);
    let cases = [
        (DelegatedGoal::Pose { chain: 0, pose: far }, error_code::UNREACHABLE),
        (DelegatedGoal::Linear { chain: 0, pose: far }, error_code::UNREACHABLE),
        (DelegatedGoal::Joint(joints([9.0; 6])), error_code::OUT_OF_LIMITS),
        (DelegatedGoal::Joint(vector([0.0; 2])), error_code::OUT_OF_LIMITS),
        (DelegatedGoal::Pose { chain: 3, pose: far }, error_code::NO_CHAIN),
    ];
    let mut pair = enabled();
    for (number, (goal, code)) in (1..).zip(cases) {
        pair.request(DriverRequest::Move(to(number, goal)));
        watch(&mut pair, number, DelegatedStatus::Failed { code });
        assert_eq!(pair.feedback().joint_position, joints([0.0; 6]));
        assert!(pair.feedback().ready, "a refusal is no error of the controller");
    }
    pair.request(DriverRequest::Disable);
    pair.until("disabled", 0.5, |feedback| !feedback.enabled);
    pair.request(DriverRequest::Move(to(9, DelegatedGoal::Joint(joints([0.1; 6])))));
    watch(&mut pair, 9, DelegatedStatus::Failed { code: error_code::NOT_READY });
}

#[test]
fn what_stops_the_robot_fails_the_move() {
    for (fault, code) in [
        ("estop_button=1", error_code::INTERRUPTED),
        ("guard_open=1", error_code::INTERRUPTED),
        ("error=17", 17),
    ] {
        let mut pair = enabled();
        pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([1.0; 6])))));
        pair.run(0.2);
        assert!(pair.inject(fault));
        watch(&mut pair, 1, DelegatedStatus::Failed { code });
        pair.run(0.5);
        assert!(pair.feedback().joint_velocity.iter().all(|v| v.abs() < 1e-9), "{fault}");
    }
}

#[test]
fn manual_reduced_speed_holds_the_reduced_limits() {
    let mut pair = enabled();
    assert!(pair.inject("key_switch=manual_reduced_speed"));
    pair.until("mode", 0.1, |f| f.operational_mode == OperationalMode::ManualReducedSpeed);
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([0.3; 6])))));
    let seen = watch(&mut pair, 1, DelegatedStatus::Done);
    let (velocity, _) = peaks(&seen);
    assert!((0.24..=0.2505).contains(&velocity), "{velocity} rad/s");
}

#[test]
fn moves_are_made_once_and_in_order_through_a_bad_network() {
    let weather = Weather { loss: 0.3, hold_up: 3, twice: 0.3 };
    let mut pair = Pair::of(arm, config(), weather);
    pair.enable();
    for (number, turn) in (1..).zip([0.3, -0.3, 0.1]) {
        let goal = joints([turn, 0.0, 0.0, 0.0, 0.0, 0.0]);
        pair.request(DriverRequest::Move(to(number, DelegatedGoal::Joint(goal))));
    }
    let seen = watch(&mut pair, 3, DelegatedStatus::Done);
    let turns: Vec<f64> = seen.iter().map(|position| position[0]).collect();
    let highest = turns.iter().position(|turn| (turn - 0.3).abs() < 1e-3);
    let lowest = turns.iter().position(|turn| (turn + 0.3).abs() < 1e-3);
    assert!(highest.is_some() && highest < lowest, "{highest:?} {lowest:?}");
    pair.run(1.0);
    assert!((pair.position() - 0.1).abs() < 1e-4);
}

#[test]
fn a_client_that_dies_leaves_the_robot_at_rest_and_the_next_one_knows_of_no_move() {
    let mut pair = enabled();
    pair.request(DriverRequest::Move(DelegatedMove {
        speed: 0.1,
        ..to(1, DelegatedGoal::Joint(joints([1.0; 6])))
    }));
    pair.run(0.2);
    pair.driver = super::config(config()).driver(&arm(12)).expect("driver");
    pair.peer = address(50_002);
    pair.until("status", 2.0, |_| true);
    pair.run(0.3);
    assert_eq!(pair.feedback().delegated, None);
    assert!(pair.position() < 0.9, "stopped on the way");
    let rest = pair.feedback().joint_position;
    pair.run(0.5);
    assert!(pair.feedback().joint_position.max_abs_difference(&rest) < 1e-6);
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([0.0; 6])))));
    watch(&mut pair, 1, DelegatedStatus::Done);
}

#[test]
fn a_controller_that_restarts_in_a_move_knows_of_none() {
    let mut pair = enabled();
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(joints([1.0; 6])))));
    pair.run(0.2);
    pair.request(DriverRequest::Move(to(2, DelegatedGoal::Joint(joints([0.5; 6])))));
    pair.emulator = super::config(config()).emulator(&arm(33)).expect("emulator");
    pair.run(0.5);
    assert_eq!(pair.feedback().delegated, None);
    assert!(!pair.feedback().enabled);
    pair.enable();
    pair.run(0.5);
    assert_eq!(pair.feedback().joint_position, joints([0.0; 6]));
}

#[test]
fn set_points_are_dropped_while_it_moves_itself() {
    let mut pair = enabled();
    let goal = joints([0.5; 6]);
    pair.request(DriverRequest::Move(to(1, DelegatedGoal::Joint(goal))));
    let stale = SetPoint {
        joint_position: joints([0.0; 6]),
        joint_velocity: joints([0.0; 6]).map_indexed(|_, _| 0.0),
    };
    for _ in 0..20_000 {
        pair.driver.command(pair.now, &stale);
        pair.tick();
        if pair.feedback().delegated.is_some_and(|r| r.status == DelegatedStatus::Done) {
            assert!(pair.feedback().joint_position.max_abs_difference(&goal) < 1e-3);
            return;
        }
    }
    panic!("never done: {:?}", pair.feedback());
}
