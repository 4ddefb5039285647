//! Paths that cannot be followed: where, and why, against closed forms and a naive search.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use armada_model::{
    ArcOrientation, BlockReason, CartesianError, CartesianMove, CartesianOptions, CartesianPath,
    CartesianPlanner, CartesianSegment, Chain, DEFAULT_ROTATION_WEIGHT, Damping, GeometricPath,
    JointVector, PathBlock, Pose, RobotModel, Twist,
};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Six joints: shoulder turning and lifting at the origin, elbow at 0.4 m, and at 0.8 m a wrist
/// whose axes meet. Joint 0 turns by at most 1 rad.
const SPHERICAL: &str = r#"<robot name="spherical">
  <link name="base"/><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
  <link name="l4"/><link name="tool"/>
  <joint name="j0" type="revolute"><parent link="base"/><child link="l0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" velocity="2" effort="1"/></joint>
  <joint name="j1" type="revolute"><parent link="l0"/><child link="l1"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
  <joint name="j2" type="revolute"><origin xyz="0.4 0 0"/><parent link="l1"/><child link="l2"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
  <joint name="j3" type="revolute"><origin xyz="0.4 0 0"/><parent link="l2"/><child link="l3"/>
    <axis xyz="1 0 0"/><limit lower="-6" upper="6" velocity="2" effort="1"/></joint>
  <joint name="j4" type="revolute"><parent link="l3"/><child link="l4"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
  <joint name="j5" type="revolute"><parent link="l4"/><child link="tool"/><axis xyz="1 0 0"/>
    <limit lower="-6" upper="6" velocity="2" effort="1"/></joint></robot>"#;

/// Elbow up, the tool pointing down.
const READY: [f64; 6] = [0.0, -0.9, 1.6, 0.0, 0.8, 0.0];

/// No singularity and no rate is refused.
const LENIENT: fn() -> CartesianOptions = || CartesianOptions {
    min_singular_value: 0.0,
    max_joint_rate: f64::INFINITY,
    ..CartesianOptions::default()
};

fn spherical() -> Chain {
    let model = RobotModel::from_urdf(SPHERICAL, "spherical.urdf").expect("a robot");
    Chain::new(&model, "base", "tool").expect("a chain")
}

fn vector(position: &[f64]) -> JointVector {
    JointVector::from_slice(position).expect("finite")
}

fn pose(chain: &Chain, position: &[f64]) -> Pose {
    Pose::from_isometry(chain.forward(position).expect("positions fit"))
}

fn moved(start: &Pose, shift: [f64; 3], turn: [f64; 3]) -> Pose {
    let rotation =
        UnitQuaternion::from_scaled_axis(Vector3::from(turn)) * start.isometry().rotation;
    let position = start.position() + Vector3::from(shift);
    Pose::from_isometry(Isometry3::from_parts(position.into(), rotation))
}

fn block(
    chain: &Chain,
    path: &CartesianPath,
    start: &[f64],
    options: &CartesianOptions,
) -> PathBlock {
    let planner = CartesianPlanner::new(chain, options).expect("options");
    match planner.follow(path, &vector(start)) {
        Err(CartesianError::Blocked(block)) => *block,
        Ok(_) => panic!("not blocked"),
        Err(error) => panic!("{error}"),
    }
}

/// Follows the path in small equal steps by Newton's method, and tells the fraction of the first
/// step at which `bad` holds for residual, positions, and smallest singular value.
fn naive(
    chain: &Chain,
    path: &CartesianPath,
    start: &[f64],
    bad: impl Fn(f64, &[f64], f64) -> bool,
) -> f64 {
    const STEPS: u32 = 4000;
    let damping = Damping { threshold: 1e-3, maximum: 1e-4, length: 1.0 };
    let mut position = vector(start);
    for step in 0..=STEPS {
        let target = path.pose_at(path.length() * f64::from(step) / f64::from(STEPS));
        let mut residual = f64::INFINITY;
        let mut singular = 0.0;
        for _ in 0..20 {
            let (pose, jacobian) = chain.forward_and_jacobian(&position).expect("positions fit");
            let shift = target.position() - pose.translation.vector;
            let turn = (target.isometry().rotation * pose.rotation.inverse()).scaled_axis();
            residual = shift.norm() + turn.norm();
            let resolved = jacobian.joint_velocity(&Twist::new(shift, turn), &damping, &[]);
            singular = resolved.distance_to_singularity;
            position = position.map_indexed(|joint, value| value + resolved.velocities[joint]);
        }
        if bad(residual, &position, singular) {
            return f64::from(step) / f64::from(STEPS);
        }
    }
    panic!("nothing bad on the whole path");
}

