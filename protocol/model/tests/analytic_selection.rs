//! Selecting one of the postures: singularities, limits, reach.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod analytic_arms;
mod common;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use analytic_arms::{Axes, Convention, Subject, angles, distance, for_random};
use armada_model::{
    AnalyticArm, AnalyticError, BeyondLimit, Branch, BranchError, Configuration, Elbow,
    JointLimits, JointVector, RobotModel, Selection, Shoulder, Wrist,
};
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

const NEAREST: Selection = Selection::Nearest { weights: JointVector::EMPTY };

fn recognised(model: RobotModel, base: &str, tip: &str) -> (Subject, AnalyticArm) {
    let arm = AnalyticArm::recognise(&model, base, tip).unwrap_or_else(|error| panic!("{error}"));
    (Subject::new(model, base, tip, arm.variables()), arm)
}

/// UR10e dimensions; joint 3 within half a turn, the others within a turn to either side.
fn own() -> (Subject, AnalyticArm) {
    recognised(common::own_robot("six_axis_arm.urdf"), "base_link", "tool0")
}

/// An arm with spherical wrist and without shoulder offset, each joint within ±3.2 rad.
fn industrial() -> (Subject, AnalyticArm) {
    let axes = Axes::ortho_parallel([0.0, 0.04, 0.0, 0.4, 0.45, 0.45, 0.08]);
    recognised(axes.model(&Convention::plain()), "base", "tool")
}

fn assert_exact(subject: &Subject, branch: &Branch, target: &Isometry3<f64>, limit: f64) {
    let error = subject.error(&branch.joint_position, target);
    assert!(error <= limit, "{branch:?} off by {error:e}");
}

#[test]
fn the_nearest_posture_is_the_one_the_pose_comes_from() {
    let (subject, arm) = own();
    let within = angles::<6>().prop_map(|q| [2.0 * q[0], 2.0 * q[1], q[2], q[3], q[4], 2.0 * q[5]]);
    for_random(500, within, |q| {
        let chosen = arm
            .select(&subject.pose(&q), &q, &NEAREST)
            .map_err(|error| TestCaseError::fail(error.to_string()))?;
        let apart =
            chosen.joint_position.max_abs_difference(&JointVector::from_slice(&q).expect("6"));
        prop_assert!(apart < 1e-6, "whole turns included, {apart:e} from {q:?}");
        Ok(())
    });
}

#[test]
fn weights_decide_which_posture_is_nearest() {
    let (subject, arm) = own();
    let reference = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];
    let target = subject.pose(&[0.3, -1.2, 1.9, -2.4, 1.1, 0.5]);
    let cost = |branch: &Branch, weights: &[f64; 6]| {
        let near = arm.within_limits(branch, &reference).expect("wide limits");
        let squares = near.joint_position.iter().zip(reference).map(|(a, b)| (a - b).powi(2));
        squares.zip(weights).map(|(square, weight)| square * weight).sum::<f64>()
    };
    for weights in [[1.0; 6], [0.0, 0.0, 0.0, 0.0, 100.0, 0.0], [100.0, 1.0, 1.0, 0.0, 0.0, 0.0]] {
        let selection =
            Selection::Nearest { weights: JointVector::from_slice(&weights).expect("six") };
        let chosen = arm.select(&target, &reference, &selection).expect("within reach");
        for other in arm.solve_near(&target, &reference).iter() {
            assert!(cost(&chosen, &weights) <= cost(other, &weights) + 1e-9, "{other:?}");
        }
    }
}

#[test]
fn each_configuration_can_be_selected() {
    let (subject, arm) = own();
    let reference = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];
    let target = subject.pose(&reference);
    let branches = arm.solve(&target);
    assert_eq!(branches.len(), 8);
    for branch in branches.iter() {
        let selection = Selection::Configuration(branch.configuration);
        let chosen = arm.select(&target, &reference, &selection).expect("available");
        assert_eq!(chosen.configuration, branch.configuration);
        assert!(distance(&chosen.joint_position, &branch.joint_position) < 1e-9);
        assert_exact(&subject, &chosen, &target, 1e-9);
    }
}

