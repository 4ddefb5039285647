//! Which samples of a stream are followed, and what becomes of the stream.

use std::time::Duration;

use armada_model::{JointVector, Twist};
use armada_protocol::messages::{CommandMode, JogFrame, RobotFlags, Role, StopLevel, StreamHeader};
use uuid::Uuid;

use super::rig::{JOINTS, PERIOD, Rig, joints};
use crate::control::{
    DroppedSamples, LinkReport, LoopEvent, Order, StreamChange, StreamReport, StreamSample,
    StreamValues, TwistTarget,
};
use crate::drivers::JointSet;

use CommandMode::{Halt, PositionCommand, VelocityCommand};

pub(super) const LEASE: Uuid = Uuid::from_u128(77);

/// A robot in `mode`, under the lease.
pub(super) fn streaming(mode: CommandMode) -> Rig {
    lead(Rig::new(), mode)
}

/// The same with a robot that is given.
pub(super) fn lead(mut rig: Rig, mode: CommandMode) -> Rig {
    rig.tick();
    let order =
        Order::AcquireLease { lease: LEASE, ttl: Duration::from_secs(60), role: Role::Program };
    rig.ask(order).expect("a free robot");
    rig.ask_under(LEASE, Order::SetMode(mode)).expect("a mode of every robot");
    rig
}

/// A sample that is good now, if its values are.
pub(super) fn sample(rig: &mut Rig, values: StreamValues) -> StreamSample {
    rig.sample_seq += 1;
    let snapshot = &rig.last.as_ref().expect("a tick").snapshot;
    let (epoch, state_seqno) = (snapshot.epoch, snapshot.seqno);
    let header = StreamHeader { lease: LEASE, epoch, seq: rig.sample_seq, state_seqno };
    StreamSample { header, values }
}

pub(super) fn position(position: [f64; JOINTS]) -> StreamValues {
    let joints_set = JointSet::first(JOINTS);
    let velocity = JointVector::EMPTY;
    StreamValues::Position { joints: joints_set, position: joints(position), velocity }
}

pub(super) fn velocity(velocity: [f64; JOINTS]) -> StreamValues {
    StreamValues::Velocity { joints: JointSet::first(JOINTS), velocity: joints(velocity) }
}

/// Hands in a good sample and runs a tick.
pub(super) fn send(rig: &mut Rig, values: StreamValues) {
    let sample = sample(rig, values);
    rig.samples.push(sample);
    rig.tick();
}

fn dropped(rig: &Rig) -> DroppedSamples {
    rig.last.as_ref().expect("a tick").snapshot.dropped_samples
}

fn report(rig: &Rig) -> Option<StreamReport> {
    rig.last.as_ref().expect("a tick").snapshot.stream
}

fn flags(rig: &Rig) -> RobotFlags {
    rig.last.as_ref().expect("a tick").snapshot.flags
}

fn commanded(rig: &Rig) -> JointVector {
    rig.commands.last().expect("sent").joint_position
}

fn changes(rig: &Rig) -> Vec<StreamChange> {
    rig.events
        .iter()
        .filter_map(|event| match event {
            LoopEvent::Stream(change) => Some(*change),
            _ => None,
        })
        .collect()
}

/// Sends a sample whose header was changed; it must not be followed.
fn refuse(rig: &mut Rig, change: impl FnOnce(&mut StreamHeader)) -> DroppedSamples {
    let mut bad = sample(rig, position([1.0; JOINTS]));
    change(&mut bad.header);
    rig.samples.push(bad);
    rig.ticks(5);
    assert!(rig.command_rests(), "a sample was followed that should have been dropped");
    dropped(rig)
}

#[test]
fn a_sample_needs_the_lease_in_force() {
    let none = DroppedSamples::default();
    let mut rig = streaming(PositionCommand);
    let other = Uuid::from_u128(78);
    assert_eq!(refuse(&mut rig, |h| h.lease = other), DroppedSamples { lease: 1, ..none });
    rig.ask(Order::ReleaseLease(LEASE)).expect("held");
    rig.ask(Order::SetMode(Halt)).expect("granted");
    rig.ask(Order::SetMode(PositionCommand)).expect("nobody holds a lease");
    assert_eq!(refuse(&mut rig, |_| {}), DroppedSamples { lease: 2, ..none });
}

#[test]
fn a_sample_of_another_epoch_is_dropped() {
    let mut rig = streaming(PositionCommand);
    let expected = DroppedSamples { epoch: 1, ..DroppedSamples::default() };
    assert_eq!(refuse(&mut rig, |header| header.epoch -= 1), expected);
    let expected = DroppedSamples { epoch: 2, ..expected };
    assert_eq!(refuse(&mut rig, |header| header.epoch += 1), expected);
}

