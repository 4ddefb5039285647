//! Cubic splines through waypoints as paths.

use super::geometric::{GeometricPath, PathError, PathRows};

/// How a spline begins and ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SplineEnds {
    /// The first two pieces are one polynomial and so are the last two: no bend is added that the
    /// waypoints do not show. Two waypoints give a line, three a parabola.
    #[default]
    NotAKnot,
    /// No second derivative at the ends.
    Natural,
    /// No first derivative at the ends. The path stands still there while its parameter moves, so
    /// prefer another for a path that is to be retimed.
    Clamped,
}

/// The cubic spline with continuous second derivative through waypoints of N coordinates.
///
/// Evaluation allocates nothing and costs the logarithm of the number of waypoints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPath {
    coordinates: usize,
    /// Path parameter of each waypoint, increasing; two at least.
    parameters: Vec<f64>,
    /// Per piece four rows of one value per coordinate: all `c0`, all `c1`, all `c2`, all `c3`.
    coefficients: Vec<f64>,
}

impl JointPath {
    /// The spline through `waypoints`, parametrised by the summed length of the straight chords
    /// between them, in the mixed unit of the coordinates \[rad or m\].
    ///
    /// # Errors
    /// [`PathError::TooFewWaypoints`], [`PathError::NoCoordinates`], [`PathError::RowLength`],
    /// [`PathError::NotFinite`] for what their names say, [`PathError::Repeated`] if two
    /// neighbours are equal, [`PathError::TooSteep`] if the curve overflows.
    pub fn through(waypoints: &[impl AsRef<[f64]>], ends: SplineEnds) -> Result<Self, PathError> {
        check_rows(waypoints)?;
        let mut parameters = vec![0.0];
        let mut length = 0.0;
        for (waypoint, pair) in waypoints.windows(2).enumerate() {
            let before = length;
            length += chord(pair[0].as_ref(), pair[1].as_ref());
            if length == before {
                return Err(PathError::Repeated { waypoint: waypoint + 1 });
            }
            parameters.push(length);
        }
        Self::with_parameters(&parameters, waypoints, ends)
    }

    /// The spline that has `waypoints[i]` at the path parameter `parameters[i]`. With many rows of
    /// another curve it stands for that curve, as for a Cartesian path that was solved on a grid.
    ///
    /// # Errors
    /// [`PathError::TooFewWaypoints`], [`PathError::NoCoordinates`], [`PathError::RowLength`],
    /// [`PathError::NotFinite`], [`PathError::ParameterCount`], [`PathError::ParameterOrder`] for
    /// what their names say, [`PathError::TooSteep`] if the curve overflows.
    pub fn with_parameters(
        parameters: &[f64],
        waypoints: &[impl AsRef<[f64]>],
        ends: SplineEnds,
    ) -> Result<Self, PathError> {
        let coordinates = check_rows(waypoints)?;
        check_parameters(parameters, waypoints.len())?;
        let positions: Vec<f64> =
            waypoints.iter().flat_map(|row| row.as_ref().iter().copied()).collect();
        let system = Tridiagonal::new(parameters, ends);
        let slopes = system.solve(parameters, &positions, coordinates);
        let mut coefficients = Vec::with_capacity(4 * coordinates * (parameters.len() - 1));
        for (piece, ends) in parameters.windows(2).enumerate() {
            let length = ends[1] - ends[0];
            let here = coordinates * piece..coordinates * (piece + 1);
            let next = coordinates * (piece + 1)..coordinates * (piece + 2);
            let chord = |i: usize| (positions[next.start + i] - positions[here.start + i]) / length;
            let (from, to) = (&slopes[here.clone()], &slopes[next.clone()]);
            coefficients.extend_from_slice(&positions[here.clone()]);
            coefficients.extend_from_slice(from);
            coefficients.extend(
                (0..coordinates).map(|i| (3.0 * chord(i) - 2.0 * from[i] - to[i]) / length),
            );
            coefficients.extend(
                (0..coordinates).map(|i| (from[i] + to[i] - 2.0 * chord(i)) / (length * length)),
            );
        }
        match coefficients.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(PathError::TooSteep { waypoint: at / (4 * coordinates) }),
            None => Ok(Self { coordinates, parameters: parameters.to_vec(), coefficients }),
        }
    }

    /// Path parameter of each waypoint.
    #[must_use]
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The four rows of the piece that holds `s`, and how far into the piece that is.
    fn piece(&self, s: f64) -> (f64, [&[f64]; 4]) {
        let inner = &self.parameters[1..self.parameters.len() - 1];
        let piece = inner.partition_point(|&knot| knot <= s);
        let n = self.coordinates;
        let rows = &self.coefficients[4 * n * piece..][..4 * n];
        let row = |power: usize| &rows[power * n..][..n];
        (s - self.parameters[piece], [row(0), row(1), row(2), row(3)])
    }
}

