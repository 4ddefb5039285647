//! Straight moves in joint space, joined by blends.

use super::error::BlendError as Error;
use crate::{GeometricPath, PathRows};

/// Least radius of a blend in the mixed unit of the coordinates \[rad or m\]; below it a corner
/// is a stop.
pub const MIN_BLEND_RADIUS: f64 = 1e-6;

/// How far the middle of a blend is from its corner, per radius and change of direction.
const DEVIATION: f64 = 3.0 / 16.0;

/// How the corner at a waypoint is passed.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum JointCorner {
    /// The waypoint is reached, at rest.
    #[default]
    Stop,
    /// Its moves are left and reached this far from it, in the norm of the coordinates \[rad or m\];
    /// zero is a stop.
    Radius(f64),
    /// No coordinate comes further from the two moves than its value here \[rad or m\]. Where that
    /// leaves no room, the corner is a stop.
    Tolerance(Vec<f64>),
}

/// Straight moves in joint space, their corners rounded off: no stop between start and end.
///
/// Its parameter is the length of the moves before their corners are rounded off, in the Euclidean
/// norm of the coordinates \[rad or m, mixed\], from zero. From `r` before a corner to `r` after it
/// the direction changes from the unit vector `t` of one move to `t'` of the next by
/// `t + (t' - t) (3 x² - 2 x³)`, `x` from 0 to 1: position is of fourth degree, the least that has
/// the values and first two derivatives of the moves at both ends. At equal parameter it is at most
/// `3/16 r |t' - t|` from the moves, reached at the corner.
///
/// Made by [`blended_legs`]. Evaluating it allocates nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct BlendedPath {
    coordinates: usize,
    /// One row per waypoint.
    points: Vec<f64>,
    /// One row per move: its unit vector.
    directions: Vec<f64>,
    /// Path parameter of each waypoint.
    lengths: Vec<f64>,
    /// Of each waypoint; zero for the first and the last.
    radii: Vec<f64>,
}

/// A corner that a [`BlendedPath`] rounds off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlendedCorner {
    /// Where the corner would be along the path \[rad or m\].
    pub s: f64,
    /// How far before and after it the moves are left and reached \[rad or m\]; may be less than
    /// asked for.
    pub radius: f64,
    /// Largest distance to the moves, in the norm of the coordinates \[rad or m\].
    pub deviation: f64,
}

/// The way of a path at one parameter: a move, or a blend between two.
struct Place<'p> {
    /// Waypoint that the position is counted from.
    origin: &'p [f64],
    /// Unit vectors of this move or of the move before the corner, and of the one after it.
    directions: [&'p [f64]; 2],
    /// Parameter from the waypoint on.
    offset: f64,
    /// Weight of the change of direction in position and its derivatives.
    weights: [f64; 4],
}

/// Joins `waypoints` by straight moves, whose `corners` (one per waypoint but the first and last)
/// are rounded off as far as asked for. Every stop ends a leg and begins another: each is one path,
/// to be run along from rest to rest.
///
/// A radius is reduced to half of the shorter move beside its corner.
/// [`BlendedPath::corners`] tells what it became.
///
/// ```
/// use armada_model::{JointCorner, blended_legs};
///
/// let waypoints = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
/// let legs = blended_legs(&waypoints, &[JointCorner::Radius(0.2), JointCorner::Stop])?;
/// assert_eq!(legs.len(), 2);
/// assert!((legs[0].corners()[0].deviation - 0.0375 * 2.0_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), armada_model::BlendError>(())
/// ```
///
/// # Errors
/// A [`BlendError`](Error): fewer than two waypoints, rows or corners of wrong number or length,
/// values that are not finite, equal neighbours, radii and tolerances that are none.
pub fn blended_legs(
    waypoints: &[impl AsRef<[f64]>],
    corners: &[JointCorner],
) -> Result<Vec<BlendedPath>, Error> {
    let whole = BlendedPath::sharp(waypoints)?;
    let expected = waypoints.len() - 2;
    if corners.len() != expected {
        return Err(Error::CornerCount { corners: corners.len(), expected });
    }
    let mut radii = vec![0.0];
    for (index, corner) in corners.iter().enumerate() {
        radii.push(whole.radius(index + 1, corner)?);
    }
    radii.push(0.0);
    let inner = 1..radii.len() - 1;
    let stops: Vec<usize> = inner.filter(|&waypoint| radii[waypoint] == 0.0).collect();
    let ends = stops.iter().copied().chain([radii.len() - 1]);
    let starts = [0].into_iter().chain(stops.iter().copied());
    Ok(starts.zip(ends).map(|(from, to)| whole.part(from, to, &radii)).collect())
}

