//! Loops that follow a motion together, with their words on a wire between them.

use std::sync::Arc;
use std::time::Duration;

use armada_model::{CompiledTrajectory, JointVector};
use armada_protocol::messages::{
    ActionStatus, CommandMode, Coupling, LeaseLoss, StopLevel, StopStage,
};
use uuid::Uuid;

use super::rig::{PERIOD, Rig, joints, params, trajectory};
use crate::control::{
    FollowOrder, GroupOrder, GroupWord, LoopEvent, MotionReport, Order, Params, PartnerFault,
    Refusal, Say, Word,
};

use ActionStatus::{Cancelled, Complete, Failed, Paused, Running};
use Coupling::{Independent, Rigid, TimeSynced};

const END: [f64; 3] = [0.6, 0.3, 0.6];
const MOTION: u128 = 5;
/// How long the common ramp of a group takes at most: from full rate at its slope, and who is ahead
/// goes slower.
const COMMON_S: f64 = 0.56;

fn path() -> Arc<CompiledTrajectory> {
    trajectory(&[(0.0, [0.0; 3]), (1.5, [0.4, 0.05, 0.3]), (3.0, END)])
}

/// Two robots, and whether the one hears the other.
struct Pair {
    /// Boxed, since two loops are large for a test's stack.
    rigs: [Box<Rig>; 2],
    /// Whether what a robot says arrives.
    heard: [bool; 2],
}

impl Pair {
    /// Two robots that are to start together in a tenth of a second.
    fn committed(coupling: Coupling) -> Self {
        Self::committed_after(coupling, |_, _| {})
    }

    /// The same of robots to which something was done before.
    fn committed_after(coupling: Coupling, before: impl Fn(usize, &mut Rig)) -> Self {
        Self::committed_under(coupling, LeaseLoss::StopOnPath, None, before)
    }

    fn committed_under(
        coupling: Coupling,
        on_lease_loss: LeaseLoss,
        lease: Option<Uuid>,
        before: impl Fn(usize, &mut Rig),
    ) -> Self {
        let mut rigs = [0, 1].map(|_| Box::new(Rig::in_mode(CommandMode::Trajectory)));
        for (index, rig) in rigs.iter_mut().enumerate() {
            before(index, rig);
        }
        let start = rigs[0].now.max(rigs[1].now) + Duration::from_millis(100);
        for rig in &mut rigs {
            if let Some(lease) = lease {
                let ttl = Duration::from_millis(600);
                rig.ask(Order::AcquireLease { lease, ttl, role: Default::default() })
                    .expect("granted");
            }
            let order = FollowOrder {
                start: Some(start),
                group: Some(group(coupling)),
                on_lease_loss,
                ..FollowOrder::at_once(Uuid::from_u128(MOTION), path())
            };
            rig.order_under(lease, Order::Follow(order));
        }
        Self { rigs, heard: [true; 2] }
    }

    /// Under way for a while.
    fn under_way(coupling: Coupling) -> Self {
        let mut pair = Self::committed(coupling);
        pair.ticks(125);
        assert!(pair.rates().iter().all(|&rate| rate == 1.0), "{:?}", pair.rates());
        pair
    }

    fn tick(&mut self) {
        for index in 0..2 {
            self.tick_one(index, 1);
        }
    }

    /// One loop wakes after so many periods.
    fn tick_one(&mut self, index: usize, periods: u32) {
        let output = self.rigs[index].late_tick(periods);
        let at = self.rigs[index].now;
        for said in output.group.iter().filter(|_| self.heard[index]) {
            let word = match said.say {
                Say::Go => Word::Go,
                Say::Heartbeat(beat) => Word::Heartbeat(beat),
                Say::Abort { from_phase_s, .. } => Word::Abort { from_phase_s },
            };
            let word = GroupWord { group: said.group, partner: 0, at, word };
            self.rigs[1 - index].words.push(word);
        }
    }

    fn ticks(&mut self, count: usize) {
        for _ in 0..count {
            self.tick();
        }
    }

    /// The loop that is due first wakes.
    fn tick_in_turn(&mut self) {
        let [first, second] = [0, 1].map(|index| {
            let rig = &self.rigs[index];
            rig.now + rig.params.period
        });
        self.tick_one(usize::from(second < first), 1);
    }

    fn until(&mut self, what: &str, condition: impl Fn(&Self) -> bool) {
        for _ in 0..2000 {
            self.tick();
            if condition(self) {
                return;
            }
        }
        panic!("{what} did not come");
    }

