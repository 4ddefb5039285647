//! Capsules and the distance between two of them, in closed form.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use super::error::{ClearanceError, length};

/// All points within a radius of a line segment; a sphere if the segment's ends are one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    a: Point3<f64>,
    b: Point3<f64>,
    radius: f64,
}

/// Distance of two bodies and where they are nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Distance \[m\]; below zero the bodies overlap.
    pub distance_m: f64,
    /// Point of the first body's surface nearest to the second.
    pub point_a: Point3<f64>,
    /// Point of the second body's surface nearest to the first.
    pub point_b: Point3<f64>,
}

impl Capsule {
    /// The capsule around the segment from `a` to `b` \[m\].
    ///
    /// # Errors
    /// [`ClearanceError::Length`] if a number is not finite, above 1e6 m, or the radius is below
    /// zero.
    pub fn new(a: Point3<f64>, b: Point3<f64>, radius: f64) -> Result<Self, ClearanceError> {
        for value in a.iter().chain(b.iter()) {
            length("coordinate", *value)?;
        }
        if length("radius", radius)? < 0.0 {
            return Err(ClearanceError::Length { field: "radius", value: radius });
        }
        Ok(Self { a, b, radius })
    }

    /// Ends of the segment.
    #[must_use]
    pub const fn ends(&self) -> [Point3<f64>; 2] {
        [self.a, self.b]
    }

    /// Radius \[m\].
    #[must_use]
    pub const fn radius(&self) -> f64 {
        self.radius
    }

    /// The capsule given in frame A, of which `X_WA` is the pose in W, in W.
    #[must_use]
    pub fn transformed(&self, X_WA: &Isometry3<f64>) -> Self {
        Self { a: X_WA * self.a, b: X_WA * self.b, radius: self.radius }
    }

    /// Volume \[m³\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        let (length, r) = ((self.b - self.a).norm(), self.radius);
        std::f64::consts::PI * r * r * (length + 4.0 / 3.0 * r)
    }

    /// Distance to the other capsule: that of the segments less both radii.
    ///
    /// If the segments themselves cross, it is minus the sum of the radii. Allocates nothing.
    #[must_use]
    pub fn distance(&self, other: &Self) -> Nearest {
        Placed::new(self).nearest(&Placed::new(other))
    }

    /// Signed distance of a point from the surface, below zero inside \[m\].
    #[must_use]
    pub fn distance_to_point(&self, point: &Point3<f64>) -> f64 {
        let placed = Placed::new(self);
        let along = (point.coords - placed.start).dot(&placed.span) * placed.per_span2;
        let foot = placed.start + placed.span * along.clamp(0.0, 1.0);
        (point.coords - foot).norm() - self.radius
    }
}

/// A capsule in the world with what its distances need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    start: Vector3<f64>,
    span: Vector3<f64>,
    /// One by the squared length of `span`; zero if that is zero.
    per_span2: f64,
    radius: f64,
    centre: Vector3<f64>,
    /// Radius of the sphere about `centre` that holds the capsule.
    reach: f64,
}

impl Placed {
    pub(super) fn new(capsule: &Capsule) -> Self {
        let (start, span) = (capsule.a.coords, capsule.b - capsule.a);
        let span2 = span.norm_squared();
        let per_span2 = if span2 > f64::MIN_POSITIVE { 1.0 / span2 } else { 0.0 };
        let (radius, centre) = (capsule.radius, start + 0.5 * span);
        Self { start, span, per_span2, radius, centre, reach: 0.5 * span2.sqrt() + radius }
    }

    /// Largest absolute coordinate of the segment; not a number if one is not.
    pub(super) fn extent(&self) -> f64 {
        let end = self.start + self.span;
        self.start.iter().chain(end.iter()).fold(0.0, |most, value| {
            if value.is_nan() || value.abs() > most { value.abs() } else { most }
        })
    }

    /// Whether the spheres around both capsules show that they are at least `distance` apart.
    #[inline]
    pub(super) fn is_beyond(&self, other: &Self, distance: f64) -> bool {
        let gap = distance + self.reach + other.reach;
        gap > 0.0 && (self.centre - other.centre).norm_squared() >= gap * gap
    }

    /// Signed distance.
    #[inline]
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let (s, t) = self.parameters(other);
        let gap = other.start + t * other.span - self.start - s * self.span;
        gap.norm() - self.radius - other.radius
    }

    /// A distance that the capsule is not below from a box, given by half its edges and the world's
    /// pose in it: that of the box around the capsule's segment, less the radius.
    pub(super) fn gap_to_box(&self, half: &[f64; 3], X_BW: &Isometry3<f64>) -> f64 {
        let start = X_BW * Point3::from(self.start);
        let span = X_BW.rotation * self.span;
        let mut gap = Vector3::zeros();
        for axis in 0..3 {
            let (low, high) = (start[axis].min(start[axis] + span[axis]), span[axis].abs());
            let beyond = (low - half[axis]).max(-half[axis] - low - high);
            gap[axis] = beyond.max(0.0);
        }
        gap.norm() - self.radius
    }

    /// Signed distance and the nearest points.
    pub(super) fn nearest(&self, other: &Self) -> Nearest {
        let (s, t) = self.parameters(other);
        let (p, q) = (self.start + s * self.span, other.start + t * other.span);
        let gap = (q - p).norm();
        let direction = Unit::try_new(q - p, f64::MIN_POSITIVE)
            .or_else(|| Unit::try_new(self.span.cross(&other.span), f64::MIN_POSITIVE))
            .unwrap_or_else(|| across(&self.span, &other.span));
        Nearest {
            distance_m: gap - self.radius - other.radius,
            point_a: Point3::from(p + self.radius * *direction),
            point_b: Point3::from(q - other.radius * *direction),
        }
    }

    /// Where on the two segments, from zero to one, the nearest points lie.
    ///
    /// The first parameter comes from cross products, not from `ac - b²`: nearly parallel segments
    /// lose nothing. Of parallel ones any pair of nearest points is found.
    ///
    /// Source: Ericson, Real-Time Collision Detection (2005), 5.1.9; the cross products as in
    /// Sunday, Practical Geometry Algorithms (2021).
    #[inline]
    fn parameters(&self, other: &Self) -> (f64, f64) {
        let r = other.start - self.start;
        let normal = self.span.cross(&other.span);
        let sine2 = normal.norm_squared();
        let dot = self.span.dot(&other.span);
        let free = r.cross(&other.span).dot(&normal);
        let s = if sine2 > 0.0 { (free / sine2).clamp(0.0, 1.0) } else { 0.0 };
        let t = ((s * dot - r.dot(&other.span)) * other.per_span2).clamp(0.0, 1.0);
        // Best for that t: a change only if t was held at an end.
        let s = ((t * dot + r.dot(&self.span)) * self.per_span2).clamp(0.0, 1.0);
        (s, t)
    }
}

/// Some direction across the first span that is not zero; any if both are.
fn across(a: &Vector3<f64>, b: &Vector3<f64>) -> Unit<Vector3<f64>> {
    let span = if a.norm_squared() > 0.0 { a } else { b };
    let thin = span.iamin();
    let mut other = Vector3::zeros();
    other[thin] = 1.0;
    Unit::try_new(span.cross(&other), f64::MIN_POSITIVE).unwrap_or_else(Vector3::x_axis)
}
