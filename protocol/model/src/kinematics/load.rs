//! Mass that a flange carries.

#![allow(non_snake_case, reason = "X_FP is the pose of frame P in frame F")]

use nalgebra::{Matrix3, Vector3};

use crate::{Inertial, Pose};

/// By how much, of its largest element, an inertia may miss its conditions.
const TOLERANCE: f64 = 1e-9;

/// A rigid body's mass, centre of mass and inertia, in a frame that the holder names.
///
/// For what an arm carries, tool and payload, that is the flange's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    mass: f64,
    centre_of_mass: Vector3<f64>,
    inertia: Matrix3<f64>,
}

/// Why numbers are not a [`Load`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// A number is infinite or not a number.
    #[error("{field} has a value of {value}, which is not finite")]
    NotFinite {
        /// The field: `mass`, `centre_of_mass` or `inertia`.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// The mass is below zero.
    #[error("mass is {mass} kg, below 0")]
    NegativeMass {
        /// The mass \[kg\].
        mass: f64,
    },
    /// A product of inertia differs from its mirror image.
    #[error("inertia is not symmetric: element {row},{column} is {value}, but {mirrored} mirrored")]
    NotSymmetric {
        /// Row of the element, from 0.
        row: usize,
        /// Column of the element, from 0.
        column: usize,
        /// The element \[kg m²\].
        value: f64,
        /// The element with row and column exchanged \[kg m²\].
        mirrored: f64,
    },
    /// A principal moment of inertia is below zero.
    #[error("a principal moment of inertia is {moment} kg m², below 0")]
    NegativeMoment {
        /// The moment \[kg m²\].
        moment: f64,
    },
    /// A principal moment of inertia is larger than the sum of the others, which no body's is.
    #[error("a principal moment of inertia is {moment} kg m², above the sum {sum} of the others")]
    TriangleInequality {
        /// The moment \[kg m²\].
        moment: f64,
        /// Sum of the two others \[kg m²\].
        sum: f64,
    },
}

