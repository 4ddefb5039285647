//! The invariants of stops that one loop can show, by their numbers in the specification.

use std::sync::Arc;
use std::time::Duration;

use armada_model::{CompiledTrajectory, MAX_JOINTS, Twist};
use armada_protocol::messages::{
    CommandMode, Coupling, FaultCode, HomeMethod, JogFrame, Queue, StopLevel, StopStage,
};
use uuid::Uuid;

use super::rig::{JOINTS, PERIOD, Rig, follow, jog, joints, params, queued, trajectory};
use super::stream;
use crate::control::{
    FollowOrder, GroupOrder, HomeOrder, JogCartesianOrder, JogJointOrder, LoopEvent, MAX_CHAINS,
    Order, Params, Refusal, TwistTarget,
};
use crate::drivers::{DriverRequest, JointSet, Values};

use CommandMode::{Halt, InvalidState, Jog, PositionCommand, Trajectory, VelocityCommand};
use StopLevel::{L0, L1, L2};
use StopStage::{Commanded, DrivesOff, Standstill};

const LEVELS: [StopLevel; 3] = [L2, L1, L0];

fn moving() -> Rig {
    let mut rig = Rig::in_mode(Jog);
    rig.jog(1, [1.8, 0.0, 0.0]).expect("granted");
    rig.ticks(120);
    rig
}

fn raises(rig: &Rig) -> Vec<StopLevel> {
    let raised = |event: &LoopEvent| match event {
        LoopEvent::StopRaised(level) => Some(*level),
        _ => None,
    };
    rig.events.iter().filter_map(raised).collect()
}

#[test]
fn invariant_03_a_stop_is_taken_in_every_mode_under_a_lease_with_a_fault_and_on_top_of_another() {
    for level in LEVELS {
        for mode in [Halt, Jog, Trajectory, PositionCommand, VelocityCommand] {
            let mut rig = Rig::in_mode(mode);
            let (lease, ttl) = (Uuid::from_u128(7), Duration::from_secs(10));
            rig.ask(Order::AcquireLease { lease, ttl, role: Default::default() }).expect("free");
            rig.stop = Some(level);
            rig.tick();
            assert_eq!(rig.stages(), [Commanded], "{mode:?} {level:?}");
            assert_eq!(rig.mode(), Halt);
        }
        let mut rig = moving();
        rig.loop_error = true;
        rig.tick();
        rig.loop_error = false;
        assert_eq!(rig.mode(), InvalidState);
        rig.stop = Some(level);
        rig.tick();
        assert_eq!(rig.stages(), [Commanded], "with a fault, {level:?}");
    }
    let mut rig = moving();
    for (count, level) in (1..).zip(LEVELS) {
        rig.stop = Some(level);
        rig.tick();
        assert_eq!(rig.stages(), vec![Commanded; count], "each is a stop of its own");
    }
}

#[test]
fn invariant_04_nothing_that_comes_after_a_stop_ends_its_ramp_sooner_or_later() {
    let ramp = |disturbed: bool| {
        let mut rig = moving();
        rig.stop = Some(L2);
        for turn in 0..200 {
            if disturbed {
                let order = match turn % 4 {
                    0 => Order::Halt,
                    1 => Order::Cancel(Uuid::from_u128(1)),
                    2 => Order::SetMode(Halt),
                    _ => Order::Enable,
                };
                rig.order(order);
            }
            rig.tick();
        }
        let at = rig.commands.len() - 200;
        rig.commands[at..].iter().map(|command| command.joint_position).collect::<Vec<_>>()
    };
    assert_eq!(ramp(true), ramp(false));
}

#[test]
fn invariant_05_no_way_to_move_is_open_while_a_stop_is_latched() {
    let path = trajectory(&[(0.0, [0.0; 3]), (1.0, [0.1; 3])]);
    for level in LEVELS {
        for mode in [Halt, Jog, Trajectory, PositionCommand, VelocityCommand] {
            let mut rig = Rig::in_mode(mode);
            rig.stop = Some(level);
            let (lease, ttl) = (Uuid::from_u128(7), Duration::from_secs(10));
            let ways = [
                jog(1, [0.1; 3]),
                follow(2, &path),
                Order::SetMode(Jog),
                Order::SetMode(Trajectory),
                Order::SetMode(PositionCommand),
                Order::SetMode(VelocityCommand),
                Order::Enable,
                Order::AcquireLease { lease, ttl, role: Default::default() },
            ];
            for order in ways {
                let what = format!("{order:?}");
                assert_eq!(rig.ask(order), Err(Refusal::Stopped(level)), "{mode:?}: {what}");
            }
            // Whatever else forbids these as well.
            for order in other_ways(&rig, &path) {
                let what = format!("{order:?}");
                assert!(rig.ask(order).is_err(), "{mode:?}: {what}");
            }
            let before = rig.plant.position;
            rig.ticks(50);
            assert_eq!(rig.plant.position, before);
            let begun = |asked: &DriverRequest| {
                !matches!(asked, DriverRequest::Disable | DriverRequest::StopMotion)
            };
            assert!(!rig.plant.asked.iter().any(begun), "{mode:?}: {:?}", rig.plant.asked);
        }
    }
}

