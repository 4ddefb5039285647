use std::sync::Arc;

use armada_model::JointVector;
use armada_protocol::messages::{ActionStatus, CommandMode, MotionKind, RobotFlags, StopLevel};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, follow, follow_with, joints, trajectory};
use crate::control::{Order, Refusal};

use ActionStatus::{Cancelled, Complete, Failed, Queued, Running};
use CommandMode::Trajectory;

const END: [f64; 3] = [0.4, -0.3, 1.1];

fn path() -> Arc<armada_model::CompiledTrajectory> {
    // Not a whole number of periods.
    trajectory(&[(0.0, [0.0; 3]), (0.6, [0.18, -0.12, 0.5]), (1.2345, END)])
}

fn positions(rig: &Rig) -> Vec<JointVector> {
    rig.commands.iter().map(|command| command.joint_position).collect()
}

#[test]
fn the_set_points_are_the_samples_and_the_last_is_the_last_waypoint_bit_for_bit() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = path();
    rig.commands.clear();
    rig.follow(1, &path).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.commands.len(), 1 + 309, "1.2345 s of 4 ms, and the first");
    let mut hint = 0;
    for (tick, sent) in positions(&rig).iter().enumerate() {
        let sample = path.sample(tick as f64 * PERIOD.as_secs_f64(), &mut hint);
        assert_eq!(*sent, sample.position, "tick {tick}");
    }
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints(END));
    assert_eq!(rig.statuses(1), [Running, Complete], "complete in the tick of the last set-point");
    assert_eq!(rig.mode(), Trajectory);
    rig.ticks(10);
    assert_eq!(rig.commands.last().expect("held").joint_position, joints(END));
    assert_eq!(rig.last.as_ref().expect("a tick").snapshot.limited_setpoints, 0);
    assert_eq!(rig.retired.len(), 1);
    assert!(Arc::ptr_eq(&rig.retired[0], &path));
}

#[test]
fn a_duration_just_beyond_a_whole_number_of_periods_ends_exactly_too() {
    let mut rig = Rig::in_mode(Trajectory);
    // As 0.1 + 0.1 + 0.1 is beyond 0.3: no period more for that, but the last waypoint exactly.
    let path = trajectory(&[(0.0, [0.0; 3]), (1.4 + 1e-12, END)]);
    rig.commands.clear();
    rig.follow(1, &path).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.commands.len(), 1 + 350);
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints(END));
}

#[test]
fn progress_is_told_while_it_runs() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    let report = rig.reports(1)[0];
    assert_eq!((report.kind, report.started), (MotionKind::Trajectory, Some(rig.now)));
    rig.ticks(150);
    let snapshot = rig.last.as_ref().expect("a tick").snapshot;
    let progress = snapshot.motion.expect("in progress");
    assert!((progress.elapsed_s - 0.6).abs() < 1e-12);
    assert_eq!((progress.duration_s, progress.waypoint), (1.2345, 1));
    assert!(snapshot.flags.contains(RobotFlags::TRAJECTORY_RUNNING));
    rig.until("the end", |rig| rig.ended(1).is_some());
    let end = rig.ended(1).expect("ended").progress;
    assert_eq!((end.elapsed_s, end.waypoint), (1.2345, 2));
}

#[test]
fn one_trajectory_follows_another() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    let back = trajectory(&[(0.0, END), (1.5, [0.0; 3])]);
    rig.commands.clear();
    rig.follow(2, &back).expect("the robot lags, but is near enough");
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!(rig.statuses(2), [Running, Complete], "no lead-in: it is held there exactly");
    assert_eq!(rig.fault_codes(), []);
}

#[test]
fn while_one_is_in_progress_or_armed_another_is_refused() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    let busy = Err(Refusal::Busy(Uuid::from_u128(1)));
    assert_eq!(rig.follow(2, &path()), busy);
    rig.ask(Order::Cancel(Uuid::from_u128(1))).expect("granted");
    rig.until("the end", |rig| rig.ended(1).is_some());
    let start = Some(rig.now + PERIOD * 100);
    rig.ask(follow_with(3, &trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]), start, None))
        .expect("armed");
    assert_eq!(rig.follow(4, &path()), Err(Refusal::Busy(Uuid::from_u128(3))));
    rig.finish();
}

