//! Robots of a group on an invented clock, with a network between them that does what it is told.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{Coupling, GroupState};
use uuid::Uuid;

use crate::control::{
    Decision, GroupMachine, GroupOrder, GroupSay, GroupWord, Own, Refusal, Say, Word,
};

pub(super) const PERIOD: Duration = Duration::from_millis(4);
pub(super) const LOSS: Duration = Duration::from_millis(60);
/// Change of the common rate \[1/s\], and how fast a robot's own rate can change.
pub(super) const SLOPE: f64 = 2.0;
const STEEPEST: f64 = 10.0;
pub(super) const GROUP: Uuid = Uuid::from_u128(7);

pub(super) fn order(coupling: Coupling, partners: usize) -> GroupOrder {
    GroupOrder {
        coupling,
        partners: u8::try_from(partners).expect("few"),
        loss: LOSS,
        max_divergence_s: 0.05,
        rate_slope_s: SLOPE,
    }
}

/// A robot that follows its part of the group.
#[derive(Clone, Debug)]
pub(super) struct Robot {
    pub(super) machine: GroupMachine,
    pub(super) phase_s: f64,
    pub(super) rate: f64,
    /// Whether its process lives.
    pub(super) alive: bool,
    pub(super) said_go: bool,
    pub(super) started: bool,
    /// How and when its motion ended.
    pub(super) ended: Option<(MonoTime, Option<Refusal>)>,
    /// Ticks that its loop is going to miss.
    pub(super) late: u32,
}

impl Robot {
    pub(super) fn state(&self) -> GroupState {
        self.machine.report().state
    }

    /// Whether it moves along the common path.
    pub(super) fn moves(&self) -> bool {
        self.alive && self.started && self.ended.is_none()
    }

    pub(super) fn end(&mut self, now: MonoTime, why: Option<Refusal>) {
        if self.ended.is_none() {
            self.ended = Some((now, why));
            self.rate = 0.0;
            self.machine.end(now, why);
        }
    }
}

/// When a message arrives, as times after it was sent; none if it is lost.
pub(super) type Fate<'a> = &'a mut dyn FnMut(usize, usize, &Say) -> Vec<Duration>;

pub(super) struct World {
    pub(super) now: MonoTime,
    pub(super) robots: Vec<Robot>,
    pub(super) duration_s: f64,
    wires: Vec<(MonoTime, usize, GroupWord)>,
}

impl World {
    /// Robots that were all told to start in 150 ms and to move for a while \[s\].
    pub(super) fn new(coupling: Coupling, count: usize, duration_s: f64) -> Self {
        let now = MonoTime::from_nanos(1_000_000_000);
        let start = now + Duration::from_millis(150);
        let robot = || Robot {
            machine: GroupMachine::new(GROUP, &order(coupling, count - 1), start, 1.0),
            phase_s: 0.0,
            rate: 0.0,
            alive: true,
            said_go: false,
            started: false,
            ended: None,
            late: 0,
        };
        let robots = (0..count).map(|_| robot()).collect();
        Self { now, robots, duration_s, wires: Vec::new() }
    }

    /// One period passes.
    pub(super) fn tick(&mut self, fate: Fate<'_>) {
        self.now = self.now + PERIOD;
        for index in 0..self.robots.len() {
            if self.robots[index].late > 0 {
                self.robots[index].late -= 1;
                continue;
            }
            let said = self.step(index);
            for say in said {
                self.send(index, &say, fate);
            }
        }
    }

    pub(super) fn ticks(&mut self, count: u32, fate: Fate<'_>) {
        for _ in 0..count {
            self.tick(fate);
        }
    }

    /// Ticks until `condition`, within ten seconds.
    pub(super) fn until(&mut self, what: &str, fate: Fate<'_>, condition: impl Fn(&Self) -> bool) {
        for _ in 0..2500 {
            self.tick(fate);
            if condition(self) {
                return;
            }
        }
        panic!("{what} did not come: {:#?}", self.robots);
    }

    fn step(&mut self, index: usize) -> Vec<GroupSay> {
        let now = self.now;
        let robot = &mut self.robots[index];
        self.wires.retain(|(at, to, word)| {
            let due = *to == index && *at <= now;
            if due && robot.alive {
                robot.machine.hear(word);
            }
            !due
        });
        if !robot.alive {
            return Vec::new();
        }
        let before = robot.state();
        let (phase_s, rate) = (robot.phase_s, robot.rate);
        if robot.ended.is_none() {
            let own = Own { phase_s, rate, error: 0.0, period: PERIOD };
            match robot.machine.guide(now, &own) {
                Decision::Hold => {}
                Decision::Free => robot.go(1.0),
                Decision::Run { rate, .. } => robot.go(rate),
                Decision::Stop(why) | Decision::Rested(why) => robot.end(now, Some(why)),
            }
        }
        if robot.ended.is_none() && robot.started {
            robot.phase_s += robot.rate * PERIOD.as_secs_f64();
            if robot.phase_s >= self.duration_s {
                robot.end(now, None);
            }
        }
        check_order(before, robot.state());
        robot.machine.poll(now, robot.phase_s).into_iter().collect()
    }

    fn send(&mut self, from: usize, say: &GroupSay, fate: Fate<'_>) {
        let word = match say.say {
            Say::Go => Word::Go,
            Say::Heartbeat(beat) => Word::Heartbeat(beat),
            Say::Abort { from_phase_s, .. } => Word::Abort { from_phase_s },
        };
        self.robots[from].said_go |= matches!(say.say, Say::Go);
        for to in (0..self.robots.len()).filter(|&to| to != from) {
            let partner = u8::try_from(if from < to { from } else { from - 1 }).expect("few");
            for delay in fate(from, to, &say.say) {
                let at = self.now + delay;
                self.wires.push((at, to, GroupWord { group: say.group, partner, at, word }));
            }
        }
    }

    /// Difference of the phases of those that move \[s\].
    pub(super) fn divergence_s(&self) -> f64 {
        let phases = self.robots.iter().filter(|robot| robot.moves()).map(|robot| robot.phase_s);
        let (low, high) = phases
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), phase_s| {
                (low.min(phase_s), high.max(phase_s))
            });
        (high - low).max(0.0)
    }
}

impl Robot {
    fn go(&mut self, rate: f64) {
        let step = STEEPEST * PERIOD.as_secs_f64();
        // At rest at the start any rate is possible.
        let fresh = !std::mem::replace(&mut self.started, true);
        self.rate = if fresh { rate } else { rate.clamp(self.rate - step, self.rate + step) };
    }
}

/// No state leads back.
fn check_order(before: GroupState, after: GroupState) {
    let place = |state| match state {
        GroupState::Armed => 0,
        GroupState::Running => 1,
        GroupState::Done => 2,
        GroupState::Aborting => 3,
    };
    let legal = place(after) >= place(before) && (before != GroupState::Done || after == before);
    assert!(legal, "{before:?} -> {after:?}");
}

/// Every message arrives at once.
pub(super) fn perfect(_: usize, _: usize, _: &Say) -> Vec<Duration> {
    vec![Duration::from_millis(1)]
}