impl GeometricPath for JointPath {
    fn coordinates(&self) -> usize {
        self.coordinates
    }

    fn range(&self) -> (f64, f64) {
        let last = self.parameters.last().copied().unwrap_or_default();
        (self.parameters.first().copied().unwrap_or_default(), last)
    }

    fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
        let (u, [c0, c1, c2, c3]) = self.piece(s);
        let cubic = c0.iter().zip(c1).zip(c2.iter().zip(c3));
        let rows = out.position.iter_mut().zip(&mut *out.first).zip(&mut *out.second);
        for (((position, first), second), ((c0, c1), (c2, c3))) in rows.zip(cubic) {
            *position = c0 + u * (c1 + u * (c2 + u * c3));
            *first = c1 + u * (2.0 * c2 + u * 3.0 * c3);
            *second = 2.0 * c2 + u * 6.0 * c3;
        }
    }

    fn add_breakpoints(&self, out: &mut Vec<f64>) {
        out.extend_from_slice(&self.parameters[1..self.parameters.len() - 1]);
    }

    fn third_derivative(&self, s: f64, out: &mut [f64]) {
        let (_, [_, _, _, c3]) = self.piece(s);
        for (third, c3) in out.iter_mut().zip(c3) {
            *third = 6.0 * c3;
        }
    }
}

fn chord(from: &[f64], to: &[f64]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt()
}

/// Number of coordinates of all rows, if they are as they should be.
fn check_rows(waypoints: &[impl AsRef<[f64]>]) -> Result<usize, PathError> {
    let expected = match waypoints.first() {
        Some(first) if waypoints.len() > 1 => first.as_ref().len(),
        _ => return Err(PathError::TooFewWaypoints { count: waypoints.len() }),
    };
    if expected == 0 {
        return Err(PathError::NoCoordinates);
    }
    for (waypoint, row) in waypoints.iter().map(AsRef::as_ref).enumerate() {
        if row.len() != expected {
            return Err(PathError::RowLength { waypoint, len: row.len(), expected });
        }
        if let Some(coordinate) = row.iter().position(|value| !value.is_finite()) {
            return Err(PathError::NotFinite { waypoint, coordinate, value: row[coordinate] });
        }
    }
    Ok(expected)
}

fn check_parameters(parameters: &[f64], waypoints: usize) -> Result<(), PathError> {
    if parameters.len() != waypoints {
        return Err(PathError::ParameterCount { parameters: parameters.len(), waypoints });
    }
    let mut previous = f64::NEG_INFINITY;
    for (waypoint, &value) in parameters.iter().enumerate() {
        // Written so that not a number is refused as well.
        let is_later = value > previous && value < f64::INFINITY;
        if !is_later {
            return Err(PathError::ParameterOrder { waypoint, value, previous });
        }
        previous = value;
    }
    Ok(())
}

/// The equations for the slopes at the knots, equal for all coordinates: row `i` holds the factors
/// of the slopes before, at and after knot `i`.
///
/// Source: C. de Boor, A Practical Guide to Splines, revised edition, chapter IV, "cubic spline
/// interpolation": equation (8), and its end conditions.
struct Tridiagonal {
    rows: Vec<[f64; 3]>,
    ends: SplineEnds,
}

