//! The steps of a motion check.

use super::error::ClearanceError;
use super::motion::{MotionCheck, MotionReport, MotionVerdict, TimedDistance};
use super::query::Accuracy;
use super::scene::{ClearanceWorkspace, CollisionScene};

/// Length of a step relative to the one that is certain to suffice. Below two, so that half of it
/// is certain.
const BOLDNESS: f64 = 1.4;
/// A joint may be that much faster than its speed, relative and absolute \[rad or m\]: rounding.
const SPEED_SLACK: f64 = 1e-9;

/// A step may be that much longer than the resolution: rounding.
const TIME_SLACK: f64 = 1e-6;

/// Most pairs that are measured to make one step longer.
const MAX_MEASURED: usize = 8;

/// A check under way.
pub(super) struct Sweep<'c, F> {
    scene: &'c CollisionScene,
    check: &'c MotionCheck<'c>,
    sample: F,
    workspace: &'c mut ClearanceWorkspace,
    states: usize,
    minimum: Option<TimedDistance>,
    first_violation: Option<TimedDistance>,
    undecided: Option<(f64, f64)>,
    guaranteed: f64,
}

impl<'c, F: FnMut(f64, &mut [f64])> Sweep<'c, F> {
    pub(super) const fn new(
        scene: &'c CollisionScene,
        check: &'c MotionCheck<'c>,
        sample: F,
        workspace: &'c mut ClearanceWorkspace,
    ) -> Self {
        Self {
            scene,
            check,
            sample,
            workspace,
            states: 0,
            minimum: None,
            first_violation: None,
            undecided: None,
            guaranteed: f64::INFINITY,
        }
    }

    pub(super) fn run(mut self) -> Result<MotionReport, ClearanceError> {
        let MotionCheck { duration_s, resolution_s, .. } = *self.check;
        let nearest = self.look_at(0.0)?;
        self.accept(nearest);
        self.guaranteed = self.workspace.distances.iter().copied().fold(f64::INFINITY, f64::min);
        let (mut from, mut step) = (0.0, self.next_step(0.0));
        self.keep();
        while from < duration_s {
            if self.states >= self.check.max_states {
                return Ok(self.report(Some(from)));
            }
            let to = if from + step < duration_s { from + step } else { duration_s };
            let length = to - from;
            let nearest = self.look_at(to)?;
            if self.check.speeds.is_some() {
                self.check_speeds(from, to)?;
                let bound = self.bound(to, length);
                // The last step may be shorter than the resolution, others longer by rounding.
                if bound < self.floor() && length > resolution_s * (1.0 + TIME_SLACK) {
                    step = (0.5 * length).max(resolution_s);
                    continue;
                }
                if bound < self.check.threshold_m && self.undecided.is_none() {
                    self.undecided = Some((from, to));
                }
                self.guaranteed = self.guaranteed.min(bound);
            }
            self.accept(nearest);
            (from, step) = (to, self.next_step(to));
            self.keep();
        }
        Ok(self.report(None))
    }

    /// Bounds on the distances of all pairs at a time, and the distances of those that may break
    /// the threshold or be a new minimum; the nearest of these.
    fn look_at(&mut self, time_s: f64) -> Result<Option<TimedDistance>, ClearanceError> {
        self.states += 1;
        let mut positions = std::mem::take(&mut self.workspace.positions);
        (self.sample)(time_s, &mut positions);
        let placed = self.scene.place_bodies(&positions, self.workspace);
        self.workspace.positions = positions;
        placed?;
        if self.check.speeds.is_some() {
            self.scene.check_strokes(&self.workspace.positions)?;
        }
        self.workspace.bound_distances(self.scene, 0..self.scene.pairs.len());
        self.workspace.measured.fill(false);
        let mut nearest: Option<TimedDistance> = None;
        for pair in 0..self.scene.pairs.len() {
            let least = self.minimum.map_or(f64::INFINITY, |least| least.pair.distance_m);
            let bound = self.workspace.distances.get(pair).copied();
            if bound.is_some_and(|bound| bound >= least && bound >= self.check.threshold_m) {
                continue;
            }
            let found = self.measure(pair, time_s);
            let limit = nearest.map_or(f64::INFINITY, |near| near.pair.distance_m);
            nearest = found.filter(|found| found.pair.distance_m < limit).or(nearest);
        }
        Ok(nearest)
    }

    /// Measures the shapes of a pair at the last sample.
    fn measure(&mut self, pair: usize, time_s: f64) -> Option<TimedDistance> {
        let measured = self.workspace.measure(self.scene, pair, Accuracy::Shapes)?;
        let distance = self.workspace.distances.get_mut(pair)?;
        // Rounding aside, shapes are no nearer than any bound.
        *distance = distance.max(measured.distance_m);
        *self.workspace.measured.get_mut(pair)? = true;
        let found = TimedDistance { time_s, pair: measured };
        if self.minimum.is_none_or(|least| measured.distance_m < least.pair.distance_m) {
            self.minimum = Some(found);
        }
        Some(found)
    }

