//! Several paths as one, so that several robots move in phase.

use std::ops::Range;

use super::geometric::{GeometricPath, PathError, PathRows};
use crate::{JointTrajectory, TrajectoryError};

/// Paths of several robots, one below the other, with one parameter from 0 to 1 for all: at any
/// time each has come equally far along the range of its own parameter.
///
/// Retimed with the limits of all robots in the same order, none waits for another and all start
/// and end together. A robot that stands still has a path of equal waypoints
/// ([`JointPath::with_parameters`](super::JointPath::with_parameters)).
#[derive(Clone, Debug, PartialEq)]
pub struct StackedPath<P> {
    paths: Vec<P>,
}

impl<P: GeometricPath> StackedPath<P> {
    /// The paths in the order of `paths`. For different kinds take `P = &dyn GeometricPath`.
    ///
    /// # Errors
    /// [`PathError::NoCoordinates`] if there is no path.
    pub fn new(paths: Vec<P>) -> Result<Self, PathError> {
        if paths.is_empty() { Err(PathError::NoCoordinates) } else { Ok(Self { paths }) }
    }

    /// The stacked paths.
    #[must_use]
    pub fn paths(&self) -> &[P] {
        &self.paths
    }

    /// For each path which coordinates of the stack are its own.
    pub fn columns(&self) -> impl Iterator<Item = Range<usize>> {
        let mut next = 0;
        self.paths.iter().map(move |path| {
            let first = next;
            next += path.coordinates();
            first..next
        })
    }

    /// A trajectory of all coordinates as one trajectory per path, with the same times.
    ///
    /// # Errors
    /// [`TrajectoryError::ColumnUnknown`] or [`TrajectoryError::RowLength`] if `trajectory` is not
    /// one of this stack.
    pub fn split(
        &self,
        trajectory: &JointTrajectory,
    ) -> Result<Vec<JointTrajectory>, TrajectoryError> {
        self.columns()
            .map(|columns| {
                let names = trajectory.joint_names.get(columns.clone()).unwrap_or_default();
                let names = names.to_vec();
                let columns: Vec<usize> = columns.collect();
                trajectory.select(&columns, names)
            })
            .collect()
    }
}

impl<P: GeometricPath> GeometricPath for StackedPath<P> {
    fn coordinates(&self) -> usize {
        self.paths.iter().map(GeometricPath::coordinates).sum()
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 1.0)
    }

    fn evaluate(&self, s: f64, out: &mut PathRows<'_>) {
        for (path, columns) in self.paths.iter().zip(self.columns()) {
            let (own, length) = own_parameter(path, s);
            let first = &mut out.first[columns.clone()];
            let second = &mut out.second[columns.clone()];
            let position = &mut out.position[columns];
            path.evaluate(own, &mut PathRows { position, first, second });
            scale(first, length);
            scale(second, length * length);
        }
    }

    fn add_breakpoints(&self, out: &mut Vec<f64>) {
        for path in &self.paths {
            let (start, end) = path.range();
            let first = out.len();
            path.add_breakpoints(out);
            for s in &mut out[first..] {
                *s = (*s - start) / (end - start);
            }
        }
    }

    fn third_derivative(&self, s: f64, out: &mut [f64]) {
        for (path, columns) in self.paths.iter().zip(self.columns()) {
            let (own, length) = own_parameter(path, s);
            let third = &mut out[columns];
            path.third_derivative(own, third);
            scale(third, length * length * length);
        }
    }
}

/// A path's own parameter at fraction `s`, and the length of its range.
fn own_parameter(path: &impl GeometricPath, s: f64) -> (f64, f64) {
    let (start, end) = path.range();
    (if s < 1.0 { start + s * (end - start) } else { end }, end - start)
}

fn scale(row: &mut [f64], factor: f64) {
    for value in row {
        *value *= factor;
    }
}
