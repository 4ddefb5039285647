//! Distance queries and motion checks allocate nothing.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

mod common;
mod counting_allocator;

use armada_model::{Accuracy, CollisionScene, MotionCheck, Mount, Pose, SceneBuilder, Shape};
use counting_allocator::allocations_of;

fn scene() -> CollisionScene {
    let arm = common::own_robot("seven_axis_arm.urdf");
    let mut builder = SceneBuilder::new();
    for (name, y) in [("left", 0.3), ("right", -0.3)] {
        let mount = Mount::World(Pose::from_translation(0.0, y, 0.0));
        builder.add_robot(name, &arm, mount, &mut |_| None).expect("a robot");
    }
    let plate = Shape::Box { size: [2.0, 2.0, 0.1] };
    builder.add_fixed("table", &plate, &Pose::from_translation(0.0, 0.0, -0.06)).expect("a box");
    builder.build()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| drop(std::hint::black_box(Box::new(1)))), 1);
}

#[test]
fn queries_allocate_nothing() {
    let scene = scene();
    let mut workspace = scene.workspace();
    for bend in [0.0, 0.8, 1.6] {
        let mut found = 0;
        let allocations = allocations_of(|| {
            let mut placed = scene.place(&[bend; 14], &mut workspace).expect("positions fit");
            for accuracy in [Accuracy::Capsules, Accuracy::Shapes] {
                assert!(placed.minimum(accuracy).is_some());
                placed.pairs_below(0.5, accuracy, |_| found += 1);
            }
        });
        assert_eq!(allocations, 0, "bend {bend}");
        assert!(found > 0, "bend {bend}: nothing was measured");
    }
    let allocations = allocations_of(|| {
        scene.place(&[f64::NAN; 14], &mut workspace).expect_err("not a number");
    });
    assert_eq!(allocations, 0);
}

#[test]
fn a_motion_check_allocates_nothing() {
    let scene = scene();
    let mut workspace = scene.workspace();
    let speeds = [0.5; 14];
    let check = MotionCheck {
        duration_s: 1.0,
        resolution_s: 1e-2,
        threshold_m: 0.01,
        speeds: Some(&speeds),
        max_states: 1000,
    };
    let mut states = 0;
    let allocations = allocations_of(|| {
        let sample = |time: f64, positions: &mut [f64]| positions.fill(0.5 * time);
        states = scene.check_motion(&check, sample, &mut workspace).expect("checked").states;
    });
    assert_eq!(allocations, 0);
    assert!(states > 5, "{states} states");
}