#[test]
fn a_late_wake_delays_the_motion_and_never_makes_it_jump() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = path();
    rig.commands.clear();
    rig.follow(1, &path).expect("granted");
    for late in [1, 2, 7, 1, 9, 3].into_iter().cycle().take(60) {
        rig.late_tick(late);
    }
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Running, Complete]);
    let mut hint = 0;
    for (tick, sent) in positions(&rig).iter().enumerate() {
        let sample = path.sample(tick as f64 * PERIOD.as_secs_f64(), &mut hint);
        assert_eq!(*sent, sample.position, "the same set-points as without late wakes");
    }
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn a_start_at_an_instant_is_at_the_nearest_tick() {
    for offset_us in [-1900, -100, 0, 100, 1900] {
        let mut rig = Rig::in_mode(Trajectory);
        let tick = rig.now + PERIOD * 50;
        let start = tick.shifted(offset_us * 1000);
        rig.ask(follow_with(1, &path(), Some(start), None)).expect("granted");
        assert_eq!(rig.statuses(1), [Queued]);
        let snapshot = rig.last.as_ref().expect("a tick").snapshot;
        assert_eq!(snapshot.motion.map(|m| m.elapsed_s), Some(0.0));
        assert!(!snapshot.flags.contains(RobotFlags::TRAJECTORY_RUNNING));
        rig.until("the start", |rig| rig.statuses(1).contains(&Running));
        assert_eq!(rig.reports(1)[1].started, Some(tick), "offset {offset_us} us");
    }
}

#[test]
fn a_start_in_the_past_is_missed_by_more_than_a_period_only() {
    let mut rig = Rig::in_mode(Trajectory);
    let next = rig.now + PERIOD;
    let late = next - PERIOD * 3;
    let answer = rig.ask(follow_with(1, &path(), Some(late), None));
    assert_eq!(answer, Err(Refusal::StartMissed { late_s: 0.012 }));
    let just = rig.now + PERIOD - PERIOD;
    assert!(rig.ask(follow_with(2, &path(), Some(just), None)).is_ok());
    assert_eq!(rig.statuses(2), [Running]);
}

#[test]
fn an_armed_trajectory_whose_instant_was_slept_through_fails_without_moving() {
    let mut rig = Rig::in_mode(Trajectory);
    let start = rig.now + PERIOD * 5;
    rig.ask(follow_with(1, &path(), Some(start), None)).expect("granted");
    rig.late_tick(9);
    let end = rig.ended(1).expect("ended");
    assert_eq!((end.status, end.reason), (Failed, Some(Refusal::StartMissed { late_s: 0.02 })));
    rig.ticks(10);
    assert!(positions(&rig).iter().all(|position| *position == joints([0.0; 3])));
    assert!(rig.follow(2, &path()).is_ok(), "nothing is left behind");
    rig.finish();
}

