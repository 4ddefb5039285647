//! The lease taken, delegated, and given up to the pendant.

use std::time::Duration;

use armada_protocol::messages::{
    ActionStatus, AuthorityState, CommandMode, FaultCode, LeaseLoss, LeaseScope, Queue, Role,
    StopLevel, StopStage, StreamHeader,
};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, follow, jog, joints, queued, trajectory};
use crate::control::{
    FollowOrder, Granted, LeaseChange, LoopEvent, MAX_DELEGATES, MotionReport, Order, Refusal,
    Snapshot, StreamSample, StreamValues,
};
use crate::drivers::{DriverRequest, JointSet};

use AuthorityState::{Free, Held, Inhibited, Local, Stale};
use CommandMode::{Halt, Jog, Trajectory, VelocityCommand};

const TTL: Duration = Duration::from_millis(200);
/// Ticks until a lease of [`TTL`] has run out.
const TTL_TICKS: usize = 50;
/// The lease of the tests, and its sub-leases.
const MAIN: Uuid = Uuid::from_u128(1);
const SUB: Uuid = Uuid::from_u128(2);
const OTHER: Uuid = Uuid::from_u128(3);

fn acquire(lease: Uuid, role: Role) -> Order {
    Order::AcquireLease { lease, ttl: Duration::from_secs(60), role }
}

fn take(lease: Uuid, role: Role) -> Order {
    Order::TakeLease { lease, ttl: TTL, role }
}

fn delegate(lease: Uuid, scope: LeaseScope) -> Order {
    Order::DelegateLease { parent: MAIN, lease, scope, ttl: TTL }
}

const fn renew(lease: Uuid) -> Order {
    Order::RenewLease { lease, ttl: None }
}

const fn parameter() -> Order {
    Order::SetParameter { parameter: 0, value: 0.0, restricted: false }
}

/// A robot in `mode` under [`MAIN`], which lasts a minute, with [`SUB`] for the arm.
fn shared(mode: CommandMode) -> Rig {
    let mut rig = Rig::in_mode(mode);
    rig.ask(acquire(MAIN, Role::Program)).expect("free");
    rig.ask(delegate(SUB, LeaseScope::Arm)).expect("it is the holder's");
    rig
}

/// The same, on a way of two seconds under [`SUB`] that reacts so to the loss of its lease.
fn following(reaction: LeaseLoss) -> Rig {
    let mut rig = shared(Trajectory);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [1.0, 0.0, 0.0])]);
    let order = FollowOrder::at_once(Uuid::from_u128(1), path);
    let order = Order::Follow(FollowOrder { on_lease_loss: reaction, ..order });
    rig.ask_under(SUB, order).expect("granted");
    rig.ticks(10);
    rig
}

fn snapshot(rig: &Rig) -> Snapshot {
    rig.last.as_ref().expect("a tick").snapshot
}

fn changes(rig: &Rig) -> Vec<LeaseChange> {
    let change = |event: &LoopEvent| match event {
        LoopEvent::Lease(change) => Some(*change),
        _ => None,
    };
    rig.events.iter().filter_map(change).collect()
}

fn delegates(rig: &Rig) -> Vec<Uuid> {
    snapshot(rig).delegates.iter().flatten().map(|sub| sub.lease).collect()
}

fn end(report: Option<MotionReport>) -> (ActionStatus, Option<Refusal>) {
    report.map(|report| (report.status, report.reason)).expect("the motion ended")
}

fn epoch(answer: Result<Granted, Refusal>) -> u64 {
    answer.expect("granted").epoch
}

#[test]
fn a_person_takes_the_lease_from_a_role_that_is_not_higher_and_what_moves_ends() {
    let mut rig = Rig::in_mode(Jog);
    rig.ask(acquire(MAIN, Role::Operator)).expect("free");
    rig.ask_under(MAIN, jog(1, [1.5, 0.0, 0.0])).expect("the holder may");
    rig.ticks(20);
    let before = rig.epoch();
    assert_eq!(epoch(rig.ask(take(OTHER, Role::Operator))), before + 1);
    assert_eq!(end(rig.ended(1)), (ActionStatus::Cancelled, Some(Refusal::LeaseTaken)));
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    assert_eq!(changes(&rig).last(), Some(&LeaseChange::Taken { lease: OTHER, from: MAIN }));
    assert_eq!(rig.ask(renew(MAIN)), Err(Refusal::LeaseStale));
    let report = snapshot(&rig).lease.expect("held");
    assert_eq!(
        (report.lease, report.role, snapshot(&rig).authority),
        (OTHER, Role::Operator, Held)
    );
}

