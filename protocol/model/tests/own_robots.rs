//! The robots of `config/robots`: their dimensions against the published ones.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
#![allow(non_snake_case, reason = "X_RB is the pose of frame B in frame R")]

mod common;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use armada_model::{JointType, RobotModel};
use nalgebra::{Isometry3, Matrix4, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Largest difference in any element of a transform.
const TOLERANCE: f64 = 1e-9;

/// Denavit–Hartenberg parameters `(a, d, alpha)` of the UR10e, joint by joint \[m, m, rad\].
///
/// Source: Universal Robots, "DH Parameters for calculations of kinematics and dynamics", UR10e.
const UR10E: [(f64, f64, f64); 6] = [
    (0.0, 0.1807, FRAC_PI_2),
    (-0.6127, 0.0, 0.0),
    (-0.57155, 0.0, 0.0),
    (0.0, 0.17415, FRAC_PI_2),
    (0.0, 0.11985, -FRAC_PI_2),
    (0.0, 0.11655, 0.0),
];

/// Denavit–Hartenberg parameters `(a, d, alpha)` of the Franka Research 3 with its flange, joint by
/// joint in Craig's convention \[m, m, rad\].
///
/// Source: Franka Robotics, FCI documentation, "Robot specifications".
const FR3: [(f64, f64, f64); 8] = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -FRAC_PI_2),
    (0.0, 0.316, FRAC_PI_2),
    (0.0825, 0.0, FRAC_PI_2),
    (-0.0825, 0.384, -FRAC_PI_2),
    (0.0, 0.0, FRAC_PI_2),
    (0.088, 0.0, FRAC_PI_2),
    (0.0, 0.107, 0.0),
];

/// Standard Denavit–Hartenberg matrix `Rz(q) Tz(d) Tx(a) Rx(alpha)`, written out.
fn denavit_hartenberg(q: f64, (a, d, alpha): (f64, f64, f64)) -> Matrix4<f64> {
    let ((sq, cq), (sa, ca)) = (q.sin_cos(), alpha.sin_cos());
    Matrix4::new(
        cq,
        -sq * ca,
        sq * sa,
        a * cq, //
        sq,
        cq * ca,
        -cq * sa,
        a * sq, //
        0.0,
        sa,
        ca,
        d, //
        0.0,
        0.0,
        0.0,
        1.0,
    )
}

/// Denavit–Hartenberg matrix in Craig's convention `Rx(alpha) Tx(a) Rz(q) Tz(d)`, written out.
fn craig(q: f64, (a, d, alpha): (f64, f64, f64)) -> Matrix4<f64> {
    let ((sq, cq), (sa, ca)) = (q.sin_cos(), alpha.sin_cos());
    Matrix4::new(
        cq,
        -sq,
        0.0,
        a, //
        sq * ca,
        cq * ca,
        -sa,
        -sa * d, //
        sq * sa,
        cq * sa,
        ca,
        ca * d, //
        0.0,
        0.0,
        0.0,
        1.0,
    )
}

fn tool0(model: &RobotModel, positions: &[f64]) -> Isometry3<f64> {
    let link = model.link_index("tool0").expect("there is a tool0");
    model.link_pose(positions, link).expect("positions fit")
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20_261_122);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(500))]

    #[test]
    fn the_arm_equals_the_published_table(positions in prop::array::uniform6(-TAU..TAU)) {
        let model = common::own_robot("six_axis_arm.urdf");
        let expected = positions
            .iter()
            .zip(UR10E)
            .fold(Matrix4::identity(), |product, (&q, row)| product * denavit_hartenberg(q, row));
        let difference = common::difference(&tool0(&model, &positions), &expected);
        prop_assert!(difference <= TOLERANCE, "off by {difference:e} at {positions:?}");
    }

    #[test]
    fn the_seven_axis_arm_equals_the_published_table(
        positions in prop::array::uniform7(-PI..PI)
    ) {
        let model = common::own_robot("seven_axis_arm.urdf");
        let angles = positions.iter().chain([&0.0]);
        let expected = angles
            .zip(FR3)
            .fold(Matrix4::identity(), |product, (&q, row)| product * craig(q, row));
        let difference = common::difference(&tool0(&model, &positions), &expected);
        prop_assert!(difference <= TOLERANCE, "off by {difference:e} at {positions:?}");
    }
}

#[test]
fn the_seven_axis_arm_has_the_vendors_kinematics_and_limits() {
    let Some(folder) = common::shared("robots/fr3") else { return };
    let (own, vendor) =
        (common::own_robot("seven_axis_arm.urdf"), common::load(&folder.join("fr3.urdf")));
    for (own, vendor) in own.variables().zip(vendor.variables()).take(7) {
        assert_eq!(vendor.name, format!("fr3_{}", own.name.replace('_', "")));
        assert_eq!(own.motion.limits, vendor.motion.limits, "{}", own.name);
    }
    let flange = vendor.link_index("fr3_link8").expect("the vendor has a flange");
    let ready = [0.1, -FRAC_PI_2 / 2.0, 0.2, -2.3, 0.4, 1.6, 0.8];
    let fingers = vec![0.0; vendor.variable_count() - 7];
    let positions = [&ready[..], &fingers[..]].concat();
    let X_RF = vendor.link_pose(&positions, flange).expect("positions fit");
    let difference = common::difference(&tool0(&own, &ready), &X_RF.to_homogeneous());
    assert!(difference <= TOLERANCE, "off by {difference:e}");
}