#[test]
fn the_end_of_the_reach_is_found_where_the_arm_is_straight() {
    let chain = spherical();
    let start = pose(&chain, &READY);
    let to = moved(&start, [0.6, 0.0, 0.1], [0.0; 3]);
    let path = CartesianPath::line(&start, &to).expect("a line");
    let block = block(&chain, &path, &READY, &LENIENT());
    // The distance of the wrist from the shoulder is that of both arms: |p + f d| = 0.8.
    let (p, d) = (start.position(), to.position() - start.position());
    let (a, b, c) = (d.norm_squared(), p.dot(&d), p.norm_squared() - 0.64);
    let expected = (-b + (b * b - a * c).sqrt()) / a;
    assert!((block.fraction - expected).abs() < 1e-5, "{} {expected}", block.fraction);
    assert_eq!(block.reason, BlockReason::Unreachable);
    assert!(block.position_residual < 1e-5, "{block:?}");
    assert!(block.pose.distance(&path.pose_at(expected * path.length())).0 < 1e-5);
}

#[test]
fn a_joint_limit_is_found_where_the_line_crosses_it() {
    let chain = spherical();
    let start = pose(&chain, &READY);
    let path =
        CartesianPath::line(&start, &moved(&start, [-0.2, 0.6, 0.0], [0.0; 3])).expect("a line");
    let block = block(&chain, &path, &READY, &LENIENT());
    // The shoulder turns to tan(1) = f 0.6 / (x - f 0.2), less the margin that is kept.
    let (x, tan) = (start.position().x, (1.0 - 1e-4_f64).tan());
    let expected = x * tan / (0.6 + 0.2 * tan);
    assert!((block.fraction - expected).abs() < 1e-5, "{} {expected}", block.fraction);
    assert_eq!(block.reason, BlockReason::JointLimit { joint: 0, limit: 1.0 });
    assert!((block.joint_position[0] - 1.0).abs() < 1.1e-4);
}

#[test]
fn a_singularity_is_refused_where_a_naive_search_meets_it() {
    let model = common::own_robot("six_axis_arm.urdf");
    let chain = Chain::from_root(&model, "tool0").expect("a chain");
    // The wrist turns through zero on the way: its first and last axis become parallel.
    let ready = [0.2, -1.4, 1.7, -1.9, -0.4, 0.3];
    let start = pose(&chain, &ready);
    let axis = pose(&chain, &ready).isometry().rotation * Vector3::y();
    let to = moved(&start, [0.02, 0.03, 0.0], (axis * -0.9).into());
    for way in [to, moved(&start, [-0.6, -0.4, 0.1], [0.0; 3])] {
        let path = CartesianPath::line(&start, &way).expect("a line");
        let limit = 0.06;
        let options = CartesianOptions { min_singular_value: limit, ..LENIENT() };
        let block = block(&chain, &path, &ready, &options);
        let expected = naive(&chain, &path, &ready, |_, _, singular| singular < limit);
        assert!((block.fraction - expected).abs() < 3e-4, "{} {expected}", block.fraction);
        assert!(matches!(block.reason, BlockReason::Singular { .. }), "{}", block.reason);
    }
}

#[test]
fn the_reach_of_our_arms_ends_where_a_naive_search_loses_the_line() {
    let model = common::own_robot("six_axis_arm.urdf");
    let chain = Chain::from_root(&model, "tool0").expect("a chain");
    let ready = [0.2, -1.4, 1.7, -1.9, -1.5, 0.3];
    let start = pose(&chain, &ready);
    let path =
        CartesianPath::line(&start, &moved(&start, [1.0, 0.3, 0.2], [0.0; 3])).expect("a line");
    let block = block(&chain, &path, &ready, &LENIENT());
    let expected = naive(&chain, &path, &ready, |residual, _, _| residual > 1e-4);
    assert!((block.fraction - expected).abs() < 1e-3, "{} {expected}", block.fraction);
    assert_eq!(block.reason, BlockReason::Unreachable);
}

