//! Closed-form inverse kinematics allocates nothing, refusals included.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod analytic_arms;
mod common;
mod counting_allocator;

use analytic_arms::{Axes, Convention, Subject};
use armada_model::{AnalyticArm, Configuration, Elbow, JointVector, Selection, Shoulder, Wrist};
use counting_allocator::allocations_of;
use nalgebra::Isometry3;

#[test]
fn solving_and_selecting_allocate_nothing() {
    let industrial = Axes::ortho_parallel([0.05, 0.04, 0.0, 0.4, 0.45, 0.45, 0.08]);
    for (model, base, tip) in [
        (common::own_robot("six_axis_arm.urdf"), "base_link", "tool0"),
        (industrial.model(&Convention::plain()), "base", "tool"),
    ] {
        let arm = AnalyticArm::recognise(&model, base, tip).expect("recognised");
        let subject = Subject::new(model, base, tip, arm.variables());
        let q = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];
        let targets =
            [subject.pose(&q), subject.pose(&[0.0; 6]), Isometry3::translation(9.0, 0., 0.)];
        let back =
            Configuration { shoulder: Shoulder::Back, elbow: Elbow::Down, wrist: Wrist::Flip };
        let mut found = 0;
        let allocations = allocations_of(|| {
            for target in &targets {
                found += arm.solve(target).len();
                let nearest = Selection::Nearest { weights: JointVector::EMPTY };
                found += usize::from(arm.select(target, &q, &nearest).is_ok());
                let other = arm.select(target, &q, &Selection::Configuration(back));
                found += usize::from(other.is_ok());
            }
        });
        assert_eq!(allocations, 0, "{}", subject.name);
        assert!(found > 8, "nothing was calculated");
    }
}
