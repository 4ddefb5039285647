//! Whether a motion keeps clear: what is asked and answered.

use super::error::ClearanceError;
use super::query::PairDistance;
use super::scene::{ClearanceWorkspace, CollisionScene};
use super::sweep::Sweep;

/// What a motion is checked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionCheck<'s> {
    /// Length of the motion, which begins at zero \[s\].
    pub duration_s: f64,
    /// Shortest step \[s\], above zero: with `speeds` how close a doubtful place is looked at,
    /// without them the time from each sample to the next.
    pub resolution_s: f64,
    /// Every pair must keep at least this distance \[m\], above zero.
    pub threshold_m: f64,
    /// Highest absolute velocity of each driven joint of the scene at any time of the motion
    /// \[rad/s or m/s\]; `None` if unknown, then nothing is said about times between samples.
    pub speeds: Option<&'s [f64]>,
    /// Most configurations to look at.
    pub max_states: usize,
}

/// Answer to a [`MotionCheck`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionReport {
    /// Whether the motion keeps the threshold.
    pub verdict: MotionVerdict,
    /// First sample with a pair nearer than the threshold, and the nearest pair of that sample.
    pub first_violation: Option<TimedDistance>,
    /// Nearest pair of all samples; `None` if the scene has no pairs.
    pub minimum: Option<TimedDistance>,
    /// Distance that no pair is below at any time of the motion \[m\], measured or not; `None`
    /// without `speeds`, without pairs, or if the motion was not checked to its end.
    pub guaranteed_m: Option<f64>,
    /// Configurations looked at.
    pub states: usize,
}

/// Whether a motion keeps its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionVerdict {
    /// Every pair keeps the threshold at every time of the motion.
    Clear,
    /// Every pair keeps the threshold at every sample; nothing is known between them, because no
    /// speeds were given.
    ClearAtSamples,
    /// A sample is nearer than the threshold. With `speeds` and unless the report says otherwise,
    /// everything before the sample by more than `resolution_s` is clear.
    Violation,
    /// No sample is nearer than the threshold, but between two that are `resolution_s` apart a pair
    /// might be. Treat it as a violation, or check with a finer resolution.
    Undecided {
        /// Time of the first of the two samples \[s\].
        from_s: f64,
        /// Time of the second \[s\].
        to_s: f64,
    },
    /// `max_states` was too low: the motion was checked up to a time only, and clear there.
    OutOfStates {
        /// That time \[s\].
        until_s: f64,
    },
}

/// A distance at a time of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedDistance {
    /// Time \[s\].
    pub time_s: f64,
    /// The pair.
    pub pair: PairDistance,
}

impl CollisionScene {
    /// Checks the motion whose positions at a time \[s\] `sample` writes into the position vector
    /// of the scene that it is given.
    ///
    /// With [`speeds`](MotionCheck::speeds) nothing between two samples is missed, by this bound: a
    /// joint that turns moves any point of a body by no more than its speed times the longest way
    /// from its axis to the point that the lengths of the links allow, a slide by no more than its
    /// speed; only joints between the two bodies of a pair count. So the distance of a pair changes
    /// by at most `L` per second, and between samples `h` seconds apart, with distances `d` and `e`,
    /// it is at least `(d + e - L h) / 2`. Steps are as long as this bound stays above the
    /// threshold for every pair, capsules first and shapes where capsules leave it open, and are
    /// halved where it does not, down to `resolution_s`.
    ///
    /// What [`MotionVerdict::Clear`] guarantees: at every time from zero to `duration_s` every pair
    /// that the scene checks is at least `threshold_m` apart, the shapes of meshes taken as their
    /// convex hulls, if between samples no joint is faster than its entry in `speeds` and slides
    /// keep their limits; both are verified at the samples. Measured distances are accurate to 5e-8
    /// of themselves.
    ///
    /// After a violation the check goes on, to find the minimum. Steps are not shorter than
    /// `resolution_s` and a step is as a rule halved once at most, so about `2 * duration_s /
    /// resolution_s` configurations are looked at in the worst case, and never more than
    /// `max_states`. Allocates nothing.
    ///
    /// # Errors
    /// [`ClearanceError::Option`] if a number of the check is not usable,
    /// [`ClearanceError::SpeedCount`] if the speeds do not fit the scene,
    /// [`ClearanceError::UnboundedReach`] if a slide without limits leaves a speed without a bound,
    /// [`ClearanceError::SpeedExceeded`] and [`ClearanceError::OutsideTravel`] if the samples break
    /// what the bound rests on, and what [`place`](Self::place) fails with.
    pub fn check_motion(
        &self,
        check: &MotionCheck<'_>,
        sample: impl FnMut(f64, &mut [f64]),
        workspace: &mut ClearanceWorkspace,
    ) -> Result<MotionReport, ClearanceError> {
        self.check_workspace(workspace)?;
        check.validate(self.variable_count())?;
        self.bound_rates(check, workspace)?;
        Sweep::new(self, check, sample, workspace).run()
    }

    /// Highest rate at which the distance of any pair can change while no driven joint of the scene
    /// is faster than its entry in `speeds` \[rad/s or m/s\]: the bound of
    /// [`check_motion`](Self::check_motion) \[m/s\], in every configuration.
    ///
    /// # Errors
    /// [`ClearanceError::SpeedCount`] if the speeds do not fit the scene,
    /// [`ClearanceError::UnboundedReach`] if a slide without limits leaves a speed without a bound.
    pub fn max_rate(&self, speeds: &[f64]) -> Result<f64, ClearanceError> {
        let (expected, given) = (self.variable_count(), speeds.len());
        if expected != given {
            return Err(ClearanceError::SpeedCount { expected, given });
        }
        (0..self.pair_count())
            .try_fold(0.0_f64, |most, pair| Ok(most.max(self.rate_of(pair, speeds)?)))
    }