    fn end(&mut self) -> [MotionReport; 2] {
        self.until("the end", |pair| pair.rigs.iter().all(|rig| rig.ended(MOTION).is_some()));
        [0, 1].map(|index| self.rigs[index].ended(MOTION).expect("ended"))
    }

    fn rates(&self) -> [f64; 2] {
        [0, 1].map(|index| {
            let snapshot = self.rigs[index].last.as_ref().expect("a tick").snapshot;
            snapshot.motion.map_or(0.0, |motion| motion.rate)
        })
    }

    fn rest(&self) -> bool {
        self.rigs.iter().all(|rig| rig.command_rests())
    }
}

fn group(coupling: Coupling) -> GroupOrder {
    GroupOrder {
        coupling,
        partners: 1,
        loss: Duration::from_millis(60),
        max_divergence_s: 0.05,
        rate_slope_s: 2.0,
    }
}

fn sent(rig: &Rig) -> JointVector {
    rig.commands.last().expect("sent").joint_position
}

fn fault(report: &MotionReport) -> Option<PartnerFault> {
    match report.reason {
        Some(Refusal::Partner { fault, .. }) => Some(fault),
        _ => None,
    }
}

#[test]
fn loops_whose_ticks_fall_at_different_times_are_at_one_phase() {
    for shift_us in [1, 400, 1300, 2000, 2500, 3999] {
        for coupling in [Independent, TimeSynced, Rigid] {
            let mut pair = Pair::committed_after(coupling, |index, rig| {
                let shift = Duration::from_micros(if index == 1 { shift_us } else { 0 });
                rig.now = rig.now + shift;
            });
            let ends = pair.end();
            let [first, second] = ends.map(|end| end.started.expect("it began"));
            let apart = first.saturating_since(second) + second.saturating_since(first);
            assert!(apart < PERIOD, "{shift_us}: {apart:?}");
            for (rig, end) in pair.rigs.iter().zip(&ends) {
                assert_eq!((sent(rig), end.status), (joints(END), Complete));
                let quality = end.group.expect("it has partners");
                assert!(quality.max_divergence_ms < 1e-3, "{shift_us}: {quality:?}");
                let limited = rig.last.as_ref().expect("a tick").snapshot.limited_setpoints;
                assert_eq!(limited, 0, "{shift_us}");
            }
        }
    }
}

#[test]
fn loops_of_different_periods_are_at_one_phase() {
    for (period_ms, shift_us) in [(2, 0), (2, 700), (10, 0), (10, 300), (10, 3900)] {
        for coupling in [Independent, TimeSynced, Rigid] {
            let mut pair = Pair::committed_after(coupling, |index, rig| {
                if index == 1 {
                    let period = Duration::from_millis(period_ms);
                    let slow = Params { period, ..params() };
                    *rig = Rig::in_mode_with(slow, CommandMode::Trajectory);
                    rig.now = rig.now + Duration::from_micros(shift_us);
                }
            });
            for _ in 0..4000 {
                pair.tick_in_turn();
            }
            for rig in &pair.rigs {
                let end = rig.ended(MOTION).expect("it ended");
                assert_eq!((sent(rig), end.status), (joints(END), Complete), "{period_ms} ms");
                let quality = end.group.expect("it has partners");
                assert!(quality.max_divergence_ms < 1e-3, "{period_ms} {shift_us}: {quality:?}");
            }
        }
    }
}

#[test]
fn two_loops_start_at_one_tick_and_end_at_their_exact_ends() {
    for coupling in [Independent, TimeSynced, Rigid] {
        let mut pair = Pair::committed(coupling);
        let ends = pair.end();
        assert_eq!(ends[0].started, ends[1].started);
        for (rig, end) in pair.rigs.iter().zip(&ends) {
            assert_eq!(sent(rig), joints(END));
            assert_eq!(end.status, Complete);
            let quality = end.group.expect("it has partners");
            assert!(quality.max_silence_ms <= 28.0, "{quality:?}");
            assert!(quality.max_divergence_ms < 1e-6, "{quality:?}");
        }
        pair.ticks(300);
        let over = pair.rigs.iter().all(|rig| {
            rig.last
                .as_ref()
                .is_some_and(|output| output.snapshot.group.is_none() && output.group.is_empty())
        });
        assert!(over, "nothing is said any more");
    }
}

#[test]
fn a_loop_that_is_late_at_the_start_is_waited_for() {
    let mut pair = Pair::committed(TimeSynced);
    pair.ticks(22);
    for _ in 0..7 {
        pair.tick_one(1, 1);
    }
    pair.tick_one(0, 8);
    pair.tick_one(1, 1);
    let ends = pair.end();
    assert!(ends.iter().all(|end| end.status == Complete), "{ends:?}");
    let apart_ms = ends[1].group.expect("partners").max_divergence_ms;
    assert!((10.0..40.0).contains(&apart_ms), "{apart_ms}");
}