#[test]
fn a_program_takes_nothing_and_nobody_takes_from_a_higher_role() {
    let program = Err(Refusal::RoleTooLow { needed: Role::Operator });
    let operator = Err(Refusal::RoleTooLow { needed: Role::Supervisor });
    let mut rig = Rig::in_mode(Halt);
    assert_eq!(rig.ask(take(OTHER, Role::Program)), program, "not even a free one");
    rig.ask(acquire(MAIN, Role::Supervisor)).expect("free");
    let before = rig.epoch();
    assert_eq!(rig.ask(take(OTHER, Role::Operator)), operator);
    assert_eq!((rig.epoch(), changes(&rig).len()), (before, 1), "nothing happened");
    assert!(rig.ask(take(OTHER, Role::Supervisor)).is_ok());
    rig.ticks(TTL_TICKS);
    assert_eq!(snapshot(&rig).authority, Stale);
    assert!(rig.ask(take(MAIN, Role::Operator)).is_ok(), "what has run out is anybody's");
}

#[test]
fn a_sub_lease_commands_what_it_is_for_and_nothing_else() {
    let refused = |scope, needed| Err(Refusal::ScopeTooNarrow { scope, needed });
    use LeaseScope::{Arm, EndEffector, Io};
    for (scope, of_arm, of_values) in [
        (Arm, None, None),
        (EndEffector, Some(refused(EndEffector, Arm)), None),
        (Io, Some(refused(Io, Arm)), None),
    ] {
        let mut rig = Rig::in_mode(Jog);
        rig.ask(acquire(MAIN, Role::Program)).expect("free");
        let before = rig.epoch();
        assert_eq!(epoch(rig.ask(delegate(SUB, scope))), before, "it takes nothing away");
        for (order, expected) in [(jog(1, [0.1; 3]), of_arm), (parameter(), of_values)] {
            let answer = rig.ask_under(SUB, order);
            match expected {
                Some(expected) => assert_eq!(answer, expected, "{scope:?}"),
                None => assert!(
                    !matches!(answer, Err(Refusal::ScopeTooNarrow { .. } | Refusal::LeaseStale)),
                    "{scope:?}: {answer:?}"
                ),
            }
        }
        let equipment = Order::SetEquipment(crate::control::EquipmentOrder {
            equipment: Default::default(),
            load: None,
            replaces: 99,
        });
        let narrow = rig.ask_under(SUB, equipment) == refused(Io, EndEffector);
        assert_eq!(narrow, scope == Io);
    }
}

#[test]
fn nothing_is_delegated_by_a_sub_lease_or_by_a_lease_that_is_not_in_force() {
    let mut rig = shared(Halt);
    let by =
        |parent| Order::DelegateLease { parent, lease: OTHER, scope: LeaseScope::Io, ttl: TTL };
    assert_eq!(rig.ask(by(SUB)), Err(Refusal::DelegatedAlready));
    assert_eq!(rig.ask(by(OTHER)), Err(Refusal::LeaseStale));
    assert_eq!(delegates(&rig), [SUB]);
}

#[test]
fn there_are_eight_sub_leases_at_most_and_one_that_ran_out_makes_room() {
    let mut rig = shared(Halt);
    for number in 1..MAX_DELEGATES as u128 {
        rig.ask(delegate(Uuid::from_u128(10 + number), LeaseScope::Io)).expect("room");
        rig.ask(renew(SUB)).expect("in force");
    }
    let full = Err(Refusal::TooManyDelegates { limit: MAX_DELEGATES });
    assert_eq!(rig.ask(delegate(OTHER, LeaseScope::Io)), full);
    assert!(rig.ask(delegate(SUB, LeaseScope::Arm)).is_ok(), "one that is there is kept");
    rig.ticks(TTL_TICKS);
    assert_eq!(delegates(&rig), Vec::<Uuid>::new());
    assert!(rig.ask(delegate(OTHER, LeaseScope::Io)).is_ok());
}