/// On the spot, the tool's axis from below the forearm's to above it, `beside` it \[rad\].
fn wrist_flip(chain: &Chain, beside: f64) -> ([f64; 6], CartesianPath) {
    let ready = [0.0, -0.9, 1.6, beside / 0.5_f64.sin(), -0.5, 0.0];
    let start = pose(chain, &ready);
    let path = CartesianPath::line(&start, &moved(&start, [0.0; 3], [0.0, 1.0, 0.0]));
    (ready, path.expect("a turn"))
}

#[test]
fn a_wrist_that_must_flip_in_an_instant_is_a_jump() {
    let chain = spherical();
    let (ready, path) = wrist_flip(&chain, 5e-5);
    // A millionth of this path is 1e-6 rad, in which the wrist turns by up to 1e-6 / 5e-5 rad.
    let options = CartesianOptions { angle_tolerance: 1e-6, max_joint_step: 0.01, ..LENIENT() };
    let block = block(&chain, &path, &ready, &options);
    assert!((block.fraction - 0.5).abs() < 1e-3, "{}", block.fraction);
    let BlockReason::JointJump { joint: 3 | 5, size, limit } = block.reason else {
        panic!("{block}");
    };
    assert!(size > limit && limit == options.max_joint_step);
}

#[test]
fn a_wrist_that_may_miss_the_flip_within_tolerance_goes_straight_through() {
    let chain = spherical();
    let (ready, path) = wrist_flip(&chain, 2e-6);
    let planner = CartesianPlanner::new(&chain, &LENIENT()).expect("options");
    let motion = planner.follow(&path, &vector(&ready)).expect("straight through");
    assert_eq!(motion.legs().len(), 1);
}

#[test]
fn a_wrist_that_turns_too_fast_beside_a_singularity_is_refused() {
    let chain = spherical();
    let (ready, path) = wrist_flip(&chain, 0.02);
    let options = CartesianOptions { max_joint_rate: 100.0, ..LENIENT() };
    let block = block(&chain, &path, &ready, &options);
    // Beside the singularity the wrist turns by atan2(b, a), a and b the angles to the axis along
    // and beside the way: b / (a² + b²) = rate per rad, at a weight of 0.1 m/rad.
    let along = (0.02 / (100.0 * 0.1) - 0.02_f64 * 0.02).sqrt();
    let expected = 0.5 - along;
    assert!((block.fraction - expected).abs() < 2e-3, "{} {expected}", block.fraction);
    assert!(matches!(block.reason, BlockReason::JointRate { joint: 3 | 5, limit: 100.0, .. }));
}

#[test]
fn the_part_before_a_block_can_be_had() {
    let chain = spherical();
    let start = pose(&chain, &READY);
    let path =
        CartesianPath::line(&start, &moved(&start, [0.6, 0.0, 0.1], [0.0; 3])).expect("a line");
    let planner = CartesianPlanner::new(&chain, &CartesianOptions::default()).expect("options");
    let part = planner.follow_reachable(&path, &vector(&READY)).expect("the start fits");
    let block = part.block.expect("blocked");
    assert!(part.fraction > 0.3 && part.fraction < 0.6, "{}", part.fraction);
    assert!((part.fraction - block.fraction).abs() < 1e-12, "{}", block.fraction);
    let motion = part.motion.expect("the first part");
    let end = motion.legs()[0].parameters().last().copied().expect("rows");
    assert!((end - part.fraction * path.length()).abs() < 1e-12);
}

#[test]
fn a_block_after_a_stop_leaves_the_legs_before_it() {
    let chain = spherical();
    let start = pose(&chain, &READY);
    let moves = [[0.05, 0.0, 0.1], [0.05, 0.1, 0.1], [0.9, 0.1, 0.1]]
        .map(|shift| CartesianMove::line(moved(&start, shift, [0.0; 3])));
    let path = CartesianPath::new(&start, &moves, DEFAULT_ROTATION_WEIGHT).expect("a path");
    let planner = CartesianPlanner::new(&chain, &LENIENT()).expect("options");
    let part = planner.follow_reachable(&path, &vector(&READY)).expect("the start fits");
    let motion = part.motion.expect("the first legs");
    let ranges: Vec<_> = motion.legs().iter().map(GeometricPath::range).collect();
    let stops: Vec<_> = path.stops().collect();
    assert_eq!(ranges[..2], [(0.0, stops[0]), (stops[0], stops[1])]);
    assert_eq!((ranges.len(), ranges[2].0), (3, stops[1]));
    assert!((ranges[2].1 - part.fraction * path.length()).abs() < 1e-12);
    let reach = path.pose_at(ranges[2].1).position().norm();
    assert!((reach - 0.8).abs() < 1e-5, "{reach}");
}

