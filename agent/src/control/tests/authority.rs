//! The lease: who may command, and what becomes of a motion when its lease ends.

use std::time::Duration;

use armada_protocol::messages::{
    ActionStatus, CommandMode, FaultCode, LeaseLoss, RobotFlags, Role, StopLevel,
};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, follow, jog, params, trajectory};
use crate::control::{
    FollowOrder, LeaseChange, LeaseReport, LoopEvent, MotionReport, Order, Params, Refusal,
};

use CommandMode::{Halt, Jog, Trajectory};

const TTL: Duration = Duration::from_millis(200);
/// Ticks until a lease of [`TTL`] has run out.
const TTL_TICKS: usize = 50;

fn lease(number: u128) -> Uuid {
    Uuid::from_u128(1000 + number)
}

fn renew(number: u128) -> Order {
    Order::RenewLease { lease: lease(number), ttl: None }
}

fn acquire(number: u128) -> Order {
    Order::AcquireLease { lease: lease(number), ttl: TTL, role: Role::Program }
}

/// A robot in `mode`, entered under lease 1.
fn held_in(mode: CommandMode) -> Rig {
    let mut rig = Rig::in_mode(Halt);
    rig.ask(acquire(1)).expect("free");
    rig.ask_under(lease(1), Order::SetMode(mode)).expect("the holder may");
    rig
}

/// A robot under lease 1 on a way of two seconds that reacts so to the loss of the lease.
fn following(reaction: LeaseLoss) -> Rig {
    let mut rig = held_in(Trajectory);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0, 0.0, 0.0])]);
    let order = FollowOrder::at_once(Uuid::from_u128(1), path);
    let order = Order::Follow(FollowOrder { on_lease_loss: reaction, ..order });
    rig.ask_under(lease(1), order).expect("granted");
    rig
}

fn report(rig: &Rig) -> Option<LeaseReport> {
    rig.last.as_ref().expect("a tick").snapshot.lease
}

fn changes(rig: &Rig) -> Vec<LeaseChange> {
    let change = |event: &LoopEvent| match event {
        LoopEvent::Lease(change) => Some(*change),
        _ => None,
    };
    rig.events.iter().filter_map(change).collect()
}

fn end(report: Option<MotionReport>) -> (ActionStatus, Option<Refusal>) {
    report.map(|report| (report.status, report.reason)).expect("the motion ended")
}

#[test]
fn where_a_lease_is_required_nothing_leads_to_motion_without_one_and_it_ends_with_it() {
    let mut rig = Rig::in_mode_with(Params { lease_required: true, ..params() }, Halt);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0, 0.0, 0.0])]);
    let order = FollowOrder::at_once(Uuid::from_u128(1), path);
    for order in [Order::SetMode(Trajectory), Order::Follow(order.clone())] {
        assert_eq!(rig.ask(order).err(), Some(Refusal::NoLease));
    }
    for order in [Order::Halt, Order::SetMode(Halt), Order::ResetErrors] {
        let ticket = rig.order(order);
        rig.until("an answer", |rig| rig.answer(ticket).is_some());
        assert!(rig.answer(ticket).expect("waited for").is_ok());
    }
    rig.ask(acquire(1)).expect("free");
    rig.ask_under(lease(1), Order::SetMode(Trajectory)).expect("the holder may");
    rig.ask_under(lease(1), Order::Follow(order)).expect("the holder may");
    rig.until("the end of the lease", |rig| rig.ended(1).is_some());
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LeaseLost)));
    rig.until("rest", Rig::command_rests);
    let jogging = rig.ask(Order::SetMode(Jog));
    assert_eq!(jogging.err(), Some(Refusal::NoLease), "a lease that has run out is none");
}

#[test]
fn while_nobody_holds_a_lease_none_is_needed_but_a_wrong_one_is_refused() {
    let mut rig = Rig::in_mode(Halt);
    assert_eq!(rig.ask_under(lease(9), Order::SetMode(Jog)), Err(Refusal::LeaseStale));
    assert!(rig.ask(Order::SetMode(Jog)).is_ok());
    assert!(rig.jog(1, [0.1, 0.0, 0.0]).is_ok());
}

