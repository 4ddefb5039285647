//! Piecewise polynomials of all joints.

use super::piece::{Knot, Piece};
use crate::JointVector;
use serde::{Deserialize, Serialize};

/// How many segments a search looks ahead of its hint before it bisects.
const LOOK_AHEAD: usize = 4;

/// Piecewise polynomials of all joints with common segments. One segment lies between two
/// waypoints or is a part of that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Curve {
    joints: usize,
    degree: Degree,
    /// Where segments begin, and the end of the last \[s\]; at least two.
    times: Vec<f64>,
    /// Index of the last waypoint whose time has come when a segment begins; empty if segment `i`
    /// begins at waypoint `i`.
    waypoints: Vec<u32>,
    /// Per segment four (or six) rows of one value per joint: all `c0`, all `c1`, and so on. A
    /// sample reads one contiguous piece, and one row at a time, as vector instructions want it.
    coefficients: Vec<f64>,
}

/// Degree of all polynomials of a [`Curve`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Degree {
    Three,
    Five,
}

/// A point of time on a [`Curve`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) segment: usize,
    /// Time since the segment began \[s\].
    pub(super) u: f64,
}

/// What pieces are made of: a row of one value per joint for each time.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnotRows<'a> {
    pub(super) positions: &'a [f64],
    pub(super) velocities: &'a [f64],
    /// Empty for cubics.
    pub(super) accelerations: &'a [f64],
}

impl KnotRows<'_> {
    fn at(&self, index: usize) -> Knot {
        Knot {
            position: self.positions[index],
            velocity: self.velocities[index],
            acceleration: self.accelerations.get(index).copied().unwrap_or_default(),
        }
    }
}

impl Degree {
    const fn rows(self) -> usize {
        match self {
            Self::Three => 4,
            Self::Five => 6,
        }
    }
}

impl Curve {
    /// No segments yet; `segments` are made room for.
    pub(super) fn with_capacity(joints: usize, segments: usize) -> Self {
        Self {
            joints,
            degree: Degree::Three,
            times: Vec::with_capacity(segments + 1),
            waypoints: Vec::with_capacity(segments),
            coefficients: Vec::with_capacity(4 * joints * segments),
        }
    }

    /// The cubics that have these positions and velocities at `times`.
    pub(super) fn cubic(joints: usize, times: Vec<f64>, knots: KnotRows<'_>) -> Self {
        Self::hermite(Degree::Three, joints, times, |length, from, to| {
            Piece::<4>::hermite(length, knots.at(from), knots.at(to)).coefficients
        })
    }

    /// The polynomials of fifth degree that have these positions, velocities and accelerations.
    pub(super) fn quintic(joints: usize, times: Vec<f64>, knots: KnotRows<'_>) -> Self {
        Self::hermite(Degree::Five, joints, times, |length, from, to| {
            Piece::<6>::hermite(length, knots.at(from), knots.at(to)).coefficients
        })
    }

    fn hermite<const N: usize>(
        degree: Degree,
        joints: usize,
        times: Vec<f64>,
        piece: impl Fn(f64, usize, usize) -> [f64; N],
    ) -> Self {
        let mut coefficients = vec![0.0; N * joints * (times.len() - 1)];
        let segments = coefficients.chunks_exact_mut(N * joints);
        for (segment, (rows, ends)) in segments.zip(times.windows(2)).enumerate() {
            for joint in 0..joints {
                let from = segment * joints + joint;
                let piece = piece(ends[1] - ends[0], from, from + joints);
                for (power, coefficient) in piece.into_iter().enumerate() {
                    rows[power * joints + joint] = coefficient;
                }
            }
        }
        Self { joints, degree, times, waypoints: Vec::new(), coefficients }
    }

    /// Adds a segment of cubics from `start_s` on. The segment before it, if any, ends there.
    pub(super) fn push(
        &mut self,
        start_s: f64,
        waypoint: usize,
        coefficients: impl Fn(usize) -> [f64; 4],
    ) {
        self.times.push(start_s);
        self.waypoints.push(u32::try_from(waypoint).unwrap_or(u32::MAX));
        let base = self.coefficients.len();
        self.coefficients.resize(base + 4 * self.joints, 0.0);
        for joint in 0..self.joints {
            for (power, coefficient) in coefficients(joint).into_iter().enumerate() {
                self.coefficients[base + power * self.joints + joint] = coefficient;
            }
        }
    }

    /// Ends the last segment.
    pub(super) fn finish(mut self, end_s: f64) -> Self {
        self.times.push(end_s);
        self
    }

    pub(super) const fn degree(&self) -> Degree {
        self.degree
    }

    pub(super) const fn joints(&self) -> usize {
        self.joints
    }

    pub(super) const fn segments(&self) -> usize {
        self.times.len().saturating_sub(1)
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.times.last().copied().unwrap_or_default()
    }

    /// Where a segment begins and how long it is \[s\].
    pub(super) fn span(&self, segment: usize) -> (f64, f64) {
        let start = self.times[segment];
        (start, self.times[segment + 1] - start)
    }

    pub(super) fn waypoint(&self, segment: usize) -> usize {
        self.waypoints.get(segment).map_or(segment, |&waypoint| waypoint as usize)
    }

