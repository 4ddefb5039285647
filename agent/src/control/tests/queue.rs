use std::sync::Arc;

use armada_model::CompiledTrajectory;
use armada_protocol::messages::{ActionStatus, CommandMode, LeaseLoss, Queue, StopLevel};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, joints, queued, trajectory};
use crate::control::{FollowOrder, MAX_QUEUED, Order, Refusal};

use ActionStatus::{Cancelled, Complete, Failed, Queued, Running};
use CommandMode::Trajectory;
use Queue::{Append, AppendBlended, Replace};

const A: [f64; 3] = [0.0; 3];
const B: [f64; 3] = [0.4, 0.0, 0.3];
const C: [f64; 3] = [0.8, 0.1, 0.6];
const D: [f64; 3] = [0.5, 0.4, 0.2];

fn line(from: [f64; 3], to: [f64; 3]) -> Arc<CompiledTrajectory> {
    trajectory(&[(0.0, from), (0.9, to)])
}

fn id(id: u128) -> Uuid {
    Uuid::from_u128(id)
}

fn queue_length(rig: &Rig) -> Option<u32> {
    rig.last.as_ref().expect("a tick").snapshot.motion.map(|motion| motion.queued)
}

fn limited(rig: &Rig) -> u64 {
    rig.last.as_ref().expect("a tick").snapshot.limited_setpoints
}

#[test]
fn appended_trajectories_run_in_order_each_to_its_exact_end() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.commands.clear();
    rig.follow(1, &line(A, B)).expect("granted");
    rig.ask(queued(2, &line(B, C), Append)).expect("it begins where the first ends");
    rig.ask(queued(3, &line(C, D), Append)).expect("granted");
    assert_eq!(queue_length(&rig), Some(2));
    rig.until("the end", |rig| rig.ended(3).is_some());
    for motion in 1..=3 {
        let rest: &[_] = if motion == 1 { &[] } else { &[Queued] };
        assert_eq!(rig.statuses(motion), [rest, &[Running, Complete]].concat());
    }
    for end in [B, C, D] {
        assert!(rig.commands.iter().any(|sent| sent.joint_position == joints(end)), "{end:?}");
    }
    assert_eq!((rig.retired.len(), limited(&rig)), (3, 0));
}

#[test]
fn what_does_not_begin_at_the_end_of_the_last_is_refused_with_joint_and_distance() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &line(A, B)).expect("granted");
    let elsewhere = trajectory(&[(0.0, A), (2.0, C)]);
    let here = rig.ask(queued(2, &elsewhere, Append));
    let expected = Refusal::StartTolerance { joint: 0, value: 0.4, limit: 0.05 };
    assert_eq!(here, Err(expected));
    assert_eq!(rig.retired.len(), 1);
    let near = trajectory(&[(0.0, [0.42, 0.0, 0.3]), (0.9, C)]);
    rig.ask(queued(3, &near, Append)).expect("near enough");
    rig.until("the end", |rig| rig.ended(3).is_some());
    assert_eq!(rig.ended(3).expect("ended").status, Complete);
    assert_eq!(limited(&rig), 0);
}

#[test]
fn the_queue_is_bounded() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &line(A, B)).expect("granted");
    for k in 0..MAX_QUEUED {
        let path = if k % 2 == 0 { line(B, C) } else { line(C, B) };
        rig.ask(queued(2 + k as u128, &path, Append)).expect("granted");
    }
    let full = rig.ask(queued(99, &line(B, C), Append));
    assert_eq!(full, Err(Refusal::QueueFull { limit: MAX_QUEUED }));
    assert_eq!(rig.ask(queued(3, &line(B, C), Append)), Err(Refusal::Busy(id(3))), "known");
    rig.order(Order::Halt);
    rig.tick();
    rig.finish();
    assert_eq!(rig.retired.len(), MAX_QUEUED + 3);
}