#[test]
fn a_sub_lease_that_ends_while_nothing_moves_under_it_disturbs_nobody() {
    for released in [true, false] {
        let mut rig = shared(Jog);
        rig.ask_under(MAIN, jog(1, [1.5, 0.0, 0.0])).expect("the holder may");
        let before = rig.epoch();
        if released {
            assert_eq!(epoch(rig.ask(Order::ReleaseLease(SUB))), before);
            assert_eq!(changes(&rig).last(), Some(&LeaseChange::Released(SUB)));
        } else {
            rig.ticks(TTL_TICKS);
            assert_eq!(changes(&rig).last(), Some(&LeaseChange::Expired(SUB)));
        }
        assert_eq!((rig.epoch(), rig.ended(1)), (before, None));
        assert_eq!(rig.ask_under(SUB, Order::SetSpeedRatio(1.0)), Err(Refusal::LeaseStale));
        assert_eq!(rig.ask(renew(SUB)), Err(Refusal::LeaseStale), "it is gone");
        rig.until("the end", |rig| rig.ended(1).is_some());
        assert_eq!(end(rig.ended(1)), (ActionStatus::Complete, None));
    }
}

#[test]
fn what_moves_under_a_sub_lease_ends_with_it() {
    let mut rig = following(LeaseLoss::StopOnPath);
    let before = rig.epoch();
    rig.ticks(TTL_TICKS);
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LeaseLost)));
    assert_eq!(rig.epoch(), before);
    let mut rig = following(LeaseLoss::Finish);
    assert_eq!(epoch(rig.ask(Order::ReleaseLease(SUB))), before + 1);
    assert_eq!(end(rig.ended(1)), (ActionStatus::Cancelled, Some(Refusal::Cancelled)));
    assert_eq!(snapshot(&rig).lease.map(|report| report.lease), Some(MAIN), "still held");
}

#[test]
fn what_may_go_on_without_its_sub_lease_keeps_it_in_sight_and_can_be_recovered() {
    let mut rig = following(LeaseLoss::Finish);
    rig.ticks(TTL_TICKS);
    let sub = snapshot(&rig).delegates[0].expect("in sight");
    assert_eq!((sub.lease, sub.stale, rig.ended(1)), (SUB, true, None));
    assert_eq!(rig.ask_under(SUB, Order::SetSpeedRatio(0.5)), Err(Refusal::LeaseStale));
    rig.ask(renew(SUB)).expect("it drives what goes on");
    assert_eq!(changes(&rig).last(), Some(&LeaseChange::Recovered(SUB)));
    assert!(rig.ask_under(SUB, Order::SetSpeedRatio(0.9)).is_ok());
    let mut rig = following(LeaseLoss::Finish);
    rig.until("the end", |rig| rig.ended(1).is_some());
    assert_eq!(end(rig.ended(1)), (ActionStatus::Complete, None));
    rig.tick();
    assert_eq!((delegates(&rig), rig.ask(renew(SUB))), (Vec::new(), Err(Refusal::LeaseStale)));
}

#[test]
fn the_loss_of_the_lease_above_ends_what_moves_under_a_sub_lease() {
    type Loss = fn(&mut Rig);
    let losses: [(&str, Loss, ActionStatus, Refusal); 3] = [
        (
            "released",
            |rig| assert!(rig.ask(Order::ReleaseLease(MAIN)).is_ok()),
            ActionStatus::Cancelled,
            Refusal::Cancelled,
        ),
        (
            "taken",
            |rig| assert!(rig.ask(take(OTHER, Role::Operator)).is_ok()),
            ActionStatus::Cancelled,
            Refusal::LeaseTaken,
        ),
        (
            "run out",
            |rig| {
                let renewal = Order::RenewLease { lease: MAIN, ttl: Some(TTL / 4) };
                rig.ask(renewal).expect("held");
                rig.ask(renew(SUB)).expect("in force");
                rig.ticks(TTL_TICKS / 4);
                assert_eq!(rig.ask(renew(SUB)), Err(Refusal::LeaseStale), "not without the other");
            },
            ActionStatus::Failed,
            Refusal::LeaseLost,
        ),
    ];
    for (name, lose, status, reason) in losses {
        let mut rig = following(LeaseLoss::StopOnPath);
        lose(&mut rig);
        assert_eq!(end(rig.ended(1)), (status, Some(reason)), "{name}");
        assert_eq!(rig.ask_under(SUB, Order::SetSpeedRatio(1.0)), Err(Refusal::LeaseStale));
    }
}

