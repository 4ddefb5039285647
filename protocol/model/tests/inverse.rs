//! Inverse kinematics: what is reachable is found, inside the limits, and the same each time.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B")]

mod common;
mod inverse_common;

use std::f64::consts::{PI, TAU};

use armada_model::{
    Chain, InverseKinematics, InverseOptions, InverseTarget, PreferredPosture, Residual,
};
use inverse_common::{Random, off, own, posture, shared, solver};
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const TOLERANCE: Residual = Residual { position: 1e-5, orientation: 1e-5 };

/// How many of `count` random reachable poses are found from unrelated seeds, each checked.
fn found(chain: &Chain, count: usize) -> usize {
    let solver = solver(chain);
    let mut random = Random::new(20_261_122);
    let solved = (0..count).filter(|_| {
        let target =
            InverseTarget::Pose(chain.forward(&posture(chain, &mut random)).expect("fits"));
        let Ok(solution) = solver.solve(&posture(chain, &mut random), &target) else {
            return false;
        };
        let residual = off(chain, &solution.positions, &target);
        assert!(residual.position <= TOLERANCE.position, "{residual:?}");
        assert!(residual.orientation <= TOLERANCE.orientation, "{residual:?}");
        assert!(inside(chain, &solution.positions, 0.0), "{:?}", solution.positions);
        true
    });
    solved.count()
}

fn inside(chain: &Chain, positions: &[f64], margin: f64) -> bool {
    positions.iter().zip(chain.variables()).all(|(&q, variable)| {
        variable.limits.lower.is_none_or(|lower| q >= lower + margin)
            && variable.limits.upper.is_none_or(|upper| q <= upper - margin)
    })
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20_261_122);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

#[test]
fn every_reachable_pose_of_five_arms_is_found() {
    for (urdf, base, tip) in [
        ("panda/panda.urdf", "panda_link0", "panda_hand"),
        ("ur5e/ur5e.urdf", "base_link", "tool0"),
        ("iiwa14/iiwa14.urdf", "base", "iiwa_link_ee"),
        ("realman/rm_75.urdf", "base_link", "Link7"),
        ("fr3/fr3.urdf", "fr3_link0", "fr3_hand_tcp"),
    ] {
        let Some(chain) = shared(urdf, base, tip) else { return };
        assert_eq!(found(&chain, 200), 200, "{urdf}");
    }
}

#[test]
fn every_reachable_pose_of_our_own_arms_is_found() {
    for file in ["six_axis_arm.urdf", "seven_axis_arm.urdf"] {
        assert_eq!(found(&own(file), 200), 200, "{file}");
    }
}

#[test]
fn chains_with_sliding_and_mimic_joints_and_of_other_lengths_are_solved() {
    for (urdf, base, tip) in [
        ("hsrb/hsrb4s.urdf", "base_link", "hand_palm_link"),
        ("stretch/stretch_se3_dw3_sg3.urdf", "base_link", "link_grasp_center"),
        ("pr2/pr2.urdf", "base_link", "r_gripper_tool_frame"),
        ("pr2/pr2.urdf", "l_gripper_tool_frame", "r_gripper_tool_frame"),
        ("vega/vega_1_gripper.urdf", "base", "L_ee"),
    ] {
        let Some(chain) = shared(urdf, base, tip) else { return };
        let count = found(&chain, 50);
        assert!(count >= 49, "{urdf} {tip}, {} variables: {count} of 50", chain.len());
    }
}

#[test]
fn warm_solutions_follow_a_path_without_jumps() {
    for file in ["six_axis_arm.urdf", "seven_axis_arm.urdf"] {
        let chain = own(file);
        let solver = solver(&chain);
        let mut q = [0.2, -1.0, 1.2, -1.6, 1.3, 1.5, 0.4][..chain.len()].to_vec();
        let start = chain.forward(&q).expect("fits");
        for step in 0_u32..400 {
            let angle = TAU * f64::from(step) / 400.0;
            let shift = Vector3::new(angle.cos() - 1.0, angle.sin(), 0.3 * angle.sin()) * 0.08;
            let turn = Isometry3::rotation(Vector3::z() * (0.2 * angle.sin()));
            let X_BT = Isometry3::from_parts(
                (start.translation.vector + shift).into(),
                turn.rotation * start.rotation,
            );
            let solution = solver.solve_warm(&q, &InverseTarget::Pose(X_BT)).expect("on the path");
            assert_eq!(solution.starts, 1);
            let moved = solution.positions.iter().zip(&q).map(|(a, b)| (a - b).abs());
            assert!(moved.fold(0.0, f64::max) < 0.02, "{file} step {step}");
            q = solution.positions.to_vec();
        }
    }
}

