//! Capsules that contain shapes, as small as a search finds them.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};

use super::capsule::Capsule;
use crate::Shape;

/// Added to radii, relative and absolute \[m\], so that rounding leaves no corner outside.
const SLACK: f64 = 1e-12;
/// Radii tried between the smallest possible and that of a sphere: while searching, and at last.
const COARSE: usize = 6;
const FINE: usize = 400;
/// Rounds of the search for the axis of a mesh.
const ROUNDS: usize = 60;

/// A small capsule around a shape at `X_LS` in its link; `None` for a mesh, whose vertices are not
/// known here.
pub(super) fn around_shape(shape: &Shape, X_LS: &Isometry3<f64>) -> Option<Capsule> {
    let along = |axis: usize, profile: &[Ring]| {
        let span = best_on_axis(profile, FINE);
        let mut ends = [Point3::origin(); 2];
        ends[0][axis] = span.low;
        ends[1][axis] = span.high;
        (span.volume(), ends, span.radius)
    };
    let (ends, radius) = match *shape {
        Shape::Sphere { radius } => ([Point3::origin(); 2], radius),
        Shape::Capsule { radius, length } => {
            let end = Point3::new(0.0, 0.0, 0.5 * length);
            ([-end, end], radius)
        }
        Shape::Cylinder { radius, length } => {
            let (_, ends, radius) = along(2, &rings(radius, 0.5 * length));
            (ends, slack(radius))
        }
        Shape::Box { size } => {
            let half = size.map(|edge| 0.5 * edge);
            let [x, y, z] = half;
            let (_, ends, radius) = [y.hypot(z), x.hypot(z), x.hypot(y)]
                .into_iter()
                .enumerate()
                .map(|(axis, across)| along(axis, &rings(across, half[axis])))
                .min_by(|a, b| a.0.total_cmp(&b.0))?;
            (ends, slack(radius))
        }
        Shape::Mesh { .. } => return None,
    };
    let [a, b] = ends.map(|end| X_LS * end);
    Capsule::new(a, b, radius).ok()
}

/// A small capsule around points; `None` if there are none or one is not finite.
pub(super) fn around_points(points: &[Point3<f64>]) -> Option<Capsule> {
    let mut lines: Vec<(f64, Line)> = axes(points)
        .into_iter()
        .map(|axis| {
            let line = Line::through_middle(points, axis);
            (line.span(points, COARSE).volume(), line)
        })
        .collect();
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    let capsules =
        lines.iter().take(2).filter_map(|(_, line)| line.improved(points).capsule(points));
    capsules.min_by(|a, b| a.volume().total_cmp(&b.volume()))
}

/// The capsule with a radius that holds all points.
pub(super) fn widened(capsule: &Capsule, points: &[Point3<f64>]) -> Option<Capsule> {
    let [a, b] = capsule.ends();
    let beyond = points.iter().map(|point| capsule.distance_to_point(point)).fold(0.0, f64::max);
    let radius = capsule.radius();
    Capsule::new(a, b, if beyond > 0.0 { slack(radius + beyond) } else { radius }).ok()
}

fn slack(radius: f64) -> f64 {
    radius * (1.0 + SLACK) + SLACK
}

/// Points at distance `across` from an axis, at `along` on it.
#[derive(Clone, Copy)]
struct Ring {
    across: f64,
    along: f64,
}

fn rings(across: f64, half: f64) -> [Ring; 2] {
    [Ring { across, along: -half }, Ring { across, along: half }]
}

/// A capsule on a known axis.
#[derive(Clone, Copy)]
struct Span {
    low: f64,
    high: f64,
    radius: f64,
}

impl Span {
    fn volume(&self) -> f64 {
        PI * self.radius * self.radius * (self.high - self.low + 4.0 / 3.0 * self.radius)
    }
}

/// The smallest of the capsules on the axis that contain the rings, one for each of so many radii.
fn best_on_axis(rings: &[Ring], radii: usize) -> Span {
    let (mut across, mut low, mut high) = (0.0_f64, f64::INFINITY, f64::NEG_INFINITY);
    for ring in rings {
        across = across.max(ring.across);
        low = low.min(ring.along);
        high = high.max(ring.along);
    }
    let widest = across.hypot(0.5 * (high - low));
    let mut best = span_of(rings, across);
    for step in 1..=radii {
        #[expect(clippy::cast_precision_loss, reason = "a few hundred steps")]
        let share = step as f64 / radii as f64;
        // Dense near the smallest, where the capsule shortens most.
        let span = span_of(rings, across + share.powi(3) * (widest - across));
        if span.volume() < best.volume() {
            best = span;
        }
    }
    best
}

