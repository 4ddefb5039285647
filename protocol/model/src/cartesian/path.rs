//! A sequence of moves as one curve.

use nalgebra::{Isometry3, Vector3};

use super::blend::Blend;
use super::error::CartesianPathError as Error;
use super::moves::CartesianMove;
use super::segment::Segment;
use crate::{Pose, Twist};

/// Least length of a move in the path's measure, and least radius of an arc or blend \[m\].
pub const MIN_PATH_LENGTH: f64 = 1e-6;

/// How near to half a turn two orientations may not be \[rad\]: there the shortest way between them
/// would be chosen by rounding.
pub const MIN_TURN_MARGIN: f64 = 1e-6;

/// How much velocity \[m/m\] and acceleration (times length, \[m/m\]) of two moves may differ where
/// one goes on as the other.
const SMOOTH_TOLERANCE: f64 = 1e-9;

/// Weight of rotation if none is given \[m/rad\]: one radian counts as 0.1 m.
pub const DEFAULT_ROTATION_WEIGHT: f64 = 0.1;

/// A curve of poses: lines and arcs, their corners rounded off where asked for.
///
/// Its parameter is `s` \[m\], the length of the moves before their corners are rounded off, from
/// 0 to [`length`](Self::length). The length of a move is `hypot(d, w a)` for the distance `d` \[m\]
/// along it, the angle `a` \[rad\] it turns by and the rotation weight `w` \[m/rad\], so a pure
/// rotation has length too. Along a move position and orientation change at a constant rate:
/// `|v|² + (w |ω|)² = 1`; the orientation goes by the shortest quaternion arc.
///
/// A corner with a blend radius `r` is left at `s - r` and reached again at `s + r`; between them
/// both position and orientation follow polynomials of fifth degree with the values and first and
/// second derivatives of the moves at both ends. So between two [`stops`](Self::stops) pose,
/// velocity and acceleration with respect to `s` are continuous, and a motion along it has bounded
/// acceleration without stopping. `r` is reduced to half the length of the shorter move beside the
/// corner; [`corners`](Self::corners) says what became of each. A corner between straight lines at
/// an angle `φ` is missed by `3/8 r sin(φ/2)`.
///
/// Poses are those of a tool in some frame B: `X_BT`. Evaluating it allocates nothing.
///
/// ```
/// use armada_model::{CartesianMove, CartesianPath, DEFAULT_ROTATION_WEIGHT, Pose};
///
/// let [a, b, c] = [(0.4, 0.0), (0.6, 0.0), (0.6, 0.2)].map(|(x, y)| Pose::from_translation(x, y, 0.3));
/// let moves = [CartesianMove::line(b).blended(0.05), CartesianMove::line(c)];
/// let path = CartesianPath::new(&a, &moves, DEFAULT_ROTATION_WEIGHT)?;
/// assert!((path.length() - 0.4).abs() < 1e-12);
/// let missed_by = path.pose_at(0.2).distance(&b).0;
/// assert!((missed_by - 0.375 * 0.05 * 0.5_f64.sqrt()).abs() < 1e-12);
/// # Ok::<(), armada_model::CartesianPathError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CartesianPath {
    /// Where each piece begins.
    starts: Vec<f64>,
    pieces: Vec<Piece>,
    corners: Vec<Corner>,
    length: f64,
}

/// What became of a corner between two moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Where the corner would be \[m along the path\].
    pub s: f64,
    /// How it is passed.
    pub passing: CornerPassing,
}

