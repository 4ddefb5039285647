//! A motion that goes on as long as a measurement.

use std::f64::consts::TAU;
use std::time::Duration;

use armada_model::{JointTrajectory, JointVector, Waypoint};

use super::robot_file::JOINTS;

/// Time there and back.
const PERIOD: Duration = Duration::from_secs(2);
/// Waypoints there and back.
const WAYPOINTS: u32 = 20;
/// How far from the middle each joint goes \[rad\].
const REACH: f64 = 0.15;

/// All joints there and back at least as long as `time`, from `from` to the far side of `middle`.
///
/// However a swing was stopped, the next one from there has at most twice the reach.
pub(super) fn swing(from: JointVector, middle: JointVector, time: Duration) -> JointTrajectory {
    let times = (0..).find(|&times| PERIOD * times >= time).unwrap_or(1).max(1);
    sampled(from, middle, times, times * WAYPOINTS + 1)
}

/// The same with a given number of waypoints, at least two, at a distance of 50 ms.
pub(super) fn long_swing(
    from: JointVector,
    middle: JointVector,
    waypoints: u32,
) -> JointTrajectory {
    let times = (waypoints / (2 * WAYPOINTS)).max(1);
    sampled(from, middle, times, waypoints)
}

fn sampled(from: JointVector, middle: JointVector, times: u32, waypoints: u32) -> JointTrajectory {
    let reach = |(from, middle): (&f64, &f64)| {
        let far = if from <= middle { middle + REACH } else { middle - REACH };
        far - from
    };
    let reaches: Vec<f64> = from.iter().zip(middle.iter()).map(reach).collect();
    let intervals = f64::from(waypoints - 1);
    let waypoint = |k: u32| {
        let cycles = f64::from(k) / intervals * f64::from(times);
        let share = (1.0 - (TAU * cycles).cos()) / 2.0;
        Waypoint {
            time_from_start_s: cycles * PERIOD.as_secs_f64(),
            joint_position: from.iter().zip(&reaches).map(|(x, reach)| x + reach * share).collect(),
            ..Waypoint::default()
        }
    };
    JointTrajectory {
        joint_names: JOINTS.map(str::to_owned).to_vec(),
        waypoints: (0..waypoints).map(waypoint).collect(),
        ..JointTrajectory::default()
    }
}

#[cfg(test)]
mod tests {
    use armada_model::{CompiledTrajectory, MotionLimits, RobotModel, TrajectoryOptions};

    use super::*;
    use crate::bench::robot_file::{ACCELERATION, ready_position};

    fn compile(trajectory: &JointTrajectory) -> CompiledTrajectory {
        let urdf = include_str!("../../../../config/robots/seven_axis_arm.urdf");
        let model = RobotModel::from_urdf(urdf, "arm").unwrap_or_else(|error| panic!("{error}"));
        let limits: Vec<_> = model
            .variables()
            .map(|variable| {
                let mut limits = variable.motion.limits;
                limits.acceleration = Some(ACCELERATION);
                limits
            })
            .collect();
        let limits = MotionLimits::new(&limits).expect("complete");
        let names = JOINTS.map(str::to_owned);
        CompiledTrajectory::compile(trajectory, &names, &limits, &TrajectoryOptions::default())
            .unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn a_swing_is_legal_wherever_the_last_one_was_stopped() {
        let middle = ready_position().expect("finite");
        for offset in [-0.2, -REACH, 0.0, REACH, 0.2] {
            let from = middle.map_indexed(|_, x| x + offset);
            let compiled = compile(&swing(from, middle, Duration::from_millis(4100)));
            assert!((compiled.duration_s() - 6.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_long_swing_has_as_many_waypoints_as_asked_for() {
        let middle = ready_position().expect("finite");
        for waypoints in [11, 101, 1001, 1017] {
            let compiled = compile(&long_swing(middle, middle, waypoints));
            assert_eq!(compiled.waypoint_count(), waypoints as usize);
        }
    }
}
