//! Jacobians and twists against finite differences, and at known singularities.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B")]

mod common;

use std::f64::consts::FRAC_PI_2;

use armada_model::{Chain, ChainError, Damping, Jacobian, Pose, RobotModel, Twist, Wrench};
use nalgebra::{Isometry3, Matrix6, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Step of a finite difference \[rad or m\]; its error is about the step's square.
const STEP: f64 = 1e-5;

const TOLERANCE: f64 = 1e-8;

fn own_robots() -> Vec<RobotModel> {
    let files = ["six_axis_arm.urdf", "seven_axis_arm.urdf", "lift_torso.urdf"];
    files.iter().map(|file| common::own_robot(file)).collect()
}

/// Our own robots and, where they are, the shared ones.
fn robots() -> Vec<RobotModel> {
    let mut models = own_robots();
    let Some(folder) = common::shared("robots") else { return models };
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("the folder is readable")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_dir())
        .flat_map(|path| std::fs::read_dir(path).expect("the folder is readable"))
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "urdf"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 19, "shared robots are missing");
    models.extend(files.iter().map(|file| common::load(file)));
    models
}

/// Chains from the root to every leaf that moves.
fn chains(model: &RobotModel) -> Vec<Chain> {
    let carries = |link: usize| model.joints().iter().any(|joint| joint.parent == link);
    let leaves = model.links().iter().enumerate().filter(|(index, _)| !carries(*index));
    leaves
        .filter_map(|(_, link)| match Chain::from_root(model, &link.name) {
            Ok(chain) => Some(chain),
            Err(ChainError::Rigid { .. }) => None,
            Err(error) => panic!("{}: {error}", model.name()),
        })
        .collect()
}

/// Difference of two near poses per time `dt`.
fn rate(from: &Isometry3<f64>, to: &Isometry3<f64>, dt: f64) -> Twist {
    let linear = (to.translation.vector - from.translation.vector) / dt;
    let angular = (to.rotation * from.rotation.inverse()).scaled_axis() / dt;
    Twist::new(linear, angular)
}

fn distance(a: &Twist, b: &Twist) -> f64 {
    (a.to_vector() - b.to_vector()).amax()
}

/// Rate of the TCP by a central difference, if the variables move with `velocities`.
fn moved(chain: &Chain, positions: &[f64], velocities: &[f64]) -> Twist {
    let at = |time: f64| {
        let moved: Vec<f64> = positions.iter().zip(velocities).map(|(q, v)| q + v * time).collect();
        chain.forward(&moved).expect("positions fit")
    };
    rate(&at(-STEP), &at(STEP), 2.0 * STEP)
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20_261_122);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

#[test]
fn chains_of_all_robots_agree_with_finite_differences_and_with_the_pose_of_the_link() {
    let columns = std::cell::Cell::new(0);
    let tool = Pose::from_isometry(Isometry3::new(
        Vector3::new(0.05, -0.1, 0.2),
        Vector3::new(0.3, 0.2, 0.1),
    ));
    for model in robots() {
        // A runner stops for good after its cases.
        let mut runner = proptest::test_runner::TestRunner::new(config(3));
        let count = model.variable_count();
        let values = prop::collection::vec(-3.0..3.0, count);
        let outcome = runner.run(&(values.clone(), values), |(positions, velocities)| {
            for chain in chains(&model) {
                let link = model.link_index(chain.tip()).expect("the tip exists");
                let q = chain.gather(&positions).expect("fits");
                let v = chain.gather(&velocities).expect("fits");
                let (X_BT, jacobian) = chain.forward_and_jacobian(&q).expect("fits");
                let (X_RL, V_RL) = model.link_twist(&positions, &velocities, link).expect("fits");
                prop_assert!(common::difference(&X_BT, &X_RL.to_homogeneous()) < 1e-12);
                prop_assert_eq!(model.link_pose(&positions, link), Ok(X_RL));
                prop_assert!(distance(&jacobian.twist(&v), &V_RL) < 1e-12, "{}", chain.tip());
                prop_assert_eq!(chain.forward(&q), Ok(X_BT));

                let chain = chain.with_tool(&tool);
                let (_, jacobian) = chain.forward_and_jacobian(&q).expect("fits");
                for k in 0..chain.len() {
                    let unit: Vec<f64> = (0..chain.len()).map(|j| f64::from(j == k)).collect();
                    let column = jacobian.column(k).expect("inside");
                    let off = distance(&moved(&chain, &q, &unit), &column);
                    prop_assert!(off < TOLERANCE, "{} column {k}: {off:e}", chain.tip());
                    columns.set(columns.get() + 1);
                }
                let off = distance(&moved(&chain, &q, &v), &jacobian.twist(&v));
                prop_assert!(off < 10.0 * TOLERANCE, "{}: {off:e}", chain.tip());
            }
            Ok(())
        });
        outcome.unwrap_or_else(|error| panic!("{}: {error}", model.name()));
    }
    println!("{} columns compared", columns.get());
    assert!(columns.get() >= 3 * 14);
}

