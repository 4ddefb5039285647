//! Lines and arcs of the tool on real arms: followed within tolerance, or refused at the right place.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_BT is the pose of the tool in the base")]

mod common;

use std::path::Path;

use armada_model::{
    CartesianError, CartesianMotion, CartesianMove, CartesianOptions, CartesianPath,
    CartesianPlanner, Chain, CompiledTrajectory, DEFAULT_ROTATION_WEIGHT, GeometricPath,
    JointLimits, JointTrajectory, JointVector, MotionLimits, PathRows, Pose, RobotModel,
    TrajectoryOptions,
};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// An arm and a posture from which it can move in all directions.
struct Arm {
    chain: Chain,
    limits: MotionLimits,
    ready: JointVector,
}

impl Arm {
    fn new(model: &RobotModel, tip: &str, ready: &[f64]) -> Self {
        let chain = Chain::from_root(model, tip).expect("a chain");
        let limits: Vec<JointLimits> = chain
            .variables()
            .iter()
            .map(|variable| JointLimits { acceleration: Some(5.0), ..variable.limits })
            .collect();
        let limits = MotionLimits::new(&limits).expect("complete");
        Self { chain, limits, ready: JointVector::from_slice(ready).expect("finite") }
    }

    fn names(&self) -> Vec<String> {
        self.chain.variables().iter().map(|variable| variable.name.clone()).collect()
    }

    /// Poses of the tool every millisecond of a trajectory, which an agent accepts.
    fn poses(&self, trajectory: &JointTrajectory) -> Vec<Pose> {
        let options = TrajectoryOptions::default();
        let compiled =
            CompiledTrajectory::compile(trajectory, &self.names(), &self.limits, &options)
                .unwrap_or_else(|error| panic!("{error}"));
        let mut hint = 0;
        let steps = (compiled.duration_s() / TICK_S).ceil();
        let mut poses = Vec::new();
        while poses.len() as f64 <= steps {
            let sample = compiled.sample(poses.len() as f64 * TICK_S, &mut hint);
            poses.push(self.pose(&sample.position));
        }
        poses
    }

    fn pose(&self, position: &[f64]) -> Pose {
        Pose::from_isometry(self.chain.forward(position).expect("positions fit"))
    }
}

/// Time between two poses that are looked at \[s\].
const TICK_S: f64 = 1e-3;

const UR_READY: [f64; 6] = [0.2, -1.4, 1.7, -1.9, -1.5, 0.3];
const FRANKA_READY: [f64; 7] = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785];

/// Our own arms, and those beside the checkout.
fn arms() -> Vec<Arm> {
    let mut arms = vec![
        Arm::new(&common::own_robot("six_axis_arm.urdf"), "tool0", &UR_READY),
        Arm::new(&common::own_robot("seven_axis_arm.urdf"), "tool0", &FRANKA_READY),
    ];
    if let Some(robots) = common::shared("robots") {
        let load = |file: &str| common::load(&robots.join(Path::new(file)));
        arms.push(Arm::new(&load("ur5e/ur5e.urdf"), "tool0", &UR_READY));
        arms.push(Arm::new(&load("panda/panda.urdf"), "panda_hand", &FRANKA_READY));
    }
    arms
}

/// `start` moved by `shift` \[m\] and turned by a rotation vector \[rad\], both in the base.
fn moved(start: &Pose, shift: [f64; 3], turn: [f64; 3]) -> Pose {
    let rotation =
        UnitQuaternion::from_scaled_axis(Vector3::from(turn)) * start.isometry().rotation;
    Pose::from_isometry(Isometry3::from_parts(
        (start.position() + Vector3::from(shift)).into(),
        rotation,
    ))
}