#[test]
fn nobody_starts_whose_partner_was_not_told_to() {
    let mut pair = Pair::committed(TimeSynced);
    pair.heard[1] = false;
    let ends = pair.end();
    assert_eq!(fault(&ends[0]), Some(PartnerFault::NotReady));
    assert_eq!(fault(&ends[1]), Some(PartnerFault::Aborted));
    assert_eq!((ends[0].status, ends[0].started), (Failed, None));
    assert!(sent(&pair.rigs[1]).max_abs_difference(&joints([0.0; 3])) < 1e-4);
}

#[test]
fn a_start_too_near_to_agree_on_and_a_group_without_a_start_are_refused() {
    let mut rig = Rig::in_mode(CommandMode::Trajectory);
    let order = |start, group| FollowOrder {
        start,
        group: Some(group),
        ..FollowOrder::at_once(Uuid::from_u128(MOTION), path())
    };
    let near = order(Some(rig.now + PERIOD * 3), group(TimeSynced));
    let refused = rig.ask(Order::Follow(near));
    assert!(matches!(refused, Err(Refusal::StartTooSoon { .. })), "{refused:?}");
    let refused = rig.ask(Order::Follow(order(None, group(TimeSynced))));
    assert!(matches!(refused, Err(Refusal::NotSupported(_))), "{refused:?}");
    let no_ramp = GroupOrder { rate_slope_s: 0.0, ..group(Rigid) };
    let refused = rig.ask(Order::Follow(order(Some(rig.now + PERIOD * 50), no_ramp)));
    assert!(matches!(refused, Err(Refusal::NotSupported(_))), "{refused:?}");
    assert_eq!(rig.retired.len(), 3, "what was refused is given back");
}

#[test]
fn a_cancel_of_one_ends_both_at_rest() {
    for coupling in [Independent, TimeSynced, Rigid] {
        let mut pair = Pair::under_way(coupling);
        pair.rigs[0].order(Order::Cancel(Uuid::from_u128(MOTION)));
        let ends = pair.end();
        assert_eq!(ends[0].status, Cancelled, "{coupling:?}");
        assert_eq!((ends[1].status, fault(&ends[1])), (Failed, Some(PartnerFault::Aborted)));
        pair.until("rest", Pair::rest);
        if coupling == Rigid {
            let apart = sent(&pair.rigs[0]).max_abs_difference(&sent(&pair.rigs[1]));
            assert!(apart < 2e-4, "one ramp, {apart} apart");
        }
        let limited = pair
            .rigs
            .iter()
            .map(|rig| rig.last.as_ref().map_or(1, |output| output.snapshot.limited_setpoints));
        assert_eq!(limited.sum::<u64>(), 0);
    }
}

#[test]
fn a_pause_of_one_rests_both_at_one_place_and_its_end_moves_both() {
    for coupling in [TimeSynced, Rigid] {
        let mut pair = Pair::under_way(coupling);
        pair.rigs[1].order(Order::Pause(Uuid::from_u128(MOTION)));
        pair.until("rest", Pair::rest);
        let apart = sent(&pair.rigs[0]).max_abs_difference(&sent(&pair.rigs[1]));
        assert!(apart < 1e-4, "{apart} apart");
        pair.ticks(100);
        assert!(pair.rest());
        for rig in &pair.rigs {
            assert_eq!(rig.statuses(MOTION).last(), Some(&Paused));
        }
        pair.rigs[1].order(Order::Resume(Uuid::from_u128(MOTION)));
        let ends = pair.end();
        for (rig, end) in pair.rigs.iter().zip(&ends) {
            assert_eq!(sent(rig), joints(END));
            assert_eq!(end.status, Complete);
            let told: Vec<_> = rig.statuses(MOTION);
            assert_eq!(told[1..], [Running, Paused, Running, Complete]);
            assert!(end.group.expect("partners").max_divergence_ms < 5.0, "{end:?}");
        }
    }
}

#[test]
fn one_of_robots_that_each_keep_their_pace_cannot_be_paused_or_slowed() {
    // Where they may be at the same time was proved clear for the full rate only.
    let mut pair = Pair::under_way(Independent);
    let id = Uuid::from_u128(MOTION);
    let pause = pair.rigs[1].order(Order::Pause(id));
    let slow = pair.rigs[1].order(Order::SetSpeedRatio(0.5));
    pair.ticks(100);
    assert_eq!(pair.rigs[1].answer(pause), Some(Err(Refusal::NotPausable)));
    assert_eq!(pair.rigs[1].answer(slow), Some(Err(Refusal::Busy(id))));
    assert_eq!(pair.rates(), [1.0, 1.0]);
}

