//! Planning and following jerk-limited motions allocates nothing: a control loop does both.

#![expect(clippy::expect_used, reason = "a test fails by panicking, its helpers too")]

mod counting_allocator;

use std::hint::black_box;

use armada_model::{
    JerkLimitedMove, JerkLimitedStop, JointLimits, JointVector, MAX_JOINTS, MotionLimits,
    OnlineOptions, OnlineState, Retargeter, Synchronisation,
};
use counting_allocator::allocations_of;

fn limits() -> MotionLimits {
    let joint = JointLimits {
        lower: Some(-3.0),
        upper: Some(3.0),
        velocity: 2.0,
        acceleration: Some(10.0),
        jerk: Some(300.0),
        effort: None,
    };
    MotionLimits::new(&[joint; MAX_JOINTS]).expect("complete limits")
}

fn rest(value: f64) -> OnlineState {
    let position = JointVector::zeros(MAX_JOINTS).expect("few").map_indexed(|joint, _| {
        value * (1.0 - 0.05 * f64::from(u8::try_from(joint).expect("few")))
    });
    OnlineState::at_rest(position)
}

#[test]
fn an_allocation_is_counted() {
    assert_eq!(allocations_of(|| drop(black_box(Box::new(1)))), 1);
}

#[test]
fn retargets_ticks_stops_and_refusals_allocate_nothing() {
    let limits = limits();
    for synchronisation in [Synchronisation::Time, Synchronisation::Phase, Synchronisation::None] {
        let options = OnlineOptions { synchronisation, minimum_duration_s: 0.0 };
        let count = allocations_of(|| {
            let mut joints = Retargeter::new(&rest(0.0), &limits, options).expect("usable");
            for round in 0..200_u32 {
                let target = rest(if round % 2 == 0 { 1.5 } else { -1.5 });
                joints.retarget(&target).expect("legal");
                assert!(joints.retarget(&rest(4.0)).is_err());
                for _ in 0..10 {
                    black_box(joints.tick(0.007));
                }
                if round % 7 == 0 {
                    joints.stop();
                }
            }
            let motion = JerkLimitedMove::plan(&rest(0.0), &rest(1.0), &limits, &options);
            let half_way = motion.expect("legal").at(0.3);
            black_box(JerkLimitedStop::plan(&half_way, &limits).expect("usable").at(0.1));
        });
        assert_eq!(count, 0, "{synchronisation:?}");
    }
}