fn other_ways(rig: &Rig, path: &Arc<CompiledTrajectory>) -> Vec<Order> {
    let mut twists = [None; MAX_CHAINS];
    twists[0] = Some(TwistTarget { chain: 0, twist: Twist::ZERO, frame: JogFrame::Base });
    let mut groups = [JointSet::NONE; MAX_JOINTS];
    groups[0] = JointSet::first(JOINTS);
    let (timeout, renews) = (Duration::from_millis(100), false);
    let joint_velocity = joints([0.1; JOINTS]);
    let partners = GroupOrder {
        coupling: Coupling::TimeSynced,
        partners: 1,
        loss: Duration::from_millis(60),
        max_divergence_s: 0.05,
        rate_slope_s: 2.0,
    };
    let id = Uuid::from_u128;
    vec![
        Order::JogJoint(JogJointOrder { id: id(3), joint_velocity, timeout, renews }),
        Order::JogCartesian(JogCartesianOrder { id: id(4), twists, timeout, renews }),
        Order::Home(HomeOrder { id: id(5), groups, method: HomeMethod::MoveToHome }),
        queued(6, path, Queue::Append),
        Order::Follow(FollowOrder {
            start: Some(rig.now + Duration::from_millis(100)),
            group: Some(partners),
            ..FollowOrder::at_once(id(7), Arc::clone(path))
        }),
        Order::Resume(id(1)),
        Order::SetSignal {
            signal: 0,
            values: Values::from_slice(&[1.0]).expect("one value"),
            restricted: false,
            while_stopped: false,
        },
    ]
}

#[test]
fn invariant_05_no_sample_of_a_stream_is_followed_while_a_stop_is_latched() {
    for level in LEVELS {
        for (mode, values) in [
            (PositionCommand, stream::position([0.1; JOINTS])),
            (VelocityCommand, stream::velocity([0.1; JOINTS])),
        ] {
            let mut rig = stream::streaming(mode);
            rig.stop = Some(level);
            for _ in 0..50 {
                // Of the newest epoch, under the lease that was held.
                stream::send(&mut rig, values);
            }
            assert_eq!(rig.plant.position, joints([0.0; JOINTS]), "{level:?} {mode:?}");
            assert!(rig.last.as_ref().expect("a tick").snapshot.stream.is_none());
        }
    }
}

#[test]
fn invariant_06_the_level_only_rises_until_a_reset() {
    let mut rig = moving();
    rig.stop = Some(L1);
    rig.tick();
    rig.stop = Some(L2);
    rig.until("drives off", |rig| rig.stages().contains(&DrivesOff));
    assert_eq!(rig.ask(Order::SetMode(Jog)), Err(Refusal::Stopped(L1)), "not the lower one");
    rig.stop = None;
    rig.tick();
    assert!(rig.events.contains(&LoopEvent::StopCleared));
    rig.stop = Some(L2);
    rig.tick();
    assert_eq!(rig.ask(Order::Enable), Err(Refusal::Stopped(L2)), "after a reset it begins anew");
}

#[test]
fn invariant_07_standstill_is_said_only_when_it_is_measured() {
    let mut rig = moving();
    rig.plant.blocked = true;
    rig.plant.creep = 0.02 * PERIOD.as_secs_f64();
    rig.stop = Some(L2);
    rig.until("the end of the set-points", Rig::command_rests);
    rig.ticks(100);
    assert_eq!(rig.stages(), [Commanded], "all set-points rest, and the robot does not");
    rig.plant.creep = 0.0;
    rig.until("standstill", |rig| rig.stages().contains(&Standstill));
}

#[test]
fn invariant_08_without_data_a_robot_is_not_stopped_and_is_stopped_harder() {
    let mut rig = moving();
    rig.plant.silent = true;
    rig.stop = Some(L2);
    let begun = rig.now;
    rig.until("the first raise", |rig| raises(rig) == [L1]);
    let waited = rig.now.saturating_since(begun);
    let stop_time = rig.params.stop_time;
    assert!(waited > stop_time && waited <= stop_time + PERIOD * 3, "{waited:?}");
    rig.until("the second raise", |rig| raises(rig) == [L1, L0]);
    assert!(!rig.stages().contains(&Standstill), "nothing is known of it");
    assert!(rig.plant.asked.contains(&DriverRequest::Disable), "asked for though nothing is heard");
    assert_eq!(rig.fault_codes(), [FaultCode::CommunicationLost]);
    rig.ticks(1000);
    assert_eq!(raises(&rig), [L1, L0], "there is nothing harder");
}