#[test]
fn a_lease_that_is_recovered_brings_its_sub_leases_back_and_moves_nothing() {
    let mut rig = shared(Jog);
    let short = Order::RenewLease { lease: MAIN, ttl: Some(TTL / 4) };
    rig.ask(short).expect("held");
    rig.ticks(TTL_TICKS / 4 + 1);
    assert_eq!((snapshot(&rig).authority, delegates(&rig)), (Stale, vec![SUB]));
    assert_eq!(rig.ask_under(SUB, Order::SetSpeedRatio(1.0)), Err(Refusal::LeaseStale));
    rig.ask(renew(MAIN)).expect("nobody took it");
    assert!(rig.ask_under(SUB, Order::SetSpeedRatio(1.0)).is_ok());
}

#[test]
fn what_waits_behind_a_motion_is_under_the_same_lease() {
    let mut rig = shared(Trajectory);
    let first = trajectory(&[(0.0, [0.0; 3]), (2.0, [0.5, 0.0, 0.0])]);
    let second = trajectory(&[(0.0, [0.5, 0.0, 0.0]), (2.0, [0.0; 3])]);
    rig.ask_under(MAIN, follow(1, &first)).expect("the holder may");
    let refused = rig.ask_under(SUB, queued(2, &second, Queue::Append));
    assert_eq!(refused, Err(Refusal::Busy(Uuid::from_u128(1))));
    assert!(rig.ask_under(MAIN, queued(3, &second, Queue::Append)).is_ok());
}

/// A sample under a lease, of the newest state.
fn sample(rig: &mut Rig, lease: Uuid) -> StreamSample {
    rig.sample_seq += 1;
    let Snapshot { epoch, seqno, .. } = snapshot(rig);
    let header = StreamHeader { lease, epoch, seq: rig.sample_seq, state_seqno: seqno };
    let velocity = joints([0.3, 0.0, 0.0]);
    StreamSample { header, values: StreamValues::Velocity { joints: JointSet::first(3), velocity } }
}

fn stream(rig: &mut Rig, lease: Uuid) {
    for _ in 0..20 {
        let sample = sample(rig, lease);
        rig.samples.push(sample);
        rig.tick();
    }
}

#[test]
fn a_stream_under_a_sub_lease_keeps_others_out_and_ends_with_it() {
    let mut rig = shared(VelocityCommand);
    stream(&mut rig, SUB);
    assert_eq!(snapshot(&rig).stream.map(|stream| stream.taken), Some(20));
    let mixed = sample(&mut rig, MAIN);
    rig.samples.push(mixed);
    rig.tick();
    assert_eq!(snapshot(&rig).dropped_samples.lease, 1, "one stream at a time");
    rig.ask(Order::ReleaseLease(SUB)).expect("in force");
    assert_eq!(snapshot(&rig).stream, None);
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    rig.until("standstill", Rig::command_rests);
    stream(&mut rig, MAIN);
    assert_eq!(snapshot(&rig).stream.map(|stream| stream.taken), Some(20));
}

#[test]
fn a_sub_lease_that_is_not_for_the_arm_streams_nothing() {
    let mut rig = Rig::in_mode(VelocityCommand);
    rig.ask(acquire(MAIN, Role::Program)).expect("free");
    rig.ask(delegate(SUB, LeaseScope::EndEffector)).expect("it is the holder's");
    stream(&mut rig, SUB);
    assert_eq!((snapshot(&rig).stream, snapshot(&rig).dropped_samples.lease), (None, 20));
}

