//! Convex shapes and the exact distance between two of them; the only module that names parry.

use nalgebra::{Isometry3, Point3};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::gjk::{CsoPoint, GJKResult, VoronoiSimplex, closest_points};
use parry3d_f64::shape::{Cuboid, Cylinder, Segment, SupportMap};

use super::capsule::Nearest;

/// A convex shape: all points within a radius of a core.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    core: Core,
    radius: f64,
    /// Pose of the shape in its link; cylinders lie along their own y, not z.
    X_LS: Isometry3<f64>,
}

#[derive(Clone, Debug)]
enum Core {
    Segment(Segment),
    Cuboid(Cuboid),
    Cylinder(Cylinder),
    Points(Points),
}

/// The convex hull of points, none of which needs to be a corner of it.
#[derive(Clone, Debug)]
struct Points(Vec<Vector>);

impl SupportMap for Points {
    fn local_support_point(&self, direction: Vector) -> Vector {
        let mut best = (f64::NEG_INFINITY, Vector::ZERO);
        for point in &self.0 {
            let along = point.dot(direction);
            if along > best.0 {
                best = (along, *point);
            }
        }
        best.1
    }
}

/// Room for one distance, reused from call to call.
#[derive(Clone)]
pub(super) struct Scratch(VoronoiSimplex);

impl Default for Scratch {
    fn default() -> Self {
        Self(VoronoiSimplex::new())
    }
}

impl std::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Scratch")
    }
}

impl Hull {
    pub(super) fn capsule(ends: [Point3<f64>; 2], radius: f64) -> Self {
        let [a, b] = ends.map(|end| vector(&end));
        let (core, X_LS) = (Core::Segment(Segment::new(a, b)), Isometry3::identity());
        Self { core, radius, X_LS }
    }

    pub(super) fn cuboid(size: [f64; 3], X_LS: Isometry3<f64>) -> Self {
        let [x, y, z] = size;
        let half = 0.5 * Vector::new(x, y, z);
        Self { core: Core::Cuboid(Cuboid::new(half)), radius: 0.0, X_LS }
    }

    /// A cylinder along z.
    pub(super) fn cylinder(radius: f64, length: f64, X_LS: Isometry3<f64>) -> Self {
        let quarter = std::f64::consts::FRAC_PI_2;
        let upright = Isometry3::rotation(nalgebra::Vector3::new(quarter, 0.0, 0.0));
        let core = Core::Cylinder(Cylinder::new(0.5 * length, radius));
        Self { core, radius: 0.0, X_LS: X_LS * upright }
    }

    /// The convex hull of points in the link.
    pub(super) fn points(points: &[Point3<f64>]) -> Self {
        let points = points.iter().map(vector).collect();
        Self { core: Core::Points(Points(points)), radius: 0.0, X_LS: Isometry3::identity() }
    }

    /// Half the edges of the shape and its pose in the link, if it is a box.
    pub(super) fn as_box(&self) -> Option<([f64; 3], Isometry3<f64>)> {
        let Core::Cuboid(cuboid) = &self.core else { return None };
        Some((cuboid.half_extents.to_array(), self.X_LS))
    }

    const fn support(&self) -> &dyn SupportMap {
        match &self.core {
            Core::Segment(shape) => shape,
            Core::Cuboid(shape) => shape,
            Core::Cylinder(shape) => shape,
            Core::Points(shape) => shape,
        }
    }

