//! Joint velocities for a twist, near singularities as well.

use super::jacobian::Jacobian;
use super::twist::Twist;
use crate::{JointVector, MAX_JOINTS};

/// How much exactness is given up near a singularity.
///
/// Without it joint velocities grow without bound there. Each direction of motion is damped by
/// itself, so those that are not lost stay exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    /// Singular value below which a direction is damped, above zero.
    pub threshold: f64,
    /// Damping at the singularity, where the singular value is zero; not negative.
    pub maximum: f64,
    /// Length \[m\] in whose units distances are measured, see [`Jacobian::singular_values`].
    pub length: f64,
}

impl Damping {
    /// Damping for arms: begins at a singular value of 0.04 with lengths in \[m\] and keeps
    /// joint velocities below 29 \[rad/s\] per \[m/s\] of a twist.
    pub const ARM: Self = Self { threshold: 0.04, maximum: 0.02, length: 1.0 };

    /// Square of the damping at the singular value `value`.
    fn squared(&self, value: f64) -> f64 {
        let ratio = value / self.threshold;
        // Not `>=`: a threshold that is zero or no number damps nothing.
        if ratio < 1.0 { (1.0 - ratio * ratio) * self.maximum * self.maximum } else { 0.0 }
    }
}

/// Joint velocities for a wanted twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedVelocity {
    /// Velocity of each variable \[rad/s or m/s\], inside the limits given.
    pub velocities: JointVector,
    /// By what all were multiplied, from 0 to 1, to stay inside the limits.
    pub scale: f64,
    /// Twist the velocities give in the base's axes; at full scale it differs from the one wanted
    /// by what damping takes away.
    pub twist: Twist,
    /// Smallest singular value, see [`Jacobian::distance_to_singularity`].
    pub distance_to_singularity: f64,
}

impl Jacobian {
    /// The smallest joint velocities that give `twist`, damped near singularities and slowed down
    /// as a whole, direction kept, until each is within its element of `limits`.
    ///
    /// `limits` holds the highest speed of each variable \[rad/s or m/s\]; one that is missing, not
    /// above zero or not a number is not checked. Allocates nothing. A twist that is not finite
    /// gives zero velocities with a scale of zero.
    ///
    /// Source: A. Maciejewski and C. Klein, "Numerical filtering for the operation of robotic
    /// manipulators through kinematically singular configurations", J. of Robotic Systems 5(6),
    /// 1988; damping factor of Y. Nakamura and H. Hanafusa, "Inverse kinematic solutions with
    /// singularity robustness", ASME J. of Dynamic Systems 108(3), 1986, in the form of
    /// S. Chiaverini et al., IEEE Trans. on Control Systems Technology 2(2), 1994, equation 13.
    #[must_use]
    pub fn joint_velocity(
        &self,
        twist: &Twist,
        damping: &Damping,
        limits: &[f64],
    ) -> ResolvedVelocity {
        let singular = self.singular_values(damping.length);
        let distance_to_singularity = singular.smallest();
        let wanted = Twist::new(twist.linear / singular.length(), twist.angular).to_vector();
        let mut sum = [0.0; MAX_JOINTS];
        for (value, direction, row) in singular.parts() {
            let divisor = value * value + damping.squared(value);
            if divisor > 0.0 {
                let share = direction.dot(&wanted) / divisor;
                for (slot, element) in sum.iter_mut().zip(row) {
                    *slot += share * element;
                }
            }
        }
        let scale = scale_into(&sum[..self.len()], limits);
        let zero = JointVector::zeros(self.len()).unwrap_or_default();
        let velocities = zero.map_indexed(|k, _| {
            if scale > 0.0 { sum.get(k).map_or(0.0, |velocity| velocity * scale) } else { 0.0 }
        });
        let twist = self.twist(&velocities);
        ResolvedVelocity { velocities, scale, twist, distance_to_singularity }
    }
}

/// The largest factor up to 1 that brings each velocity within its limit; 0 if one is not finite.
fn scale_into(velocities: &[f64], limits: &[f64]) -> f64 {
    if !velocities.iter().all(|velocity| velocity.is_finite()) {
        return 0.0;
    }
    let excess = velocities
        .iter()
        .zip(limits)
        .map(|(velocity, &limit)| if limit > 0.0 { velocity.abs() / limit } else { 0.0 });
    1.0 / excess.fold(1.0, f64::max)
}