/// Largest distance \[m\] and angle \[rad\] of the tool from the path, at many places.
fn deviation(arm: &Arm, motion: &CartesianMotion) -> (f64, f64) {
    let mut worst = (0.0_f64, 0.0_f64);
    let joints = arm.chain.len();
    for leg in motion.legs() {
        let (from, to) = leg.range();
        for step in 0..=2000 {
            let s = from + (to - from) * f64::from(step) / 2000.0;
            let mut rows = vec![0.0; 3 * joints];
            leg.evaluate(s, &mut PathRows::split(&mut rows));
            let (distance, angle) = arm.pose(&rows[..joints]).distance(&motion.path().pose_at(s));
            worst = (worst.0.max(distance), worst.1.max(angle));
        }
    }
    worst
}

fn follow(arm: &Arm, path: &CartesianPath, options: &CartesianOptions) -> CartesianMotion {
    let planner = CartesianPlanner::new(&arm.chain, options).expect("options");
    planner.follow(path, &arm.ready).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn lines_are_followed_within_tolerance() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        for (shift, turn) in [
            ([0.1, 0.1, -0.1], [0.0; 3]),
            ([-0.1, 0.05, 0.05], [0.3, -0.2, 0.4]),
            ([0.0; 3], [0.0, 0.0, 0.6]),
        ] {
            let path = CartesianPath::line(&start, &moved(&start, shift, turn)).expect("a line");
            for tolerance in [1e-3, 1e-4, 1e-6] {
                let options = CartesianOptions {
                    position_tolerance: tolerance,
                    angle_tolerance: tolerance,
                    ..CartesianOptions::default()
                };
                let motion = follow(&arm, &path, &options);
                let (distance, angle) = deviation(&arm, &motion);
                assert!(distance <= tolerance && angle <= tolerance, "{distance} {angle}");
            }
        }
    }
}

#[test]
fn a_blended_path_of_lines_and_arcs_is_one_smooth_leg() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let p = start.position();
        let moves = [
            CartesianMove::line(moved(&start, [0.1, 0.0, -0.05], [0.0; 3])).blended(0.03),
            CartesianMove::arc(
                p + Vector3::new(0.07, 0.1, -0.05),
                moved(&start, [0.0, 0.1, -0.05], [0.2, 0.0, 0.3]),
            )
            .blended(0.03),
            CartesianMove::line(start),
        ];
        let path = CartesianPath::new(&start, &moves, DEFAULT_ROTATION_WEIGHT).expect("a path");
        let motion = follow(&arm, &path, &CartesianOptions::default());
        assert_eq!(motion.legs().len(), 1);
        let (distance, angle) = deviation(&arm, &motion);
        assert!(distance <= 1e-4 && angle <= 1e-3, "{distance} {angle}");
    }
}

/// Largest speed \[m/s\] and angular speed \[rad/s\] from pose to pose.
fn speeds(poses: &[Pose]) -> (f64, f64) {
    let pairs = poses.windows(2).map(|pair| pair[0].distance(&pair[1]));
    let (linear, angular) =
        pairs.fold((0.0_f64, 0.0_f64), |most, (d, a)| (most.0.max(d), most.1.max(a)));
    (linear / TICK_S, angular / TICK_S)
}

#[test]
fn a_line_becomes_a_trajectory_that_agents_accept_and_that_stays_on_the_line() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let to = moved(&start, [0.1, -0.1, 0.08], [0.3, 0.1, -0.4]);
        let planner =
            CartesianPlanner::new(&arm.chain, &CartesianOptions::default()).expect("options");
        let trajectory = planner.line(&arm.ready, &to, &arm.limits).expect("a motion");
        let poses = arm.poses(&trajectory);
        let path = CartesianPath::line(&start, &to).expect("a line");
        let (from, length) = (*start.position(), to.distance(&start).0);
        let along = (to.position() - from) / length;
        for pose in &poses {
            let share = along.dot(&(pose.position() - from)) / length;
            let (distance, angle) = pose.distance(&path.pose_at(share * path.length()));
            assert!(distance <= 1e-4 && angle <= 1.5e-3, "{share}: {distance} {angle}");
        }
        let (distance, angle) = poses[poses.len() - 1].distance(&to);
        assert!(distance < 1e-8 && angle < 1e-8, "{distance} {angle}");
    }
}

