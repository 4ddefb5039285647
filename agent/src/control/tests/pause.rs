use std::sync::Arc;

use armada_model::{CompiledTrajectory, JointVector};
use armada_protocol::messages::{
    ActionStatus, CommandMode, FaultCode, OperationalMode, Queue, StopLevel,
};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, follow_with, jog, joints, queued, trajectory, trajectory_with};
use crate::control::{JogJointOrder, Order, Refusal};

use ActionStatus::{Cancelled, Complete, Paused, Running};
use CommandMode::Trajectory;

const END: [f64; 3] = [0.6, 0.3, 0.6];

/// Round a corner at speed.
fn path() -> Arc<CompiledTrajectory> {
    trajectory(&[(0.0, [0.0; 3]), (0.8, [0.4, 0.05, 0.3]), (1.6, END)])
}

fn id(id: u128) -> Uuid {
    Uuid::from_u128(id)
}

fn sent(rig: &Rig) -> JointVector {
    rig.commands.last().expect("sent").joint_position
}

/// How far the last set-point is from the curve, at the place of it that is nearest.
fn off_path(rig: &Rig, path: &CompiledTrajectory) -> f64 {
    let (position, mut hint) = (sent(rig), 0);
    let samples = (0..=16_000).map(|k| path.sample(f64::from(k) * 1e-4, &mut hint).position);
    samples.map(|x| x.max_abs_difference(&position)).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_paused_trajectory_rests_on_its_path_and_goes_on_to_its_exact_end() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = path();
    rig.follow(1, &path).expect("granted");
    rig.ticks(150);
    rig.ask(Order::Pause(id(1))).expect("granted");
    rig.ask(Order::Pause(id(1))).expect("granted again, and not told again");
    rig.until("rest", Rig::command_rests);
    let rest = sent(&rig);
    assert!(off_path(&rig, &path) < 1e-4);
    let progress = rig.last.as_ref().expect("a tick").snapshot.motion.expect("in progress");
    assert!(progress.paused && progress.rate == 0.0, "{progress:?}");
    rig.ticks(500);
    assert_eq!(sent(&rig), rest, "nothing moves while it is paused");
    rig.ask(Order::Resume(id(1))).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(sent(&rig), joints(END));
    assert_eq!(rig.statuses(1), [Running, Paused, Running, Complete]);
    let end = rig.ended(1).expect("ended").progress;
    assert_eq!((end.elapsed_s, end.waypoint), (1.6, 2), "its clock is that of its path");
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn another_speed_is_taken_at_once_and_by_what_comes_later() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    rig.ticks(100);
    rig.ask(Order::SetSpeedRatio(0.5)).expect("granted");
    rig.ticks(100);
    let snapshot = rig.last.as_ref().expect("a tick").snapshot;
    assert_eq!(snapshot.speed_ratio, 0.5);
    assert_eq!(snapshot.motion.expect("in progress").rate, 0.5);
    rig.until("the end", |rig| rig.ended(1).is_some());
    let back = trajectory(&[(0.0, END), (1.0, [0.3, 0.2, 0.6])]);
    rig.commands.clear();
    rig.follow(2, &back).expect("granted");
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.commands.len(), 1 + 500, "one second of 4 ms at half the speed");
    assert_eq!(sent(&rig), joints([0.3, 0.2, 0.6]));
    for ratio in [0.0, 0.009, 1.01, f64::NAN] {
        assert!(matches!(rig.ask(Order::SetSpeedRatio(ratio)), Err(Refusal::NotSupported(_))));
    }
}