fn arm(positions: &[f64]) -> Jacobian {
    let model = common::own_robot("six_axis_arm.urdf");
    let chain = Chain::from_root(&model, "tool0").expect("a chain");
    chain.forward_and_jacobian(positions).expect("fits").1
}

fn gram(jacobian: &Jacobian) -> Matrix6<f64> {
    let matrix = nalgebra::Matrix6xX::from_fn(jacobian.len(), |row, column| {
        jacobian.element(row, column).expect("inside")
    });
    &matrix * matrix.transpose()
}

#[test]
fn a_straight_elbow_is_a_singularity_along_the_arm() {
    let straight = arm(&[0.3, -1.2, 0.0, -0.7, 1.1, 0.2]);
    assert!(straight.manipulability() < 1e-15, "{}", straight.manipulability());
    assert!(straight.distance_to_singularity(1.0) < 1e-15);
    // What is lost is a motion that no joint gives.
    let lost = straight.weakest_direction(1.0).to_vector();
    for k in 0..6 {
        let given = straight.column(k).expect("inside").to_vector();
        assert!(lost.dot(&given).abs() < 1e-14, "column {k}");
    }
    let bent = arm(&[0.3, -1.2, 0.5, -0.7, 1.1, 0.2]);
    assert!(bent.distance_to_singularity(1.0) > 0.01, "{}", bent.distance_to_singularity(1.0));
}

#[test]
fn parallel_wrist_axes_are_a_singularity() {
    for wrist_2 in [0.0, std::f64::consts::PI] {
        let jacobian = arm(&[0.3, -1.2, 1.0, -0.7, wrist_2, 0.2]);
        assert!(jacobian.distance_to_singularity(0.5) < 1e-15);
        assert!(jacobian.singular_values(1.0).condition() > 1e15);
    }
}

