//! Forward kinematics allocates nothing.

mod common;
mod counting_allocator;

use armada_model::{Chain, Damping};
use counting_allocator::allocations_of;
use nalgebra::Isometry3;

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| drop(std::hint::black_box(Box::new(1)))), 1);
}

#[test]
fn poses_of_one_and_of_all_links_allocate_nothing() {
    for file in ["six_axis_arm.urdf", "lift_torso.urdf"] {
        let model = common::own_robot(file);
        let positions = vec![0.3; model.variable_count()];
        let mut poses = vec![Isometry3::identity(); model.links().len()];
        let tip = model.links().len() - 1;
        let allocations = allocations_of(|| {
            model.link_poses(&positions, &mut poses).expect("positions fit");
            model.link_pose(&positions, tip).expect("positions fit");
        });
        assert_eq!(allocations, 0, "{file}");
        assert_ne!(poses[tip], Isometry3::identity(), "{file}: nothing was calculated");
    }
}

#[test]
fn pose_jacobian_and_joint_velocities_of_a_chain_allocate_nothing() {
    let model = common::own_robot("seven_axis_arm.urdf");
    let chain = Chain::from_root(&model, "tool0").expect("a chain");
    let tip = model.link_index("tool0").expect("a link");
    let positions = [0.3; 7];
    let allocations = allocations_of(|| {
        let (_, jacobian) = chain.forward_and_jacobian(&positions).expect("positions fit");
        let twist = jacobian.twist(&positions);
        let resolved = jacobian.joint_velocity(&twist, &Damping::ARM, &[1.0; 7]);
        assert!(resolved.scale > 0.0 && jacobian.manipulability() > 0.0);
        chain.forward(&positions).expect("positions fit");
        model.link_twist(&positions, &positions, tip).expect("positions fit");
        chain.forward(&[f64::NAN; 7]).expect_err("not a number");
    });
    assert_eq!(allocations, 0);
}

#[test]
fn refusals_allocate_nothing() {
    let model = common::own_robot("six_axis_arm.urdf");
    let mut poses = vec![Isometry3::identity(); model.links().len()];
    let allocations = allocations_of(|| {
        model.link_poses(&[f64::NAN; 6], &mut poses).expect_err("not a number");
        model.link_poses(&[], &mut poses).expect_err("too short");
    });
    assert_eq!(allocations, 0);
}