/// How a corner is passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CornerPassing {
    /// It is reached, and there must be a stop.
    Stop,
    /// It is reached without a stop: the next move goes on as the one before.
    Smooth,
    /// It is rounded off.
    Blend {
        /// How far before and after the corner the moves are left and reached \[m\]; may be less
        /// than asked for.
        radius: f64,
        /// Largest distance to the moves at equal `s` \[m\].
        position_deviation: f64,
        /// Largest angle to the orientation of the moves at equal `s` \[rad\].
        angle_deviation: f64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Piece {
    /// A segment, and how much of it a blend has replaced before it begins.
    Segment(Segment, f64),
    Blend(Blend),
}

impl CartesianPath {
    /// The path from `start` by `moves`, with the weight of rotation `rotation_weight` \[m/rad\].
    ///
    /// # Errors
    /// A [`CartesianPathError`](Error): there is no move, something is not finite or goes nowhere,
    /// an arc has no circle, orientations are half a turn apart, or a blend radius is no radius.
    pub fn new(start: &Pose, moves: &[CartesianMove], rotation_weight: f64) -> Result<Self, Error> {
        if moves.is_empty() {
            return Err(Error::Empty);
        }
        if !(rotation_weight.is_finite() && rotation_weight > 0.0) {
            return Err(Error::RotationWeight { value: rotation_weight });
        }
        let mut segments = Vec::with_capacity(moves.len());
        let mut from = *start;
        for (index, step) in moves.iter().enumerate() {
            check_radius(index, step.blend_radius, index + 1 == moves.len())?;
            let segment = Segment::new(index, &from, &step.segment, rotation_weight)?;
            from = end_of(&segment);
            segments.push(segment);
        }
        Ok(Self::of(&segments, moves))
    }

    /// The straight path between two poses, with [`DEFAULT_ROTATION_WEIGHT`].
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn line(from: &Pose, to: &Pose) -> Result<Self, Error> {
        Self::new(from, &[CartesianMove::line(*to)], DEFAULT_ROTATION_WEIGHT)
    }

    /// The path on the circle through three points, with [`DEFAULT_ROTATION_WEIGHT`].
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn arc(from: &Pose, via: &Vector3<f64>, to: &Pose) -> Result<Self, Error> {
        Self::new(from, &[CartesianMove::arc(*via, *to)], DEFAULT_ROTATION_WEIGHT)
    }

    /// Length in the path's measure \[m\].
    #[must_use]
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// The corners between the moves, in their order.
    #[must_use]
    pub fn corners(&self) -> &[Corner] {
        &self.corners
    }

    /// Where a motion along the path must stop before its end \[m\], in order.
    pub fn stops(&self) -> impl Iterator<Item = f64> {
        let stops = self.corners.iter().filter(|corner| corner.passing == CornerPassing::Stop);
        stops.map(|corner| corner.s)
    }

    /// The pose at `s`, which is held inside the path; not a number is its start.
    #[must_use]
    pub fn pose_at(&self, s: f64) -> Pose {
        let Some((piece, u)) = self.piece_at(s) else {
            return Pose::default();
        };
        Pose::from_isometry(match piece {
            Piece::Segment(segment, skipped) => {
                let s = u + skipped;
                Isometry3::from_parts(segment.position(s).into(), segment.rotation(s))
            }
            Piece::Blend(blend) => blend.pose(u),
        })
    }

    /// Rates of the pose with respect to `s`, which is held inside the path, in the frame of the
    /// path: the tool's twist when the path is run along at `ds/dt` = 1 m/s. At a stop it is that of
    /// the move that begins there.
    ///
    /// On a move its measure is one, `|v|² + (w |ω|)² = 1`. In a blend of straight moves it is at
    /// most that, down to zero where the path turns back on itself; arcs may add some percent.
    #[must_use]
    pub fn tangent_at(&self, s: f64) -> Twist {
        match self.piece_at(s) {
            None => Twist::ZERO,
            Some((Piece::Segment(segment, skipped), u)) => Twist::new(
                segment.point(u + skipped).first,
                segment.rotation(u + skipped) * segment.turn(),
            ),
            Some((Piece::Blend(blend), u)) => Twist::new(blend.point(u).first, blend.angular(u)),
        }
    }

    /// Curvature of the tool's way at `s` \[1/m\], one over the radius: zero on a line, and where
    /// the tool only turns.
    #[must_use]
    pub fn curvature_at(&self, s: f64) -> f64 {
        let point = match self.piece_at(s) {
            None => return 0.0,
            Some((Piece::Segment(segment, skipped), u)) => segment.point(u + skipped),
            Some((Piece::Blend(blend), u)) => blend.point(u),
        };
        let speed = point.first.norm();
        if speed > 0.0 { point.first.cross(&point.second).norm() / speed.powi(3) } else { 0.0 }
    }

    /// Joins segments by what their moves say.
    fn of(segments: &[Segment], moves: &[CartesianMove]) -> Self {
        let mut path =
            Self { starts: Vec::new(), pieces: Vec::new(), corners: Vec::new(), length: 0.0 };
        let mut skipped = 0.0;
        for (index, (segment, step)) in segments.iter().zip(moves).enumerate() {
            path.push(path.length + skipped, Piece::Segment(*segment, skipped));
            path.length += segment.length;
            skipped = 0.0;
            if let Some(next) = segments.get(index + 1) {
                let passing = if smooth(segment, next) {
                    CornerPassing::Smooth
                } else if step.blend_radius > 0.0 {
                    let shorter = segment.length.min(next.length);
                    let blend = Blend::new(segment, next, step.blend_radius.min(0.5 * shorter));
                    skipped = blend.radius;
                    path.push(path.length - skipped, Piece::Blend(blend));
                    passing(&blend, segment, next)
                } else {
                    CornerPassing::Stop
                };
                path.corners.push(Corner { s: path.length, passing });
            }
        }
        path
    }

    fn push(&mut self, start: f64, piece: Piece) {
        self.starts.push(start);
        self.pieces.push(piece);
    }

    /// The piece at `s`, and how far into it.
    fn piece_at(&self, s: f64) -> Option<(&Piece, f64)> {
        // Not a number becomes zero here.
        let s = s.max(0.0).min(self.length);
        let index = self.starts.partition_point(|&start| start <= s).saturating_sub(1);
        Some((self.pieces.get(index)?, s - self.starts.get(index)?))
    }
}

fn check_radius(index: usize, value: f64, last: bool) -> Result<(), Error> {
    if value == 0.0 {
        Ok(())
    } else if last {
        Err(Error::BlendAtEnd { index, value })
    } else if value.is_finite() && value >= MIN_PATH_LENGTH {
        Ok(())
    } else {
        Err(Error::BlendRadius { index, value })
    }
}

fn end_of(segment: &Segment) -> Pose {
    let s = segment.length;
    Pose::from_isometry(Isometry3::from_parts(segment.position(s).into(), segment.rotation(s)))
}

fn passing(blend: &Blend, before: &Segment, after: &Segment) -> CornerPassing {
    let deviation = blend.deviation(before, after);
    CornerPassing::Blend {
        radius: blend.radius,
        position_deviation: deviation.position,
        angle_deviation: deviation.angle,
    }
}

/// Whether `after` goes on as `before`, to the second derivative.
fn smooth(before: &Segment, after: &Segment) -> bool {
    let (end, start) = (before.point(before.length), after.point(0.0));
    let scale = before.length.min(after.length);
    (end.first - start.first).norm() < SMOOTH_TOLERANCE
        && (end.second - start.second).norm() * scale < SMOOTH_TOLERANCE
        && (before.turn() - after.turn()).norm() * scale < SMOOTH_TOLERANCE
}