#[test]
fn letters_mean_what_they_say() {
    let (subject, arm) = industrial();
    let front_up = |q: &[f64; 6]| arm.solve(&subject.pose(q));
    let q = [0.4, 0.3, 0.9, 0.2, 0.7, -0.3];
    for branch in front_up(&q).iter() {
        let q = &branch.joint_position;
        let Configuration { shoulder, elbow, wrist } = branch.configuration;
        let (lean, lift) = (q[1], q[1] + q[2]);
        let (forth, up) = (0.45 * lean.sin() + 0.45 * lift.sin() + 0.04 * lift.cos(), lean.cos());
        assert_eq!(shoulder == Shoulder::Front, forth > 0.0, "{branch:?}");
        assert_eq!(wrist == Wrist::NoFlip, q[4] > 0.0, "{branch:?}");
        // The elbow is above the line to the wrist, at its height where it crosses the elbow.
        let rise = 0.45 * lean.cos() + 0.45 * lift.cos() - 0.04 * lift.sin();
        let above = 0.45 * up - rise * 0.45 * lean.sin() / forth;
        assert_eq!(elbow == Elbow::Up, above > 0.0, "{branch:?}: {above}");
    }
}

#[test]
fn a_stretched_wrist_keeps_joint_4_of_the_reference() {
    let (subject, arm) = industrial();
    for fold in [0.0, PI] {
        let q = [0.4, 0.3, 0.9, 0.8, fold, -0.3];
        let target = subject.pose(&q);
        let chosen = arm.select(&target, &q, &NEAREST).expect("within reach");
        assert!(chosen.singular.wrist && !chosen.singular.elbow && !chosen.singular.shoulder);
        assert!(distance(&chosen.joint_position, &q) < 1e-7, "{chosen:?}");
        let other = [0.4, 0.3, 0.9, -0.5, fold, 0.0];
        let chosen = arm.select(&target, &other, &NEAREST).expect("within reach");
        assert_eq!(chosen.joint_position[3], -0.5);
        assert_exact(&subject, &chosen, &target, 1e-9);
    }
}

#[test]
fn parallel_axes_of_wrist_and_elbow_keep_joint_6_of_the_reference() {
    let (subject, arm) = own();
    let q = [0.3, -1.2, 1.9, -0.4, 0.0, 0.5];
    let target = subject.pose(&q);
    let chosen = arm.select(&target, &q, &NEAREST).expect("within reach");
    assert!(chosen.singular.wrist && distance(&chosen.joint_position, &q) < 1e-7, "{chosen:?}");
    let other = [0.3, -1.2, 1.9, -0.4, 0.0, 0.9];
    let chosen = arm.select(&target, &other, &NEAREST).expect("within reach");
    assert!(chosen.singular.wrist);
    assert_eq!(chosen.joint_position[5], 0.9);
    assert_exact(&subject, &chosen, &target, 1e-9);
}

#[test]
fn a_reference_out_of_reach_at_a_singularity_does_not_lose_the_pose() {
    let (subject, arm) = own();
    for_random(2000, (angles::<6>(), -PI..PI), |(mut q, wrist_3)| {
        q[4] = 0.0;
        let target = subject.pose(&q);
        let reference = [q[0], q[1], q[2], q[3], q[4], wrist_3];
        let branches = arm.solve_near(&target, &reference);
        prop_assert!(!branches.is_empty(), "joint 6 at {wrist_3}, {q:?}");
        for branch in branches.iter() {
            let error = subject.error(&branch.joint_position, &target);
            prop_assert!(error <= 1e-6, "{branch:?} off by {error:e}");
        }
        Ok(())
    });
}

#[test]
fn a_stretched_elbow_is_one_posture_and_says_so() {
    for ((subject, arm), stretched) in [(own(), 0.0), (industrial(), -(0.04_f64 / 0.45).atan())] {
        let q = [0.3, -0.7, stretched, -0.4, 0.8, 0.5];
        let target = subject.pose(&q);
        let chosen = arm.select(&target, &q, &NEAREST).expect("within reach");
        assert!(chosen.singular.elbow && !chosen.singular.wrist, "{chosen:?}");
        assert!(distance(&chosen.joint_position, &q) < 1e-6, "{chosen:?}");
        assert_exact(&subject, &chosen, &target, 1e-9);
        for elbow in [Elbow::Up, Elbow::Down] {
            let wanted = Configuration { elbow, ..chosen.configuration };
            let again = arm.select(&target, &q, &Selection::Configuration(wanted));
            assert_eq!(again, Ok(chosen), "both letters mean this posture");
        }
    }
}