#[test]
fn a_number_that_came_before_is_dropped_even_if_what_it_came_with_was_dropped_too() {
    let mut rig = streaming(PositionCommand);
    send(&mut rig, position([0.0; JOINTS]));
    let again = rig.sample_seq;
    let expected = DroppedSamples { sequence: 1, ..DroppedSamples::default() };
    assert_eq!(refuse(&mut rig, |header| header.seq = again), expected);
    refuse(&mut rig, |header| (header.seq, header.state_seqno) = (1000, u64::MAX));
    let expected = DroppedSamples { sequence: 2, age: 1, ..expected };
    assert_eq!(refuse(&mut rig, |header| header.seq = 1000), expected);
}

#[test]
fn a_new_epoch_may_be_numbered_anew() {
    let mut rig = streaming(PositionCommand);
    rig.sample_seq = 500;
    send(&mut rig, position([0.1, 0.0, 0.0]));
    rig.ask(Order::Halt).expect("granted");
    rig.until("rest", Rig::command_rests);
    rig.ask_under(LEASE, Order::SetMode(PositionCommand)).expect("granted");
    rig.sample_seq = 0;
    send(&mut rig, position([0.1, 0.0, 0.0]));
    assert_eq!(dropped(&rig), DroppedSamples::default());
    assert_eq!(report(&rig).expect("in progress").taken, 1);
}

#[test]
fn a_sample_for_a_state_that_is_too_old_or_of_the_future_is_dropped() {
    let mut rig = streaming(PositionCommand);
    let age_ticks = (rig.params.stream_max_age.as_nanos() / PERIOD.as_nanos()) as u64;
    rig.ticks(age_ticks as usize + 10);
    let newest = rig.last.as_ref().expect("a tick").snapshot.seqno;
    // The sample is taken a tick after the newest state.
    let mut just_young = sample(&mut rig, position([0.0; JOINTS]));
    just_young.header.state_seqno = newest + 1 - age_ticks;
    rig.samples.push(just_young);
    rig.tick();
    assert_eq!(dropped(&rig).age, 0);
    let too_old = newest + 1 - age_ticks;
    assert_eq!(refuse(&mut rig, |header| header.state_seqno = too_old).age, 1);
    assert_eq!(refuse(&mut rig, |header| header.state_seqno = 0).age, 2);
    assert_eq!(refuse(&mut rig, |header| header.state_seqno += 1).age, 3);
}

#[test]
fn the_age_of_a_sample_is_time_and_not_ticks() {
    let mut rig = streaming(PositionCommand);
    let old = sample(&mut rig, position([1.0; JOINTS]));
    rig.params.communication_timeout = Duration::from_secs(1);
    rig.samples.push(old);
    // Few ticks, but long ones.
    rig.late_tick(30);
    assert_eq!(dropped(&rig).age, 1);
}

#[test]
fn each_mode_takes_only_its_own_samples() {
    for (mode, wrong) in [
        (PositionCommand, velocity([0.1; JOINTS])),
        (PositionCommand, twist()),
        (VelocityCommand, position([0.1; JOINTS])),
        (CommandMode::Trajectory, position([0.1; JOINTS])),
        (CommandMode::Jog, velocity([0.1; JOINTS])),
    ] {
        let mut rig = streaming(mode);
        send(&mut rig, wrong);
        rig.ticks(5);
        assert!(rig.command_rests() && report(&rig).is_none(), "{mode:?} took {wrong:?}");
        assert_eq!(dropped(&rig), DroppedSamples { mode: 1, ..DroppedSamples::default() });
    }
}

fn twist() -> StreamValues {
    StreamValues::Twist(TwistTarget { chain: 0, twist: Twist::default(), frame: JogFrame::Base })
}

#[test]
fn values_that_make_no_sense_for_the_robot_are_dropped() {
    let all = JointSet::first(JOINTS);
    let good = joints([0.1; JOINTS]);
    let short = JointVector::from_slice(&[0.1; 2]).expect("finite");
    let broken = good.map_indexed(|_, _| f64::NAN);
    let of = |joints, position, velocity| StreamValues::Position { joints, position, velocity };
    let cases = [
        of(all, short, JointVector::EMPTY),
        of(all, good, short),
        of(all, broken, JointVector::EMPTY),
        of(all, good, broken),
        of(JointSet::NONE, good, JointVector::EMPTY),
        of(JointSet::first(JOINTS + 1), good, JointVector::EMPTY),
    ];
    let mut rig = streaming(PositionCommand);
    for (count, values) in (1..).zip(cases) {
        send(&mut rig, values);
        assert_eq!(dropped(&rig).values, count, "{values:?}");
    }
    let mut rig = streaming(VelocityCommand);
    let fast = StreamValues::Velocity { joints: all, velocity: broken };
    for (count, values) in (1..).zip([fast, twist()]) {
        send(&mut rig, values);
        assert_eq!(dropped(&rig).values, count, "{values:?}");
    }
    assert!(rig.command_rests());
}

