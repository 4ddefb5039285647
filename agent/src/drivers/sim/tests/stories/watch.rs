//! What must hold in every tick of a story, and what is counted of it.

use std::collections::BTreeMap;

use armada_model::{JointLimits, JointVector};
use armada_protocol::messages::{ActionStatus, Executor, MotionKind};

use super::super::*;
use super::SEARCH_SHARE;
use crate::control::{LoopEvent, Output, Params};
use crate::drivers::DelegatedStatus;

/// Room for the tolerance that trajectories are accepted with, and for rounding.
const ROOM: f64 = 1.0 + 1e-5;
/// How far a report may be outside the position limits: what the controller lets pass, and noise
/// \[rad or m\].
const REPORT_ROOM: f64 = 1.1e-3;
/// The same for the speed of moves of the controller's own, over the limit: noise, and the lag of
/// the drives.
const SPEED_ROOM: f64 = 1.02;

/// What the controller does by itself, as it reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Own {
    Nothing,
    Search,
    Move,
}

/// Looks at every tick.
pub(super) struct Watch {
    limits: Vec<JointLimits>,
    /// The set-points of the last two ticks, as long as the stream lives.
    sent: Vec<JointVector>,
    commands: u64,
    moved: u64,
    /// Ticks in which the controller moved by itself: searches, moves.
    own: [u64; 2],
    /// A joint was blocked since the last recovery: its drive catches up faster than it moves.
    pub(super) joint_is_blocked: bool,
    /// How often something happened, by its name.
    happened: BTreeMap<String, u32>,
    was_paused: bool,
}

impl Watch {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            limits: params.limits.clone(),
            sent: Vec::new(),
            commands: 0,
            moved: 0,
            own: [0; 2],
            joint_is_blocked: false,
            happened: BTreeMap::new(),
            was_paused: false,
        }
    }

    pub(super) fn see(&mut self, feedback: Option<&Feedback>, output: &Output) {
        if let Some(feedback) = feedback {
            self.see_report(feedback, output);
        }
        match &output.command {
            Some(command) => self.see_set_point(command.joint_position),
            None => self.sent.clear(),
        }
        self.count(output);
    }

    /// What is sent is inside every limit, by the differences that the controller sees.
    fn see_set_point(&mut self, position: JointVector) {
        let period_s = PERIOD.as_secs_f64();
        self.commands += 1;
        for (joint, limits) in self.limits.iter().enumerate() {
            let (x, story) = (position[joint], (self.commands, joint));
            let range = limits.lower.expect("given") - 1e-5..=limits.upper.expect("given") + 1e-5;
            assert!(range.contains(&x), "{story:?}: position {x}");
            let Some(last) = self.sent.last() else { continue };
            let speed = (x - last[joint]) / period_s;
            self.moved += u64::from(speed != 0.0);
            assert!(speed.abs() <= limits.velocity * ROOM, "{story:?}: speed {speed}");
            let [.., before, last] = &self.sent[..] else { continue };
            let change = (speed - (last[joint] - before[joint]) / period_s) / period_s;
            let most = limits.acceleration.expect("given") * ROOM;
            assert!(change.abs() <= most, "{story:?}: acceleration {change}");
        }
        self.sent.push(position);
        if self.sent.len() > 2 {
            self.sent.remove(0);
        }
    }

    /// While the controller moves by itself it keeps the limits, and nothing is sent.
    fn see_report(&mut self, feedback: &Feedback, output: &Output) {
        let own = own_of(feedback);
        let share = match own {
            Own::Nothing => return,
            Own::Search => SEARCH_SHARE,
            Own::Move => 1.0,
        };
        self.own[usize::from(own == Own::Move)] += 1;
        assert_eq!(output.command, None, "a set-point in {own:?}: {feedback:?}");
        let measured = feedback.joint_position.iter().zip(feedback.joint_velocity.iter());
        for ((joint, limits), (x, v)) in self.limits.iter().enumerate().zip(measured) {
            let room = REPORT_ROOM;
            let range = limits.lower.expect("given") - room..=limits.upper.expect("given") + room;
            assert!(range.contains(x), "{own:?}, joint {joint}: position {x}");
            let most = share * limits.velocity * SPEED_ROOM + 1e-3;
            assert!(self.joint_is_blocked || v.abs() <= most, "{own:?}, joint {joint}: speed {v}");
        }
    }

    fn count(&mut self, output: &Output) {
        for event in &output.events {
            match event {
                LoopEvent::Motion(report) => {
                    let who = if report.executor == Executor::Controller { " itself" } else { "" };
                    self.note(format!("{:?}{who} {:?}", report.kind, report.status));
                }
                LoopEvent::Stream(change) => self.note(format!("Stream {change:?}")),
                _ => {}
            }
        }
        let paused = output.snapshot.motion.is_some_and(|motion| motion.paused);
        if paused && !self.was_paused {
            let whose = if output.command.is_some() { "" } else { " itself" };
            self.note(format!("paused{whose}"));
        }
        self.was_paused = paused;
    }

    fn note(&mut self, what: String) {
        *self.happened.entry(what).or_default() += 1;
    }

    /// A story of which a part never happens shows nothing about it.
    pub(super) fn assert_that_all_happened(&self) {
        assert!(self.commands > 300_000, "the robot was commanded: {}", self.commands);
        assert!(self.moved > 100_000, "and moved: {}", self.moved);
        let [searches, moves] = self.own;
        assert!(searches > 10_000 && moves > 10_000, "by itself too: {:?}", self.own);
        let jogs = [MotionKind::JogFreespace, MotionKind::JogJoint, MotionKind::JogCartesian];
        for kind in jogs.into_iter().chain([MotionKind::Trajectory, MotionKind::Home]) {
            self.assert_that_it_ended(&format!("{kind:?}"));
        }
        let own = [MotionKind::MoveJoint, MotionKind::MovePose, MotionKind::MoveLinear];
        for kind in own.into_iter().chain([MotionKind::Home]) {
            self.assert_that_it_ended(&format!("{kind:?} itself"));
        }
        for what in ["paused", "paused itself", "Stream Began"] {
            self.assert_that_it_happened(what, 20);
        }
        self.assert_that_it_happened("Stream Starved", 5);
    }

    fn assert_that_it_ended(&self, kind: &str) {
        for status in [ActionStatus::Complete, ActionStatus::Cancelled, ActionStatus::Failed] {
            self.assert_that_it_happened(&format!("{kind} {status:?}"), 5);
        }
    }

    fn assert_that_it_happened(&self, what: &str, least: u32) {
        let count = self.happened.get(what).copied().unwrap_or_default();
        assert!(count >= least, "{what}: {count} times of {:#?}", self.happened);
    }
}

fn own_of(feedback: &Feedback) -> Own {
    let status = feedback.delegated.map(|report| report.status);
    if !feedback.homing.is_empty() {
        Own::Search
    } else if matches!(status, Some(DelegatedStatus::Running | DelegatedStatus::Paused)) {
        Own::Move
    } else {
        Own::Nothing
    }
}