impl Tridiagonal {
    fn new(parameters: &[f64], ends: SplineEnds) -> Self {
        let steps: Vec<f64> = parameters.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut rows = Vec::with_capacity(parameters.len());
        let (first, last) = (steps[0], steps[steps.len() - 1]);
        let (second, last_but_one) = match steps.len() {
            1 => (first, last),
            count => (steps[1], steps[count - 2]),
        };
        rows.push(match (ends, steps.len()) {
            (SplineEnds::Clamped, _) | (SplineEnds::NotAKnot, 1) => [0.0, 1.0, 0.0],
            (SplineEnds::NotAKnot, 2) => [0.0, 1.0, 1.0],
            (SplineEnds::NotAKnot, _) => [0.0, second, first + second],
            (SplineEnds::Natural, _) => [0.0, 2.0, 1.0],
        });
        rows.extend(steps.windows(2).map(|h| [h[1], 2.0 * (h[0] + h[1]), h[0]]));
        rows.push(match (ends, steps.len()) {
            (SplineEnds::Clamped, _) | (SplineEnds::NotAKnot, 1) => [0.0, 1.0, 0.0],
            (SplineEnds::NotAKnot, 2) => [1.0, 1.0, 0.0],
            (SplineEnds::NotAKnot, _) => [last_but_one + last, last_but_one, 0.0],
            (SplineEnds::Natural, _) => [1.0, 2.0, 0.0],
        });
        Self { rows, ends }
    }

    /// The slopes, a row of `n` values per knot like `positions`. Elimination needs no pivoting:
    /// the rows dominate, and the not-a-knot ends leave `h0 + h1` on the diagonal.
    fn solve(&self, parameters: &[f64], positions: &[f64], n: usize) -> Vec<f64> {
        let mut slopes = self.right_sides(parameters, positions, n);
        let mut upper = vec![0.0; self.rows.len()];
        for (knot, &[before, at, after]) in self.rows.iter().enumerate() {
            let previous = if knot == 0 { 0.0 } else { upper[knot - 1] };
            let pivot = 1.0 / (at - before * previous);
            upper[knot] = after * pivot;
            for here in knot * n..(knot + 1) * n {
                let eliminated = if knot == 0 { 0.0 } else { before * slopes[here - n] };
                slopes[here] = (slopes[here] - eliminated) * pivot;
            }
        }
        for knot in (0..self.rows.len() - 1).rev() {
            for here in knot * n..(knot + 1) * n {
                slopes[here] -= upper[knot] * slopes[here + n];
            }
        }
        slopes
    }

    fn right_sides(&self, parameters: &[f64], positions: &[f64], n: usize) -> Vec<f64> {
        let pieces = parameters.len() - 1;
        let step = |i: usize| parameters[i + 1] - parameters[i];
        let mut right = vec![0.0; positions.len()];
        for joint in 0..n {
            let chord =
                |i: usize| (positions[(i + 1) * n + joint] - positions[i * n + joint]) / step(i);
            for knot in 1..pieces {
                let (before, after) = (step(knot - 1), step(knot));
                right[knot * n + joint] = 3.0 * (after * chord(knot - 1) + before * chord(knot));
            }
            let (first, last) = match (self.ends, pieces) {
                (SplineEnds::Clamped, _) => (0.0, 0.0),
                (SplineEnds::NotAKnot, 1) => (chord(0), chord(0)),
                (SplineEnds::NotAKnot, 2) => (2.0 * chord(0), 2.0 * chord(1)),
                (SplineEnds::Natural, _) => (3.0 * chord(0), 3.0 * chord(pieces - 1)),
                (SplineEnds::NotAKnot, _) => {
                    let near = |outer: usize, inner: usize| {
                        let (h, g) = (step(outer), step(inner));
                        let both = h + g;
                        ((h + 2.0 * both) * g * chord(outer) + h * h * chord(inner)) / both
                    };
                    (near(0, 1), near(pieces - 1, pieces - 2))
                }
            };
            right[joint] = first;
            right[pieces * n + joint] = last;
        }
        right
    }
}