#[test]
fn what_waits_ends_with_the_one_before_it() {
    for how in 0..3 {
        let mut rig = Rig::in_mode(Trajectory);
        rig.follow(1, &line(A, B)).expect("granted");
        rig.ask(queued(2, &line(B, C), Append)).expect("granted");
        rig.ask(queued(3, &line(C, D), AppendBlended)).expect("granted");
        rig.ticks(50);
        match how {
            0 => drop(rig.order(Order::Cancel(id(1)))),
            1 => rig.plant.error_code = 7,
            _ => rig.stop = Some(StopLevel::L1),
        }
        rig.ticks(3);
        for motion in 2..=3 {
            let end = rig.ended(motion).expect("ended");
            assert_eq!((end.status, end.reason), (Cancelled, Some(Refusal::QueueBroken)));
        }
        rig.until("the end", |rig| rig.ended(1).is_some());
        let status = rig.ended(1).expect("ended").status;
        assert_eq!(status, if how == 0 { Cancelled } else { Failed });
        rig.stop = None;
        rig.ticks(200);
        assert_eq!(rig.retired.len(), 3);
    }
}

#[test]
fn a_cancel_of_one_that_waits_takes_those_behind_it_along_and_no_other() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &line(A, B)).expect("granted");
    for (motion, path) in [(2, line(B, C)), (3, line(C, D)), (4, line(D, C))] {
        rig.ask(queued(motion, &path, Append)).expect("granted");
    }
    rig.ask(Order::Cancel(id(3))).expect("granted");
    assert_eq!(rig.ended(3).expect("ended").reason, Some(Refusal::Cancelled));
    assert_eq!(rig.ended(4).expect("ended").reason, Some(Refusal::QueueBroken));
    rig.until("the end", |rig| rig.ended(2).is_some());
    assert_eq!([1, 2].map(|motion| rig.ended(motion).expect("ended").status), [Complete; 2]);
}

#[test]
fn a_blend_goes_over_without_a_rest_and_not_further_from_the_corner_than_it_may() {
    let run = |queue| {
        let mut rig = Rig::in_mode(Trajectory);
        rig.params.tracking_tolerance = joints([0.04; 3]);
        rig.follow(1, &line(A, B)).expect("granted");
        rig.ask(queued(2, &line(B, C), queue)).expect("granted");
        rig.commands.clear();
        rig.until("the end", |rig| rig.ended(2).is_some());
        assert_eq!(rig.statuses(1), [Running, Complete]);
        assert_eq!(rig.statuses(2), [Queued, Running, Complete]);
        assert_eq!(rig.commands.last().expect("sent").joint_position, joints(C));
        assert_eq!((rig.retired.len(), limited(&rig)), (2, 0));
        rig.ticks(20);
        assert_eq!(rig.fault_codes(), []);
        rig
    };
    let (rested, blended) = (run(Append), run(AppendBlended));
    assert!(blended.commands.len() + 5 < rested.commands.len(), "it saves time");
    let slowest = blended.commands[20..blended.commands.len() - 40]
        .windows(2)
        .map(|pair| pair[1].joint_position.max_abs_difference(&pair[0].joint_position))
        .fold(f64::INFINITY, f64::min);
    assert!(slowest > 1e-5, "no rest in between: {slowest}");
    let nearest = blended.commands.iter().map(|s| s.joint_position.max_abs_difference(&joints(B)));
    assert!(nearest.fold(f64::INFINITY, f64::min) <= 0.04);
}

#[test]
fn a_blend_can_be_paused_slowed_down_and_taken_off_again() {
    for ticks in (150..260).step_by(9) {
        for what in 0..3 {
            let mut rig = Rig::in_mode(Trajectory);
            rig.follow(1, &line(A, B)).expect("granted");
            rig.ask(queued(2, &line(B, C), AppendBlended)).expect("granted");
            rig.ticks(ticks);
            let running = if rig.ended(1).is_some() { 2 } else { 1 };
            match what {
                0 => {
                    rig.ask(Order::Pause(id(running))).expect("granted");
                    rig.until("rest", Rig::command_rests);
                    let now = if rig.ended(1).is_some() { 2 } else { 1 };
                    rig.ask(Order::Resume(id(now))).expect("granted");
                }
                1 => drop(rig.ask(Order::SetSpeedRatio(0.3)).expect("granted")),
                _ => {
                    let _ = rig.ask(Order::Cancel(id(2)));
                }
            }
            rig.until("the end", |rig| rig.ended(2).is_some() && rig.ended(1).is_some());
            assert_eq!(rig.ended(1).expect("ended").status, Complete, "{what} at {ticks}");
            let end = if what == 2 { Cancelled } else { Complete };
            assert_eq!(rig.ended(2).expect("ended").status, end, "{what} at {ticks}");
            assert_eq!((rig.retired.len(), limited(&rig)), (2, 0), "{what} at {ticks}");
        }
    }
}