    /// The distance that steps must not let a pair pass unseen: the threshold, and once that is
    /// broken the least distance seen.
    fn floor(&self) -> f64 {
        match (self.first_violation, self.minimum) {
            (Some(_), Some(least)) => least.pair.distance_m.min(self.check.threshold_m),
            _ => self.check.threshold_m,
        }
    }

    /// The least that the distance of any pair can be in the step that ends at the last sample.
    fn bound(&mut self, time_s: f64, length: f64) -> f64 {
        let floor = self.floor();
        let mut least = f64::INFINITY;
        for pair in 0..self.scene.pairs.len() {
            let mut bound = self.pair_bound(pair, length);
            if bound < floor && self.workspace.measured.get(pair) == Some(&false) {
                self.measure(pair, time_s);
                bound = self.pair_bound(pair, length);
            }
            least = least.min(bound);
        }
        least
    }

    fn pair_bound(&self, pair: usize, length: f64) -> f64 {
        let ClearanceWorkspace { previous, distances, rates, .. } = &*self.workspace;
        match (previous.get(pair), distances.get(pair), rates.get(pair)) {
            (Some(d), Some(e), Some(rate)) => 0.5 * (d + e - rate * length),
            _ => f64::INFINITY,
        }
    }

    /// A step after the last sample that the bound is likely to allow.
    ///
    /// The pair that allows least is measured, and the next, for as long as that may help.
    fn next_step(&mut self, time_s: f64) -> f64 {
        let MotionCheck { duration_s, resolution_s, speeds, .. } = *self.check;
        if speeds.is_none() {
            return resolution_s;
        }
        for _ in 0..MAX_MEASURED {
            let (step, pair) = self.shortest_step();
            let is_bound = pair.filter(|&pair| self.workspace.measured.get(pair) == Some(&false));
            match is_bound {
                Some(pair) if step < duration_s - time_s => self.measure(pair, time_s),
                _ => break,
            };
        }
        self.shortest_step().0.max(resolution_s)
    }

    fn shortest_step(&self) -> (f64, Option<usize>) {
        let floor = self.floor();
        let pairs = self.workspace.distances.iter().zip(&self.workspace.rates).enumerate();
        pairs.filter(|(_, (_, rate))| **rate > 0.0).fold(
            (self.check.duration_s, None),
            |shortest, (pair, (distance, rate))| {
                let step = BOLDNESS * (distance - floor) / rate;
                if step < shortest.0 { (step, Some(pair)) } else { shortest }
            },
        )
    }

    fn accept(&mut self, nearest: Option<TimedDistance>) {
        let near = |near: &TimedDistance| near.pair.distance_m < self.check.threshold_m;
        if self.first_violation.is_none() {
            self.first_violation = nearest.filter(near);
        }
    }

    fn keep(&mut self) {
        let ClearanceWorkspace { previous, distances, positions, last_positions, .. } =
            &mut *self.workspace;
        std::mem::swap(previous, distances);
        std::mem::swap(last_positions, positions);
    }

    fn check_speeds(&self, from_s: f64, to_s: f64) -> Result<(), ClearanceError> {
        let ClearanceWorkspace { positions, last_positions, .. } = &*self.workspace;
        let ends = positions.iter().zip(last_positions);
        let speeds = self.check.speeds.unwrap_or_default();
        for (variable, ((to, from), &speed)) in ends.zip(speeds).enumerate() {
            let distance = (to - from).abs();
            if distance > speed * (to_s - from_s) * (1.0 + SPEED_SLACK) + SPEED_SLACK {
                let fault =
                    ClearanceError::SpeedExceeded { variable, from_s, to_s, distance, speed };
                return Err(fault);
            }
        }
        Ok(())
    }

    fn report(self, stopped_at: Option<f64>) -> MotionReport {
        let verdict = match (self.first_violation, stopped_at, self.undecided) {
            (Some(_), _, _) => MotionVerdict::Violation,
            (None, Some(until_s), _) => MotionVerdict::OutOfStates { until_s },
            (None, None, Some((from_s, to_s))) => MotionVerdict::Undecided { from_s, to_s },
            (None, None, None) if self.check.speeds.is_none() => MotionVerdict::ClearAtSamples,
            (None, None, None) => MotionVerdict::Clear,
        };
        let is_whole = stopped_at.is_none() && self.check.speeds.is_some();
        MotionReport {
            verdict,
            first_violation: self.first_violation,
            minimum: self.minimum,
            guaranteed_m: Some(self.guaranteed).filter(|least| is_whole && least.is_finite()),
            states: self.states,
        }
    }
}
