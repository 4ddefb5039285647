//! Evaluating a Cartesian path allocates nothing.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod counting_allocator;

use armada_model::{CartesianMove, CartesianPath, DEFAULT_ROTATION_WEIGHT, Pose};
use counting_allocator::allocations_of;
use nalgebra::Vector3;

#[test]
fn poses_tangents_and_curvatures_on_lines_arcs_and_blends_allocate_nothing() {
    let moves = [
        CartesianMove::line(Pose::from_translation(0.3, 0.0, 0.0)).blended(0.05),
        CartesianMove::arc(Vector3::new(0.4, 0.2, 0.1), Pose::from_translation(0.1, 0.4, 0.0)),
    ];
    let path = CartesianPath::new(&Pose::default(), &moves, DEFAULT_ROTATION_WEIGHT)
        .expect("a line and an arc");
    let mut sum = 0.0;
    let allocations = allocations_of(|| {
        for step in 0..=1000 {
            let s = path.length() * f64::from(step) / 1000.0;
            sum += path.pose_at(s).position().x + path.tangent_at(s).linear.x;
            sum += path.curvature_at(s);
        }
    });
    assert_eq!(allocations, 0);
    assert!(sum > 100.0, "nothing was calculated: {sum}");
}
