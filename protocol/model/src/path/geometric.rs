//! What a path is: a curve in joint space without time.

/// Fraction of a path's range by which the third derivative is found where a path gives none.
const DIFFERENCE_FRACTION: f64 = 1e-5;

/// A curve `q(s)` of N coordinates that is twice differentiable, without any time.
///
/// Coordinates are joint positions \[rad or m\], of one robot or of several in a row; `s` is any
/// parameter that grows along the curve (length, waypoint number, fraction). The second derivative
/// may bend but should not jump: limits of acceleration are found at the points of a grid.
pub trait GeometricPath {
    /// Number of coordinates, one at least.
    fn coordinates(&self) -> usize;

    /// First and last path parameter, finite and in increasing order.
    fn range(&self) -> (f64, f64);

    /// Writes position and derivatives at `s`, which lies in the range, into rows that are
    /// [`coordinates`](Self::coordinates) long.
    fn evaluate(&self, s: f64, out: &mut PathRows<'_>);

    /// Adds to `out` the path parameters at which the third derivative jumps, such as the knots of
    /// a spline. Where jerk is limited they are looked at from both sides; a path that has such
    /// places and does not tell may exceed limits there by what lies between two looks.
    fn add_breakpoints(&self, out: &mut Vec<f64>) {
        let _ = out;
    }

    /// Writes `d³q/ds³` at `s` into `out`; needed where jerk is limited.
    ///
    /// Without an own version this is the difference quotient of the second derivative, and it
    /// allocates.
    fn third_derivative(&self, s: f64, out: &mut [f64]) {
        let (start, end) = self.range();
        let step = DIFFERENCE_FRACTION * (end - start);
        let (before, after) = ((s - step).max(start), (s + step).min(end));
        let mut scratch = vec![0.0; 3 * self.coordinates()];
        self.evaluate(before, &mut PathRows::split(&mut scratch));
        for (third, &second) in out.iter_mut().zip(&*PathRows::split(&mut scratch).second) {
            *third = -second / (after - before);
        }
        self.evaluate(after, &mut PathRows::split(&mut scratch));
        for (third, &second) in out.iter_mut().zip(&*PathRows::split(&mut scratch).second) {
            *third += second / (after - before);
        }
    }
}

/// Where a path writes one point: one value per coordinate in each row.
#[derive(Debug)]
pub struct PathRows<'a> {
    /// `q` \[rad or m\].
    pub position: &'a mut [f64],
    /// `dq/ds`.
    pub first: &'a mut [f64],
    /// `d²q/ds²`.
    pub second: &'a mut [f64],
}

impl<'a> PathRows<'a> {
    /// Three rows of a third of `scratch` each; what is left over is not used.
    #[must_use]
    pub fn split(scratch: &'a mut [f64]) -> Self {
        let row = scratch.len() / 3;
        let (position, rest) = scratch.split_at_mut(row);
        let (first, rest) = rest.split_at_mut(row);
        let (second, _) = rest.split_at_mut(row);
        Self { position, first, second }
    }
}

impl<P: GeometricPath + ?Sized> GeometricPath for &P {
    fn coordinates(&self) -> usize {
        (**self).coordinates()
    }

    fn range(&self) -> (f64, f64) {
        (**self).range()
    }

    fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
        (**self).evaluate(s, out);
    }

    fn add_breakpoints(&self, out: &mut Vec<f64>) {
        (**self).add_breakpoints(out);
    }

    fn third_derivative(&self, s: f64, out: &mut [f64]) {
        (**self).third_derivative(s, out);
    }
}

/// Why points are not a path. Waypoints and coordinates are counted from zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    /// There is nothing to move along.
    #[error("{count} waypoints, at least 2 are needed")]
    TooFewWaypoints {
        /// Number of waypoints.
        count: usize,
    },
    /// The waypoints have no coordinates, or a stack has no paths.
    #[error("there is no coordinate to move")]
    NoCoordinates,
    /// A waypoint does not have as many coordinates as the first.
    #[error("waypoint {waypoint} has {len} coordinates, expected {expected}")]
    RowLength {
        /// Index of the waypoint.
        waypoint: usize,
        /// Number of its coordinates.
        len: usize,
        /// Number of coordinates of waypoint 0.
        expected: usize,
    },
    /// A coordinate is infinite or not a number.
    #[error("waypoint {waypoint}: coordinate {coordinate} is {value}, which is not finite")]
    NotFinite {
        /// Index of the waypoint.
        waypoint: usize,
        /// Index of the coordinate.
        coordinate: usize,
        /// The value.
        value: f64,
    },
    /// There is not one parameter per waypoint.
    #[error("{parameters} path parameters, expected one for each of {waypoints} waypoints")]
    ParameterCount {
        /// Number of parameters.
        parameters: usize,
        /// Number of waypoints.
        waypoints: usize,
    },
    /// A parameter is not finite or not above the one before it.
    #[error("waypoint {waypoint}: path parameter {value} is not above {previous}")]
    ParameterOrder {
        /// Index of the waypoint.
        waypoint: usize,
        /// Its parameter.
        value: f64,
        /// Parameter of the waypoint before it.
        previous: f64,
    },
    /// A waypoint is where the one before it is, so that the path has no direction there.
    #[error("waypoint {waypoint} is equal to waypoint {}", .waypoint - 1)]
    Repeated {
        /// Index of the later waypoint.
        waypoint: usize,
    },
    /// Two waypoints are so near in parameter that the curve between overflows.
    #[error("the curve between waypoints {waypoint} and {} is too steep", .waypoint + 1)]
    TooSteep {
        /// Index of the earlier waypoint.
        waypoint: usize,
    },
}
