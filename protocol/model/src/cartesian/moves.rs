//! A path as it is asked for.

use nalgebra::{UnitQuaternion, Vector3};

use crate::Pose;

/// One move of a Cartesian path, and how its end is passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianMove {
    /// Where it goes.
    pub segment: CartesianSegment,
    /// How far before its end it is left for the next move, and how far after its start the next
    /// one is reached, in the path's measure \[m\]. Zero means that the corner is reached, with a
    /// stop unless the next move goes on without a kink. Zero for the last move.
    pub blend_radius: f64,
}

/// Where a move goes from the end of the one before, in the frame of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CartesianSegment {
    /// Straight to a pose; if only the orientations differ, a rotation on the spot.
    Line {
        /// The pose at its end.
        to: Pose,
    },
    /// On the circle through three points, the shorter or the longer way: whichever meets `via`.
    Arc {
        /// A point on the way \[m\].
        via: Vector3<f64>,
        /// The pose at its end.
        to: Pose,
    },
    /// About an axis, by any angle: more than a whole circle too.
    Turn {
        /// A point of the axis \[m\]; the centre of the circle is the axis' point next to the start.
        center: Vector3<f64>,
        /// Direction of the axis; need not be of unit length.
        normal: Vector3<f64>,
        /// How far, anticlockwise seen against `normal` \[rad\]; negative goes the other way.
        angle: f64,
        /// What the orientation does meanwhile.
        orientation: ArcOrientation,
    },
}

/// What the orientation does during a turn about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArcOrientation {
    /// It stays as it is.
    Fixed,
    /// It turns with the arc, about the same axis by the same angle.
    WithArc,
    /// It goes the shortest way to this one.
    To(UnitQuaternion<f64>),
}

impl CartesianMove {
    /// A straight move to `to` that ends in a stop.
    #[must_use]
    pub const fn line(to: Pose) -> Self {
        Self { segment: CartesianSegment::Line { to }, blend_radius: 0.0 }
    }

    /// A move on the circle through `via` to `to` that ends in a stop.
    #[must_use]
    pub const fn arc(via: Vector3<f64>, to: Pose) -> Self {
        Self { segment: CartesianSegment::Arc { via, to }, blend_radius: 0.0 }
    }

    /// This move with its end blended into the next one.
    #[must_use]
    pub const fn blended(self, blend_radius: f64) -> Self {
        Self { blend_radius, ..self }
    }
}
