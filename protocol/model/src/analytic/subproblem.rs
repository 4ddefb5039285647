//! The geometric subproblems that every closed form here is made of.
//!
//! An axis is a unit vector; a turn about it by a positive angle follows the right hand.
//! Subproblem 1 is [`angle_between`]. Subproblem 3, a turn that brings a point to a given distance
//! from another, and the first half of subproblem 2, two turns about axes that meet, are one
//! equation `a cos q + b sin q = c`, [`Wave`]; the second half of subproblem 2 is subproblem 1.
//!
//! Source: Murray, Li, Sastry, "A Mathematical Introduction to Robotic Manipulation", section 3.3;
//! Elias, Wen, "IK-Geo: Unified Robot Inverse Kinematics Using Subproblem Decomposition", 2022.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Neg, Sub};

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

/// Two roots this near to each other, half the angle between them \[rad\], are one.
const DOUBLE_ROOT_RAD: f64 = 1e-6;

/// An angle with its sine and cosine, so that neither is calculated twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Angle {
    /// Value \[rad\], maybe with whole turns.
    pub(super) rad: f64,
    pub(super) sin: f64,
    pub(super) cos: f64,
}

impl Angle {
    const ZERO: Self = Self { rad: 0.0, sin: 0.0, cos: 1.0 };
    const HALF_TURN: Self = Self { rad: PI, sin: 0.0, cos: -1.0 };

    pub(super) fn of(rad: f64) -> Self {
        let (sin, cos) = rad.sin_cos();
        Self { rad, sin, cos }
    }

    /// The angle whose sine and cosine are in this proportion; zero if both are zero.
    pub(super) fn towards(sin: f64, cos: f64) -> Self {
        let norm = (sin * sin + cos * cos).sqrt();
        if norm == 0.0 {
            return Self::ZERO;
        }
        Self { rad: sin.atan2(cos), sin: sin / norm, cos: cos / norm }
    }

    /// The angle, or its negative if `sign` is negative.
    pub(super) fn signed(self, sign: f64) -> Self {
        if sign < 0.0 { -self } else { self }
    }
}

impl Neg for Angle {
    type Output = Self;

    fn neg(self) -> Self {
        Self { rad: -self.rad, sin: -self.sin, cos: self.cos }
    }
}

impl Add for Angle {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            rad: self.rad + other.rad,
            sin: self.sin * other.cos + self.cos * other.sin,
            cos: self.cos * other.cos - self.sin * other.sin,
        }
    }
}

impl Sub for Angle {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

/// `vector` turned about `axis` by `angle`.
pub(super) fn turned(axis: &Vector3<f64>, angle: Angle, vector: &Vector3<f64>) -> Vector3<f64> {
    let Angle { sin, cos, .. } = angle;
    vector * cos + axis.cross(vector) * sin + axis * (axis.dot(vector) * (1.0 - cos))
}

/// The matrix that turns about `axis` by `angle`.
pub(super) fn turning(axis: &Vector3<f64>, angle: Angle) -> Matrix3<f64> {
    let Angle { sin, cos, .. } = angle;
    let (x, y, z) = (axis.x, axis.y, axis.z);
    let (s, v) = (axis * sin, axis * (1.0 - cos));
    Matrix3::new(
        v.x * x + cos,
        v.x * y - s.z,
        v.x * z + s.y,
        v.y * x + s.z,
        v.y * y + cos,
        v.y * z - s.x,
        v.z * x - s.y,
        v.z * y + s.x,
        v.z * z + cos,
    )
}

/// `angle` less the whole turns, in [-π, π] \[rad\].
pub(super) fn wrapped(angle: f64) -> f64 {
    if angle.abs() <= PI { angle } else { angle - TAU * (angle / TAU).round() }
}

/// `vector` without its part along `axis`.
pub(super) fn across(axis: &Vector3<f64>, vector: &Vector3<f64>) -> Vector3<f64> {
    vector - axis * axis.dot(vector)
}

/// A unit vector at right angles to `axis`.
pub(super) fn any_across(axis: &Vector3<f64>) -> Vector3<f64> {
    let least = axis.iamin();
    let mut other = Vector3::zeros();
    other[least] = 1.0;
    across(axis, &other).normalize()
}

/// Subproblem 1: the turn about `axis` that brings `from` nearest to `onto`.
///
/// Zero if one of them lies along the axis.
pub(super) fn angle_between(
    axis: &Vector3<f64>,
    from: &Vector3<f64>,
    onto: &Vector3<f64>,
) -> Angle {
    // First across, so that short parts across keep their digits.
    let (from, onto) = (across(axis, from), across(axis, onto));
    Angle::towards(axis.dot(&from.cross(&onto)), from.dot(&onto))
}

/// The height along one direction of a vector that turns: `amplitude cos(q - phase) + mean`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wave {
    pub(super) amplitude: f64,
    pub(super) phase: Angle,
    pub(super) mean: f64,
}

