//! Whether two robots keep a distance for all phases of the one and all near phases of the other.
//!
//! Phases are a stretch of time of the reference and a range of shifts of the other robot. One sweep
//! along the stretch, in the middle of the range, finds the distances there, with nothing missed in
//! between (`CollisionScene::check_motion`). Within the range they can be smaller by the speed of
//! the shifted robot times half the range at most. If that keeps the least distance, all these
//! phases are clear; otherwise the stretch or the range is halved, until a sweep finds two shapes too
//! near, or the rest is too small to be worth it: then nothing is claimed. A few configurations show
//! beforehand whether a sweep is likely to succeed, since one that fails is lost time.
//!
//! The distance that is proved is more than what is required where that is easy: by a share of what
//! is left above it at the nearest place that was found.

use armada_model::{ClearanceWorkspace, MotionVerdict, TimedDistance};
use armada_protocol::messages::Denial;

use super::scene::{PairScene, Phases};

/// Most configurations of one problem: about a second of work.
const MAX_STATES: usize = 100_000;
/// Range of shifts that is not halved any more \[s\].
const LEAST_SPREAD_S: f64 = 5e-4;
/// Stretch of time that is not halved any more \[s\].
const LEAST_STRETCH_S: f64 = 0.1;
/// How much of the distance above the required one is to be proved.
const AMBITION: f64 = 0.3;
/// How much of the distance above that the slack of a sweep may take: more would make it slow.
const MOST_SLACK: f64 = 0.5;
/// Configurations that show whether a sweep is worth it.
const PROBES: u32 = 4;

/// Proves distances, pair after pair, with one budget.
pub(super) struct Prover {
    required_m: f64,
    states: usize,
}

/// What was found of two robots.
pub(super) enum Outcome {
    /// They keep the required distance: this one, at least \[m\].
    Clear { lower_bound_m: f64, near: Near },
    /// They do not.
    Near(Near),
    /// It could not be decided.
    Open(Near),
}

/// A place of a motion where two links are near.
#[derive(Clone, Debug)]
pub(super) struct Near {
    pub(super) distance_m: f64,
    pub(super) links: (String, String),
    /// Phase of the reference \[s\].
    pub(super) at_s: f64,
    /// How far ahead of the reference the other robot is \[s\].
    pub(super) ahead_s: f64,
    /// The shifted robot and the reference.
    shifted: Option<(String, String)>,
}

impl Near {
    /// How far one robot is ahead of the other, for people.
    pub(super) fn ahead(&self) -> String {
        match &self.shifted {
            Some((robot, reference)) if self.ahead_s != 0.0 => {
                let (lead, what) = (1e3 * self.ahead_s.abs(), self.ahead_s > 0.0);
                let what = if what { "ahead of" } else { "behind" };
                format!(" with {robot} {lead:.0} ms {what} {reference}")
            }
            _ => String::new(),
        }
    }
}

impl Outcome {
    /// What is known of the distance \[m\].
    pub(super) const fn lower_bound(&self, required_m: f64) -> f64 {
        match self {
            Self::Clear { lower_bound_m, .. } => *lower_bound_m,
            Self::Near(near) => near.distance_m,
            // Less than required may lie between the phases that were looked at.
            Self::Open(near) => near.distance_m.min(required_m),
        }
    }

    pub(super) fn near(&self) -> Near {
        let (Self::Clear { near, .. } | Self::Near(near) | Self::Open(near)) = self;
        near.clone()
    }
}

/// The proof of one pair under way.
struct Proof<'s, 'p> {
    scene: &'s PairScene<'p>,
    offset_s: f64,
    required_m: f64,
    workspace: ClearanceWorkspace,
    /// The distance to be proved.
    floor_m: f64,
    lower_bound_m: f64,
    nearest: Option<Near>,
}

/// What a sweep says of its phases.
enum Verdict {
    Clear,
    Near,
    Unclear,
}

impl Prover {
    pub(super) const fn new(required_m: f64) -> Self {
        Self { required_m, states: 0 }
    }

    /// Configurations looked at so far.
    pub(super) const fn states(&self) -> usize {
        self.states
    }