#[test]
fn a_wrist_on_axis_1_keeps_joint_1_of_the_reference() {
    let (subject, arm) = industrial();
    // Where 0.45 sin(q2) + 0.45 sin(q2 + q3) + 0.04 cos(q2 + q3) is zero.
    let (lean, length) = (-0.5_f64, 0.45_f64.hypot(0.04));
    let lift = (-0.45 * lean.sin() / length).asin() - 0.04_f64.atan2(0.45);
    let q = [0.7, lean, lift - lean, 0.3, 0.8, 0.5];
    let target = subject.pose(&q);
    for pan in [0.7, -1.3] {
        let reference = [pan, q[1], q[2], q[3], q[4], q[5]];
        let chosen = arm.select(&target, &reference, &NEAREST).expect("within reach");
        assert!(chosen.singular.shoulder, "{chosen:?}");
        assert_eq!(chosen.joint_position[0], pan);
        assert_exact(&subject, &chosen, &target, 1e-9);
    }
}

#[test]
fn near_singularities_each_answer_is_exact_to_a_micrometre() {
    for (subject, arm) in [own(), industrial()] {
        for exponent in 5..14 {
            let small = 10.0_f64.powi(-exponent);
            for q in [
                [0.3, -1.2, 1.4, -0.4, small, 0.5],
                [0.3, -1.2, small, -0.4, 0.9, 0.5],
                [0.3, -1.2, small, -0.4, small, 0.5],
                [0.3, -1.2, 1.4, -0.4, PI - small, 0.5],
            ] {
                let target = subject.pose(&q);
                let chosen = arm.select(&target, &q, &NEAREST);
                let chosen = chosen.unwrap_or_else(|error| panic!("{q:?}: {error}"));
                assert!(distance(&chosen.joint_position, &q) < 1e-5, "{q:?}: {chosen:?}");
                for branch in arm.solve_near(&target, &q).iter() {
                    assert_exact(&subject, branch, &target, 1e-6);
                }
            }
        }
    }
}

#[test]
fn a_pose_out_of_reach_says_by_how_much() {
    let (subject, arm) = industrial();
    let q = [0.0, 0.6, -(0.04_f64 / 0.45).atan(), 0.3, 0.8, 0.5];
    // Stretched; further along the line from shoulder to wrist.
    let away = Vector3::new(0.6_f64.sin(), 0.0, 0.6_f64.cos()) * 0.125;
    let target = nalgebra::Translation3::from(away) * subject.pose(&q);
    let Err(BranchError::OutOfReach { excess_m }) = arm.select(&target, &q, &NEAREST) else {
        panic!("reached");
    };
    assert!((excess_m - 0.125).abs() < 1e-9, "{excess_m}");
    assert_eq!(arm.solve(&target).out_of_reach_m(), Some(excess_m));
    assert_eq!(arm.solve(&subject.pose(&q)).out_of_reach_m(), None);
}

#[test]
fn a_wrist_too_near_to_axis_1_says_by_how_much() {
    let (subject, arm) = own();
    let table = 0.17415 - 0.1;
    // Axes 5 and 6 meet 0.1 m from axis 1, but always are 0.17415 m from the plane of the arm.
    let target = Isometry3::from_parts(
        Vector3::new(0.1, 0.0, 0.9 + 0.11655).into(),
        nalgebra::UnitQuaternion::identity(),
    );
    let Some(excess_m) = arm.solve(&target).out_of_reach_m() else { panic!("reached") };
    assert!((excess_m - table).abs() < 1e-9, "{excess_m} of {}", subject.name);
}