    /// Distance of two shapes in links at `X_WA` and `X_WB`; `None` if the search does not end.
    ///
    /// Not below minus the sum of the radii; zero at least for shapes without a radius, however
    /// deep they overlap. Relative accuracy 5e-8. Poses must be finite. Allocates nothing.
    pub(super) fn distance(
        &self,
        X_WA: &Isometry3<f64>,
        other: &Self,
        X_WB: &Isometry3<f64>,
        scratch: &mut Scratch,
    ) -> Option<Nearest> {
        let (X_WS, X_WT) = (X_WA * self.X_LS, X_WB * other.X_LS);
        let X_ST = pose(&X_WS.inv_mul(&X_WT));
        let (a, b) = (self.support(), other.support());
        let direction = (-X_ST.translation).try_normalize().unwrap_or(Vector::X);
        scratch.0.reset(CsoPoint::from_shapes(&X_ST, a, b, direction));
        match closest_points(&X_ST, a, b, f64::MAX, true, &mut scratch.0) {
            GJKResult::ClosestPoints(p, q, axis) => {
                let gap = (q - p).length();
                let direction = (q - p).try_normalize().unwrap_or(axis);
                let (p, q) = (p + self.radius * direction, q - other.radius * direction);
                Some(Nearest {
                    distance_m: gap - self.radius - other.radius,
                    point_a: X_WS * point(p),
                    point_b: X_WS * point(q),
                })
            }
            GJKResult::Intersection => {
                // Some point of the overlap: the simplex has none that is certain, so the middle
                // of where the two were entered.
                let (p, q) = (a.local_support_point(-direction), b.support_point(&X_ST, direction));
                let middle = X_WS * point(0.5 * (p + q));
                let distance_m = 0.0 - (self.radius + other.radius);
                Some(Nearest { distance_m, point_a: middle, point_b: middle })
            }
            GJKResult::Proximity(_) | GJKResult::NoIntersection(_) => None,
        }
    }
}

/// Directions in which corners are looked for first.
const DIRECTIONS: u32 = 256;
/// A point that is less outside than this adds nothing \[m\].
const INSIDE: f64 = 1e-12;

/// The points without most of those that lie inside the convex hull of the others.
///
/// Not parry's convex hull: it asserts what rounding can break. Kept are the farthest points in many
/// directions, and all that are outside the hull of these.
pub(super) fn corners(points: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let order = |a: &Point3<f64>, b: &Point3<f64>| {
        let by = |axis: usize| a[axis].total_cmp(&b[axis]);
        by(0).then_with(|| by(1)).then_with(|| by(2))
    };
    let mut distinct = points.to_vec();
    distinct.sort_by(order);
    distinct.dedup();
    let all = Points(distinct.iter().map(vector).collect());
    let mut farthest: Vec<Point3<f64>> = (0..DIRECTIONS)
        .map(|index| point(all.local_support_point(spread_direction(index))))
        .collect();
    farthest.sort_by(order);
    farthest.dedup();
    let hull = Hull::points(&farthest);
    let (here, mut scratch) = (Isometry3::identity(), Scratch::default());
    distinct.retain(|corner| {
        let single = Hull::capsule([*corner; 2], 0.0);
        farthest.binary_search_by(|known| order(known, corner)).is_ok()
            || hull
                .distance(&here, &single, &here, &mut scratch)
                .is_none_or(|nearest| nearest.distance_m > INSIDE)
    });
    distinct
}

/// One of the directions, evenly spread over a sphere along a spiral.
fn spread_direction(index: u32) -> Vector {
    let height = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(DIRECTIONS);
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let (sin, cos) = (golden_angle * f64::from(index)).sin_cos();
    let across = (1.0 - height * height).max(0.0).sqrt();
    Vector::new(across * cos, across * sin, height)
}

fn vector(point: &Point3<f64>) -> Vector {
    Vector::new(point.x, point.y, point.z)
}

fn point(vector: Vector) -> Point3<f64> {
    Point3::new(vector.x, vector.y, vector.z)
}

fn pose(isometry: &Isometry3<f64>) -> Pose {
    Pose::from_parts(isometry.translation.vector.into(), isometry.rotation.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_a_fine_box_are_few_and_none_is_lost() {
        let grid = (0..11_u32)
            .flat_map(|x| (0..11_u32).flat_map(move |y| (0..11_u32).map(move |z| [x, y, z])));
        let points: Vec<_> =
            grid.map(|at| Point3::from(at.map(|n| 0.1 * f64::from(n) - 0.5))).collect();
        let kept = corners(&points);
        assert_eq!(kept.len(), 8, "{kept:?}");
        assert!(kept.iter().all(|corner| (corner.coords.abs().min() - 0.5).abs() < 1e-15));
    }

    #[test]
    fn points_on_a_ball_are_all_kept() {
        let ball: Vec<_> = (0..DIRECTIONS).map(|n| point(spread_direction(n))).collect();
        let inner = ball.iter().map(|point| point * 0.9);
        let all: Vec<_> = ball.iter().copied().chain(inner).chain(ball.clone()).collect();
        assert_eq!(corners(&all).len(), ball.len());
    }
}