#[test]
fn nothing_is_left_of_a_path_that_begins_at_a_singularity() {
    let chain = spherical();
    let mut straight = READY;
    straight[2] = 0.0;
    let start = pose(&chain, &straight);
    let path =
        CartesianPath::line(&start, &moved(&start, [-0.1, 0.0, 0.0], [0.0; 3])).expect("a line");
    let planner = CartesianPlanner::new(&chain, &CartesianOptions::default()).expect("options");
    let part = planner.follow_reachable(&path, &vector(&straight)).expect("the start fits");
    assert!(part.motion.is_none());
    assert_eq!(part.fraction, 0.0);
    let reason = part.block.expect("blocked").reason;
    assert!(matches!(reason, BlockReason::Singular { value, .. } if value < 1e-9), "{reason}");
}

#[test]
fn a_path_that_takes_too_many_poses_for_its_tolerance_is_refused_as_a_deviation() {
    let chain = spherical();
    let start = pose(&chain, &READY);
    // 150 turns on a circle of 20 cm.
    let circles = CartesianMove {
        segment: CartesianSegment::Turn {
            center: start.position() + Vector3::new(-0.1, 0.0, 0.0),
            normal: Vector3::y(),
            angle: 150.0 * std::f64::consts::TAU,
            orientation: ArcOrientation::Fixed,
        },
        blend_radius: 0.0,
    };
    let path = CartesianPath::new(&start, &[circles], DEFAULT_ROTATION_WEIGHT).expect("a path");
    let options = CartesianOptions { position_tolerance: 1e-8, ..CartesianOptions::default() };
    let block = block(&chain, &path, &READY, &options);
    assert!(matches!(block.reason, BlockReason::Deviation { .. }), "{block}");
    assert!(block.position_residual > 0.5e-8 && block.position_residual < 1e-4, "{block}");
}

#[test]
fn a_start_that_is_not_on_the_path_is_refused() {
    let chain = spherical();
    let start = pose(&chain, &READY);
    let path =
        CartesianPath::line(&start, &moved(&start, [0.1, 0.0, 0.1], [0.0; 3])).expect("a line");
    let planner = CartesianPlanner::new(&chain, &CartesianOptions::default()).expect("options");
    let refusal = |position: &[f64]| {
        planner.follow(&path, &vector(position)).expect_err("refused").to_string()
    };
    let mut beside = READY;
    beside[0] = 0.1;
    let text = refusal(&beside);
    assert!(text.ends_with("away from the start of the path"), "{text}");
    assert!(refusal(&READY[..5]).starts_with("start positions: 5 positions given"));
    let mut beyond = READY;
    (beyond[3], beyond[5]) = (std::f64::consts::TAU, -std::f64::consts::TAU);
    assert_eq!(refusal(&beyond), "joint 3 starts at 6.283185307179586, beyond its limit 6");
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    let chain = spherical();
    let refusal = |options: CartesianOptions| {
        CartesianPlanner::new(&chain, &options).expect_err("refused").to_string()
    };
    let default = CartesianOptions::default;
    for (options, name) in [
        (
            CartesianOptions { position_tolerance: 1e-9, ..default() },
            "position_tolerance is 0.000000001, expected at least 0.00000001",
        ),
        (
            CartesianOptions { angle_tolerance: -1.0, ..default() },
            "angle_tolerance is -1, expected at least",
        ),
        (CartesianOptions { max_joint_step: f64::NAN, ..default() }, "max_joint_step is NaN"),
        (CartesianOptions { max_joint_rate: 0.0, ..default() }, "max_joint_rate is 0"),
        (CartesianOptions { min_singular_value: -0.1, ..default() }, "min_singular_value is -0.1"),
        (CartesianOptions { max_linear_speed: 0.0, ..default() }, "max_linear_speed is 0"),
        (CartesianOptions { max_angular_speed: 0.0, ..default() }, "max_angular_speed is 0"),
    ] {
        let text = refusal(options);
        assert!(text.starts_with(name), "{text}");
    }
}