/// Messages take so many ticks each way, and what comes between two ticks waits for the next: from
/// the sending of a take until the old holder is told, and no sample of it is followed any more.
#[test]
fn a_revocation_takes_one_round_trip_and_one_period() {
    for one_way in [0_u64, 1, 3, 7] {
        let mut rig = shared(VelocityCommand);
        let mut told = None;
        for tick in 0..60_u64 {
            // Whoever had the lease streams on, and its samples are as old as their way.
            let late = sample(&mut rig, MAIN);
            rig.samples.push(late);
            // Sent just after tick 10, so it has missed it.
            if tick == 10 + one_way + 1 {
                rig.order(take(OTHER, Role::Operator));
            }
            let output = rig.tick();
            let taken = LoopEvent::Lease(LeaseChange::Taken { lease: OTHER, from: MAIN });
            if output.events.contains(&taken) {
                told = Some(tick + one_way);
                assert_eq!(output.snapshot.stream, None, "ended in the same tick");
                let seen = output.snapshot.lease.map(|report| report.lease);
                assert_eq!((seen, output.snapshot.authority), (Some(OTHER), Held), "and told");
            }
            if told.is_some() {
                assert_eq!(output.snapshot.stream, None, "nothing of the old holder is followed");
            } else if tick > 0 {
                assert!(output.snapshot.stream.is_some(), "it is followed until then");
            }
        }
        assert_eq!(told, Some(10 + 2 * one_way + 1), "one way {one_way} ticks");
        let dropped = snapshot(&rig).dropped_samples;
        assert_eq!(dropped.lease, 60 - (10 + one_way + 1), "each that came later is counted");
    }
}

#[test]
fn the_pendant_ends_everything_and_nothing_resumes_after_it() {
    let mut rig = following(LeaseLoss::Finish);
    let before = rig.epoch();
    rig.plant.local_control = true;
    rig.tick();
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LocalControl)));
    assert!(!rig.command_rests(), "a ramp, not a jump to standstill");
    assert_eq!((snapshot(&rig).authority, snapshot(&rig).lease), (Local, None));
    assert_eq!((rig.epoch(), rig.mode(), delegates(&rig)), (before + 1, Halt, Vec::new()));
    assert_eq!(changes(&rig).last(), Some(&LeaseChange::Released(MAIN)));
    rig.ticks(200);
    let stood = rig.plant.position;
    rig.plant.local_control = false;
    rig.ticks(200);
    let sent = rig.commands.last().expect("set-points").joint_position;
    assert_eq!((snapshot(&rig).authority, sent), (Free, stood), "it stays where it is");
    let told = |local| rig.events.iter().filter(|e| **e == LoopEvent::LocalControl(local)).count();
    assert_eq!((told(true), told(false)), (1, 1));
    assert_eq!(rig.ask(renew(MAIN)), Err(Refusal::LeaseStale));
    assert!(rig.ask(Order::SetMode(Jog)).is_ok());
}

#[test]
fn while_the_pendant_has_control_only_what_ends_motion_is_granted() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.local_control = true;
    rig.tick();
    let path = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    for order in [
        Order::SetMode(Jog),
        Order::Enable,
        Order::ResetErrors,
        jog(1, [0.1; 3]),
        follow(2, &path),
        Order::SetSpeedRatio(0.5),
        parameter(),
        acquire(MAIN, Role::Supervisor),
        take(MAIN, Role::Supervisor),
        delegate(SUB, LeaseScope::Io),
    ] {
        assert_eq!(rig.ask(order.clone()), Err(Refusal::LocalControl), "{order:?}");
    }
    assert!(rig.ask(Order::SetMode(Halt)).is_ok());
    assert!(rig.ask(Order::Halt).is_ok());
    assert_eq!(rig.ask(Order::Cancel(SUB)), Err(Refusal::NoSuchMotion), "not refused for it");
    assert!(rig.ask_and_wait(Order::Disable).is_ok());
    rig.stop = Some(StopLevel::L2);
    rig.tick();
    assert!(
        rig.last
            .as_ref()
            .expect("a tick")
            .snapshot
            .flags
            .contains(armada_protocol::messages::RobotFlags::ESTOP_SOFTWARE)
    );
    assert_eq!(snapshot(&rig).authority, Local, "before everything else");
    rig.until("standstill", |rig| rig.stages().contains(&StopStage::Standstill));
    rig.plant.local_control = false;
    rig.tick();
    assert_eq!(snapshot(&rig).authority, Inhibited);
}

