//! Time-optimal path parametrisation by reachability analysis.
//!
//! The unknown is `x = ṡ²` over the points `s_i` of a grid; with `u = s̈` constant between two
//! points, `x_(i+1) = x_i + 2 (s_(i+1) - s_i) u_i`, and joint velocity and acceleration are
//! `q' √x` and `q' u + q'' x`: linear limits on `(u, x)`. A pass from the end finds at each point
//! the interval of `x` from which the end can be reached; a pass from the start takes the largest
//! `u` that stays inside.
//!
//! Source: H. Pham, Q.-C. Pham, A New Approach to Time-Optimal Path Parameterization Based on
//! Reachability Analysis, IEEE Transactions on Robotics 34(3), 2018, algorithm 1 and the two
//! schemes of discretising constraints.

mod constraints;
mod error;
mod grid;
mod passes;

pub use error::RetimeError;
pub use grid::{Grid, MAX_GRID_POINTS};

use super::geometric::GeometricPath;
use super::timed::TimedPath;
use crate::AxisLimits;
use constraints::Constraints;
use grid::PathTable;

/// Where between two grid points the limits of acceleration are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ConstraintScheme {
    /// At both ends of each interval: what is exceeded between shrinks with the square of the
    /// interval.
    #[default]
    Interpolation,
    /// At the beginning of each interval only: half the work, and an error that shrinks with the
    /// interval.
    Collocation,
}

/// How to retime a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetimeOptions {
    /// At which path parameters limits are held.
    pub grid: Grid,
    /// Where between grid points.
    pub scheme: ConstraintScheme,
    /// `ds/dt` at the start, zero for a motion from rest.
    pub start_velocity: f64,
    /// `ds/dt` at the end, zero for a motion to rest.
    pub end_velocity: f64,
    /// Highest `ds/dt`, infinite if only the joints limit it. On a path whose parameter is the
    /// length of a tool's way \[m\] this is the highest speed of the tool \[m/s\].
    pub max_velocity: f64,
}

impl Default for RetimeOptions {
    /// From rest to rest on an adaptive grid, limited by the joints alone.
    fn default() -> Self {
        Self {
            grid: Grid::Adaptive,
            scheme: ConstraintScheme::Interpolation,
            start_velocity: 0.0,
            end_velocity: 0.0,
            max_velocity: f64::INFINITY,
        }
    }
}

/// The fastest motion along `path` within `limits` of velocity and acceleration, one per
/// coordinate; positions of the path are checked too, jerk is not limited.
///
/// Exact to the second order of the grid's steps: limits may be exceeded by some thousandths
/// between grid points.
///
/// ```
/// use armada_model::{JointLimits, JointPath, MotionLimits, RetimeOptions, SplineEnds, retime};
///
/// let joint = JointLimits { velocity: 1.0, acceleration: Some(2.0), ..JointLimits::default() };
/// let limits = MotionLimits::new(&[joint; 2])?;
/// let path = JointPath::through(&[[0.0, 0.0], [0.6, 1.0], [2.0, 0.5]], SplineEnds::NotAKnot)?;
/// let timed = retime(&path, &limits, &RetimeOptions::default())?;
/// assert!(timed.duration_s() > 2.0 && timed.duration_s() < 3.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`RetimeError`] if limits or options make no sense or do not fit the path, if the path is not
/// finite, stands still or leaves the position limits, and if no motion along it keeps the limits,
/// which happens only if it shall begin or end in motion.
pub fn retime<P: GeometricPath>(
    path: P,
    limits: &[AxisLimits],
    options: &RetimeOptions,
) -> Result<TimedPath<P>, RetimeError> {
    let retimer = Retimer::new(&path, limits, options)?;
    let knots = retimer.retime(&[])?.knots().to_vec();
    Ok(TimedPath::from_knots(path, limits, knots))
}

/// A path on its grid, to be retimed once or more often.
pub(super) struct Retimer<'a, P> {
    path: &'a P,
    limits: &'a [AxisLimits],
    options: &'a RetimeOptions,
    table: PathTable,
}

impl<'a, P: GeometricPath> Retimer<'a, P> {
    pub(super) fn new(
        path: &'a P,
        limits: &'a [AxisLimits],
        options: &'a RetimeOptions,
    ) -> Result<Self, RetimeError> {
        let table = PathTable::sample(path, limits, options)?;
        Ok(Self { path, limits, options, table })
    }

    /// Path parameters of the grid points.
    pub(super) fn grid(&self) -> &[f64] {
        &self.table.s
    }

    /// The fastest motion if at grid point `i` everything is slower by `slowness[i] <= 1`: velocity
    /// limits by that factor, acceleration limits by its square. Empty means one everywhere.
    pub(super) fn retime(&self, slowness: &[f64]) -> Result<TimedPath<&'a P>, RetimeError> {
        let Self { path, limits, options, table } = self;
        let constraints = Constraints::new(table, limits, options, slowness)?;
        let squared = passes::solve(&constraints, options).map_err(|failure| failure.at(table))?;
        TimedPath::from_squared_velocities(path, limits, &table.s, &squared)
    }
}