#[test]
fn the_arm_equals_the_vendors_description_in_the_frame_named_base() {
    let Some(folder) = common::shared("robots/ur10e") else { return };
    let (own, vendor) =
        (common::own_robot("six_axis_arm.urdf"), common::load(&folder.join("ur10e.urdf")));
    let base = vendor.link_index("base").expect("the vendor has a base");
    for positions in
        [[0.0; 6], [0.3, -1.2, 1.9, -2.4, -1.1, 5.0], [-6.0, 2.0, -3.0, 1.0, 4.0, -0.5]]
    {
        let X_RB = vendor.link_pose(&positions, base).expect("positions fit");
        let X_BT = X_RB.inverse() * tool0(&vendor, &positions);
        let difference = common::difference(&tool0(&own, &positions), &X_BT.to_homogeneous());
        assert!(difference <= TOLERANCE, "off by {difference:e} at {positions:?}");
    }
}

#[test]
fn the_arm_has_the_published_limits() {
    let model = common::own_robot("six_axis_arm.urdf");
    let names: Vec<_> = model.variables().map(|variable| variable.name).collect();
    let expected = [
        ("shoulder_pan_joint", TAU, 120.0, 330.0),
        ("shoulder_lift_joint", TAU, 120.0, 330.0),
        ("elbow_joint", PI, 180.0, 150.0),
        ("wrist_1_joint", TAU, 180.0, 56.0),
        ("wrist_2_joint", TAU, 180.0, 56.0),
        ("wrist_3_joint", TAU, 180.0, 56.0),
    ];
    assert_eq!(names, expected.map(|(name, ..)| name));
    for (variable, (name, range, degrees_per_s, effort)) in model.variables().zip(expected) {
        let limits = variable.motion.limits;
        assert_eq!(variable.motion.joint_type, JointType::Revolute, "{name}");
        assert_eq!((limits.lower, limits.upper), (Some(-range), Some(range)), "{name}");
        assert!((limits.velocity - f64::to_radians(degrees_per_s)).abs() < 1e-12, "{name}");
        assert_eq!(limits.effort, Some(effort), "{name}");
    }
}

#[test]
fn flange_and_tool0_are_one_point_with_x_and_z_outwards() {
    let model = common::own_robot("six_axis_arm.urdf");
    let positions = [0.3, -1.2, 1.9, -2.4, -1.1, 5.0];
    let flange = model.link_index("flange").expect("there is a flange");
    let X_RF = model.link_pose(&positions, flange).expect("positions fit");
    let X_RT = tool0(&model, &positions);
    assert!((X_RF.translation.vector - X_RT.translation.vector).amax() < TOLERANCE);
    let outwards = (X_RF.rotation * Vector3::x(), X_RT.rotation * Vector3::z());
    assert!((outwards.0 - outwards.1).amax() < TOLERANCE, "{outwards:?}");
}

#[test]
fn the_torso_lifts_carriage_and_head_straight_up() {
    let model = common::own_robot("lift_torso.urdf");
    let lift = model.variables().next().expect("one driven joint");
    assert_eq!((lift.name, model.variable_count()), ("lift_joint", 1));
    assert_eq!(lift.motion.joint_type, JointType::Prismatic);
    let limits = lift.motion.limits;
    assert_eq!((limits.lower, limits.upper, limits.velocity), (Some(0.0), Some(0.5), 0.15));
    let (down, up) = (common::link_poses(&model, &[0.0]), common::link_poses(&model, &[0.5]));
    for (link, rises) in [("base_link", 0.0), ("column", 0.0), ("carriage", 0.5), ("head", 0.5)] {
        let index = model.link_index(link).expect("the link exists");
        let shift = up[index].translation.vector - down[index].translation.vector;
        assert!((shift - Vector3::z() * rises).amax() < 1e-15, "{link} moved by {shift}");
    }
}

#[test]
fn own_robots_are_drawn_without_meshes() {
    for file in ["six_axis_arm.urdf", "seven_axis_arm.urdf", "lift_torso.urdf"] {
        let model = common::own_robot(file);
        for link in model.links() {
            let is_frame = matches!(link.name.as_str(), "flange" | "tool0");
            assert_ne!(link.visuals.is_empty(), !is_frame, "{file} {}", link.name);
            assert_eq!(link.visuals.is_empty(), link.collisions.is_empty(), "{file} {}", link.name);
            for visual in &link.visuals {
                assert!(visual.colour.is_some(), "{file} {}: no colour", link.name);
                let is_mesh = matches!(visual.shape, armada_model::Shape::Mesh { .. });
                assert!(!is_mesh, "{file} {}: mesh", link.name);
            }
        }
    }
}