#[test]
fn a_controller_that_ceases_to_take_commands_for_its_pendant_has_no_fault() {
    let mut rig = shared(Jog);
    rig.ask_under(MAIN, jog(1, [1.5, 0.0, 0.0])).expect("the holder may");
    rig.ticks(20);
    (rig.plant.local_control, rig.plant.ready) = (true, false);
    rig.ticks(20);
    assert_eq!((rig.fault_codes(), rig.mode()), (Vec::<FaultCode>::new(), Halt));
    assert_eq!(end(rig.ended(1)), (ActionStatus::Failed, Some(Refusal::LocalControl)));
    // Moved by hand: what is commanded next begins where the robot is then.
    rig.plant.position = joints([0.7, 0.2, 0.0]);
    rig.ticks(20);
    (rig.plant.local_control, rig.plant.ready) = (false, true);
    rig.tick();
    let sent = rig.commands.last().expect("set-points").joint_position;
    assert_eq!(sent, joints([0.7, 0.2, 0.0]));
    rig.ticks(50);
    assert_eq!(rig.fault_codes(), []);
}

#[test]
fn a_robot_that_was_moved_by_hand_is_not_sent_back_when_the_pendant_gives_control_back() {
    let mut rig = shared(Jog);
    rig.ask_under(MAIN, jog(1, [1.5, 0.0, 0.0])).expect("the holder may");
    rig.ticks(20);
    rig.plant.local_control = true;
    rig.tick();
    assert!(rig.last.as_ref().expect("a tick").command.is_some(), "a ramp first");
    rig.until("the end of the ramp", |rig| {
        rig.last.as_ref().is_some_and(|output| output.command.is_none())
    });
    rig.ticks(20);
    rig.plant.position = joints([-0.4, 0.3, 0.1]);
    rig.ticks(20);
    assert_eq!(rig.last.as_ref().expect("a tick").command, None, "it is the pendant's");
    rig.plant.local_control = false;
    rig.tick();
    let sent = rig.commands.last().expect("set-points").joint_position;
    assert_eq!(sent, joints([-0.4, 0.3, 0.1]));
    rig.ticks(50);
    assert_eq!((rig.fault_codes(), rig.mode()), (Vec::<FaultCode>::new(), Halt));
}

#[test]
fn the_pendant_takes_back_that_drives_are_to_go_on() {
    let mut rig = Rig::in_mode(Halt);
    rig.ask_and_wait(Order::Disable).expect("granted");
    rig.plant.obeys_after = None;
    let ticket = rig.order(Order::Enable);
    rig.tick();
    assert_eq!(rig.answer(ticket), None, "waits for the controller");
    rig.plant.local_control = true;
    rig.tick();
    assert_eq!(rig.answer(ticket), Some(Err(Refusal::LocalControl)));
    rig.plant.asked.clear();
    rig.ticks(100);
    assert!(!rig.plant.asked.contains(&DriverRequest::Enable), "{:?}", rig.plant.asked);
}

#[test]
fn drives_do_not_go_on_by_themselves_at_the_start_while_the_pendant_has_control() {
    for local in [false, true] {
        let params = crate::control::Params { enable_on_start: true, ..super::rig::params() };
        let mut rig = Rig::with(params);
        (rig.plant.enabled, rig.plant.ready, rig.plant.local_control) = (false, false, local);
        rig.ticks(20);
        assert_eq!(rig.plant.enabled, !local);
        assert_eq!(snapshot(&rig).authority, if local { Local } else { Free });
    }
}

#[test]
fn silence_gives_nothing_back_that_the_pendant_took() {
    let mut rig = Rig::in_mode(Halt);
    rig.plant.local_control = true;
    rig.tick();
    rig.plant.silent = true;
    rig.ticks(50);
    assert_eq!(rig.fault_codes(), [FaultCode::CommunicationLost]);
    assert_eq!(snapshot(&rig).authority, Local);
    assert_eq!(rig.ask(Order::ResetErrors), Err(Refusal::LocalControl));
    assert!(rig.now > armada_model::MonoTime::ZERO + 50 * PERIOD);
}