#[test]
fn what_waits_or_does_not_exist_or_cannot_is_not_paused() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    let next = trajectory(&[(0.0, END), (1.0, [0.3, 0.2, 0.6])]);
    rig.ask(queued(2, &next, Queue::Append)).expect("granted");
    assert_eq!(rig.ask(Order::Pause(id(2))), Err(Refusal::NotPausable));
    assert_eq!(rig.ask(Order::Pause(id(9))), Err(Refusal::NoSuchMotion));
    rig.ask(Order::Halt).expect("granted");
    rig.until("rest", Rig::command_rests);
    rig.ticks(3);
    rig.ask(Order::SetMode(Trajectory)).expect("granted");
    let at = sent(&rig);
    let [a, b, c] = [at[0], at[1], at[2]];
    let armed = trajectory(&[(0.0, [a, b, c]), (1.0, [a + 0.1, b, c])]);
    let start = Some(rig.now + PERIOD * 100);
    rig.ask(follow_with(3, &armed, start, None)).expect("armed");
    assert_eq!(rig.ask(Order::Pause(id(3))), Err(Refusal::NotPausable));
    rig.finish();
    let mut rig = Rig::in_mode(CommandMode::Jog);
    let (joint_velocity, timeout) = (joints([0.1; 3]), PERIOD * 100);
    let order = JogJointOrder { id: id(1), joint_velocity, timeout, renews: false };
    rig.ask(Order::JogJoint(order)).expect("granted");
    assert_eq!(rig.ask(Order::Pause(id(1))), Err(Refusal::NotPausable), "let it go instead");
}

#[test]
fn a_paused_jog_rests_on_its_way_and_goes_on_to_its_exact_goal() {
    let goal = [0.7, -0.35, 1.4];
    for ticks in [1, 7, 40, 120, 200] {
        let mut rig = Rig::in_mode(CommandMode::Jog);
        rig.ask(jog(1, goal)).expect("granted");
        rig.ticks(ticks);
        assert_eq!(rig.ended(1), None);
        rig.ask(Order::Pause(id(1))).expect("granted");
        rig.ask(Order::Pause(id(1))).expect("granted again, and not told again");
        rig.until("rest", Rig::command_rests);
        rig.ticks(2);
        let rest = sent(&rig);
        let off = (0..3).map(|joint| (rest[joint] * goal[0] - rest[0] * goal[joint]).abs());
        assert!(off.fold(0.0, f64::max) < 1e-6, "off the straight way at {ticks}: {rest:?}");
        let progress = rig.last.as_ref().expect("a tick").snapshot.motion.expect("in progress");
        assert!(progress.paused && progress.rate == 0.0, "{progress:?}");
        rig.ticks(100);
        assert_eq!(sent(&rig), rest, "nothing moves while it is paused");
        rig.ask(Order::Resume(id(1))).expect("granted");
        rig.until("the end", |rig| rig.ended(1).is_some());
        assert_eq!(sent(&rig), joints(goal));
        assert_eq!(rig.statuses(1), [Running, Paused, Running, Complete]);
        let end = rig.ended(1).expect("ended").progress;
        assert!((end.elapsed_s - end.duration_s).abs() < 1e-9, "{end:?}");
        assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
    }
}

#[test]
fn a_jog_resumed_on_its_way_to_rest_or_sent_elsewhere_stays_legal() {
    for ticks in (3..200).step_by(17) {
        let mut rig = Rig::in_mode(CommandMode::Jog);
        rig.ask(jog(1, [0.7, -0.35, 1.4])).expect("granted");
        rig.ticks(ticks);
        rig.ask(Order::Pause(id(1))).expect("granted");
        rig.ticks(4);
        rig.ask(Order::Resume(id(1))).expect("granted");
        rig.ticks(3);
        rig.ask(Order::SetSpeedRatio(0.5)).expect("granted");
        rig.ask(Order::Pause(id(1))).expect("granted");
        rig.ticks(ticks % 30);
        rig.ask(jog(2, [0.0, 0.2, 0.1])).expect("another goal");
        assert_eq!(rig.ended(1).map(|end| end.status), Some(Cancelled));
        rig.until("the end", |rig| rig.ended(2).is_some());
        assert_eq!(sent(&rig), joints([0.0, 0.2, 0.1]));
        assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0, "after {ticks}");
    }
}

#[test]
fn a_cancel_and_a_halt_stay_on_the_path_and_a_stop_is_in_time() {
    for how in 0..3 {
        for ticks in (5..395).step_by(13) {
            let mut rig = Rig::in_mode(Trajectory);
            let path = path();
            rig.follow(1, &path).expect("granted");
            rig.ticks(ticks);
            match how {
                0 => drop(rig.order(Order::Cancel(id(1)))),
                1 => drop(rig.order(Order::Halt)),
                // The rig looks whether it is in time.
                _ => rig.stop = Some(StopLevel::L2),
            }
            rig.tick();
            rig.until("rest", Rig::command_rests);
            rig.tick();
            if how < 2 {
                assert!(off_path(&rig, &path) < 1e-4, "way {how} at {ticks}");
            }
            rig.tick();
            assert!(rig.ended(1).is_some(), "way {how} at {ticks}");
            assert_eq!(rig.retired.len(), 1);
            assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
        }
    }
}