#[test]
fn a_lease_is_granted_once_with_a_new_epoch_and_told_in_the_snapshot() {
    let mut rig = Rig::in_mode(Halt);
    let epoch = rig.epoch();
    let granted = rig.ask(acquire(1)).expect("free");
    assert_eq!(granted.epoch, epoch + 1);
    let deadline = rig.now + TTL;
    assert_eq!(
        report(&rig),
        Some(LeaseReport { lease: lease(1), role: Role::Program, deadline, stale: false })
    );
    rig.ticks(10);
    let remaining_s = (TTL - 11 * PERIOD).as_secs_f64();
    assert_eq!(rig.ask(acquire(2)), Err(Refusal::LeaseRequired { remaining_s }));
    assert_eq!(changes(&rig), [LeaseChange::Granted(lease(1))]);
}

#[test]
fn the_same_lease_acquired_again_is_renewed_for_its_new_time() {
    let mut rig = held_in(Halt);
    let epoch = rig.epoch();
    rig.ticks(10);
    let again = Order::AcquireLease { lease: lease(1), ttl: 2 * TTL, role: Role::Program };
    assert_eq!(rig.ask(again).map(|granted| granted.epoch), Ok(epoch));
    assert_eq!(report(&rig).map(|report| report.deadline), Some(rig.now + 2 * TTL));
    assert_eq!(changes(&rig), [LeaseChange::Granted(lease(1))]);
}

#[test]
fn what_commands_needs_the_lease_and_what_ends_motion_does_not() {
    use crate::control::{DelegateOrder, EquipmentOrder, HomeOrder, JogJointOrder};
    use crate::drivers::{DelegatedGoal, DelegatedMove, JointSet, Values};
    use armada_protocol::messages::{HomeMethod, MotionKind, Queue};

    let path = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    let id = Uuid::from_u128(5);
    let joint_velocity = super::rig::joints([0.1; 3]);
    let goal = DelegatedGoal::Joint(joint_velocity);
    let order = DelegatedMove { number: 0, goal, speed: 1.0, blend_radius_m: 0.0, connect: false };
    let commanding = [
        Order::SetMode(Jog),
        Order::Enable,
        Order::ResetErrors,
        jog(1, [0.1; 3]),
        follow(2, &path),
        Order::Home(HomeOrder {
            id,
            groups: [JointSet::NONE; armada_model::MAX_JOINTS],
            method: HomeMethod::default(),
        }),
        Order::JogJoint(JogJointOrder { id, joint_velocity, timeout: TTL, renews: false }),
        Order::Delegate(DelegateOrder {
            id,
            kind: MotionKind::MoveJoint,
            order,
            queue: Queue::Refuse,
            on_lease_loss: LeaseLoss::StopOnPath,
        }),
        Order::Pause(id),
        Order::Resume(id),
        Order::SetSpeedRatio(0.5),
        Order::SetEquipment(EquipmentOrder {
            equipment: Default::default(),
            load: None,
            replaces: 0,
        }),
        Order::SetSignal {
            signal: 0,
            values: Values::EMPTY,
            restricted: false,
            while_stopped: false,
        },
        Order::SetParameter { parameter: 0, value: 0.0, restricted: false },
    ];
    for order in commanding {
        let mut rig = held_in(Halt);
        let answer = rig.ask(order.clone());
        assert!(matches!(answer, Err(Refusal::LeaseRequired { .. })), "{order:?}: {answer:?}");
        assert_eq!(rig.ask_under(lease(2), order.clone()), Err(Refusal::LeaseStale), "{order:?}");
        let retired = matches!(order, Order::Follow(_) | Order::SetEquipment(_));
        assert_eq!(rig.last_retired(), usize::from(retired), "{order:?}");
    }
    for order in [Order::SetMode(Halt), Order::Halt] {
        assert!(held_in(Jog).ask(order).is_ok());
    }
    assert!(held_in(Halt).ask_and_wait(Order::Disable).is_ok());
    let mut rig = held_in(Jog);
    rig.ask_under(lease(1), jog(1, [1.0, 0.0, 0.0])).expect("the holder may");
    assert!(rig.ask_under(lease(7), Order::Cancel(Uuid::from_u128(1))).is_ok());
}