#[test]
fn the_newest_good_sample_of_a_tick_is_followed_and_all_are_counted() {
    let mut rig = streaming(PositionCommand);
    for first in [0.5, -0.5, 0.001] {
        let next = sample(&mut rig, position([first, 0.0, 0.0]));
        rig.samples.push(next);
    }
    let mut wrong = sample(&mut rig, position([-0.9, 0.0, 0.0]));
    wrong.header.epoch = 0;
    rig.samples.push(wrong);
    rig.tick();
    let newest = rig.now;
    let link = LinkReport::default();
    let expected = StreamReport { taken: 3, dropped: 1, limited: 0, newest, starved: false, link };
    assert_eq!(report(&rig), Some(expected));
    for _ in 0..400 {
        send(&mut rig, position([0.001, 0.0, 0.0]));
        assert!((0.0..=0.001).contains(&commanded(&rig)[0]), "only the newest counts");
    }
    assert_eq!(commanded(&rig)[0], 0.001);
}

#[test]
fn a_stream_that_starves_comes_to_rest_and_holds_and_another_sample_resumes_it() {
    for (mode, values) in
        [(PositionCommand, position([1.9, 0.0, 0.0])), (VelocityCommand, velocity([1.2, 0.0, 0.0]))]
    {
        let mut rig = streaming(mode);
        for _ in 0..100 {
            send(&mut rig, values);
        }
        let epoch = rig.epoch();
        assert!(!rig.command_rests() && changes(&rig) == [StreamChange::Began]);
        let silent_ticks = (rig.params.stream_timeout.as_nanos() / PERIOD.as_nanos()) as usize;
        rig.ticks(silent_ticks);
        assert_eq!(report(&rig).map(|stream| stream.starved), Some(false), "in time still");
        rig.tick();
        assert_eq!(report(&rig).map(|stream| stream.starved), Some(true));
        assert_eq!(changes(&rig), [StreamChange::Began, StreamChange::Starved]);
        // 1.5 rad/s at 4 rad/s² and 80 rad/s³
        rig.ticks(115);
        assert!(rig.command_rests(), "{mode:?}");
        let held = commanded(&rig);
        rig.ticks(50);
        assert_eq!((commanded(&rig), rig.mode(), rig.epoch()), (held, mode, epoch));
        send(&mut rig, values);
        send(&mut rig, values);
        assert_eq!(changes(&rig).last(), Some(&StreamChange::Resumed));
        assert!(!rig.command_rests() && report(&rig).is_some_and(|stream| !stream.starved));
        assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
    }
}

#[test]
fn a_stream_under_way_shows_in_the_flags_of_its_mode() {
    let (by_position, by_velocity) =
        (RobotFlags::VALID_POSITION_COMMAND, RobotFlags::VALID_VELOCITY_COMMAND);
    for (mode, values, own, other) in [
        (PositionCommand, position([0.1; JOINTS]), by_position, by_velocity),
        (VelocityCommand, velocity([0.1; JOINTS]), by_velocity, by_position),
    ] {
        let mut rig = streaming(mode);
        assert!(!flags(&rig).contains(own));
        send(&mut rig, values);
        assert!(flags(&rig).contains(own) && !flags(&rig).contains(other));
        rig.ticks(30);
        assert!(!flags(&rig).contains(own), "no sample is followed any more");
    }
}

#[test]
fn what_raises_the_epoch_ends_the_stream_with_a_ramp() {
    type Act = fn(&mut Rig);
    let acts: [(&str, Act); 5] = [
        ("halt", |rig| assert!(rig.ask(Order::Halt).is_ok())),
        ("stop", |rig| rig.stop = Some(StopLevel::L2)),
        ("fault", |rig| rig.plant.error_code = 7),
        ("release", |rig| assert!(rig.ask(Order::ReleaseLease(LEASE)).is_ok())),
        ("disable", |rig| assert!(rig.order(Order::Disable) > 0)),
    ];
    for (what, act) in acts {
        let mut rig = streaming(VelocityCommand);
        for _ in 0..100 {
            send(&mut rig, velocity([0.5, 0.2, -1.0]));
        }
        let epoch = rig.epoch();
        act(&mut rig);
        rig.tick();
        assert!(rig.epoch() > epoch && report(&rig).is_none(), "{what}");
        assert_eq!(changes(&rig), [StreamChange::Began, StreamChange::Ended], "{what}");
        assert!(!rig.command_rests(), "{what} does not stop dead");
        let mut late = sample(&mut rig, velocity([1.0; JOINTS]));
        late.header.epoch = epoch;
        rig.samples.push(late);
        rig.until("rest", Rig::command_rests);
        assert!(report(&rig).is_none(), "{what}");
    }
}

