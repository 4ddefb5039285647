use std::time::Duration;

use armada_protocol::messages::{Coupling, GroupState};

use super::world::{GROUP, LOSS, PERIOD, World, order, perfect};
use crate::control::{BEAT, GroupMachine, GroupWord, PartnerFault, Refusal, Say, Word};

use Coupling::{Independent, Rigid, TimeSynced};

fn fault(world: &World, robot: usize) -> Option<PartnerFault> {
    match world.robots[robot].ended {
        Some((_, Some(Refusal::Partner { fault, .. }))) => Some(fault),
        _ => None,
    }
}

fn running(world: &World) -> bool {
    world.robots.iter().all(|robot| robot.moves())
}

/// Up to an instant in the middle of the motion.
fn under_way(coupling: Coupling, count: usize) -> World {
    let mut world = World::new(coupling, count, 3.0);
    world.until("the start", &mut perfect, running);
    world.ticks(100, &mut perfect);
    world
}

#[test]
fn robots_that_hear_each_other_start_at_once_and_end_as_done() {
    for count in [2, 3, 16] {
        let mut world = World::new(TimeSynced, count, 0.5);
        world.until("the start", &mut perfect, running);
        assert_eq!(world.divergence_s(), 0.0);
        world.until("the end", &mut perfect, |world| {
            world.robots.iter().all(|robot| robot.machine.is_over(world.now))
        });
        for robot in &world.robots {
            assert_eq!(robot.state(), GroupState::Done);
            let quality = robot.machine.report().quality;
            assert!(quality.max_silence_ms < 30.0, "{quality:?}");
            assert!(quality.max_divergence_ms < 1e-6, "{quality:?}");
        }
    }
}

#[test]
fn whoever_misses_a_go_does_not_start_and_takes_those_along_that_did() {
    let mut world = World::new(TimeSynced, 3, 1.0);
    let mut deaf = |from: usize, to: usize, say: &Say| match (from, to, say) {
        (0, 2, Say::Go) => Vec::new(),
        _ => perfect(from, to, say),
    };
    world.until("the end", &mut deaf, |world| world.robots.iter().all(|r| r.ended.is_some()));
    assert_eq!(fault(&world, 2), Some(PartnerFault::NotReady));
    assert!(!world.robots[2].started);
    for robot in [0, 1] {
        assert_eq!(fault(&world, robot), Some(PartnerFault::Aborted));
        assert!(world.robots[robot].phase_s <= 0.01, "{}", world.robots[robot].phase_s);
    }
}

#[test]
fn a_partner_that_falls_silent_stops_all_within_the_loss_time() {
    for coupling in [Independent, TimeSynced] {
        let mut world = under_way(coupling, 3);
        world.robots[1].alive = false;
        let crash = world.now;
        world.until("the end", &mut perfect, |world| {
            world.robots.iter().all(|robot| !robot.moves())
        });
        let silence = (world.now - Duration::ZERO).saturating_since(crash);
        assert!(silence <= LOSS + PERIOD, "{silence:?}");
        let silent = [0, 2].map(|robot| fault(&world, robot));
        assert!(silent.iter().any(|f| matches!(f, Some(PartnerFault::Silent(s)) if *s < 0.07)));
    }
}

#[test]
fn heartbeats_that_were_held_up_do_not_make_a_partner_look_alive() {
    let mut world = under_way(TimeSynced, 2);
    let held_up = Duration::from_millis(100);
    let mut slow = |_: usize, _: usize, _: &Say| vec![held_up];
    world.until("the end", &mut slow, |world| world.robots.iter().all(|r| r.ended.is_some()));
    assert!(matches!(fault(&world, 0), Some(PartnerFault::Silent(_))), "{:?}", fault(&world, 0));
}

#[test]
fn a_start_that_is_shifted_for_a_later_controller_is_no_silence_and_no_divergence() {
    let mut world = World::new(TimeSynced, 2, 2.0);
    let shifted = world.now + Duration::from_millis(150 + 40);
    let machine = GroupMachine::new(GROUP, &order(TimeSynced, 1), shifted, 1.0);
    world.robots[1].machine = machine;
    world.until("the start", &mut perfect, running);
    world.ticks(50, &mut perfect);
    for paused in [true, false] {
        world.robots[0].machine.set_paused(paused);
        world.ticks(300, &mut perfect);
    }
    world.until("the end", &mut perfect, |world| world.robots.iter().all(|r| !r.moves()));
    for robot in &world.robots {
        assert_eq!(robot.state(), GroupState::Done, "{:?}", robot.ended);
        let quality = robot.machine.report().quality;
        assert!(quality.max_silence_ms < 30.0, "{quality:?}");
        assert!(quality.max_divergence_ms < 3.0, "{quality:?}");
    }
}