    /// How fast the distance of a pair can change.
    fn rate_of(&self, pair: usize, speeds: &[f64]) -> Result<f64, ClearanceError> {
        self.levers_of(pair).iter().try_fold(0.0, |rate, lever| {
            let speed = speeds.get(lever.variable).copied().unwrap_or_default();
            if speed > 0.0 && !lever.reach.is_finite() {
                return Err(ClearanceError::UnboundedReach { variable: lever.variable });
            }
            Ok(rate + if speed > 0.0 { speed * lever.reach } else { 0.0 })
        })
    }

    /// How fast the distance of each pair can change.
    fn bound_rates(
        &self,
        check: &MotionCheck<'_>,
        workspace: &mut ClearanceWorkspace,
    ) -> Result<(), ClearanceError> {
        let Some(speeds) = check.speeds else {
            workspace.rates.fill(0.0);
            return Ok(());
        };
        for (pair, rate) in workspace.rates.iter_mut().enumerate() {
            *rate = self.rate_of(pair, speeds)?;
        }
        Ok(())
    }
}

/// Most steps of the shortest length in a motion: below, times cannot be told apart.
const MAX_STEPS: f64 = 1e9;

impl MotionCheck<'_> {
    fn validate(&self, variables: usize) -> Result<(), ClearanceError> {
        let not_negative = "a finite number of zero or more";
        let fail = |field, value, expected| Err(ClearanceError::Option { field, value, expected });
        if !(self.duration_s.is_finite() && self.duration_s >= 0.0) {
            return fail("duration_s", self.duration_s, not_negative);
        }
        if !(self.resolution_s.is_finite()
            && self.resolution_s > 0.0
            && self.resolution_s * MAX_STEPS >= self.duration_s)
        {
            let expected = "above zero and at least a billionth of duration_s";
            return fail("resolution_s", self.resolution_s, expected);
        }
        // Overlapping shapes are at zero, so zero could not tell them from touching ones.
        if !(self.threshold_m.is_finite() && self.threshold_m > 0.0) {
            return fail("threshold_m", self.threshold_m, "a finite number above zero");
        }
        if self.max_states == 0 {
            return fail("max_states", 0.0, "one or more");
        }
        let Some(speeds) = self.speeds else { return Ok(()) };
        if speeds.len() != variables {
            let given = speeds.len();
            return Err(ClearanceError::SpeedCount { expected: variables, given });
        }
        match speeds.iter().find(|speed| !(speed.is_finite() && **speed >= 0.0)) {
            Some(&speed) => fail("speeds", speed, not_negative),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Mount, SceneBuilder};
    use super::*;
    use crate::{Pose, RobotModel};

    const ARM: &str = include_str!("../../../../config/robots/seven_axis_arm.urdf");
    const LIFT: &str = include_str!("../../../../config/robots/lift_torso.urdf");

    /// An arm on the carriage of a lift, and one beside it.
    fn scene() -> CollisionScene {
        let [arm, lift] =
            [ARM, LIFT].map(|text| RobotModel::from_urdf(text, "robot.urdf").expect("a robot"));
        let mut builder = SceneBuilder::new();
        let world = |x: f64| Mount::World(Pose::from_translation(x, 0.0, 0.0));
        let robot = builder.add_robot("lift", &lift, world(0.0), &mut |_| None).expect("valid");
        let link = lift.link_index("carriage").expect("a link");
        let mount = Mount::Link { robot, link, pose: Pose::from_translation(0.3, 0.0, 0.1) };
        builder.add_robot("upper", &arm, mount, &mut |_| None).expect("valid");
        builder.add_robot("lower", &arm, world(0.9), &mut |_| None).expect("valid");
        builder.build()
    }

    #[test]
    fn no_distance_changes_faster_than_its_rate() {
        let scene = scene();
        let mut workspace = scene.workspace();
        let count = scene.variable_count();
        let (mut seed, step) = (5_u64, 1e-4);
        let mut random = |most: f64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            most * (2.0 * f64::from(u32::try_from(seed >> 32).expect("fits")) / f64::from(u32::MAX)
                - 1.0)
        };
        let mut highest = 0.0_f64;
        for _ in 0..200 {
            let mut positions: Vec<f64> = (0..count).map(|_| random(0.3)).collect();
            let speeds: Vec<f64> = (0..count).map(|_| random(2.0)).collect();
            let bounds: Vec<f64> = speeds.iter().map(|speed| speed.abs()).collect();
            let (duration_s, resolution_s, threshold_m) = (1.0, 1.0, 0.1);
            let speeds_given = Some(&*bounds);
            let check = MotionCheck {
                duration_s,
                resolution_s,
                threshold_m,
                speeds: speeds_given,
                max_states: 1,
            };
            scene.bound_rates(&check, &mut workspace).expect("bounded");
            let mut distances = Vec::new();
            for _ in 0..2 {
                scene.place_bodies(&positions, &mut workspace).expect("fits");
                workspace.bound_distances(&scene, 0..scene.pair_count());
                distances.push(workspace.distances.clone());
                positions.iter_mut().zip(&speeds).for_each(|(q, v)| *q += v * step);
            }
            for (pair, rate) in workspace.rates.iter().enumerate() {
                let change = (distances[1][pair] - distances[0][pair]).abs();
                assert!(change <= rate * step + 1e-12, "pair {pair}: {change} in {step} s, {rate}");
                highest = highest.max(change / (rate * step));
            }
            let most = workspace.rates.iter().copied().fold(0.0, f64::max);
            assert_eq!(scene.max_rate(&bounds), Ok(most));
        }
        // Not so far above the truth that it would be of no use.
        assert!(highest > 0.5, "{highest}");
    }
}