#[test]
fn a_stop_that_is_not_at_standstill_in_its_time_is_raised_and_one_that_is_stays() {
    let mut rig = moving();
    rig.stop = Some(L2);
    rig.ticks(1000);
    assert_eq!((raises(&rig), rig.plant.enabled), (vec![], true));
    let mut rig = moving();
    rig.plant.blocked = true;
    rig.plant.creep = 0.02 * PERIOD.as_secs_f64();
    rig.stop = Some(L2);
    rig.until("the raise", |rig| raises(rig) == [L1]);
    let epoch = rig.epoch();
    rig.until("the drives are off", |rig| !rig.plant.enabled);
    rig.plant.creep = 0.0;
    rig.until("all is measured", |rig| rig.stages().last() == Some(&DrivesOff));
    assert_eq!(rig.epoch(), epoch, "a raise is one epoch");
    // What the gate says is lower, but the raise stays until it opens.
    assert_eq!(rig.ask(Order::Enable), Err(Refusal::Stopped(L1)));
    rig.stop = None;
    rig.tick();
    assert!(rig.events.contains(&LoopEvent::StopCleared));
    assert!(!rig.plant.enabled, "a reset enables nothing");
}

#[test]
fn a_reset_empties_the_queue_and_takes_the_set_point_from_where_the_robot_stands() {
    let mut rig = Rig::in_mode(Trajectory);
    let path = trajectory(&[(0.0, [0.0; 3]), (2.0, [0.4; 3])]);
    rig.follow(1, &path).expect("granted");
    let behind = trajectory(&[(0.0, [0.4; 3]), (2.0, [0.0; 3])]);
    rig.ask(queued(2, &behind, Queue::Append)).expect("granted");
    rig.ticks(100);
    rig.stop = Some(L0);
    rig.until("the drives are off", |rig| rig.stages().contains(&DrivesOff));
    assert!(rig.ended(1).is_some() && rig.ended(2).is_some(), "the queue is empty");
    rig.plant.position = joints([0.3, 0.2, -0.1]);
    rig.tick();
    let epoch = rig.epoch();
    rig.stop = None;
    rig.tick();
    let snapshot = rig.last.as_ref().expect("a tick").snapshot;
    assert_eq!((snapshot.epoch, snapshot.command_mode), (epoch + 1, Halt));
    assert!(snapshot.motion.is_none() && snapshot.lease.is_none());
    rig.ask_and_wait(Order::Enable).expect("granted");
    let command = rig.commands.last().expect("sent").joint_position;
    assert_eq!(command, joints([0.3, 0.2, -0.1]), "where it stands, not where it stood");
}

#[test]
fn a_gate_that_is_closed_from_the_start_keeps_the_drives_off_that_were_to_go_on() {
    let mut rig = Rig::with(Params { enable_on_start: true, ..params() });
    (rig.plant.enabled, rig.plant.ready) = (false, false);
    rig.stop = Some(L2);
    rig.ticks(100);
    assert_eq!(rig.plant.asked, [], "nothing is asked of the controller");
    assert_eq!(rig.stages().last(), Some(&DrivesOff), "the stages come from measurement");
    assert_eq!(rig.ask(Order::Enable), Err(Refusal::Stopped(L2)));
    rig.stop = None;
    rig.ticks(100);
    assert!(!rig.plant.enabled, "a reset enables nothing");
}

#[test]
fn an_acknowledgement_is_a_signal_that_rises_while_it_is_watched() {
    let mut rig = Rig::with(Params { acknowledge: Some(1), ..params() });
    let acknowledged = |rig: &Rig| rig.last.as_ref().expect("a tick").snapshot.acknowledged;
    let signal = |rig: &mut Rig, value: f64| {
        rig.plant.signals = Values::from_slice(&[0.0, value]).expect("two values");
        rig.ticks(3);
        acknowledged(rig)
    };
    assert_eq!(signal(&mut rig, 1.0), None, "on from the start: a jammed button");
    assert_eq!(signal(&mut rig, 0.0), None);
    let before = rig.now;
    let first = signal(&mut rig, 1.0).expect("it rose");
    assert!(first > before && first <= rig.now);
    assert_eq!(signal(&mut rig, 1.0), Some(first), "held, it rises no more");
    rig.plant.silent = true;
    rig.ticks(50);
    rig.plant.silent = false;
    rig.ticks(3);
    assert_eq!(acknowledged(&rig), Some(first), "what was not seen to rise did not");
}