#[test]
fn a_replacement_goes_over_in_motion_and_ends_what_was() {
    let mut rig = Rig::in_mode(Trajectory);
    rig.follow(1, &line(A, B)).expect("granted");
    rig.ask(queued(2, &line(B, C), Append)).expect("granted");
    rig.ticks(100);
    let far = rig.ask(queued(3, &trajectory(&[(0.0, [1.9; 3]), (1.0, [1.8; 3])]), Replace));
    assert!(matches!(far, Err(Refusal::StartTolerance { .. })), "{far:?}");
    let aside = trajectory(&[(0.0, [0.3, 0.05, 0.2]), (1.0, D)]);
    rig.ask(queued(4, &aside, Replace)).expect("granted");
    assert_eq!(rig.ended(1).expect("ended").status, Cancelled);
    assert_eq!(rig.ended(2).expect("ended").reason, Some(Refusal::QueueBroken));
    assert!(!rig.command_rests(), "it goes on");
    rig.until("the end", |rig| rig.ended(4).is_some());
    assert_eq!(rig.statuses(4), [Running, Complete]);
    assert_eq!(rig.commands.last().expect("sent").joint_position, joints(D));
    assert_eq!((rig.retired.len(), limited(&rig)), (4, 0));
}

#[test]
fn a_replacement_at_rest_or_at_a_changing_speed_arrives_too() {
    for paused in [false, true] {
        let mut rig = Rig::in_mode(Trajectory);
        rig.follow(1, &line(A, B)).expect("granted");
        rig.ticks(100);
        let order = if paused { Order::Pause(id(1)) } else { Order::SetSpeedRatio(0.4) };
        rig.ask(order).expect("granted");
        if paused {
            rig.until("rest", Rig::command_rests);
        }
        let aside = trajectory(&[(0.0, [0.3, 0.05, 0.2]), (1.0, D)]);
        rig.ask(queued(2, &aside, Replace)).expect("granted");
        rig.until("the end", |rig| rig.ended(2).is_some());
        assert_eq!(rig.ended(2).expect("ended").status, Complete);
        assert_eq!(rig.commands.last().expect("sent").joint_position, joints(D));
        assert_eq!(limited(&rig), 0);
    }
}

#[test]
fn the_loss_of_a_lease_ends_a_motion_as_it_was_told_to() {
    for (reaction, status) in [
        (LeaseLoss::StopOnPath, Failed),
        (LeaseLoss::Finish, Complete),
        (LeaseLoss::ContinueS(0.2), Failed),
    ] {
        let mut rig = Rig::in_mode(CommandMode::Halt);
        let lease = id(77);
        let ttl = PERIOD * 100;
        rig.ask(Order::AcquireLease { lease, ttl, role: Default::default() }).expect("granted");
        rig.ask_under(lease, Order::SetMode(Trajectory)).expect("granted");
        let first = FollowOrder::at_once(id(1), line(A, B));
        let first = Order::Follow(FollowOrder { on_lease_loss: reaction, ..first });
        rig.ask_under(lease, first).expect("granted");
        rig.ask_under(lease, queued(2, &line(B, C), Append)).expect("granted");
        rig.until("the end", |rig| rig.ended(1).is_some());
        assert_eq!(rig.ended(1).expect("ended").status, status, "{reaction:?}");
        assert_eq!(rig.ended(2).expect("ended").status, Cancelled, "{reaction:?}");
        rig.ticks(300);
        assert!(rig.command_rests());
        assert_eq!(limited(&rig), 0);
    }
}
