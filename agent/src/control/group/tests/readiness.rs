use std::sync::Arc;

use armada_model::{
    CompiledTrajectory, JointLimits, JointTrajectory, MotionLimits, TrajectoryOptions, Waypoint,
};

use crate::control::{Readiness, StartTravel, stretch_for_slope};

fn limits() -> MotionLimits {
    let limits = JointLimits { velocity: 2.0, acceleration: Some(4.0), ..JointLimits::default() };
    MotionLimits::new(&[limits; 2]).expect("complete")
}

/// The first joint goes by a radian, at rest and without acceleration at both ends.
fn soft(duration_s: f64) -> Arc<CompiledTrajectory> {
    let names = ["a", "b"];
    let waypoints = (0..=40).map(|k| {
        let share = f64::from(k) / 40.0;
        let soft = share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
        Waypoint {
            time_from_start_s: share * duration_s,
            joint_position: vec![soft, 0.1 * soft],
            ..Waypoint::default()
        }
    });
    let wanted = JointTrajectory {
        joint_names: names.map(str::to_owned).to_vec(),
        waypoints: waypoints.collect(),
        ..JointTrajectory::default()
    };
    let options = TrajectoryOptions::default();
    Arc::new(CompiledTrajectory::compile(&wanted, &names, &limits(), &options).expect("legal"))
}

#[test]
fn a_slow_trajectory_stops_soon_and_can_change_its_rate_fast() {
    let slow = Readiness::of(&soft(6.0), &limits()).expect("two joints");
    assert!(slow.rate_slope_s >= 2.0, "{slow:?}");
    // At most 0.31 rad/s, and 4 rad/s² reached within 50 ms.
    assert!(slow.stop_time_s > 0.05 && slow.stop_time_s < 0.3, "{slow:?}");
}

#[test]
fn a_trajectory_near_its_limits_stops_later_and_changes_its_rate_more_slowly() {
    let (fast, slow) = (soft(1.25), soft(6.0));
    let [fast, slow] = [fast, slow].map(|path| Readiness::of(&path, &limits()).expect("joints"));
    assert!(fast.stop_time_s > slow.stop_time_s, "{fast:?} {slow:?}");
    assert!(fast.rate_slope_s < slow.rate_slope_s, "{fast:?} {slow:?}");
}

#[test]
fn the_stretch_that_is_suggested_suffices_and_is_not_far_too_long() {
    let path = soft(1.25);
    let stretch = stretch_for_slope(&path, &limits(), 0.5);
    assert!((1.0..3.0).contains(&stretch), "{stretch}");
    let stretched = Readiness::of(&soft(1.25 * stretch), &limits()).expect("joints");
    assert!(stretched.rate_slope_s >= 0.5, "{stretched:?}");
    let limit = 1e-4;
    let travel = StartTravel::of(&path, 0.064);
    assert_eq!(travel.joint, 0);
    assert!(travel.travel > limit, "{travel:?}");
    let stretch = StartTravel::stretch(&path, 0.064, limit);
    let stretched = StartTravel::of(&soft(1.25 * stretch), 0.064).travel;
    assert!(stretched <= limit * 1.01 && stretched > 0.9 * limit, "{stretched}");
}