#[test]
fn a_stream_whose_lease_runs_out_ends_and_a_renewed_lease_needs_new_samples() {
    let mut rig = Rig::new();
    rig.tick();
    let ttl = Duration::from_millis(400);
    rig.ask(Order::AcquireLease { lease: LEASE, ttl, role: Role::Program }).expect("free");
    rig.ask_under(LEASE, Order::SetMode(VelocityCommand)).expect("granted");
    for _ in 0..200 {
        send(&mut rig, velocity([0.5, 0.0, 0.0]));
    }
    assert!(rig.command_rests() && report(&rig).is_none());
    assert_eq!(changes(&rig), [StreamChange::Began, StreamChange::Ended]);
    assert!(dropped(&rig).lease > 50);
    rig.ask(Order::RenewLease { lease: LEASE, ttl: None }).expect("nobody else has one");
    rig.ticks(20);
    assert!(rig.command_rests(), "renewing does not move");
    send(&mut rig, velocity([0.5, 0.0, 0.0]));
    assert_eq!(changes(&rig).last(), Some(&StreamChange::Began));
}

#[test]
fn samples_during_the_ramp_of_an_older_stream_wait_for_its_end() {
    let mut rig = streaming(VelocityCommand);
    for _ in 0..100 {
        send(&mut rig, velocity([1.0, 0.0, 0.0]));
    }
    rig.ask(Order::ReleaseLease(LEASE)).expect("held");
    let order =
        Order::AcquireLease { lease: LEASE, ttl: Duration::from_secs(60), role: Role::Program };
    rig.ask(order).expect("free again");
    assert!(!rig.command_rests());
    for _ in 0..300 {
        send(&mut rig, velocity([-0.5, 0.0, 0.0]));
    }
    let speed = rig.commands.last().expect("sent").joint_velocity[0];
    assert!((speed + 0.5).abs() < 1e-9, "{speed}");
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0);
}

#[test]
fn speeds_are_scaled_by_the_speed_ratio_and_positions_are_not() {
    let mut rig = streaming(VelocityCommand);
    rig.state.speed_ratio = 0.5;
    for _ in 0..200 {
        send(&mut rig, velocity([0.5, -0.4, 1.0]));
    }
    let speed = rig.commands.last().expect("sent").joint_velocity;
    assert!(speed.max_abs_difference(&joints([0.25, -0.2, 0.5])) < 1e-9, "{speed:?}");
    let mut rig = streaming(PositionCommand);
    rig.state.speed_ratio = 0.1;
    for _ in 0..500 {
        send(&mut rig, position([0.5, -0.4, 1.0]));
    }
    assert_eq!(commanded(&rig), joints([0.5, -0.4, 1.0]));
}

#[test]
fn joints_that_a_sample_does_not_command_come_to_rest_and_stay() {
    let only = |joint: usize| JointSet::NONE.with(joint);
    let mut rig = streaming(PositionCommand);
    let values = |joint, first| StreamValues::Position {
        joints: only(joint),
        position: joints([first; JOINTS]),
        velocity: JointVector::EMPTY,
    };
    for _ in 0..60 {
        send(&mut rig, values(0, 1.0));
    }
    assert!(commanded(&rig)[0] > 0.05 && commanded(&rig)[1] == 0.0 && commanded(&rig)[2] == 0.0);
    for _ in 0..800 {
        send(&mut rig, values(2, -1.0));
    }
    let left = commanded(&rig);
    assert!(left[0] < 1.0 && left[1] == 0.0 && left[2] == -1.0, "{left:?}");
    let mut rig = streaming(VelocityCommand);
    let velocity = joints([0.5; JOINTS]);
    for _ in 0..100 {
        send(&mut rig, StreamValues::Velocity { joints: only(1), velocity });
    }
    assert_eq!(rig.commands.last().expect("sent").joint_velocity, joints([0.0, 0.5, 0.0]));
}

#[test]
fn positions_out_of_reach_are_followed_to_the_limit_and_counted() {
    let mut rig = streaming(PositionCommand);
    for _ in 0..1000 {
        send(&mut rig, position([20.0, -20.0, 1.0]));
    }
    assert_eq!(commanded(&rig), joints([2.0, -1.0, 1.0]));
    let stream = report(&rig).expect("in progress");
    assert_eq!((stream.taken, stream.limited), (1000, 1000));
    assert_eq!(rig.last.expect("a tick").snapshot.limited_setpoints, 0, "the limiter slept");
}