impl Load {
    /// Nothing.
    pub const NONE: Self = Self {
        mass: 0.0,
        centre_of_mass: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// A body of `mass` \[kg\] with its centre at `centre_of_mass` \[m\], and `inertia` about that
    /// centre along the frame's axes \[kg m²\].
    ///
    /// # Errors
    /// [`LoadError::NotFinite`] and [`LoadError::NegativeMass`] for numbers no body has,
    /// [`LoadError::NotSymmetric`], [`LoadError::NegativeMoment`] and
    /// [`LoadError::TriangleInequality`] for an inertia no body has.
    pub fn new(
        mass: f64,
        centre_of_mass: Vector3<f64>,
        inertia: Matrix3<f64>,
    ) -> Result<Self, LoadError> {
        check_finite("mass", &[mass])?;
        check_finite("centre_of_mass", centre_of_mass.as_slice())?;
        check_finite("inertia", inertia.as_slice())?;
        if mass < 0.0 {
            return Err(LoadError::NegativeMass { mass });
        }
        check_inertia(&inertia)?;
        Ok(Self { mass, centre_of_mass, inertia })
    }

    /// A body as it goes over the wire: `mass` \[kg\], `centre_of_mass` \[m\], and the inertia about
    /// that centre as xx xy xz yy yz zz \[kg m²\].
    ///
    /// # Errors
    /// Those of [`Load::new`].
    pub fn from_elements(
        mass: f64,
        centre_of_mass: [f64; 3],
        [xx, xy, xz, yy, yz, zz]: [f64; 6],
    ) -> Result<Self, LoadError> {
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Self::new(mass, Vector3::from(centre_of_mass), inertia)
    }

    /// The inertia about the centre of mass as xx xy xz yy yz zz \[kg m²\].
    #[must_use]
    pub fn inertia_elements(&self) -> [f64; 6] {
        let i = &self.inertia;
        [i[(0, 0)], i[(0, 1)], i[(0, 2)], i[(1, 1)], i[(1, 2)], i[(2, 2)]]
    }

    /// The load of a link, in the link's frame.
    ///
    /// # Errors
    /// Those of [`Load::new`].
    pub fn from_inertial(inertial: &Inertial) -> Result<Self, LoadError> {
        let own = Self::new(inertial.mass, Vector3::zeros(), inertial.inertia)?;
        Ok(own.seen_from(&inertial.origin))
    }

    /// Mass \[kg\], not negative.
    #[must_use]
    pub const fn mass(&self) -> f64 {
        self.mass
    }

    /// Centre of mass \[m\]; zero for a mass of zero that was combined.
    #[must_use]
    pub const fn centre_of_mass(&self) -> &Vector3<f64> {
        &self.centre_of_mass
    }

    /// Inertia about the centre of mass along the frame's axes \[kg m²\].
    #[must_use]
    pub const fn inertia(&self) -> &Matrix3<f64> {
        &self.inertia
    }

    /// Inertia about `point` \[m\] along the frame's axes \[kg m²\].
    ///
    /// Source: the parallel axis theorem, R. Featherstone, "Rigid Body Dynamics Algorithms", 2008,
    /// equation 2.63.
    #[must_use]
    pub fn inertia_about(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let d = self.centre_of_mass - point;
        self.inertia + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * self.mass
    }

    /// The same body in frame F, if this describes it in frame P that stands at `X_FP`.
    #[must_use]
    pub fn seen_from(&self, X_FP: &Pose) -> Self {
        let X_FP = X_FP.isometry();
        let R_FP = X_FP.rotation.to_rotation_matrix();
        let turned = R_FP.matrix() * self.inertia * R_FP.matrix().transpose();
        Self {
            mass: self.mass,
            centre_of_mass: X_FP.rotation * self.centre_of_mass + X_FP.translation.vector,
            // Exactly symmetric again.
            inertia: (turned + turned.transpose()) * 0.5,
        }
    }

    /// Both bodies as one, in the frame that both are described in.
    #[must_use]
    pub fn combine(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        let moment = self.centre_of_mass * self.mass + other.centre_of_mass * other.mass;
        let centre_of_mass = if mass > 0.0 { moment / mass } else { Vector3::zeros() };
        let inertia = self.inertia_about(&centre_of_mass) + other.inertia_about(&centre_of_mass);
        Self { mass, centre_of_mass, inertia }
    }
}

impl Default for Load {
    fn default() -> Self {
        Self::NONE
    }
}

/// A body that a flange carries, by the pose at which it is attached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    /// Pose of the payload's frame in the flange.
    pub attached_at: Pose,
    /// Its mass, in the payload's own frame.
    pub load: Load,
}

impl Payload {
    /// Pose of the payload in W, if the flange stands at `X_WF`.
    #[must_use]
    pub fn pose(&self, X_WF: &Pose) -> Pose {
        *X_WF * self.attached_at
    }

    /// What `payloads` weigh together, tool and all, in the flange's frame.
    #[must_use]
    pub fn combined<'p>(payloads: impl IntoIterator<Item = &'p Self>) -> Load {
        let seen = |payload: &Self| payload.load.seen_from(&payload.attached_at);
        payloads.into_iter().map(seen).fold(Load::NONE, |sum, load| sum.combine(&load))
    }
}

fn check_finite(field: &'static str, values: &[f64]) -> Result<(), LoadError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(LoadError::NotFinite { field, value }),
        None => Ok(()),
    }
}