impl Wave {
    /// `direction · turned(axis, q, vector)` as a function of `q` (subproblem 4 of Elias and Wen).
    pub(super) fn of(direction: &Vector3<f64>, axis: &Vector3<f64>, vector: &Vector3<f64>) -> Self {
        let mean = direction.dot(axis) * axis.dot(vector);
        let vector = across(axis, vector);
        let (cos, sin) = (direction.dot(&vector), direction.dot(&axis.cross(&vector)));
        Self { amplitude: (cos * cos + sin * sin).sqrt(), phase: Angle::towards(sin, cos), mean }
    }

    /// Where the wave is at its crest, or at its trough if `level` is negative.
    pub(super) fn crest(&self, level: f64) -> Angle {
        if level < 0.0 { self.phase + Angle::HALF_TURN } else { self.phase }
    }

    /// Where the wave has the given height; up to `slack` beyond its crest counts as the crest.
    pub(super) fn roots(&self, height: f64, slack: f64) -> Roots {
        let level = height - self.mean;
        if self.amplitude <= slack && level.abs() <= slack {
            return Roots::Free;
        }
        let gap = self.amplitude - level.abs();
        if gap < -slack || gap.is_nan() {
            return Roots::Beyond { excess: -gap };
        }
        // Not a number, and so not above, if the level is beyond the crest within the slack.
        let sine = ((self.amplitude + level.abs()) * gap).sqrt();
        if sine > DOUBLE_ROOT_RAD * self.amplitude {
            let half = Angle::towards(sine, level);
            Roots::Two { falling: self.phase + half, rising: self.phase - half }
        } else {
            Roots::Double(self.crest(level))
        }
    }
}

/// Where a [`Wave`] has a height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Roots {
    /// Nowhere: the height is beyond the crest by so much, or not a number.
    Beyond { excess: f64 },
    /// Everywhere, since the wave is flat.
    Free,
    /// At its crest or trough.
    Double(Angle),
    /// At two places.
    Two { falling: Angle, rising: Angle },
}

/// One place where a [`Wave`] has a height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Root {
    pub(super) angle: Angle,
    /// Whether the wave falls there; true as well where it does neither.
    pub(super) falls: bool,
    /// Whether the two roots are one, or all angles are roots.
    pub(super) singular: bool,
}

