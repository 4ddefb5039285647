//! One move of a path: a line or an arc, turning at a constant rate.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::error::CartesianPathError as Error;
use super::moves::{ArcOrientation, CartesianSegment};
use super::path::MIN_PATH_LENGTH;
use super::rotation::shortest;
use crate::Pose;

/// Three points count as on one line if the sine of their angle is below this.
const MIN_SINE: f64 = 1e-6;

/// A line or an arc, run along with constant velocity and angular velocity.
///
/// Parameter is the path's measure `s` \[m\] from 0 to `length`, in which the whole motion has the
/// speed one: `|v|² + (w |ω|)² = 1` for the rotation weight `w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) length: f64,
    curve: Curve,
    from: UnitQuaternion<f64>,
    /// Rotation per length, in the moving frame and, since it turns about it, in the start's.
    turn: Vector3<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Curve {
    Line {
        from: Vector3<f64>,
        /// Velocity; zero for a pure rotation.
        along: Vector3<f64>,
    },
    Arc {
        center: Vector3<f64>,
        /// From the centre to the start.
        radial: Vector3<f64>,
        /// As long as `radial`, ahead at the start.
        ahead: Vector3<f64>,
        /// Angle per length.
        rate: f64,
    },
}

/// Position or its derivatives with respect to `s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PointMotion {
    pub(super) position: Vector3<f64>,
    pub(super) first: Vector3<f64>,
    pub(super) second: Vector3<f64>,
}

/// A circle: centre, vector to the start, and as long as that the direction ahead.
struct Circle {
    center: Vector3<f64>,
    radial: Vector3<f64>,
    ahead: Vector3<f64>,
}

impl Segment {
    /// The move number `index` from `from`.
    pub(super) fn new(
        index: usize,
        from: &Pose,
        segment: &CartesianSegment,
        weight: f64,
    ) -> Result<Self, Error> {
        check_pose(index, "start pose", from)?;
        match segment {
            CartesianSegment::Line { to } => Self::line(index, from, to, weight),
            CartesianSegment::Arc { via, to } => {
                check_pose(index, "end pose", to)?;
                check_vector(index, "via", via)?;
                let (circle, angle) = through(index, [from.position(), via, to.position()])?;
                let turn = shortest_turn(index, from, to)?;
                Self::arc(index, (from, circle), (angle, turn), weight)
            }
            CartesianSegment::Turn { center, normal, angle, orientation } => {
                check_vector(index, "center", center)?;
                check_vector(index, "normal", normal)?;
                if !angle.is_finite() {
                    return Err(Error::NotFinite { index, field: "angle" });
                }
                let (circle, normal) = about(index, from.position(), (center, normal))?;
                let turn = match orientation {
                    ArcOrientation::Fixed => Vector3::zeros(),
                    ArcOrientation::WithArc => from.isometry().rotation.inverse() * normal * *angle,
                    ArcOrientation::To(to) => {
                        let to = Isometry3::from_parts(Translation3::identity(), *to);
                        let to = Pose::from_isometry(to);
                        check_pose(index, "orientation", &to)?;
                        shortest_turn(index, from, &to)?
                    }
                };
                Self::arc(index, (from, circle), (*angle, turn), weight)
            }
        }
    }

    fn line(index: usize, from: &Pose, to: &Pose, weight: f64) -> Result<Self, Error> {
        check_pose(index, "end pose", to)?;
        let shift = to.position() - from.position();
        let turn = shortest_turn(index, from, to)?;
        let length = length(index, shift.norm(), turn.norm() * weight)?;
        let curve = Curve::Line { from: *from.position(), along: shift / length };
        Ok(Self { length, curve, from: from.isometry().rotation, turn: turn / length })
    }

    fn arc(
        index: usize,
        (from, circle): (&Pose, Circle),
        (angle, turn): (f64, Vector3<f64>),
        weight: f64,
    ) -> Result<Self, Error> {
        let Circle { center, radial, ahead } = circle;
        let length = length(index, radial.norm() * angle, turn.norm() * weight)?;
        let curve = Curve::Arc { center, radial, ahead, rate: angle / length };
        Ok(Self { length, curve, from: from.isometry().rotation, turn: turn / length })
    }

    pub(super) fn rotation(&self, s: f64) -> UnitQuaternion<f64> {
        self.from * UnitQuaternion::from_scaled_axis(self.turn * s)
    }