impl BlendedPath {
    /// The moves between `waypoints`, with no corner rounded off.
    pub(super) fn sharp(waypoints: &[impl AsRef<[f64]>]) -> Result<Self, Error> {
        let n = match waypoints.first() {
            Some(first) if waypoints.len() > 1 => first.as_ref().len(),
            _ => return Err(Error::TooFewWaypoints { count: waypoints.len() }),
        };
        if n == 0 {
            return Err(Error::NoCoordinates);
        }
        let mut path = Self {
            coordinates: n,
            points: Vec::with_capacity(n * waypoints.len()),
            directions: Vec::with_capacity(n * waypoints.len()),
            lengths: vec![0.0],
            radii: vec![0.0; waypoints.len()],
        };
        for (waypoint, row) in waypoints.iter().map(AsRef::as_ref).enumerate() {
            check_row(waypoint, row, n)?;
            if waypoint > 0 {
                path.push_move(waypoint, row)?;
            }
            path.points.extend_from_slice(row);
        }
        Ok(path)
    }

    /// Adds the direction and length of the move from the last point to `row`.
    fn push_move(&mut self, waypoint: usize, row: &[f64]) -> Result<(), Error> {
        let from = &self.points[(waypoint - 1) * self.coordinates..];
        let shift: Vec<f64> = from.iter().zip(row).map(|(from, to)| to - from).collect();
        let length = norm(&shift);
        if let Some(coordinate) = shift.iter().position(|_| !length.is_finite()) {
            return Err(Error::NotFinite { waypoint, coordinate, value: row[coordinate] });
        }
        if length < MIN_BLEND_RADIUS {
            return Err(Error::Repeated { waypoint });
        }
        self.directions.extend(shift.iter().map(|value| value / length));
        self.lengths.push(self.length() + length);
        Ok(())
    }

    /// The radius at an inner waypoint; zero for a stop.
    fn radius(&self, waypoint: usize, corner: &JointCorner) -> Result<f64, Error> {
        let wanted = match corner {
            JointCorner::Stop => 0.0,
            &JointCorner::Radius(value) => {
                let legal = value == 0.0 || (value.is_finite() && value >= MIN_BLEND_RADIUS);
                if !legal {
                    return Err(Error::Radius { waypoint, value });
                }
                value
            }
            JointCorner::Tolerance(tolerance) => self.radius_within(waypoint, tolerance)?,
        };
        let ends = [waypoint - 1, waypoint, waypoint + 1].map(|index| self.lengths[index]);
        let radius = wanted.min(0.5 * (ends[1] - ends[0])).min(0.5 * (ends[2] - ends[1]));
        Ok(if radius < MIN_BLEND_RADIUS { 0.0 } else { radius })
    }

    /// The largest radius that keeps every coordinate within its tolerance.
    fn radius_within(&self, waypoint: usize, tolerance: &[f64]) -> Result<f64, Error> {
        let (len, expected) = (tolerance.len(), self.coordinates);
        if len != expected {
            return Err(Error::RowLength { waypoint, field: "tolerance", len, expected });
        }
        if let Some(coordinate) = tolerance.iter().position(|value| value.is_nan() || *value < 0.0)
        {
            return Err(Error::Tolerance { waypoint, coordinate, value: tolerance[coordinate] });
        }
        let (before, after) = (self.direction(waypoint - 1), self.direction(waypoint));
        let changes = before.iter().zip(after).map(|(before, after)| (after - before).abs());
        let radii = changes.zip(tolerance).map(|(change, tolerance)| {
            if change > 0.0 { tolerance / (DEVIATION * change) } else { f64::INFINITY }
        });
        Ok(radii.fold(f64::INFINITY, f64::min))
    }

    /// From one waypoint to another, with radii for all waypoints of `self`.
    fn part(&self, from: usize, to: usize, radii: &[f64]) -> Self {
        let n = self.coordinates;
        let mut radii = radii[from..=to].to_vec();
        radii[0] = 0.0;
        radii[to - from] = 0.0;
        Self {
            coordinates: n,
            points: self.points[n * from..n * (to + 1)].to_vec(),
            directions: self.directions[n * from..n * to].to_vec(),
            lengths: self.lengths[from..=to].iter().map(|s| s - self.lengths[from]).collect(),
            radii,
        }
    }

