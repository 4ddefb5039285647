//! Every course that two or three robots can take in a small world: each message is delivered, late
//! or lost, each robot may crash or stop at any tick. Breadth first, until nothing new comes.

use std::collections::HashSet;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{Coupling, GroupState};
use serde::Serialize;

use crate::control::{
    BEAT, Decision, GroupMachine, GroupOrder, GroupSay, GroupWord, Own, Refusal, Say, Word,
};

/// A tick is a heartbeat, and so is the time on the way.
const TICK: Duration = BEAT;
const START_TICK: u32 = 3;
/// Ticks of motion.
const MOTION: u32 = 4;
/// Ticks until everything must be over.
const HORIZON: u32 = 20;
/// Change of the common rate \[1/s\].
const SLOPE: f64 = 25.0;
/// Ticks of the common ramp of a rigid group: its lead, and from the full rate to rest.
const RAMP: u32 = 3;

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Robot {
    machine: GroupMachine,
    phase_s: f64,
    rate: f64,
    alive: bool,
    said_go: bool,
    started: bool,
    over: bool,
    failed: bool,
    /// Tick at which this robot crashed or stopped moving early.
    left_at: Option<u32>,
}

#[derive(Clone, Debug, Serialize)]
struct State {
    tick: u32,
    robots: Vec<Robot>,
    /// What arrives at the next tick and the one after it: receiver and word.
    wires: [Vec<(usize, GroupWord)>; 2],
    /// Messages that may still be lost or late, robots that may still fail.
    harms: u32,
    blows: u32,
    /// Ticks that the common ramp takes, where there is one.
    ramp: u32,
    /// Whether nothing was lost or late, and nobody crashed or stopped at once.
    calm: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Blow {
    None,
    Crash(usize),
    /// It stops as it can.
    Stop(usize),
    /// It is to end early, with the others if the group is rigid.
    Leave(usize),
}

fn at(tick: u32) -> MonoTime {
    MonoTime::from_nanos(1_000_000_000) + TICK * tick
}

fn first(coupling: Coupling, count: usize, committed: usize, harms: u32, blows: u32) -> State {
    let order = GroupOrder {
        coupling,
        partners: u8::try_from(count - 1).expect("few"),
        loss: Duration::from_millis(60),
        max_divergence_s: 0.05,
        rate_slope_s: SLOPE,
    };
    let robot = |index: usize| Robot {
        machine: GroupMachine::new(super::world::GROUP, &order, at(START_TICK), 1.0),
        phase_s: 0.0,
        rate: 0.0,
        alive: index < committed,
        said_go: false,
        started: false,
        over: index >= committed,
        failed: false,
        left_at: None,
    };
    let robots = (0..count).map(robot).collect();
    let wires = [Vec::new(), Vec::new()];
    let ramp = if coupling == Coupling::Rigid { RAMP } else { 0 };
    State { tick: 0, robots, wires, harms, blows, ramp, calm: committed == count }
}

impl State {
    /// This state after a tick with `blow`, and what was said in it to whom.
    fn step(&self, blow: Blow) -> (Self, Vec<(usize, GroupWord)>) {
        let mut next = self.clone();
        next.tick += 1;
        let now = at(next.tick);
        let arrived = std::mem::take(&mut next.wires[0]);
        next.wires.swap(0, 1);
        let mut said = Vec::new();
        for index in 0..next.robots.len() {
            let robot = &mut next.robots[index];
            for (_, word) in arrived.iter().filter(|(to, _)| *to == index && robot.alive) {
                robot.machine.hear(&GroupWord { at: now, ..*word });
            }
            match blow {
                Blow::Crash(which) if which == index => robot.crash(next.tick),
                Blow::Stop(which) if which == index => {
                    robot.end(next.tick, now, Some(Refusal::NotEnabled));
                }
                Blow::Leave(which) if which == index => robot.leave(next.tick, now),
                _ => {}
            }
            let words = robot.tick(next.tick, now);
            for say in words {
                for to in (0..next.robots.len()).filter(|&to| to != index) {
                    said.push((to, heard(index, to, &say, now)));
                }
            }
        }
        next.calm &= matches!(blow, Blow::None | Blow::Leave(_));
        next.blows -= u32::from(blow != Blow::None);
        (next, said)
    }

    /// All states that can follow.
    fn successors(&self) -> Vec<Self> {
        let mut blows = vec![Blow::None];
        if self.blows > 0 {
            for (index, _) in self.robots.iter().enumerate().filter(|(_, r)| r.alive && !r.over) {
                blows.extend([Blow::Crash(index), Blow::Stop(index), Blow::Leave(index)]);
            }
        }
        let mut all = Vec::new();
        for blow in blows {
            let (next, said) = self.step(blow);
            next.deliver(&said, &mut all);
        }
        all
    }

    /// Every way in which what was said can be delivered, late or lost.
    fn deliver(self, said: &[(usize, GroupWord)], all: &mut Vec<Self>) {
        let Some(((to, word), rest)) = said.split_first() else {
            all.push(self);
            return;
        };
        if self.harms > 0 && self.robots[*to].alive {
            let mut late = self.clone();
            (late.harms, late.calm) = (late.harms - 1, false);
            late.wires[1].push((*to, *word));
            late.deliver(rest, all);
            let mut lost = self.clone();
            (lost.harms, lost.calm) = (lost.harms - 1, false);
            lost.deliver(rest, all);
        }
        let mut delivered = self;
        delivered.wires[0].push((*to, *word));
        delivered.deliver(rest, all);
    }