#[test]
fn targets_that_leave_freedom_are_reached_in_what_they_ask_for() {
    for file in ["six_axis_arm.urdf", "seven_axis_arm.urdf"] {
        let chain = own(file);
        let solver = solver(&chain);
        let mut random = Random::new(7);
        for _ in 0..100 {
            let X_BT = chain.forward(&posture(&chain, &mut random)).expect("fits");
            let tool_axis = nalgebra::Unit::new_normalize(Vector3::new(0.1, -0.2, 1.0));
            let position = X_BT.translation.vector;
            for target in [
                InverseTarget::Position(position),
                InverseTarget::Orientation(X_BT.rotation),
                InverseTarget::Axis { position, tool_axis, direction: X_BT.rotation * tool_axis },
            ] {
                let seed = posture(&chain, &mut random);
                let solution = solver.solve(&seed, &target).expect("reachable");
                let residual = off(&chain, &solution.positions, &target);
                assert!(residual.position <= TOLERANCE.position, "{target:?}");
                assert!(residual.orientation <= TOLERANCE.orientation, "{target:?}");
                assert!((residual.position - solution.residual.position).abs() < 1e-12);
                assert!(inside(&chain, &solution.positions, 0.0), "{target:?}");
            }
        }
    }
}

#[test]
fn a_preferred_posture_is_approached_without_leaving_the_target() {
    let chain = own("seven_axis_arm.urdf");
    let preferred = PreferredPosture::new(
        armada_model::JointVector::from_slice(&[0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8])
            .expect("fits"),
    );
    let plain = solver(&chain);
    let options = InverseOptions { preferred: Some(preferred), ..inverse_common::options() };
    let drawn = InverseKinematics::new(&chain, options);
    let mut random = Random::new(3);
    let (mut before, mut after) = (0.0, 0.0);
    for _ in 0..100 {
        let X_BT = chain.forward(&posture(&chain, &mut random)).expect("fits");
        let seed = posture(&chain, &mut random);
        for target in [InverseTarget::Pose(X_BT), InverseTarget::Position(X_BT.translation.vector)]
        {
            let from = plain.solve(&seed, &target).expect("reachable").positions;
            let to = drawn.solve(&seed, &target).expect("reachable").positions;
            let distances = (preferred.squared_distance(&from), preferred.squared_distance(&to));
            assert!(distances.1 <= distances.0, "{distances:?}");
            let residual = off(&chain, &to, &target);
            assert!(residual.position <= TOLERANCE.position, "{residual:?}");
            assert!(residual.orientation <= TOLERANCE.orientation, "{residual:?}");
            assert!(inside(&chain, &to, 0.0), "{to:?}");
            before += distances.0;
            after += distances.1;
        }
    }
    assert!(after < 0.65 * before, "from {before} to {after} rad²");
}

#[test]
fn the_posture_reached_is_the_nearest_of_all_that_turn_the_elbow() {
    // The redundancy of a seven-axis arm is one number: scan it through the first joint.
    let chain = own("seven_axis_arm.urdf");
    let wanted = [0.3, -0.5, 0.2, -2.0, 0.1, 1.6, 0.5];
    let preferred =
        PreferredPosture::new(armada_model::JointVector::from_slice(&wanted).expect("fits"));
    let options = InverseOptions { preferred: Some(preferred), ..inverse_common::options() };
    let drawn = InverseKinematics::new(&chain, options);
    let plain = solver(&chain);
    let start = [0.6, -0.4, -0.3, -1.8, 0.3, 1.5, 0.7];
    let target = InverseTarget::Pose(chain.forward(&start).expect("fits"));
    let reached = drawn.solve(&start, &target).expect("reachable").positions;
    let reached = preferred.squared_distance(&reached);
    // Other postures: pull one joint aside, and let the solver return to the target.
    let mut nearest = f64::INFINITY;
    for step in -60_i32..60 {
        let mut pulled = start;
        pulled[2] += f64::from(step) * 0.02;
        if let Ok(other) = plain.solve_warm(&pulled, &target) {
            nearest = nearest.min(preferred.squared_distance(&other.positions));
        }
    }
    assert!(reached <= nearest * (1.0 + 1e-4), "{reached} > {nearest}");
}