#[test]
fn an_arc_stays_on_its_circle() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let p = *start.position();
        let (via, to) =
            (p + Vector3::new(0.05, 0.05, 0.0), moved(&start, [0.0, 0.1, 0.0], [0.0; 3]));
        let planner =
            CartesianPlanner::new(&arm.chain, &CartesianOptions::default()).expect("options");
        let trajectory = planner.arc(&arm.ready, (&via, &to), &arm.limits).expect("a motion");
        let center = p + Vector3::new(0.0, 0.05, 0.0);
        for pose in arm.poses(&trajectory) {
            let off = ((pose.position() - center).norm() - 0.05).abs();
            assert!(off < 1e-4, "{off}");
            assert!(pose.distance(&start).1 < 1e-3);
        }
    }
}

#[test]
fn the_orientation_takes_the_shortest_way() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let to = moved(&start, [0.05, 0.0, 0.0], [0.0, 0.0, 0.7]);
        let planner =
            CartesianPlanner::new(&arm.chain, &CartesianOptions::default()).expect("options");
        let trajectory = planner.line(&arm.ready, &to, &arm.limits).expect("a motion");
        let poses = arm.poses(&trajectory);
        let turned: f64 = poses.windows(2).map(|pair| pair[0].distance(&pair[1]).1).sum();
        assert!((turned - 0.7).abs() < 2e-3, "{turned}");
    }
}

#[test]
fn limits_of_the_tools_speed_are_reached_and_kept() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let to = moved(&start, [0.1, 0.0, 0.1], [0.0, 0.2, 0.5]);
        for (linear, angular) in [(0.05, f64::INFINITY), (f64::INFINITY, 0.2), (0.05, 0.1)] {
            let options = CartesianOptions {
                max_linear_speed: linear,
                max_angular_speed: angular,
                ..CartesianOptions::default()
            };
            let planner = CartesianPlanner::new(&arm.chain, &options).expect("options");
            let trajectory = planner.line(&arm.ready, &to, &arm.limits).expect("a motion");
            let (v, w) = speeds(&arm.poses(&trajectory));
            assert!(v <= 1.005 * linear && w <= 1.005 * angular, "{v} {w}");
            assert!(v > 0.99 * linear || w > 0.99 * angular, "{v} {w}");
        }
    }
}

#[test]
fn a_line_with_limited_jerk_is_slower_and_its_acceleration_changes_gently() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let path = CartesianPath::line(&start, &moved(&start, [0.1, -0.1, 0.08], [0.3, 0.1, -0.4]));
        let options = CartesianOptions { max_linear_speed: 0.1, ..CartesianOptions::default() };
        let motion = follow(&arm, &path.expect("a line"), &options);
        let quick = motion.trajectory(&arm.limits).expect("a motion");
        let gentle = motion.trajectory_jerk_limited(&arm.limits).expect("a motion");
        let end = |trajectory: &JointTrajectory| {
            trajectory.waypoints[trajectory.waypoints.len() - 1].time_from_start_s
        };
        assert!(end(&gentle) > end(&quick) && end(&gentle) < end(&quick) + 0.3);
        let (v, _) = speeds(&arm.poses(&gentle));
        assert!(v <= 0.1005 && v > 0.099, "{v}");
        for pair in gentle.waypoints.windows(3) {
            let h = pair[1].time_from_start_s - pair[0].time_from_start_s;
            let after = pair[2].time_from_start_s - pair[1].time_from_start_s;
            for (joint, axis) in arm.limits.iter().enumerate() {
                let v = |i: usize| pair[i].joint_velocity[joint];
                // Mean accelerations of two steps, whose middles are half of both apart.
                let jerk = ((v(2) - v(1)) / after - (v(1) - v(0)) / h) / (0.5 * (h + after));
                assert!(jerk.abs() < 1.01 * axis.jerk, "{joint}: {jerk}");
            }
        }
    }
}