#[test]
fn fewer_variables_than_directions_have_as_many_singular_values() {
    let text = r#"<robot name="p"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="q1" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
        <joint name="q2" type="prismatic"><origin xyz="0.4 0 0"/><parent link="b"/><child link="c"/>
          <axis xyz="1 0 0"/><limit lower="0" upper="1" velocity="1"/></joint></robot>"#;
    let model = RobotModel::from_urdf(text, "p.urdf").expect("a robot");
    let chain = Chain::from_root(&model, "c").expect("a chain");
    let (_, jacobian) = chain.forward_and_jacobian(&[0.7, 0.2]).expect("fits");
    // Columns (0, 0.6, 1) and (1, 0, 0) in the plane: singular values sqrt(1.36) and 1.
    let values: Vec<f64> = jacobian.singular_values(1.0).iter().collect();
    assert_eq!(values.len(), 2);
    assert!((values[0] - 1.36_f64.sqrt()).abs() < 1e-15 && (values[1] - 1.0).abs() < 1e-15);
    assert!((jacobian.manipulability() - 1.36_f64.sqrt()).abs() < 1e-15);
    // In units of 0.1 m the arm turns as before but slides ten times as far.
    let values: Vec<f64> = jacobian.singular_values(0.1).iter().collect();
    assert!((values[0] - 10.0).abs() < 1e-14 && (values[1] - 37.0_f64.sqrt()).abs() < 1e-14);
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn singular_values_are_those_of_the_gram_matrix(
        q in prop::array::uniform7(-3.0..3.0)
    ) {
        let model = common::own_robot("seven_axis_arm.urdf");
        let chain = Chain::from_root(&model, "tool0").expect("a chain");
        let (_, jacobian) = chain.forward_and_jacobian(&q).expect("fits");
        let gram = gram(&jacobian);
        prop_assert!((gram - jacobian.gram()).amax() < 1e-14);
        let mut expected: Vec<f64> = gram.symmetric_eigenvalues().iter().copied().collect();
        expected.sort_by(|a, b| b.total_cmp(a));
        for (value, square) in jacobian.singular_values(1.0).iter().zip(expected) {
            prop_assert!((value * value - square).abs() < 1e-13, "{value} {square}");
        }
        let determinant = gram.determinant().max(0.0).sqrt();
        prop_assert!((jacobian.manipulability() - determinant).abs() < 1e-7);
    }

    #[test]
    fn power_of_joints_is_power_of_the_tcp(
        q in prop::array::uniform6(-3.0..3.0),
        v in prop::array::uniform6(-1.0..1.0),
        f in prop::array::uniform6(-10.0..10.0),
    ) {
        let jacobian = arm(&q);
        let (force, torque) = (Vector3::new(f[0], f[1], f[2]), Vector3::new(f[3], f[4], f[5]));
        let efforts = jacobian.transposed_times(&Wrench { force, torque });
        let joints: f64 = efforts.iter().zip(v).map(|(effort, rate)| effort * rate).sum();
        let twist = jacobian.twist(&v);
        let tcp = twist.linear.dot(&force) + twist.angular.dot(&torque);
        prop_assert!((joints - tcp).abs() < 1e-12, "{joints} {tcp}");
    }

    #[test]
    fn far_from_singularities_joint_velocities_give_the_twist(
        q in prop::array::uniform6(-3.0..3.0),
        t in prop::array::uniform6(-0.3..0.3),
    ) {
        let jacobian = arm(&q);
        prop_assume!(jacobian.distance_to_singularity(1.0) > Damping::ARM.threshold);
        let wanted = Twist::from_vector(&t.into());
        let resolved = jacobian.joint_velocity(&wanted, &Damping::ARM, &[]);
        prop_assert_eq!(resolved.scale, 1.0);
        prop_assert!(distance(&resolved.twist, &wanted) < 1e-13);
        prop_assert!(distance(&jacobian.twist(&resolved.velocities), &wanted) < 1e-13);
    }

    #[test]
    fn near_singularities_joint_velocities_stay_bounded_and_within_limits(
        q in prop::array::uniform6(-3.0..3.0),
        bend in -1e-3..1e-3,
        t in prop::array::uniform6(-0.3..0.3),
    ) {
        let jacobian = arm(&[q[0], q[1], bend, q[3], q[4], q[5]]);
        let wanted = Twist::from_vector(&t.into());
        let free = jacobian.joint_velocity(&wanted, &Damping::ARM, &[]);
        let norm = free.velocities.iter().map(|v| v * v).sum::<f64>().sqrt();
        prop_assert!(norm <= 29.0 * wanted.to_vector().norm(), "{norm}");
        let limited = jacobian.joint_velocity(&wanted, &Damping::ARM, &[0.1; 6]);
        for (slow, fast) in limited.velocities.iter().zip(free.velocities.iter()) {
            prop_assert!(slow.abs() <= 0.1 + 1e-15, "{slow}");
            prop_assert!((slow - fast * limited.scale).abs() < 1e-15, "the direction changed");
        }
    }
}

#[test]
fn the_motion_of_one_joint_needs_that_joint_alone() {
    let q = [0.2, -1.1, 1.4, -0.5, FRAC_PI_2, 0.1];
    let jacobian = arm(&q);
    let wanted = jacobian.column(5).expect("inside");
    let resolved = jacobian.joint_velocity(&wanted, &Damping::ARM, &[]);
    for (k, velocity) in resolved.velocities.iter().enumerate() {
        assert!((velocity - f64::from(k == 5)).abs() < 1e-12, "{k}: {velocity}");
    }
}

#[test]
fn a_twist_that_is_no_number_moves_nothing() {
    let jacobian = arm(&[0.2, -1.1, 1.4, -0.5, 1.0, 0.1]);
    let wanted = Twist::new(Vector3::x() * f64::NAN, Vector3::zeros());
    let resolved = jacobian.joint_velocity(&wanted, &Damping::ARM, &[1.0; 6]);
    assert_eq!(resolved.scale, 0.0);
    assert_eq!(*resolved.velocities, [0.0; 6]);
}