#[test]
fn joints_that_turn_more_than_once_end_as_near_to_the_seed_as_limits_allow() {
    let chain = own("six_axis_arm.urdf");
    let solver = solver(&chain);
    let mut random = Random::new(11);
    for _ in 0..100 {
        let target =
            InverseTarget::Pose(chain.forward(&posture(&chain, &mut random)).expect("fits"));
        let seed: Vec<f64> = posture(&chain, &mut random).iter().map(|q| 1.99 * q).collect();
        let solution = solver.solve(&seed, &target).expect("reachable");
        for (k, variable) in chain.variables().iter().enumerate() {
            let (q, seed) = (solution.positions[k], seed[k]);
            let nearer = [q - TAU, q + TAU].into_iter().find(|&other| {
                variable.limits.contains(other) && (other - seed).abs() < (q - seed).abs()
            });
            assert_eq!(nearer, None, "joint {k} at {q}, seed {seed}");
        }
    }
}

#[test]
fn a_margin_keeps_solutions_away_from_limits() {
    let chain = own("seven_axis_arm.urdf");
    let options = InverseOptions { limit_margin: 0.1, ..inverse_common::options() };
    let solver = InverseKinematics::new(&chain, options);
    let mut random = Random::new(5);
    let solved = (0..50).filter(|_| {
        let target =
            InverseTarget::Pose(chain.forward(&posture(&chain, &mut random)).expect("fits"));
        let solution = solver.solve(&posture(&chain, &mut random), &target);
        solution.is_ok_and(|solution| {
            assert!(inside(&chain, &solution.positions, 0.1), "{:?}", solution.positions);
            true
        })
    });
    assert!(solved.count() > 40);
}

#[test]
fn equal_questions_have_equal_answers() {
    let chain = own("seven_axis_arm.urdf");
    let (one, other) = (solver(&chain), solver(&chain));
    let mut random = Random::new(13);
    for _ in 0..50 {
        let target =
            InverseTarget::Pose(chain.forward(&posture(&chain, &mut random)).expect("fits"));
        let seed = posture(&chain, &mut random);
        let answer = one.solve(&seed, &target);
        assert_eq!(answer, one.solve(&seed, &target));
        assert_eq!(answer, other.solve(&seed, &target));
    }
}

proptest! {
    #![proptest_config(config(150))]

    #[test]
    fn limits_are_kept_and_residuals_told_whatever_the_target(
        p in prop::array::uniform3(-1.2..1.2),
        w in prop::array::uniform3(-3.0..3.0),
        seed in prop::array::uniform7(-PI..PI),
        kind in 0..4,
    ) {
        let chain = own("seven_axis_arm.urdf");
        let options = InverseOptions { starts: 20, ..inverse_common::options() };
        let solver = InverseKinematics::new(&chain, options);
        let X_BT = Isometry3::new(Vector3::from(p), Vector3::from(w));
        let position = X_BT.translation.vector;
        let target = match kind {
            0 => InverseTarget::Pose(X_BT),
            1 => InverseTarget::Position(position),
            2 => InverseTarget::Orientation(X_BT.rotation),
            _ => {
                let (tool_axis, direction) = (Vector3::z_axis(), X_BT.rotation * Vector3::z_axis());
                InverseTarget::Axis { position, tool_axis, direction }
            }
        };
        for answer in [solver.solve(&seed, &target), solver.solve_warm(&seed, &target)] {
            let (positions, told) = match answer {
                Ok(solution) => (solution.positions, solution.residual),
                Err(failure) => (failure.positions, failure.residual),
            };
            prop_assert!(inside(&chain, &positions, 0.0), "{positions:?}");
            let residual = off(&chain, &positions, &target);
            prop_assert!((told.position - residual.position).abs() < 1e-9);
            prop_assert!((told.orientation - residual.orientation).abs() < 1e-7);
        }
    }
}