    /// One joint on one segment. `N` must be the number of coefficients that the degree has.
    pub(super) fn piece<const N: usize>(&self, segment: usize, joint: usize) -> Piece<N> {
        let rows = self.rows(segment);
        let coefficients = std::array::from_fn(|power| rows[power * self.joints + joint]);
        Piece { length: self.span(segment).1, coefficients }
    }

    /// The place of `t_s`, which lies between zero and the duration. `hint` is where the last one
    /// was found.
    pub(super) fn locate(&self, t_s: f64, hint: &mut usize) -> Place {
        let segment = self.segment_at(t_s, *hint);
        *hint = segment;
        Place { segment, u: t_s - self.times[segment] }
    }

    fn segment_at(&self, t_s: f64, hint: usize) -> usize {
        let near = self.times.get(hint..).filter(|times| times.first().is_some_and(|&t| t <= t_s));
        if let Some(times) = near {
            let ahead = times.iter().take(LOOK_AHEAD + 1).take_while(|&&t| t <= t_s).count();
            if ahead <= LOOK_AHEAD {
                return hint + ahead - 1;
            }
        }
        self.times.partition_point(|&t| t <= t_s).saturating_sub(1)
    }

    /// Writes position and velocity, of which there must be one per joint.
    pub(super) fn motion(&self, place: Place, position: &mut [f64], velocity: &mut [f64]) {
        let (rows, joints, u) = (self.rows(place.segment), self.joints, place.u);
        let both = position.iter_mut().zip(velocity).enumerate();
        match self.degree {
            Degree::Three => {
                let [c0, c1, c2, c3] = split(rows, joints);
                for (joint, (x, v)) in both {
                    *x = c0[joint] + u * (c1[joint] + u * (c2[joint] + u * c3[joint]));
                    *v = c1[joint] + u * (2.0 * c2[joint] + u * 3.0 * c3[joint]);
                }
            }
            Degree::Five => {
                let [c0, c1, c2, c3, c4, c5] = split(rows, joints);
                for (joint, (x, v)) in both {
                    let (high3, high4) = (c3[joint], c4[joint] + u * c5[joint]);
                    *x = c0[joint] + u * (c1[joint] + u * (c2[joint] + u * (high3 + u * high4)));
                    let slope4 = 4.0 * c4[joint] + u * 5.0 * c5[joint];
                    *v = c1[joint] + u * (2.0 * c2[joint] + u * (3.0 * high3 + u * slope4));
                }
            }
        }
    }

    /// Acceleration of each joint.
    pub(super) fn acceleration(&self, place: Place, like: JointVector) -> JointVector {
        let (rows, joints, u) = (self.rows(place.segment), self.joints, place.u);
        match self.degree {
            Degree::Three => {
                let [_, _, c2, c3] = split(rows, joints);
                like.map_indexed(|joint, _| 2.0 * c2[joint] + u * 6.0 * c3[joint])
            }
            Degree::Five => {
                let [_, _, c2, c3, c4, c5] = split(rows, joints);
                like.map_indexed(|joint, _| {
                    let high = 12.0 * c4[joint] + u * 20.0 * c5[joint];
                    2.0 * c2[joint] + u * (6.0 * c3[joint] + u * high)
                })
            }
        }
    }

    /// Jerk of each joint.
    pub(super) fn jerk(&self, place: Place, like: JointVector) -> JointVector {
        let (rows, joints, u) = (self.rows(place.segment), self.joints, place.u);
        match self.degree {
            Degree::Three => {
                let [_, _, _, c3] = split(rows, joints);
                like.map_indexed(|joint, _| 6.0 * c3[joint])
            }
            Degree::Five => {
                let [_, _, _, c3, c4, c5] = split(rows, joints);
                like.map_indexed(|joint, _| {
                    6.0 * c3[joint] + u * (24.0 * c4[joint] + u * 60.0 * c5[joint])
                })
            }
        }
    }

    /// First to fifth derivative of one joint.
    pub(super) fn derivatives(&self, place: Place, joint: usize) -> [f64; 5] {
        let (rows, u) = (self.rows(place.segment), place.u);
        let c = |power: usize| rows[power * self.joints + joint];
        match self.degree {
            Degree::Three => {
                let (c2, c3) = (c(2), c(3));
                let second = 2.0 * c2 + u * 6.0 * c3;
                [c(1) + 0.5 * u * (2.0 * c2 + second), second, 6.0 * c3, 0.0, 0.0]
            }
            Degree::Five => {
                let (c3, c4, c5) = (c(3), c(4), c(5));
                let fourth = 24.0 * c4 + u * 120.0 * c5;
                let third = 6.0 * c3 + u * (24.0 * c4 + u * 60.0 * c5);
                let second = 2.0 * c(2) + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5));
                let high = 3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5);
                [c(1) + u * (2.0 * c(2) + u * high), second, third, fourth, 120.0 * c5]
            }
        }
    }

    fn rows(&self, segment: usize) -> &[f64] {
        let size = self.degree.rows() * self.joints;
        &self.coefficients[size * segment..][..size]
    }
}

fn split<const N: usize>(rows: &[f64], joints: usize) -> [&[f64]; N] {
    std::array::from_fn(|power| &rows[power * joints..][..joints])
}