/// The shortest capsule of that radius on the axis that contains the rings, all of them within
/// `radius` of it.
fn span_of(rings: &[Ring], radius: f64) -> Span {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for ring in rings {
        let cap = (radius * radius - ring.across * ring.across).max(0.0).sqrt();
        low = low.min(ring.along + cap);
        high = high.max(ring.along - cap);
    }
    if low > high {
        // Any centre between the two will do.
        (low, high) = (0.5 * (low + high), 0.5 * (low + high));
    }
    Span { low, high, radius }
}

/// Directions in which a capsule may lie: the principal ones, those of the frame, and that of the
/// points farthest apart.
fn axes(points: &[Point3<f64>]) -> Vec<Unit<Vector3<f64>>> {
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 points")]
    let count = points.len().max(1) as f64;
    let mean = points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / count;
    let spread = points
        .iter()
        .map(|point| point.coords - mean)
        .fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose());
    let farthest = |from: &Vector3<f64>| {
        let distance = |point: &&Point3<f64>| (point.coords - from).norm_squared();
        points.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).map(|point| point.coords)
    };
    let one = farthest(&mean).unwrap_or(mean);
    let other = farthest(&one).unwrap_or(mean);
    let principal = spread.symmetric_eigen().eigenvectors;
    let mut axes: Vec<_> =
        principal.column_iter().filter_map(|axis| Unit::try_new(axis.into_owned(), 1e-9)).collect();
    axes.extend(Unit::try_new(one - other, 1e-12));
    axes.extend([Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()]);
    axes
}

/// The axis of a capsule around points.
#[derive(Clone, Copy)]
struct Line {
    origin: Vector3<f64>,
    axis: Unit<Vector3<f64>>,
}

impl Line {
    /// The line through the middle of the points' extent across `axis`.
    fn through_middle(points: &[Point3<f64>], axis: Unit<Vector3<f64>>) -> Self {
        let (u, v) = sides(&axis);
        let middle = |side: &Vector3<f64>| {
            let along = points.iter().map(|point| point.coords.dot(side));
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            side * (0.5 * (low + high))
        };
        Self { origin: middle(&u) + middle(&v), axis }
    }

    fn span(&self, points: &[Point3<f64>], radii: usize) -> Span {
        let rings: Vec<Ring> = points
            .iter()
            .map(|point| {
                let from = point.coords - self.origin;
                let along = from.dot(&self.axis);
                Ring { across: (from - along * *self.axis).norm(), along }
            })
            .collect();
        best_on_axis(&rings, radii)
    }

    /// Turned and shifted for as long as the capsule becomes smaller.
    fn improved(mut self, points: &[Point3<f64>]) -> Self {
        let mut span = self.span(points, COARSE);
        let (mut turn, mut shift) = (0.2, 0.2 * span.radius);
        for _ in 0..ROUNDS {
            let (u, v) = sides(&self.axis);
            let steps = [u, -u, v, -v];
            let turned = steps
                .iter()
                .map(|step| Self { axis: Unit::new_normalize(*self.axis + turn * step), ..self });
            let shifted =
                steps.iter().map(|step| Self { origin: self.origin + shift * step, ..self });
            let best = turned
                .chain(shifted)
                .map(|line| (line.span(points, COARSE), line))
                .min_by(|a, b| a.0.volume().total_cmp(&b.0.volume()));
            match best {
                Some((smaller, line)) if smaller.volume() < span.volume() => {
                    (span, self) = (smaller, line);
                }
                _ => (turn, shift) = (0.5 * turn, 0.5 * shift),
            }
        }
        self
    }

    /// The capsule on the line, as wide as the points need when measured from its segment.
    fn capsule(&self, points: &[Point3<f64>]) -> Option<Capsule> {
        let span = self.span(points, FINE);
        let [a, b] =
            [span.low, span.high].map(|along| Point3::from(self.origin + along * *self.axis));
        let bare = Capsule::new(a, b, 0.0).ok()?;
        let radius = points.iter().map(|point| bare.distance_to_point(point)).fold(0.0, f64::max);
        Capsule::new(a, b, slack(radius)).ok()
    }
}

/// Two directions across the axis and each other.
fn sides(axis: &Unit<Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    let u = axis.cross(&other).normalize();
    (u, axis.cross(&u))
}