fn check_inertia(inertia: &Matrix3<f64>) -> Result<(), LoadError> {
    let tolerance = TOLERANCE * inertia.amax();
    for (row, column) in [(0, 1), (0, 2), (1, 2)] {
        let (value, mirrored) = (inertia[(row, column)], inertia[(column, row)]);
        if (value - mirrored).abs() > tolerance {
            return Err(LoadError::NotSymmetric { row, column, value, mirrored });
        }
    }
    let moments = inertia.symmetric_eigenvalues();
    let (lowest, highest) = (moments.min(), moments.max());
    if lowest < -tolerance {
        return Err(LoadError::NegativeMoment { moment: lowest });
    }
    let sum = moments.sum() - highest;
    if highest > sum + tolerance {
        return Err(LoadError::TriangleInequality { moment: highest, sum });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::Isometry3;

    use super::*;

    /// A cuboid of even density, centred in the origin.
    fn cuboid(mass: f64, [x, y, z]: [f64; 3]) -> Load {
        let moments = Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (mass / 12.0);
        Load::new(mass, Vector3::zeros(), Matrix3::from_diagonal(&moments)).expect("a body")
    }

    fn close(a: &Load, b: &Load) -> bool {
        (a.mass - b.mass).abs() < 1e-15
            && (a.centre_of_mass - b.centre_of_mass).amax() < 1e-15
            && (a.inertia - b.inertia).amax() < 1e-15
    }

    #[test]
    fn two_halves_of_a_cuboid_weigh_as_the_whole() {
        let half = Payload {
            attached_at: Pose::from_translation(0.1, 0.0, 0.0),
            load: cuboid(1.5, [0.2, 0.1, 0.3]),
        };
        let other = Payload { attached_at: Pose::from_translation(-0.1, 0.0, 0.0), ..half };
        let whole = cuboid(3.0, [0.4, 0.1, 0.3]);
        assert!(close(&Payload::combined([&half, &other]), &whole));
    }

    #[test]
    fn a_turned_body_has_its_moments_about_other_axes() {
        let turn = Pose::from_isometry(Isometry3::rotation(Vector3::z() * FRAC_PI_2));
        assert!(close(
            &cuboid(2.0, [0.1, 0.2, 0.3]).seen_from(&turn),
            &cuboid(2.0, [0.2, 0.1, 0.3])
        ));
    }

    #[test]
    fn a_point_mass_has_the_inertia_of_its_distance() {
        let point = Load::new(2.0, Vector3::new(0.0, 0.5, 0.0), Matrix3::zeros()).expect("a body");
        let about = point.inertia_about(&Vector3::zeros());
        assert_eq!(about, Matrix3::from_diagonal(&Vector3::new(0.5, 0.0, 0.5)));
    }

    #[test]
    fn elements_make_the_body_that_they_came_from() {
        let elements = [0.5, 0.01, 0.02, 0.6, 0.03, 0.7];
        let load = Load::from_elements(2.0, [0.1, 0.2, 0.3], elements).expect("a body");
        assert_eq!(load.inertia_elements(), elements);
        assert_eq!(load.inertia(), &load.inertia().transpose());
        assert_eq!(load.centre_of_mass(), &Vector3::new(0.1, 0.2, 0.3));
    }

    #[test]
    fn nothing_adds_nothing() {
        let load = cuboid(2.0, [0.1, 0.2, 0.3]).seen_from(&Pose::from_translation(0.0, 0.1, 0.2));
        assert!(close(&load.combine(&Load::NONE), &load));
        assert_eq!(Payload::combined([]), Load::NONE);
    }

    #[test]
    fn a_payload_stands_where_it_is_attached() {
        let attached_at = Pose::from_translation(0.0, 0.0, 0.2);
        let payload = Payload { attached_at, ..Payload::default() };
        let X_WF = Pose::from_isometry(Isometry3::new(Vector3::x(), Vector3::y() * FRAC_PI_2));
        assert!((payload.pose(&X_WF).position() - Vector3::new(1.2, 0.0, 0.0)).amax() < 1e-15);
    }

    #[test]
    fn numbers_no_body_has_are_refused() {
        let of = |mass: f64, inertia: Matrix3<f64>| Load::new(mass, Vector3::zeros(), inertia);
        let diagonal = |x, y, z| Matrix3::from_diagonal(&Vector3::new(x, y, z));
        assert_eq!(of(-1.0, Matrix3::zeros()), Err(LoadError::NegativeMass { mass: -1.0 }));
        let mut skew = diagonal(1.0, 1.0, 1.0);
        skew[(0, 2)] = 0.5;
        let fault = LoadError::NotSymmetric { row: 0, column: 2, value: 0.5, mirrored: 0.0 };
        assert_eq!(of(1.0, skew), Err(fault));
        let fault = LoadError::NegativeMoment { moment: -0.5 };
        assert_eq!(of(1.0, diagonal(-0.5, 1.0, 1.0)), Err(fault));
        let fault = LoadError::TriangleInequality { moment: 3.0, sum: 2.0 };
        assert_eq!(of(1.0, diagonal(1.0, 3.0, 1.0)), Err(fault));
        let fault = LoadError::NotFinite { field: "mass", value: f64::INFINITY };
        assert_eq!(of(f64::INFINITY, Matrix3::zeros()), Err(fault));
    }
}