    /// Length of the moves before their corners are rounded off \[rad or m\].
    #[must_use]
    pub fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or_default()
    }

    /// What became of each corner, in order.
    #[must_use]
    pub fn corners(&self) -> Vec<BlendedCorner> {
        let inner = 1..self.lengths.len() - 1;
        let corner = |waypoint: usize| {
            let (before, after) = (self.direction(waypoint - 1), self.direction(waypoint));
            let change: Vec<f64> = before.iter().zip(after).map(|(a, b)| b - a).collect();
            let radius = self.radii[waypoint];
            let deviation = DEVIATION * radius * norm(&change);
            BlendedCorner { s: self.lengths[waypoint], radius, deviation }
        };
        inner.map(corner).collect()
    }

    /// Waypoints in which each corner is replaced by points of its blend, so close that the straight
    /// lines between them stay within `tolerance` \[rad or m\] of the path; for receivers that know
    /// straight lines only. A tolerance below 1e-9 counts as that.
    #[must_use]
    pub fn waypoints(&self, tolerance: f64) -> Vec<Vec<f64>> {
        let mut rows = vec![self.row(0.0)];
        for corner in self.corners() {
            // A chord of the parabola that bends most is e = |q''| d² / 8 from it.
            let bend = 4.0 * corner.deviation / (corner.radius * corner.radius);
            let chord = (8.0 * tolerance.max(1e-9) / bend).sqrt();
            let chords = (2.0 * corner.radius / chord).ceil().clamp(1.0, 1e6);
            let mut chord = 0.0;
            while chord <= chords {
                let s = corner.s + corner.radius * (2.0 * chord / chords - 1.0);
                if s > 0.0 && s < self.length() {
                    rows.push(self.row(s));
                }
                chord += 1.0;
            }
        }
        rows.push(self.row(self.length()));
        // Where two blends touch, one ends at the point that the other begins at.
        rows.dedup_by(|later, earlier| {
            let shift: Vec<f64> = later.iter().zip(&*earlier).map(|(a, b)| a - b).collect();
            norm(&shift) < 1e-9
        });
        rows
    }

    fn row(&self, s: f64) -> Vec<f64> {
        let place = self.place(s);
        (0..self.coordinates).map(|coordinate| place.derivatives(coordinate)[0]).collect()
    }

    fn direction(&self, index: usize) -> &[f64] {
        &self.directions[self.coordinates * index..][..self.coordinates]
    }

    /// What holds at `s`, which is held inside the path; not a number is its start.
    fn place(&self, s: f64) -> Place<'_> {
        let s = s.max(0.0).min(self.length());
        let inner = &self.lengths[1..self.lengths.len() - 1];
        let index = inner.partition_point(|&end| end <= s);
        let (start, end) = (self.lengths[index], self.lengths[index + 1]);
        if s - start < self.radii[index] {
            self.corner_place(index, s - start)
        } else if end - s < self.radii[index + 1] {
            self.corner_place(index + 1, s - end)
        } else {
            let direction = self.direction(index);
            let directions = [direction; 2];
            Place { origin: self.point(index), directions, offset: s - start, weights: [0.0; 4] }
        }
    }

    /// In the blend at a waypoint, `offset` from it.
    fn corner_place(&self, waypoint: usize, offset: f64) -> Place<'_> {
        let span = 2.0 * self.radii[waypoint];
        let x = offset / span + 0.5;
        Place {
            origin: self.point(waypoint),
            directions: [self.direction(waypoint - 1), self.direction(waypoint)],
            offset,
            weights: [
                span * x * x * x * (1.0 - 0.5 * x),
                x * x * (3.0 - 2.0 * x),
                6.0 * x * (1.0 - x) / span,
                6.0 * (1.0 - 2.0 * x) / (span * span),
            ],
        }
    }

    fn point(&self, waypoint: usize) -> &[f64] {
        &self.points[self.coordinates * waypoint..][..self.coordinates]
    }
}

impl GeometricPath for BlendedPath {
    fn coordinates(&self) -> usize {
        self.coordinates
    }

    fn range(&self) -> (f64, f64) {
        (0.0, self.length())
    }

    fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
        let place = self.place(s);
        let rows = out.position.iter_mut().zip(&mut *out.first).zip(&mut *out.second);
        for (coordinate, ((position, first), second)) in rows.take(self.coordinates).enumerate() {
            [*position, *first, *second, _] = place.derivatives(coordinate);
        }
    }

    fn add_breakpoints(&self, out: &mut Vec<f64>) {
        for corner in self.corners() {
            out.extend([corner.s - corner.radius, corner.s + corner.radius]);
        }
    }

    fn third_derivative(&self, s: f64, out: &mut [f64]) {
        let place = self.place(s);
        for (coordinate, third) in out.iter_mut().take(self.coordinates).enumerate() {
            [_, _, _, *third] = place.derivatives(coordinate);
        }
    }
}

impl Place<'_> {
    /// Position and its first three derivatives of one coordinate.
    #[inline]
    fn derivatives(&self, coordinate: usize) -> [f64; 4] {
        let [before, after] = self.directions.map(|direction| direction[coordinate]);
        let change = after - before;
        let [w0, w1, w2, w3] = self.weights;
        let position = self.origin[coordinate] + before * self.offset + change * w0;
        [position, before + change * w1, change * w2, change * w3]
    }
}

fn check_row(waypoint: usize, row: &[f64], expected: usize) -> Result<(), Error> {
    if row.len() != expected {
        return Err(Error::RowLength { waypoint, field: "position", len: row.len(), expected });
    }
    match row.iter().position(|value| !value.is_finite()) {
        Some(coordinate) => Err(Error::NotFinite { waypoint, coordinate, value: row[coordinate] }),
        None => Ok(()),
    }
}

fn norm(row: &[f64]) -> f64 {
    row.iter().map(|value| value * value).sum::<f64>().sqrt()
}