#[test]
fn a_cancelled_pause_ends_at_once_and_where_it_is() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    rig.ticks(150);
    rig.ask(Order::Pause(id(1))).expect("granted");
    rig.until("rest", Rig::command_rests);
    let rest = sent(&rig);
    rig.ask(Order::Cancel(id(1))).expect("granted");
    assert_eq!(rig.statuses(1), [Running, Paused, Cancelled]);
    rig.ticks(50);
    assert_eq!(sent(&rig), rest);
}

#[test]
fn at_reduced_speed_no_joint_is_faster_than_its_reduced_limits() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.plant.operational_mode = OperationalMode::ManualReducedSpeed;
    rig.tick();
    if rig.mode() != Trajectory {
        // The turn of the key may have ended the mode.
        rig.ask(Order::SetMode(Trajectory)).expect("granted");
    }
    let path = path();
    rig.follow(1, &path).expect("granted");
    rig.commands.clear();
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(sent(&rig), joints(END));
    let speeds = rig.commands.windows(2).flat_map(|pair| {
        (0..3).map(|joint| {
            let moved = pair[1].joint_position[joint] - pair[0].joint_position[joint];
            moved.abs() / PERIOD.as_secs_f64() / rig.params.reduced[joint].velocity
        })
    });
    let fastest = speeds.fold(0.0, f64::max);
    assert!(fastest <= 1.0 + 1e-9 && fastest > 0.8, "{fastest} of the reduced limit");
}

#[test]
fn a_robot_that_is_not_as_fast_as_a_waypoint_asks_is_a_velocity_error() {
    let slow = [1.0; 3];
    let path = trajectory_with(&slow, &[0.05; 3], &[(0.0, [0.0; 3]), (1.0, [0.4, 0.0, 0.0])]);
    let mut rig = Rig::in_mode(Trajectory);
    rig.params.tracking_tolerance = joints([1.0; 3]);
    rig.follow(1, &path).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.ended(1).expect("ended").status, Complete, "a robot that follows does");
    let back = trajectory_with(&slow, &[0.05; 3], &[(0.0, [0.4, 0.0, 0.0]), (1.0, [0.0; 3])]);
    rig.ticks(10);
    rig.follow(2, &back).expect("granted");
    rig.ticks(20);
    rig.plant.blocked = true;
    rig.until("a fault", |rig| !rig.fault_codes().is_empty());
    assert_eq!(rig.fault_codes(), [FaultCode::VelocityError]);
    let reason = rig.ended(2).expect("ended").reason;
    assert_eq!(reason, Some(Refusal::Faulted(FaultCode::VelocityError)));
}

#[test]
fn a_tolerance_of_speeds_needs_a_controller_that_measures_them() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.plant.reports_velocity = false;
    rig.tick();
    let path = trajectory_with(&[], &[0.05; 3], &[(0.0, [0.0; 3]), (1.0, [0.4, 0.0, 0.0])]);
    assert!(matches!(rig.follow(1, &path), Err(Refusal::NotSupported(_))));
}

#[test]
fn what_began_with_other_robots_keeps_its_pace() {
    let mut rig = Rig::in_mode(Trajectory);
    let start = rig.now + 10 * PERIOD;
    rig.ask(follow_with(1, &path(), Some(start), None)).expect("granted");
    for ticks in [5, 50] {
        rig.ticks(ticks);
        assert_eq!(rig.ask(Order::SetSpeedRatio(0.5)), Err(Refusal::Busy(id(1))));
        assert_eq!(rig.ask(Order::Pause(id(1))), Err(Refusal::NotPausable));
    }
    rig.until("the end", |rig| rig.ended(1).is_some());
    rig.ask(Order::SetSpeedRatio(0.5)).expect("granted");
}