#[test]
fn a_renewed_lease_lasts_on_and_ends_nothing() {
    let mut rig = following(LeaseLoss::StopOnPath);
    let epoch = rig.epoch();
    for _ in 0..20 {
        rig.ticks(TTL_TICKS / 2);
        assert_eq!(rig.ask(renew(1)).map(|g| g.epoch), Ok(epoch));
    }
    assert_eq!(end(rig.ended(1)), (ActionStatus::Complete, None));
}

#[test]
fn a_lease_that_runs_out_ends_its_motion_with_a_ramp_in_the_same_epoch() {
    let mut rig = following(LeaseLoss::StopOnPath);
    let (epoch, deadline) = (rig.epoch(), report(&rig).expect("held").deadline);
    rig.until("the end of the lease", |rig| report(rig).is_some_and(|report| report.stale));
    assert_eq!(rig.now, deadline, "in the tick of its deadline");
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LeaseLost)));
    assert_eq!((rig.epoch(), rig.mode()), (epoch, Trajectory));
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    rig.until("standstill", Rig::command_rests);
    rig.ticks(TTL_TICKS);
    let expired = LeaseChange::Expired(lease(1));
    assert_eq!(changes(&rig), [LeaseChange::Granted(lease(1)), expired], "told once");
}

#[test]
fn a_stale_lease_is_recovered_by_its_holder_and_moves_nothing() {
    let mut rig = following(LeaseLoss::StopOnPath);
    let epoch = rig.epoch();
    rig.ticks(TTL_TICKS + 200);
    let sent = rig.commands.last().copied();
    assert_eq!(rig.ask(renew(1)).map(|granted| granted.epoch), Ok(epoch));
    assert_eq!(changes(&rig).last(), Some(&LeaseChange::Recovered(lease(1))));
    rig.ticks(TTL_TICKS / 2);
    assert_eq!(rig.commands.last().copied(), sent);
    assert!(rig.ask_under(lease(1), Order::SetSpeedRatio(1.0)) != Err(Refusal::LeaseStale));
}

#[test]
fn a_stale_lease_that_another_took_is_gone() {
    let mut rig = held_in(Jog);
    rig.ticks(TTL_TICKS);
    assert!(rig.ask(acquire(2)).is_ok());
    assert_eq!(rig.ask(renew(1)), Err(Refusal::LeaseStale));
    assert_eq!(rig.ask(Order::ReleaseLease(lease(1))), Err(Refusal::LeaseStale));
    assert_eq!(rig.ask_under(lease(1), jog(1, [0.1; 3])), Err(Refusal::LeaseStale));
    assert!(rig.ask_under(lease(2), jog(2, [0.1; 3])).is_ok());
}

#[test]
fn a_stale_lease_is_gone_once_somebody_commands_without_one() {
    let mut rig = held_in(Jog);
    rig.ticks(TTL_TICKS);
    assert!(rig.jog(1, [0.5, 0.0, 0.0]).is_ok(), "as if nobody held one");
    assert_eq!(report(&rig), None);
    assert_eq!(rig.ask(renew(1)), Err(Refusal::LeaseStale));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(end(rig.ended(1)), (ActionStatus::Complete, None));
}

#[test]
fn a_motion_without_a_lease_does_not_end_with_a_lease_of_somebody() {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.5, 0.0, 0.0]).expect("nobody holds a lease");
    rig.ticks(20);
    rig.ask(acquire(1)).expect("free");
    let taken = (ActionStatus::Cancelled, Some(Refusal::LeaseTaken));
    assert_eq!(end(rig.ended(1)), taken, "a grant ends what moved before");
    assert!(!rig.command_rests(), "with a ramp");
    rig.until("standstill", Rig::command_rests);
}

#[test]
fn a_motion_that_may_finish_does_so_and_keeps_others_away() {
    let mut rig = following(LeaseLoss::Finish);
    rig.ticks(TTL_TICKS + 1);
    assert!(report(&rig).expect("still known").stale);
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::LeaseRequired { remaining_s: 0.0 }));
    assert_eq!(rig.ask_under(lease(1), Order::SetSpeedRatio(1.0)), Err(Refusal::LeaseStale));
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(end(rig.ended(1)), (ActionStatus::Complete, None));
}