#[test]
fn a_blended_corner_is_passed_in_motion_and_a_sharp_one_at_rest() {
    for arm in arms() {
        let start = arm.pose(&arm.ready);
        let corner = moved(&start, [0.1, 0.0, 0.0], [0.0; 3]);
        let to = moved(&start, [0.1, 0.1, 0.0], [0.0; 3]);
        let mut durations = Vec::new();
        for radius in [0.0, 0.03] {
            let moves = [CartesianMove::line(corner).blended(radius), CartesianMove::line(to)];
            let path = CartesianPath::new(&start, &moves, DEFAULT_ROTATION_WEIGHT).expect("a path");
            let motion = follow(&arm, &path, &CartesianOptions::default());
            assert_eq!(motion.legs().len(), if radius > 0.0 { 1 } else { 2 });
            let trajectory = motion.trajectory(&arm.limits).expect("a motion");
            let poses = arm.poses(&trajectory);
            let near =
                |a: &&Pose, b: &&Pose| a.distance(&corner).0.total_cmp(&b.distance(&corner).0);
            let missed = poses.iter().min_by(near).expect("poses").distance(&corner).0;
            let expected = 0.375 * radius * 0.5_f64.sqrt();
            assert!((missed - expected).abs() < 2e-4, "{missed} {expected}");
            let at = poses.iter().position(|pose| pose.distance(&corner).0 == missed);
            let at = at.expect("the nearest").clamp(5, poses.len() - 6);
            let (speed, _) = speeds(&poses[at - 5..at + 5]);
            assert_eq!(speed > 0.03, radius > 0.0, "{speed}");
            durations.push(trajectory.waypoints[trajectory.waypoints.len() - 1].time_from_start_s);
        }
        assert!(durations[1] < 0.9 * durations[0], "{durations:?}");
    }
}

#[test]
fn limits_that_do_not_fit_the_chain_are_refused() {
    let arm = &arms()[0];
    let start = arm.pose(&arm.ready);
    let planner = CartesianPlanner::new(&arm.chain, &CartesianOptions::default()).expect("options");
    let joint = JointLimits { velocity: 1.0, acceleration: Some(1.0), ..JointLimits::default() };
    let limits = MotionLimits::new(&[joint; 5]).expect("complete");
    let to = moved(&start, [0.1, 0.0, 0.0], [0.0; 3]);
    let error = planner.line(&arm.ready, &to, &limits).expect_err("five of six");
    assert_eq!(error.to_string(), "limits of 5 joints, but the chain has 6");
    let error = planner.line(&arm.ready, &start, &arm.limits).expect_err("no line");
    assert!(matches!(error, CartesianError::Path(_)), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 64,
        rng_seed: RngSeed::Fixed(14),
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_line_is_followed_within_tolerance_or_refused_with_its_place(
        shift in prop::array::uniform3(-0.6..0.6),
        turn in prop::array::uniform3(-1.5..1.5),
        seven in any::<bool>(),
    ) {
        let arm = &arms()[usize::from(seven)];
        let start = arm.pose(&arm.ready);
        let path = CartesianPath::line(&start, &moved(&start, shift, turn));
        let path = path.expect("less than half a turn");
        let options = CartesianOptions::default();
        let planner = CartesianPlanner::new(&arm.chain, &options).expect("options");
        let part = planner.follow_reachable(&path, &arm.ready).expect("the start fits");
        prop_assert!((0.0..=1.0).contains(&part.fraction));
        prop_assert_eq!(part.fraction == 1.0, part.block.is_none());
        let Some(motion) = part.motion else {
            return Ok(());
        };
        let (distance, angle) = deviation(arm, &motion);
        prop_assert!(distance <= options.position_tolerance, "{}", distance);
        prop_assert!(angle <= options.angle_tolerance, "{}", angle);
        let trajectory = motion.trajectory(&arm.limits).expect("a motion");
        let end = arm.poses(&trajectory).pop().expect("poses");
        let (distance, angle) = end.distance(&path.pose_at(part.fraction * path.length()));
        prop_assert!(distance < 1e-6 && angle < 1e-6, "{} {}", distance, angle);
    }
}