    /// Rotation per length in the moving frame.
    pub(super) const fn turn(&self) -> &Vector3<f64> {
        &self.turn
    }

    pub(super) fn position(&self, s: f64) -> Vector3<f64> {
        match self.curve {
            Curve::Line { from, along } => from + along * s,
            Curve::Arc { center, radial, ahead, rate } => {
                let (sin, cos) = (rate * s).sin_cos();
                center + radial * cos + ahead * sin
            }
        }
    }

    pub(super) fn point(&self, s: f64) -> PointMotion {
        match self.curve {
            Curve::Line { from, along } => {
                PointMotion { position: from + along * s, first: along, second: Vector3::zeros() }
            }
            Curve::Arc { center, radial, ahead, rate } => {
                let (sin, cos) = (rate * s).sin_cos();
                let outward = radial * cos + ahead * sin;
                PointMotion {
                    position: center + outward,
                    first: (ahead * cos - radial * sin) * rate,
                    second: outward * (-rate * rate),
                }
            }
        }
    }
}

/// The circle from the first over the second to the third point, and the angle to the third.
fn through(index: usize, points: [&Vector3<f64>; 3]) -> Result<(Circle, f64), Error> {
    let [from, via, to] = points;
    for (a, b) in [(from, via), (via, to), (from, to)] {
        let distance = (b - a).norm();
        if distance < MIN_PATH_LENGTH {
            return Err(Error::Coincident { index, distance });
        }
    }
    let (a, b) = (via - from, to - from);
    let normal = a.cross(&b);
    let square = normal.norm_squared();
    let sine = square.sqrt() / (a.norm() * b.norm());
    if sine < MIN_SINE {
        return Err(Error::Collinear { index, sine });
    }
    // Source: circumcentre of a triangle in space, from one corner.
    let to_center = (b.norm_squared() * normal.cross(&a) - a.norm_squared() * normal.cross(&b))
        / (2.0 * square);
    let (radial, normal) = (-to_center, normal / square.sqrt());
    let ahead = normal.cross(&radial);
    let end = to - from - to_center;
    // The via point lies ahead, for the normal is by its side: count the angle upward from zero.
    let angle = end.dot(&ahead).atan2(end.dot(&radial)).rem_euclid(std::f64::consts::TAU);
    Ok((Circle { center: from + to_center, radial, ahead }, angle))
}

/// The circle of `from` about an axis, and the axis as a unit vector.
fn about(
    index: usize,
    from: &Vector3<f64>,
    (point, axis): (&Vector3<f64>, &Vector3<f64>),
) -> Result<(Circle, Vector3<f64>), Error> {
    let value = axis.norm();
    if value < MIN_PATH_LENGTH {
        return Err(Error::NoCircle { index, field: "length of normal", value });
    }
    let normal = axis / value;
    let offset = from - point;
    let radial = offset - normal * normal.dot(&offset);
    let radius = radial.norm();
    if radius < MIN_PATH_LENGTH {
        return Err(Error::NoCircle { index, field: "radius", value: radius });
    }
    Ok((Circle { center: from - radial, radial, ahead: normal.cross(&radial) }, normal))
}

fn shortest_turn(index: usize, from: &Pose, to: &Pose) -> Result<Vector3<f64>, Error> {
    shortest(&from.isometry().rotation, &to.isometry().rotation)
        .map_err(|angle| Error::HalfTurn { index, angle })
}

/// Length of a move in the path's measure.
fn length(index: usize, distance: f64, weighted_angle: f64) -> Result<f64, Error> {
    let length = distance.hypot(weighted_angle);
    if !length.is_finite() {
        Err(Error::NotFinite { index, field: "length" })
    } else if length < MIN_PATH_LENGTH {
        Err(Error::TooShort { index, length })
    } else {
        Ok(length)
    }
}

fn check_pose(index: usize, field: &'static str, pose: &Pose) -> Result<(), Error> {
    check_vector(index, field, pose.position())?;
    if pose.isometry().rotation.coords.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(Error::NotFinite { index, field })
    }
}

fn check_vector(index: usize, field: &'static str, vector: &Vector3<f64>) -> Result<(), Error> {
    if vector.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(Error::NotFinite { index, field })
    }
}