#[test]
fn a_small_distance_to_the_first_waypoint_is_gone_slowly_before() {
    let mut rig = Rig::in_mode(Trajectory);
    let near = trajectory(&[(0.0, [0.01, -0.02, 0.0]), (1.0, [0.2, 0.0, 0.0])]);
    rig.commands.clear();
    rig.follow(1, &near).expect("granted");
    assert_eq!(rig.statuses(1), [Queued], "on its way there");
    rig.until("the start", |rig| rig.statuses(1).contains(&Running));
    let there = positions(&rig);
    assert_eq!(*there.last().expect("sent"), joints([0.01, -0.02, 0.0]));
    let fastest = rig.commands.iter().map(|c| c.joint_velocity[1].abs()).fold(0.0, f64::max);
    assert!(fastest <= 0.1 + 1e-9, "a tenth of the limit, not {fastest}");
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(rig.statuses(1), [Queued, Running, Complete]);
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn clock_zero_of_an_armed_trajectory_is_on_time_though_a_way_comes_before() {
    let mut rig = Rig::in_mode(Trajectory);
    let near = trajectory(&[(0.0, [0.01, -0.02, 0.0]), (1.0, [0.2, 0.0, 0.0])]);
    let start = rig.now + PERIOD * 200;
    rig.ask(follow_with(1, &near, Some(start), None)).expect("granted");
    rig.until("the start", |rig| rig.statuses(1).contains(&Running));
    assert_eq!((rig.now, rig.reports(1)[1].started), (start, Some(start)));
    let sent = positions(&rig);
    assert_eq!(sent[sent.len() - 1], joints([0.01, -0.02, 0.0]));
    assert_eq!(sent[100], joints([0.0; 3]), "not before it has to");
}

#[test]
fn a_start_too_near_for_the_way_there_is_missed_and_nothing_moves() {
    let mut rig = Rig::in_mode(Trajectory);
    let near = trajectory(&[(0.0, [0.01, -0.02, 0.0]), (1.0, [0.2, 0.0, 0.0])]);
    let answer = rig.ask(follow_with(1, &near, Some(rig.now + PERIOD * 5), None));
    assert!(matches!(answer, Err(Refusal::StartMissed { late_s }) if late_s > 0.1));
    rig.ticks(50);
    assert!(positions(&rig).iter().all(|position| *position == joints([0.0; 3])));
}

#[test]
fn a_robot_too_far_from_the_first_waypoint_refuses_with_joint_and_distance() {
    let mut rig = Rig::in_mode(Trajectory);
    let far = trajectory(&[(0.0, [0.0, 0.06, 0.0]), (1.0, [0.1; 3])]);
    let expected = Refusal::StartTolerance { joint: 1, value: 0.06, limit: 0.05 };
    assert_eq!(rig.follow(1, &far), Err(expected));
    assert_eq!(rig.retired.len(), 1, "a refused trajectory is given back");
    // Held there, but measured elsewhere. Not so far yet that it would be a tracking error.
    rig.params.tracking_tolerance = joints([1.0; 3]);
    rig.plant.blocked = true;
    rig.plant.position = joints([0.0, 0.0, 0.07]);
    let here = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    let expected = Refusal::StartTolerance { joint: 2, value: 0.07, limit: 0.05 };
    assert_eq!(rig.follow(2, &here), Err(expected));
}

#[test]
fn an_epoch_that_has_passed_is_refused() {
    let mut rig = Rig::in_mode(Trajectory);
    let given = rig.epoch();
    assert!(rig.ask(follow_with(1, &path(), None, Some(given))).is_ok());
    rig.ask(Order::Halt).expect("granted");
    rig.until("standstill", Rig::command_rests);
    rig.ask(Order::SetMode(Trajectory)).expect("granted");
    let answer = rig.ask(follow_with(2, &path(), None, Some(given)));
    assert_eq!(answer, Err(Refusal::EpochPassed { given, current: given + 2 }));
}

#[test]
fn a_trajectory_of_another_number_of_joints_is_refused() {
    use armada_model::{
        CompiledTrajectory, JointTrajectory, MotionLimits, TrajectoryOptions, Waypoint,
    };
    let mut rig = Rig::in_mode(Trajectory);
    let limits = MotionLimits::new(&rig.params.limits[..2]).expect("complete");
    let row = |time_from_start_s| Waypoint {
        time_from_start_s,
        joint_position: vec![0.0; 2],
        ..Waypoint::default()
    };
    let two = JointTrajectory {
        joint_names: ["a", "b"].map(str::to_owned).to_vec(),
        waypoints: vec![row(0.0), row(1.0)],
        ..JointTrajectory::default()
    };
    let options = TrajectoryOptions::default();
    let two = CompiledTrajectory::compile(&two, &["a", "b"], &limits, &options).expect("legal");
    let answer = rig.follow(1, &Arc::new(two));
    assert_eq!(answer, Err(Refusal::WrongLength { given: 2, expected: 3 }));
}

#[test]
fn a_cancelled_trajectory_ramps_and_is_cancelled_when_it_stands() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &path()).expect("granted");
    rig.ticks(100);
    rig.ask(Order::Cancel(Uuid::from_u128(1))).expect("granted");
    assert_eq!(rig.follow(2, &path()), Err(Refusal::StillMoving));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert!(rig.command_rests());
    assert_eq!(rig.statuses(1), [Running, Cancelled]);
    assert_eq!((rig.mode(), rig.retired.len()), (Trajectory, 2));
}

#[test]
fn an_armed_trajectory_is_cancelled_at_once() {
    let mut rig = Rig::in_mode(Trajectory);
    let start = Some(rig.now + PERIOD * 100);
    rig.ask(follow_with(1, &path(), start, None)).expect("granted");
    rig.ask(Order::Cancel(Uuid::from_u128(1))).expect("granted");
    assert_eq!(rig.statuses(1), [Queued, Cancelled]);
    rig.ticks(200);
    assert!(positions(&rig).iter().all(|position| *position == joints([0.0; 3])));
}

#[test]
fn a_stop_ends_an_armed_trajectory_and_it_never_starts() {
    let mut rig = Rig::in_mode(Trajectory);
    let start = Some(rig.now + PERIOD * 100);
    rig.ask(follow_with(1, &path(), start, None)).expect("granted");
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    let end = rig.ended(1).expect("ended");
    assert_eq!((end.status, end.reason), (Failed, Some(Refusal::Stopped(StopLevel::L2))));
    rig.stop = None;
    rig.ticks(200);
    assert!(positions(&rig).iter().all(|position| *position == joints([0.0; 3])));
}

#[test]
fn every_trajectory_handed_in_is_given_back_once() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = path();
    for id in 1..=8 {
        rig.order(follow(id, &path));
    }
    rig.tick();
    assert_eq!(rig.retired.len(), 7, "all but the one that is followed");
    assert_eq!(Arc::strong_count(&path), 1 + 1 + 7 + rig.last_retired());
    rig.finish();
    assert_eq!(rig.retired.len(), 8);
}