    fn check(&self) {
        let all_said_go = self.robots.iter().all(|robot| robot.said_go);
        for robot in &self.robots {
            assert!(!robot.started || all_said_go, "one started alone: {self:#?}");
        }
        let left = self.robots.iter().filter_map(|robot| robot.left_at).min();
        let moves = self.robots.iter().any(|robot| robot.alive && robot.started && !robot.over);
        if let Some(left) = left.filter(|_| moves) {
            // The loss time, what is late on the way, the tick that sees it, and the common ramp.
            assert!(self.tick <= left + 5 + self.ramp, "a robot moves on after {left}: {self:#?}");
        }
        assert!(
            !moves || self.tick <= START_TICK + MOTION + 4 + self.ramp,
            "it never ends: {self:#?}"
        );
        if self.calm && !moves {
            let phases = || self.robots.iter().map(|robot| robot.phase_s);
            let apart_s = phases().fold(0.0, f64::max) - phases().fold(f64::INFINITY, f64::min);
            // What everybody hears in time ends at one place, but for a step that was under way.
            assert!(apart_s <= TICK.as_secs_f64() + 1e-9, "{apart_s} s apart: {self:#?}");
        }
    }

    /// A number that stands for everything that counts.
    fn fingerprint(&self) -> Vec<u8> {
        rmp_serde::to_vec(self).expect("it can be written")
    }
}

impl Robot {
    fn go(&mut self, rate: f64) {
        if self.started {
            self.phase_s += TICK.as_secs_f64() * rate;
        }
        (self.started, self.rate) = (true, rate);
    }

    fn crash(&mut self, tick: u32) {
        self.alive = false;
        if !self.over {
            self.left_at = Some(tick);
        }
    }

    fn leave(&mut self, tick: u32, now: MonoTime) {
        if self.over {
            return;
        }
        if self.machine.leave(Refusal::Cancelled, BEAT) {
            self.left_at = self.left_at.or(Some(tick));
        } else {
            self.end(tick, now, Some(Refusal::Cancelled));
        }
    }

    fn end(&mut self, tick: u32, now: MonoTime, why: Option<Refusal>) {
        if self.over {
            return;
        }
        (self.over, self.rate) = (true, 0.0);
        self.failed = why.is_some();
        self.left_at = self.left_at.or_else(|| why.map(|_| tick));
        self.machine.end(now, why);
    }

    fn tick(&mut self, tick: u32, now: MonoTime) -> Vec<GroupSay> {
        if !self.alive {
            return Vec::new();
        }
        let before = self.machine.report().state;
        if !self.over {
            let own = Own { phase_s: self.phase_s, rate: self.rate, error: 0.0, period: TICK };
            match self.machine.guide(now, &own) {
                Decision::Hold => {}
                Decision::Free => self.go(1.0),
                Decision::Run { rate, .. } => self.go(rate),
                Decision::Stop(why) | Decision::Rested(why) => self.end(tick, now, Some(why)),
            }
            if self.phase_s > TICK.as_secs_f64() * (f64::from(MOTION) - 0.5) {
                self.end(tick, now, None);
            }
        }
        let said: Vec<_> = self.machine.poll(now, self.phase_s).into_iter().collect();
        self.said_go |= said.iter().any(|said| said.say == Say::Go);
        let after = self.machine.report().state;
        assert!(before != GroupState::Aborting || after == before, "resurrection");
        assert!(before != GroupState::Done || after == before, "resurrection");
        said
    }
}

fn heard(from: usize, to: usize, say: &GroupSay, at: MonoTime) -> GroupWord {
    let word = match say.say {
        Say::Go => Word::Go,
        Say::Heartbeat(beat) => Word::Heartbeat(beat),
        Say::Abort { from_phase_s, .. } => Word::Abort { from_phase_s },
    };
    let partner = u8::try_from(if from < to { from } else { from - 1 }).expect("few");
    GroupWord { group: say.group, partner, at, word }
}

/// Looks at every state that can be reached; returns how many there are, and how many of them have
/// all robots at their goals.
fn explore(start: State) -> (usize, usize) {
    let mut seen = HashSet::from([start.fingerprint()]);
    let (mut border, mut done) = (vec![start], 0);
    while let Some(first) = border.first() {
        if first.tick >= HORIZON {
            break;
        }
        let mut next = Vec::new();
        for state in border.iter().flat_map(State::successors) {
            state.check();
            if seen.insert(state.fingerprint()) {
                let all = |robot: &Robot| robot.machine.report().state == GroupState::Done;
                done += usize::from(state.robots.iter().all(all));
                next.push(state);
            }
        }
        border = next;
    }
    (seen.len(), done)
}

#[test]
fn no_course_of_two_robots_lets_one_move_alone() {
    for coupling in [Coupling::Independent, Coupling::TimeSynced, Coupling::Rigid] {
        let (states, done) = explore(first(coupling, 2, 2, 3, 1));
        println!("{coupling:?}: {states} states of two robots, {done} with both at their goals");
        assert!(states > 1000 && done > 0, "{states} {done}");
    }
}

#[test]
fn no_course_of_three_robots_lets_one_move_alone() {
    for coupling in [Coupling::TimeSynced, Coupling::Rigid] {
        let (states, done) = explore(first(coupling, 3, 3, 2, 1));
        println!("{coupling:?}: {states} states of three robots, {done} with all at their goals");
        assert!(states > 1000 && done > 0, "{states} {done}");
    }
}

#[test]
fn nobody_starts_with_one_that_was_never_told_to() {
    let (states, done) = explore(first(Coupling::TimeSynced, 3, 2, 3, 1));
    println!("{states} states of two robots that wait for a third");
    assert!(states > 100 && done == 0, "{states} {done}");
}