#[test]
fn a_motion_that_may_finish_ends_when_another_acquires_the_lease() {
    let mut rig = following(LeaseLoss::Finish);
    rig.ticks(TTL_TICKS + 1);
    rig.ask(acquire(2)).expect("stale");
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LeaseLost)));
}

#[test]
fn a_motion_that_may_go_on_for_a_while_ends_after_it_unless_the_lease_is_recovered() {
    for recovered in [false, true] {
        let mut rig = following(LeaseLoss::ContinueS(0.4));
        let deadline = report(&rig).expect("held").deadline;
        rig.ticks(TTL_TICKS + 50);
        if recovered {
            rig.ask(renew(1)).expect("nobody took it");
            rig.until("another end", |rig| report(rig).is_some_and(|report| report.stale));
        }
        rig.until("the end", |rig| rig.ended(1).is_some());
        assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LeaseLost)));
        let while_s = rig.now.saturating_since(deadline).as_secs_f64();
        assert!(if recovered { while_s > 0.7 } else { while_s == 0.4 }, "{while_s} s");
    }
}

#[test]
fn a_lease_that_runs_out_does_not_change_why_a_motion_is_being_cancelled() {
    let mut rig = held_in(Jog);
    rig.ticks(TTL_TICKS - 40);
    rig.ask_under(lease(1), jog(1, [1.9, 0.0, 0.0])).expect("granted");
    rig.ticks(30);
    rig.ask(Order::Cancel(Uuid::from_u128(1))).expect("in progress");
    rig.until("the end of the lease", |rig| report(rig).is_some_and(|report| report.stale));
    assert_eq!(rig.ended(1), None, "still on the ramp");
    rig.until("standstill", |rig| rig.ended(1).is_some());
    assert_eq!(end(rig.ended(1)), (ActionStatus::Cancelled, Some(Refusal::Cancelled)));
}

#[test]
fn a_release_ends_the_motion_with_a_ramp_in_a_new_epoch() {
    let mut rig = following(LeaseLoss::Finish);
    rig.ticks(TTL_TICKS / 2);
    let epoch = rig.epoch();
    let granted = rig.ask(Order::ReleaseLease(lease(1))).expect("held");
    assert_eq!((granted.epoch, report(&rig)), (epoch + 1, None));
    assert_eq!(end(rig.ended(1)), (ActionStatus::Cancelled, Some(Refusal::Cancelled)));
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    rig.until("standstill", Rig::command_rests);
    assert!(rig.ask(Order::SetMode(Halt)).is_ok());
    assert!(rig.ask(Order::SetMode(Jog)).is_ok(), "none is needed any more");
}

#[test]
fn a_stop_takes_the_lease_and_none_can_be_acquired_until_its_reset() {
    let mut rig = following(LeaseLoss::Finish);
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    let stopped = Refusal::Stopped(StopLevel::L2);
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(stopped)));
    assert_eq!(report(&rig), None);
    assert_eq!(changes(&rig).last(), Some(&LeaseChange::Released(lease(1))));
    assert_eq!(rig.ask(acquire(2)), Err(stopped));
    assert_eq!(rig.ask(renew(1)), Err(Refusal::LeaseStale));
    assert_eq!(rig.ask_under(lease(1), Order::Enable), Err(stopped), "not: acquire it anew");
    rig.until("standstill", Rig::command_rests);
    rig.stop = None;
    rig.tick();
    assert!(rig.ask(acquire(2)).is_ok());
}

#[test]
fn a_fault_does_not_take_the_lease_and_only_the_holder_may_reset_it() {
    let mut rig = held_in(Jog);
    rig.plant.error_code = 7;
    rig.tick();
    assert_eq!(rig.fault_codes(), [FaultCode::ControllerError]);
    assert!(matches!(rig.ask(Order::ResetErrors), Err(Refusal::LeaseRequired { .. })));
    rig.plant.error_code = 0;
    assert!(rig.ask_under(lease(1), Order::ResetErrors).is_ok());
    assert_eq!(report(&rig).map(|report| report.lease), Some(lease(1)));
    let flags = rig.last.expect("a tick").snapshot.flags;
    assert!(!flags.contains(RobotFlags::ERROR));
}