#[test]
fn a_speed_ratio_of_one_is_that_of_both_and_of_what_starts_later() {
    let mut pair = Pair::under_way(TimeSynced);
    pair.rigs[0].order(Order::SetSpeedRatio(0.5));
    pair.ticks(150);
    assert_eq!(pair.rates(), [0.5, 0.5]);
    pair.rigs[0].order(Order::SetSpeedRatio(1.0));
    pair.ticks(150);
    assert_eq!(pair.rates(), [1.0, 1.0]);
    let mut pair = Pair::committed_after(TimeSynced, |index, rig| {
        let ratio = if index == 0 { 1.0 } else { 0.25 };
        rig.ask(Order::SetSpeedRatio(ratio)).expect("granted");
    });
    pair.ticks(60);
    assert_eq!(pair.rates(), [0.25, 0.25]);
}

#[test]
fn a_partner_that_is_not_heard_ends_the_motion_in_time() {
    for coupling in [Independent, TimeSynced, Rigid] {
        let mut pair = Pair::under_way(coupling);
        pair.heard = [false; 2];
        let lost = pair.rigs[0].now;
        pair.until("the end of going on", |pair| {
            let group = pair.rigs[0].last.as_ref().and_then(|output| output.snapshot.group);
            group
                .is_some_and(|group| group.state == armada_protocol::messages::GroupState::Aborting)
        });
        let silence = pair.rigs[0].now.saturating_since(lost);
        assert!(silence <= Duration::from_millis(64), "{silence:?}");
        let ends = pair.end();
        assert!(ends.iter().all(|end| matches!(fault(end), Some(PartnerFault::Silent(_)))));
    }
}

#[test]
fn a_stop_of_one_is_its_own_at_once_and_ends_the_other() {
    for coupling in [Independent, TimeSynced, Rigid] {
        let mut pair = Pair::under_way(coupling);
        if coupling == Rigid {
            pair.rigs[0].watch.common_s = COMMON_S;
        }
        pair.rigs[0].stop = Some(StopLevel::L1);
        pair.tick();
        assert_eq!(pair.rigs[0].ended(MOTION).expect("at once").status, Failed);
        let ends = pair.end();
        assert_eq!(fault(&ends[1]), Some(PartnerFault::Aborted), "{coupling:?}");
        pair.until("rest", Pair::rest);
    }
}

/// A rigid pair under way, the second with less acceleration than the first.
fn unequal_pair() -> Pair {
    let mut pair = Pair::committed_after(Rigid, |index, rig| {
        if index == 1 {
            let mut slow = params();
            for joint in &mut slow.limits {
                joint.acceleration = joint.acceleration.map(|most| 0.5 * most);
            }
            *rig = Rig::in_mode_with(slow, CommandMode::Trajectory);
        }
    });
    pair.ticks(225);
    for rig in &mut pair.rigs {
        rig.watch.common_s = COMMON_S;
    }
    pair
}

#[test]
fn a_stop_of_one_or_both_brings_a_rigid_pair_to_rest_at_one_place() {
    for level in [StopLevel::L2, StopLevel::L1] {
        for later in [Some(0), Some(1), Some(3), None] {
            let mut pair = unequal_pair();
            pair.rigs[0].stop = Some(level);
            if let Some(ticks) = later {
                pair.ticks(ticks);
                pair.rigs[1].stop = Some(level);
            }
            pair.tick();
            let end = pair.rigs[0].ended(MOTION).expect("at once");
            assert_eq!((end.status, end.reason), (Failed, Some(Refusal::Stopped(level))));
            assert_eq!(pair.rigs[0].stages(), [StopStage::Commanded], "it brakes in this tick");
            pair.until("rest", Pair::rest);
            let [first, second] = [0, 1].map(|index| sent(&pair.rigs[index]));
            let apart = first.max_abs_difference(&second);
            assert!(apart < 1e-3, "{level:?} {later:?}: {apart}");
            assert!(first.max_abs_difference(&joints([0.0; 3])) > 0.05, "they were in motion");
            pair.ticks(200);
            assert!(pair.rest(), "nothing moves any more");
            let raised = |event: &LoopEvent| matches!(event, LoopEvent::StopRaised(_));
            assert!(pair.rigs.iter().all(|rig| !rig.events.iter().any(raised)), "it is in time");
        }
    }
}