#[test]
fn limits_refuse_with_joint_value_and_limit() {
    let (subject, arm) = own();
    let q = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];
    let narrow = |lower, upper| JointLimits {
        lower: Some(lower),
        upper: Some(upper),
        ..JointLimits::default()
    };
    let mut limits = [JointLimits::default(); 6];
    limits[5] = narrow(8.0, 9.0);
    let arm = arm.with_limits(&limits).expect("six limits");
    let target = subject.pose(&q);
    let Err(BranchError::BeyondLimits { beyond }) = arm.select(&target, &q, &NEAREST) else {
        panic!("no limit refused");
    };
    assert_eq!(beyond.len(), 8);
    for (_, BeyondLimit { joint, value_rad, limit_rad }) in &beyond {
        assert_eq!(*joint, 5);
        assert!((*value_rad > 9.0 && *limit_rad == 9.0) || (*value_rad < 8.0 && *limit_rad == 8.0));
    }
    limits[5] = narrow(6.0, 7.0);
    let arm = arm.with_limits(&limits).expect("six limits");
    let chosen = arm.select(&target, &q, &NEAREST).expect("0.5 rad and a turn is within");
    assert!((chosen.joint_position[5] - (0.5 + TAU)).abs() < 1e-9, "{chosen:?}");
    assert_eq!(
        arm.with_limits(&limits[..5]).map(drop),
        Err(AnalyticError::LimitCount { expected: 6, given: 5 })
    );
}

#[test]
fn a_joint_on_its_limit_is_within() {
    let (subject, arm) = own();
    let q = [TAU, -FRAC_PI_2, PI - 0.5, -TAU, 1.0, TAU];
    let chosen = arm.select(&subject.pose(&q), &q, &NEAREST).expect("on the limits");
    assert!(chosen.joint_position.iter().zip(q).all(|(a, b)| (a - b).abs() < 1e-8), "{chosen:?}");
    assert!(chosen.joint_position.iter().all(|value| value.abs() <= TAU));
}

#[test]
fn a_posture_that_does_not_exist_is_refused_with_those_that_do() {
    let (subject, arm) = own();
    // Near axis 1 and low: reached from fewer sides.
    let q = [0.3, 0.3, 0.1, -0.4, 1.1, 0.5];
    let target = subject.pose(&q);
    let exist = arm.solve(&target);
    assert!(exist.len() < 8, "{exist:?}");
    let mut refused = 0;
    for shoulder in [Shoulder::Front, Shoulder::Back] {
        for elbow in [Elbow::Up, Elbow::Down] {
            for wrist in [Wrist::NoFlip, Wrist::Flip] {
                let wanted = Configuration { shoulder, elbow, wrist };
                let Err(error) = arm.select(&target, &q, &Selection::Configuration(wanted)) else {
                    continue;
                };
                let available = exist.iter().map(|branch| branch.configuration).collect();
                assert_eq!(error, BranchError::NotAvailable { wanted, available });
                refused += 1;
            }
        }
    }
    assert_eq!(refused, 8 - exist.len());
}

#[test]
fn arguments_that_do_not_fit_are_refused() {
    let (subject, arm) = own();
    let target = subject.pose(&[0.1; 6]);
    let refusal = |target: &Isometry3<f64>, reference: &[f64], selection: &Selection| {
        arm.select(target, reference, selection).map_err(Box::new)
    };
    assert_eq!(
        refusal(&target, &[0.0; 5], &NEAREST),
        Err(Box::new(BranchError::ReferenceLength { expected: 6, given: 5 }))
    );
    let weights = JointVector::zeros(7).expect("seven");
    assert_eq!(
        refusal(&target, &[0.0; 6], &Selection::Nearest { weights }),
        Err(Box::new(BranchError::WeightLength { expected: 6, given: 7 }))
    );
    assert_eq!(
        refusal(&target, &[f64::NAN; 6], &NEAREST),
        Err(Box::new(BranchError::NotFinite { field: "reference" }))
    );
    let nowhere = Isometry3::translation(f64::INFINITY, 0.0, 0.0);
    assert_eq!(
        refusal(&nowhere, &[0.0; 6], &NEAREST),
        Err(Box::new(BranchError::NotFinite { field: "target" }))
    );
    assert_eq!(arm.solve(&nowhere).out_of_reach_m(), Some(f64::INFINITY));
}