impl Roots {
    /// The roots; `kept` \[rad\] stands for all of them if every angle is one.
    pub(super) fn each(&self, kept: f64) -> ArrayVec<Root, 2> {
        let mut roots = ArrayVec::new();
        let one = |angle| Root { angle, falls: true, singular: true };
        match *self {
            Self::Beyond { .. } => {}
            Self::Free => roots.push(one(Angle::of(kept))),
            Self::Double(angle) => roots.push(one(angle)),
            Self::Two { falling, rising } => {
                roots.push(Root { angle: falling, falls: true, singular: false });
                roots.push(Root { angle: rising, falls: false, singular: false });
            }
        }
        roots
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn config() -> ProptestConfig {
        let rng_seed = RngSeed::Fixed(20_261_122);
        ProptestConfig { cases: 500, rng_seed, failure_persistence: None, ..Default::default() }
    }

    fn vector() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0).prop_map(Vector3::from)
    }

    fn direction() -> impl Strategy<Value = Vector3<f64>> {
        vector()
            .prop_filter("long enough", |vector| vector.norm() > 0.1)
            .prop_map(|vector| vector.normalize())
    }

    proptest! {
        #![proptest_config(config())]

        #[test]
        fn a_turn_by_vector_and_by_matrix_is_the_turn_of_nalgebra(
            axis in direction(), angle in -PI..PI, vector in vector()
        ) {
            let axis_of = nalgebra::Unit::new_unchecked(axis);
            let expected = nalgebra::Rotation3::from_axis_angle(&axis_of, angle) * vector;
            prop_assert!((turned(&axis, Angle::of(angle), &vector) - expected).amax() < 1e-15);
            prop_assert!((turning(&axis, Angle::of(angle)) * vector - expected).amax() < 1e-15);
        }

        #[test]
        fn the_turn_between_two_vectors_is_found(
            axis in direction(), angle in -PI..PI, from in vector(), along in -1.0..1.0_f64
        ) {
            prop_assume!(across(&axis, &from).norm() > 1e-3);
            // Off along the axis: what is left is the nearest turn.
            let onto = turned(&axis, Angle::of(angle), &from) + axis * along;
            let found = angle_between(&axis, &from, &onto);
            prop_assert!(wrapped(found.rad - angle).abs() < 1e-11, "{found:?} for {angle}");
        }

        #[test]
        fn a_wave_has_its_height_at_its_roots_and_one_of_them_is_known(
            to in direction(), axis in direction(), vector in vector(), angle in -PI..PI
        ) {
            let wave = Wave::of(&to, &axis, &vector);
            prop_assume!(wave.amplitude > 1e-2);
            let height = to.dot(&turned(&axis, Angle::of(angle), &vector));
            let roots = wave.roots(height, 1e-12).each(0.0);
            for root in &roots {
                let error = to.dot(&turned(&axis, root.angle, &vector)) - height;
                prop_assert!(error.abs() < 1e-12, "{root:?}: {error:e}");
                let later = to.dot(&turned(&axis, root.angle + Angle::of(1e-4), &vector));
                prop_assert!(root.singular || (later < height) == root.falls || error.abs() < 1e-7);
            }
            let nearest =
                roots.iter().map(|root| wrapped(root.angle.rad - angle).abs()).fold(PI, f64::min);
            prop_assert!(nearest < 1e-6, "nearest root {nearest:e} away");
        }

        #[test]
        fn two_turns_about_axes_that_meet_bring_a_vector_onto_another(
            axes in prop::array::uniform2(direction()), angles in prop::array::uniform2(-PI..PI),
            vector in vector()
        ) {
            let angles = angles.map(Angle::of);
            // Subproblem 2: first · second · vector = onto.
            let onto = turned(&axes[0], angles[0], &turned(&axes[1], angles[1], &vector));
            let wave = Wave::of(&axes[1], &-axes[0], &onto);
            prop_assume!(wave.amplitude > 1e-2);
            let roots = wave.roots(axes[1].dot(&vector), 1e-12).each(0.0);
            prop_assert!(!roots.is_empty());
            for root in roots {
                let back = turned(&axes[0], -root.angle, &onto);
                let second = angle_between(&axes[1], &vector, &back);
                let error = turned(&axes[0], root.angle, &turned(&axes[1], second, &vector)) - onto;
                prop_assert!(error.norm() < 1e-6, "{root:?}: {:e}", error.norm());
            }
        }

        #[test]
        fn a_vector_across_an_axis_is_a_unit_at_right_angles(axis in direction()) {
            let other = any_across(&axis);
            prop_assert!(axis.dot(&other).abs() < 1e-15 && (other.norm() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn angles_keep_sine_and_cosine_when_added_and_negated() {
        let (a, b) = (Angle::of(2.0), Angle::towards(-3.0, 4.0));
        for angle in [a + b, a - b, -a, b.signed(-1.0), b.signed(1.0), a + Angle::HALF_TURN] {
            let expected = Angle::of(angle.rad);
            assert!((angle.sin - expected.sin).abs() < 1e-15, "{angle:?}");
            assert!((angle.cos - expected.cos).abs() < 1e-15, "{angle:?}");
        }
        assert_eq!(Angle::towards(0.0, 0.0), Angle::ZERO);
    }

    #[test]
    fn a_height_beyond_the_crest_is_refused_with_the_excess() {
        let wave = Wave { amplitude: 2.0, phase: Angle::of(0.5), mean: 1.0 };
        assert_eq!(wave.roots(3.25, 1e-9), Roots::Beyond { excess: 0.25 });
        assert_eq!(wave.roots(-1.5, 1e-9), Roots::Beyond { excess: 0.5 });
        assert!(matches!(wave.roots(f64::NAN, 1e-9), Roots::Beyond { .. }));
    }

    #[test]
    fn crest_trough_and_flat_waves_have_one_root() {
        let wave = Wave { amplitude: 2.0, phase: Angle::of(0.5), mean: 1.0 };
        assert_eq!(wave.roots(3.0, 1e-9), Roots::Double(Angle::of(0.5)));
        assert_eq!(wave.roots(3.0 + 1e-10, 1e-9), Roots::Double(Angle::of(0.5)));
        assert_eq!(wave.roots(-1.0, 1e-9).each(0.0)[0].angle.rad, 0.5 + PI);
        let flat = Wave { amplitude: 1e-12, phase: Angle::ZERO, mean: 1.0 };
        assert_eq!(flat.roots(1.0, 1e-9), Roots::Free);
        assert_eq!(flat.roots(1.0, 1e-9).each(0.25)[0].angle, Angle::of(0.25));
    }

    #[test]
    fn wrapping_takes_whole_turns_away() {
        assert!((wrapped(3.0 * PI + 0.25) - (0.25 - PI)).abs() < 1e-14);
        assert_eq!(wrapped(-PI), -PI);
        assert!(wrapped(1e6).abs() <= PI);
    }
}