#[test]
fn whatever_ends_a_part_that_is_no_fault_brings_a_rigid_pair_to_rest_at_one_place() {
    let ends: [fn(&mut Rig); 2] = [
        |rig| {
            rig.order(Order::Halt);
        },
        |rig| {
            rig.order(Order::Cancel(Uuid::from_u128(MOTION)));
        },
    ];
    for (index, end) in ends.iter().enumerate() {
        let mut pair = unequal_pair();
        end(&mut pair.rigs[0]);
        pair.ticks(3);
        pair.until("rest", Pair::rest);
        let apart = sent(&pair.rigs[0]).max_abs_difference(&sent(&pair.rigs[1]));
        assert!(apart < 1e-3, "{index}: {apart}");
        let statuses = pair.end().map(|end| end.status);
        assert!(!statuses.contains(&Complete), "{index}: {statuses:?}");
    }
}

#[test]
fn a_stop_that_the_common_ramp_would_make_too_long_takes_the_own_one() {
    let mut pair = unequal_pair();
    for rig in &mut pair.rigs {
        rig.watch.common_s = 0.0;
        rig.params.stop_time = Duration::from_millis(600);
        rig.stop = Some(StopLevel::L2);
    }
    pair.until("rest", Pair::rest);
    let apart = sent(&pair.rigs[0]).max_abs_difference(&sent(&pair.rigs[1]));
    assert!(apart > 3e-3, "each brakes as hard as it can: {apart}");
}

#[test]
fn another_stop_on_the_common_ramp_stays_on_it_and_the_hardest_does_not() {
    let mut pair = unequal_pair();
    pair.rigs[0].stop = Some(StopLevel::L2);
    pair.ticks(5);
    pair.rigs[0].stop = Some(StopLevel::L1);
    pair.until("rest", Pair::rest);
    let apart = sent(&pair.rigs[0]).max_abs_difference(&sent(&pair.rigs[1]));
    assert!(apart < 1e-3, "{apart}");
    let mut pair = unequal_pair();
    pair.rigs[0].stop = Some(StopLevel::L2);
    pair.ticks(5);
    pair.rigs[0].stop = Some(StopLevel::L0);
    pair.tick();
    assert_eq!(pair.rigs[0].last.as_ref().expect("a tick").command, None);
    pair.ticks(300);
    let is_over = |rig: &Rig| rig.last.as_ref().is_some_and(|tick| tick.snapshot.group.is_none());
    assert!(pair.rigs.iter().all(|rig| is_over(rig)), "nobody waits for it");
}

#[test]
fn drives_that_go_off_end_the_motion_of_both() {
    let mut pair = Pair::under_way(Rigid);
    pair.rigs[0].plant.enabled = false;
    let ends = pair.end();
    assert!(matches!(ends[0].reason, Some(Refusal::Faulted(_))), "{:?}", ends[0].reason);
    assert_eq!(fault(&ends[1]), Some(PartnerFault::Aborted));
}

#[test]
fn a_lease_that_runs_out_ends_the_group_or_not_as_it_was_told() {
    let lease = Some(Uuid::from_u128(77));
    for coupling in [TimeSynced, Rigid] {
        let mut pair = Pair::committed_under(coupling, LeaseLoss::StopOnPath, lease, |_, _| {});
        let ends = pair.end();
        assert!(ends.iter().all(|end| end.status == Failed), "{ends:?}");
        assert!(ends.iter().any(|end| end.reason == Some(Refusal::LeaseLost)), "{ends:?}");
    }
    let mut pair = Pair::committed_under(TimeSynced, LeaseLoss::Finish, lease, |_, _| {});
    assert_eq!(pair.end().map(|end| end.status), [Complete; 2]);
}

#[test]
fn whoever_is_ahead_of_a_loop_that_was_late_waits() {
    let mut pair = Pair::under_way(TimeSynced);
    // The first loop misses 30 ms, while the second goes on.
    for _ in 0..7 {
        pair.tick_one(1, 1);
    }
    pair.tick_one(0, 8);
    pair.tick_one(1, 1);
    pair.ticks(200);
    let apart = sent(&pair.rigs[0]).max_abs_difference(&sent(&pair.rigs[1]));
    assert!(apart < 3e-3, "{apart}");
    let ends = pair.end();
    assert!(ends.iter().all(|end| end.status == Complete), "{ends:?}");
    let apart_ms = ends[1].group.expect("partners").max_divergence_ms;
    assert!((20.0..40.0).contains(&apart_ms), "{apart_ms}");
}
