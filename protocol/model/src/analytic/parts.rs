//! Shoulder, elbow and wrist: what the closed forms are put together from.

#![allow(non_snake_case, reason = "R_AB is the orientation of frame B in frame A")]

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::branch::Wrist;
use super::subproblem::{Angle, Roots, Wave, across, angle_between, any_across, turned, turning};

/// Joint 1 before joints with parallel axes: they leave a point's distance along their axes alone.
#[derive(Clone, Debug)]
pub(super) struct Shoulder {
    pub(super) axis: Vector3<f64>,
    pub(super) point: Vector3<f64>,
    /// Direction of the parallel axes.
    pub(super) normal: Vector3<f64>,
    /// What stays the same: distance of the wrist from `point` along `normal` \[m\].
    pub(super) offset: f64,
    pub(super) slack: f64,
}

impl Shoulder {
    /// Values of joint 1 for a wrist at `wrist`, in the base. Where the wave falls it is in front.
    pub(super) fn roots(&self, wrist: &Vector3<f64>) -> Roots {
        let wave = Wave::of(&self.normal, &-self.axis, &(wrist - self.point));
        wave.roots(self.offset, self.slack)
    }
}

/// Two turns that bring a point to where it shall be: subproblem 3, then 1.
#[derive(Clone, Debug)]
pub(super) struct Elbow {
    axis: Vector3<f64>,
    upper: Vector3<f64>,
    fore: Vector3<f64>,
    wave: Wave,
    /// Sum of the squares of the lengths \[m²\].
    squares: f64,
    /// Distances that can be reached \[m\].
    shortest: f64,
    longest: f64,
    slack: f64,
}

impl Elbow {
    /// An elbow whose second turn is about `axis`; `upper` leads from the first centre to the
    /// second, `fore` from there to the point, at position zero.
    pub(super) fn new(
        axis: Vector3<f64>,
        upper: Vector3<f64>,
        fore: Vector3<f64>,
        slack: f64,
    ) -> Self {
        let wave = Wave::of(&upper, &axis, &fore);
        let squares = upper.norm_squared() + fore.norm_squared();
        let reach =
            |sign: f64| (squares + 2.0 * (wave.mean + sign * wave.amplitude)).max(0.0).sqrt();
        let (shortest, longest) = (reach(-1.0), reach(1.0));
        Self { axis, upper, fore, wave, squares, shortest, longest, slack }
    }

    /// Angles of the second turn that bring the point to the distance \[m\]; the excess is in \[m\].
    ///
    /// Where the wave falls the elbow is bent positively.
    pub(super) fn roots(&self, distance: f64) -> Roots {
        let height = 0.5 * (distance * distance - self.squares);
        match self.wave.roots(height, self.slack * self.longest) {
            Roots::Beyond { .. } => {
                let excess = (distance - self.longest).max(self.shortest - distance);
                // The comparison drops what is not a number.
                Roots::Beyond { excess: if excess > 0.0 { excess } else { f64::INFINITY } }
            }
            roots => roots,
        }
    }

    /// The shortest and the longest distance that can be reached \[m\].
    pub(super) const fn limits(&self) -> [f64; 2] {
        [self.shortest, self.longest]
    }

    /// Whether `reach` is that of an elbow bent positively, or stretched.
    pub(super) fn is_bent_positively(&self, reach: &Vector3<f64>) -> bool {
        self.axis.dot(&self.upper.cross(reach)) >= 0.0
    }

    /// Which way from the line to the point the elbow is, before the first turn; `None` if the
    /// point is at the first centre.
    pub(super) fn side(
        &self,
        reach: &Vector3<f64>,
        is_bent_positively: bool,
    ) -> Option<Vector3<f64>> {
        let side = reach.cross(&self.axis).try_normalize(self.slack)?;
        Some(if is_bent_positively { side } else { -side })
    }

    /// The second turn.
    pub(super) fn turning(&self, angle: Angle) -> Matrix3<f64> {
        turning(&self.axis, angle)
    }

    /// Where the point is, from the first centre, before the first turn.
    pub(super) fn reach(&self, angle: Angle) -> Vector3<f64> {
        self.upper + turned(&self.axis, angle, &self.fore)
    }
}