    /// Looks at a pair.
    pub(super) fn prove(
        &mut self,
        scene: &PairScene<'_>,
        offset_s: f64,
    ) -> Result<Outcome, Denial> {
        let mut proof = Proof {
            scene,
            offset_s,
            required_m: self.required_m,
            workspace: scene.workspace(),
            floor_m: self.required_m,
            lower_bound_m: f64::INFINITY,
            nearest: None,
        };
        let to_s = scene.duration_s;
        let together = Phases { from_s: 0.0, to_s, ahead_s: 0.0, spread_s: 0.0 };
        // Where all are at one phase: the likeliest place of trouble, and a measure of the rest.
        if matches!(proof.sweep(&together, &mut self.states)?, Verdict::Near) {
            return Ok(proof.outcome(Outcome::Near));
        }
        proof.lower_bound_m = f64::INFINITY;
        proof.lower_floor();
        let spread_s = if scene.can_shift() { offset_s } else { 0.0 };
        let mut open = vec![Phases { spread_s, ..together }];
        while let Some(phases) = open.pop() {
            let halves = phases.halves();
            let verdict = if halves.is_some() && !proof.is_promising(&phases, &mut self.states)? {
                proof.verdict_of_nearest()
            } else {
                proof.sweep(&phases, &mut self.states)?
            };
            match (verdict, halves) {
                (Verdict::Clear, _) => {}
                (Verdict::Near, _) => return Ok(proof.outcome(Outcome::Near)),
                (Verdict::Unclear, Some(halves)) if self.states < MAX_STATES => {
                    proof.lower_floor();
                    open.extend(halves);
                }
                (Verdict::Unclear, _) => return Ok(proof.outcome(Outcome::Open)),
            }
        }
        let lower_bound_m = proof.lower_bound_m;
        Ok(proof.outcome(|near| Outcome::Clear { lower_bound_m, near }))
    }
}

impl Proof<'_, '_> {
    /// Whether a sweep of the phases is likely to show that they are clear.
    fn is_promising(&mut self, phases: &Phases, states: &mut usize) -> Result<bool, Denial> {
        let slack_m = self.scene.slack(phases, self.offset_s)?;
        let Some(found) = self.scene.probe(phases, PROBES, &mut self.workspace)? else {
            return Ok(true);
        };
        *states += PROBES as usize;
        self.take(&found, phases);
        Ok(slack_m <= MOST_SLACK * (found.pair.distance_m - self.floor_m))
    }

    fn verdict_of_nearest(&self) -> Verdict {
        let is_near = |near: &Near| near.distance_m < self.required_m;
        if self.nearest.as_ref().is_some_and(is_near) { Verdict::Near } else { Verdict::Unclear }
    }

    fn sweep(&mut self, phases: &Phases, states: &mut usize) -> Result<Verdict, Denial> {
        let slack_m = self.scene.slack(phases, self.offset_s)?;
        let left = MAX_STATES.saturating_sub(*states).max(1);
        let threshold_m = self.floor_m + slack_m;
        let workspace = &mut self.workspace;
        let report = self.scene.check(phases, self.offset_s, threshold_m, left, workspace)?;
        *states += report.states;
        if let Some(nearest) = &report.minimum {
            self.take(nearest, phases);
        }
        if let Verdict::Near = self.verdict_of_nearest() {
            return Ok(Verdict::Near);
        }
        if report.verdict != MotionVerdict::Clear {
            return Ok(Verdict::Unclear);
        }
        let bound = report.guaranteed_m.unwrap_or(f64::INFINITY) - slack_m;
        self.lower_bound_m = self.lower_bound_m.min(bound);
        Ok(Verdict::Clear)
    }

    fn take(&mut self, found: &TimedDistance, phases: &Phases) {
        let distance_m = found.pair.distance_m;
        if self.nearest.as_ref().is_some_and(|near| near.distance_m <= distance_m) {
            return;
        }
        self.nearest = Some(Near {
            distance_m,
            links: (self.scene.body(found.pair.a), self.scene.body(found.pair.b)),
            at_s: phases.from_s + found.time_s,
            ahead_s: phases.ahead_s,
            shifted: self.scene.shifted(),
        });
    }

    /// Aims at what can still be proved.
    fn lower_floor(&mut self) {
        let least = self.nearest.as_ref().map_or(self.required_m, |near| near.distance_m);
        let above = (least - self.required_m).max(0.0);
        let floor = self.required_m + AMBITION * above;
        // At first there is no aim but what is required.
        let first = self.floor_m <= self.required_m;
        self.floor_m = if first { floor } else { self.floor_m.min(floor) };
    }

    fn outcome(self, outcome: impl FnOnce(Near) -> Outcome) -> Outcome {
        let nowhere = || Near {
            distance_m: f64::INFINITY,
            links: (String::new(), String::new()),
            at_s: 0.0,
            ahead_s: 0.0,
            shifted: None,
        };
        outcome(self.nearest.unwrap_or_else(nowhere))
    }
}

impl Phases {
    /// Both halves, of the stretch or of the range; `None` if they are too small already.
    fn halves(&self) -> Option<[Self; 2]> {
        let Self { from_s, to_s, ahead_s, spread_s } = *self;
        let stretch_s = to_s - from_s;
        if stretch_s > (2.0 * spread_s).max(LEAST_STRETCH_S) {
            let middle = 0.5 * (from_s + to_s);
            return Some([Self { to_s: middle, ..*self }, Self { from_s: middle, ..*self }]);
        }
        if 2.0 * spread_s <= LEAST_SPREAD_S {
            return None;
        }
        let spread_s = 0.5 * spread_s;
        Some([ahead_s - spread_s, ahead_s + spread_s].map(|ahead_s| Self {
            ahead_s,
            spread_s,
            ..*self
        }))
    }
}