#[test]
fn a_pause_of_one_rests_all_at_one_place_and_its_end_moves_all_again() {
    for coupling in [TimeSynced, Rigid] {
        let mut world = under_way(coupling, 3);
        world.robots[2].machine.set_paused(true);
        world.until("rest", &mut perfect, |world| world.robots.iter().all(|r| r.rate == 0.0));
        assert!(world.divergence_s() < 1e-4, "{}", world.divergence_s());
        let rest_s = world.robots[0].phase_s;
        world.ticks(500, &mut perfect);
        assert_eq!(world.robots[0].phase_s, rest_s, "nothing moves in a pause");
        world.robots[2].machine.set_paused(false);
        world.until("motion", &mut perfect, |world| world.robots.iter().all(|r| r.rate == 1.0));
        assert!(world.divergence_s() < 1e-3, "{}", world.divergence_s());
        world.until("the end", &mut perfect, |world| world.robots.iter().all(|r| !r.moves()));
        assert!(world.robots.iter().all(|robot| robot.state() == GroupState::Done));
    }
}

#[test]
fn the_slowest_sets_the_pace_and_changes_of_mind_are_followed() {
    let mut world = under_way(TimeSynced, 2);
    world.robots[0].machine.set_ratio(0.5);
    world.robots[1].machine.set_ratio(0.25);
    world.ticks(200, &mut perfect);
    assert_eq!([0, 1].map(|robot| world.robots[robot].rate), [0.25; 2]);
    world.robots[1].machine.set_ratio(1.0);
    world.ticks(100, &mut perfect);
    assert_eq!([0, 1].map(|robot| world.robots[robot].rate), [0.5; 2]);
    for paused in [true, false, true, false] {
        world.robots[0].machine.set_paused(paused);
        world.tick(&mut perfect);
    }
    world.ticks(200, &mut perfect);
    assert_eq!([0, 1].map(|robot| world.robots[robot].rate), [0.5; 2]);
    assert!(world.divergence_s() < 0.004, "{}", world.divergence_s());
}

#[test]
fn whoever_is_ahead_waits_for_one_that_lost_ticks() {
    let mut world = under_way(TimeSynced, 3);
    world.robots[0].late = 8;
    world.ticks(10, &mut perfect);
    let behind = world.divergence_s();
    assert!(behind > 0.02, "{behind}");
    world.ticks(200, &mut perfect);
    assert!(world.divergence_s() < 0.004, "{}", world.divergence_s());
    assert!(running(&world));
    let apart_ms = world.robots[1].machine.report().quality.max_divergence_ms;
    assert!((20.0..40.0).contains(&apart_ms), "{apart_ms}");
}

#[test]
fn robots_that_are_too_far_apart_stop() {
    let mut world = under_way(TimeSynced, 2);
    world.robots[0].phase_s -= 0.06;
    world.until("the end", &mut perfect, |world| world.robots.iter().all(|r| !r.moves()));
    let faults = [0, 1].map(|robot| fault(&world, robot));
    assert!(faults.iter().any(|f| matches!(f, Some(PartnerFault::Diverged(s)) if *s > 0.05)));
    // Each keeps its pace, and is where it was proved to be clear of the others.
    for (late_s, state) in [(0.04, GroupState::Done), (0.06, GroupState::Aborting)] {
        let mut world = under_way(Independent, 2);
        world.robots[0].phase_s -= late_s;
        world.until("the end", &mut perfect, |world| world.robots.iter().all(|r| !r.moves()));
        assert!(world.robots.iter().all(|r| r.state() == state), "{late_s}");
    }
}

