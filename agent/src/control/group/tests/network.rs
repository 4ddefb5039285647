//! Random networks: messages are lost, late, repeated and overtake each other.

use std::time::Duration;

use armada_protocol::messages::{Coupling, GroupState};
use proptest::prelude::*;

use super::world::{LOSS, PERIOD, World};
use crate::control::{BEAT, Refusal, Say};

/// What happens to a group.
#[derive(Clone, Copy, Debug)]
enum Blow {
    Crash(usize),
    Stop(usize),
    /// Ends its part, from here or from a little later.
    Leave(usize, Duration),
    Pause(usize, bool),
    Ratio(usize, f64),
    Late(usize, u32),
}

/// How bad the network is, of 1000 messages.
#[derive(Clone, Copy, Debug)]
struct Network {
    lost: u32,
    repeated: u32,
    /// Longest time on the way.
    delay_ms: u64,
}

fn blows(count: usize) -> impl Strategy<Value = Vec<(u32, Blow)>> {
    let robot = 0..count;
    let blow = prop_oneof![
        1 => robot.clone().prop_map(Blow::Crash),
        1 => robot.clone().prop_map(Blow::Stop),
        2 => (robot.clone(), prop_oneof![Just(BEAT), Just(Duration::ZERO)])
            .prop_map(|(robot, lead)| Blow::Leave(robot, lead)),
        6 => (robot.clone(), any::<bool>()).prop_map(|(robot, paused)| Blow::Pause(robot, paused)),
        4 => (robot.clone(), 0.05..1.0).prop_map(|(robot, ratio)| Blow::Ratio(robot, ratio)),
        4 => (robot, 1..8_u32).prop_map(|(robot, ticks)| Blow::Late(robot, ticks)),
    ];
    prop::collection::vec((1..120_u32, blow), 0..8)
}

fn network() -> impl Strategy<Value = Network> {
    (0..150_u32, 0..200_u32, 1..30_u64).prop_map(|(lost, repeated, delay_ms)| Network {
        lost,
        repeated,
        delay_ms,
    })
}

fn coupling() -> impl Strategy<Value = Coupling> {
    prop_oneof![Just(Coupling::Independent), Just(Coupling::TimeSynced), Just(Coupling::Rigid)]
}

fn story() -> impl Strategy<Value = (usize, Coupling, Network, Vec<(u32, Blow)>, u64)> {
    (2..5_usize)
        .prop_flat_map(|count| (Just(count), coupling(), network(), blows(count), any::<u64>()))
}

/// Small numbers from a seed (SplitMix64).
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % bound
    }
}

fn strike(world: &mut World, blow: Blow) {
    let now = world.now;
    match blow {
        Blow::Crash(robot) => world.robots[robot].alive = false,
        Blow::Stop(robot) => world.robots[robot].end(now, Some(Refusal::NotEnabled)),
        Blow::Leave(robot, lead) => {
            let robot = &mut world.robots[robot];
            if robot.ended.is_none() && !robot.machine.leave(Refusal::Cancelled, lead) {
                robot.end(now, Some(Refusal::Cancelled));
            }
        }
        Blow::Pause(robot, paused) => world.robots[robot].machine.set_paused(paused),
        Blow::Ratio(robot, ratio) => world.robots[robot].machine.set_ratio(ratio),
        Blow::Late(robot, ticks) => world.robots[robot].late += ticks,
    }
}

/// Longest ramp of a rigid group: from full rate at the common slope, and what is heard late.
const RAMP: Duration = Duration::from_millis(700);

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

    #[test]
    fn a_group_keeps_together_or_stops_whatever_the_network_does(
        (count, coupling, network, blows, seed) in story()
    ) {
        let mut world = World::new(coupling, count, 2.0);
        let mut dice = Dice(seed);
        let mut fate = |_: usize, _: usize, _: &Say| {
            let copies = match dice.below(1000) {
                roll if roll < u64::from(network.lost) => 0,
                roll if roll >= 1000 - u64::from(network.repeated) => 2,
                _ => 1,
            };
            (0..copies).map(|_| Duration::from_millis(dice.below(network.delay_ms + 1))).collect()
        };
        let mut blows = blows.into_iter();
        let (mut next, mut first_end) = (blows.next(), None);
        for ticks in 1..=1500_u32 {
            world.tick(&mut fate);
            while let Some((after, blow)) = next.filter(|(after, _)| *after <= ticks) {
                let _ = after;
                strike(&mut world, blow);
                next = blows.next().map(|(wait, blow)| (ticks + wait, blow));
            }
            for robot in &world.robots {
                if robot.started {
                    let all = world.robots.iter().all(|robot| robot.said_go);
                    prop_assert!(all, "one started though not all said go");
                }
                let failed = robot.ended.is_some_and(|(_, why)| why.is_some());
                let over = failed || !robot.alive || robot.state() == GroupState::Aborting;
                // A robot that is done is needed by nobody any more.
                let mattered = !matches!(robot.ended, Some((_, None)));
                if over && mattered && first_end.is_none() {
                    first_end = Some(world.now);
                }
            }
            if coupling != Coupling::Independent && first_end.is_none() {
                // What the group stops for, and how far it goes before it is seen.
                let bound_s = 0.05 + (LOSS + BEAT).as_secs_f64();
                prop_assert!(world.divergence_s() <= bound_s, "{}", world.divergence_s());
            }
            if let Some(end) = first_end {
                let mut bound = LOSS + BEAT * 2 + PERIOD * 9 + Duration::from_millis(network.delay_ms);
                if coupling == Coupling::Rigid {
                    bound += RAMP;
                }
                let still = world.robots.iter().any(|robot| robot.moves() && robot.late == 0);
                let since = world.now.saturating_since(end);
                prop_assert!(!still || since <= bound, "a robot moves {since:?} after an end");
            }
        }
        for robot in &world.robots {
            let stuck = robot.moves() && !world.robots.iter().any(|r| r.rate == 0.0);
            let slow = robot.phase_s < 2.0;
            prop_assert!(!stuck || slow, "it never ends");
        }
    }
}

#[test]
fn a_quiet_network_and_any_pauses_keep_all_level_and_bring_all_to_the_end() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let orders = prop::collection::vec((1..200_u32, 0..3_usize, 0.1..1.0), 0..12);
    runner
        .run(&orders, |orders| {
            let mut world = World::new(Coupling::TimeSynced, 3, 1.0);
            let mut fate = |_: usize, _: usize, _: &Say| vec![Duration::from_millis(2)];
            for (wait, robot, ratio) in orders {
                world.ticks(wait, &mut fate);
                world.robots[robot].machine.set_paused(ratio < 0.4);
                world.robots[robot].machine.set_ratio(ratio);
                prop_assert!(world.divergence_s() < 0.005, "{}", world.divergence_s());
            }
            for robot in &mut world.robots {
                robot.machine.set_paused(false);
            }
            let done = |world: &World| world.robots.iter().all(|r| r.state() == GroupState::Done);
            for _ in 0..6000 {
                world.tick(&mut fate);
                prop_assert!(world.divergence_s() < 0.005, "{}", world.divergence_s());
            }
            prop_assert!(done(&world), "{:#?}", world.robots);
            Ok(())
        })
        .expect("level");
}