/// Three turns about axes through one point, that make up a rotation.
#[derive(Clone, Debug)]
pub(super) struct Spherical {
    axes: [Vector3<f64>; 3],
    wave: Wave,
    /// Whether the middle axis is at right angles to both others.
    is_square: bool,
    beside_first: Vector3<f64>,
    beside_last: Vector3<f64>,
    slack: f64,
}

/// Which joint keeps its value \[rad\] where the outer axes are parallel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Keep {
    First(f64),
    Last(f64),
}

/// Three angles that make up a rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turns {
    pub(super) angles: [Angle; 3],
    pub(super) flip: Wrist,
    pub(super) singular: bool,
}

impl Spherical {
    pub(super) fn new(axes: [Vector3<f64>; 3], slack: f64) -> Self {
        let [first, middle, last] = axes;
        Self {
            wave: Wave::of(&first, &middle, &last),
            is_square: first.dot(&middle).abs().max(last.dot(&middle).abs()) < 1e-4,
            beside_first: any_across(&first),
            beside_last: any_across(&last),
            axes,
            slack,
        }
    }

    /// The product of the turns by `angles`.
    pub(super) fn turning(&self, angles: [Angle; 3]) -> Matrix3<f64> {
        let [first, middle, last] = &self.axes;
        turning(first, angles[0]) * turning(middle, angles[1]) * turning(last, angles[2])
    }

    /// Angles whose product of turns is `R`.
    ///
    /// A singular answer stands first; those after it are needed only where it does not hold, since
    /// the arm is not quite the ideal one or cannot reach with the value kept.
    pub(super) fn turns(&self, R: &Matrix3<f64>, keep: Keep) -> ArrayVec<Turns, 3> {
        let mut answers = ArrayVec::new();
        let [first, _, last] = &self.axes;
        let tip = R * last;
        let level = first.dot(&tip) - self.wave.mean;
        let gap = self.wave.amplitude - level.abs();
        if gap < -self.slack || gap.is_nan() {
            return answers;
        }
        let lean = first.cross(&tip).norm();
        let sine = if self.is_square {
            lean
        } else {
            ((self.wave.amplitude + level.abs()) * gap).max(0.0).sqrt()
        };
        let half = Angle::towards(sine, level);
        // A lean of this size turns the tip by less than what a posture must be exact to.
        if lean < 10.0 * self.slack {
            answers.push(self.kept(R, self.wave.crest(level), keep));
        }
        for (angle, flip) in [(half, Wrist::NoFlip), (-half, Wrist::Flip)] {
            answers.push(self.regular(R, self.wave.phase + angle, flip));
        }
        answers
    }

    /// Outer angles for a middle one, of axes that are not parallel.
    fn regular(&self, R: &Matrix3<f64>, middle: Angle, flip: Wrist) -> Turns {
        let axes = &self.axes;
        let (from, onto) = (turned(&axes[1], -middle, &axes[0]), R.tr_mul(&axes[0]));
        let last = -angle_between(&axes[2], &from, &onto);
        Turns { angles: [self.first(R, middle, last), middle, last], flip, singular: false }
    }

    /// Outer angles for a middle one at which their axes are parallel.
    pub(super) fn kept(&self, R: &Matrix3<f64>, middle: Angle, keep: Keep) -> Turns {
        let axes = &self.axes;
        let angles = match keep {
            Keep::Last(last) => {
                let last = Angle::of(last);
                [self.first(R, middle, last), middle, last]
            }
            Keep::First(first) => {
                let first = Angle::of(first);
                let turned_tip = turned(&axes[0], -first, &(R * self.beside_last));
                let onto = turned(&axes[1], -middle, &turned_tip);
                [first, middle, angle_between(&axes[2], &self.beside_last, &onto)]
            }
        };
        Turns { angles, flip: Wrist::NoFlip, singular: true }
    }

    /// The first angle, well defined everywhere once the others are known.
    fn first(&self, R: &Matrix3<f64>, middle: Angle, last: Angle) -> Angle {
        let axes = &self.axes;
        let beside = turned(&axes[1], -middle, &self.beside_first);
        let onto = R * turned(&axes[2], -last, &beside);
        angle_between(&axes[0], &self.beside_first, &onto)
    }
}

/// What is left of `vector` in the plane of an elbow with axis along `normal`.
pub(super) fn in_plane(normal: &Vector3<f64>, vector: &Vector3<f64>) -> Vector3<f64> {
    across(normal, vector)
}