#[test]
fn a_rigid_group_ends_on_one_ramp() {
    let mut world = under_way(Rigid, 3);
    assert!(world.robots[1].machine.leave(Refusal::Cancelled, BEAT), "it goes on for the ramp");
    let from_s = world.robots[1].phase_s;
    world.until("the end", &mut perfect, |world| world.robots.iter().all(|r| r.ended.is_some()));
    let rest = world.robots.iter().map(|robot| robot.phase_s);
    let (low, high) = rest.fold((9.0_f64, 0.0_f64), |(l, h), s| (l.min(s), h.max(s)));
    assert!(high - low < 2e-4, "{low} to {high}");
    // A lead of 20 ms, and r²/2a on the ramp.
    assert!((high - from_s - 0.27).abs() < 0.005, "{}", high - from_s);
    assert_eq!(world.robots[1].ended.expect("ended").1, Some(Refusal::Cancelled));
    assert_eq!(fault(&world, 0), Some(PartnerFault::Aborted));
}

#[test]
fn those_that_are_stopped_one_after_the_other_rest_at_one_place() {
    for apart in [1, 2, 5, 10] {
        let mut world = under_way(Rigid, 3);
        let from_s = world.robots[2].phase_s;
        for robot in [2, 0, 1] {
            let goes_on = world.robots[robot].machine.leave(Refusal::NotEnabled, Duration::ZERO);
            assert!(goes_on, "the ramp is the stop");
            world.ticks(apart, &mut perfect);
        }
        let all_ended = |world: &World| world.robots.iter().all(|r| r.ended.is_some());
        world.until("the end", &mut perfect, all_ended);
        let rest = world.robots.iter().map(|robot| robot.phase_s);
        let (low, high) = rest.fold((9.0_f64, 0.0_f64), |(l, h), s| (l.min(s), h.max(s)));
        // Who hears of it late cannot go back to where it should have braked.
        let most_s = if apart > 2 { 5e-4 } else { 2e-4 };
        assert!(high - low < most_s, "{apart}: {low} to {high}");
        assert!((high - from_s - 0.25).abs() < 0.01, "{apart}: {}", high - from_s);
    }
}

#[test]
fn a_ramp_that_is_said_to_begin_far_away_begins_here() {
    for said_s in [1e9, -1e9] {
        let mut world = under_way(Rigid, 2);
        let (from_s, now) = (world.robots[1].phase_s, world.now);
        let word = Word::Abort { from_phase_s: Some(said_s) };
        world.robots[1].machine.hear(&GroupWord { group: GROUP, partner: 0, at: now, word });
        world.until("the end", &mut perfect, |world| world.robots[1].ended.is_some());
        let way_s = world.robots[1].phase_s - from_s;
        // r²/2a on the ramp; 60 ms that the word may be late, a lead of 20, and 50 that robots may
        // be apart.
        assert!((0.12..0.33).contains(&way_s), "{way_s}");
    }
}

#[test]
fn one_of_a_rigid_group_that_cannot_follow_the_ramp_stops_alone_and_the_others_on_it() {
    let mut world = under_way(Rigid, 3);
    let now = world.now;
    world.robots[0].end(now, Some(Refusal::NotEnabled));
    world.until("the end", &mut perfect, |world| world.robots.iter().all(|r| r.ended.is_some()));
    let [a, b] = [1, 2].map(|robot| world.robots[robot].phase_s);
    assert!((a - b).abs() < 1e-3 && a > world.robots[0].phase_s + 0.2, "{a} {b}");
}

#[test]
fn an_abort_is_heard_though_two_of_its_three_words_are_lost() {
    let mut world = under_way(TimeSynced, 2);
    let now = world.now;
    world.robots[0].end(now, Some(Refusal::Cancelled));
    let mut aborts = 0;
    let mut lossy = |from: usize, to: usize, say: &Say| {
        if from == 0 && matches!(say, Say::Abort { .. }) {
            aborts += 1;
        }
        let lost = from == 0 && aborts < 3;
        if lost { Vec::new() } else { perfect(from, to, say) }
    };
    world.until("the end", &mut lossy, |world| world.robots[1].ended.is_some());
    assert_eq!(fault(&world, 1), Some(PartnerFault::Aborted));
    world.ticks(30, &mut perfect);
    assert!(world.robots[0].machine.is_over(world.now), "it has said it three times");
}

#[test]
fn words_of_another_motion_and_of_nobody_do_not_count() {
    let mut world = World::new(TimeSynced, 2, 1.0);
    let mut machine = world.robots[0].machine.clone();
    let word =
        GroupWord { group: uuid::Uuid::from_u128(8), partner: 0, at: world.now, word: Word::Go };
    machine.hear(&word);
    machine.hear(&GroupWord { group: GROUP, partner: 9, ..word });
    assert_eq!(machine, world.robots[0].machine);
    world.tick(&mut perfect);
}
