//! Pose and Jacobian of the tool centre point in one pass.

#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B, R_BT its rotation")]

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::chain::{Chain, isometry};
use super::jacobian::Jacobian;
use super::reduce::Step;
use super::sin_cos_of;
use crate::KinematicsError;

/// Joints whose sines are calculated together.
const GROUP: usize = 8;

/// Axes and origin of a frame, in the base.
#[derive(Clone, Copy)]
struct Frame {
    x: Vector3<f64>,
    y: Vector3<f64>,
    z: Vector3<f64>,
    p: Vector3<f64>,
}

impl Chain {
    /// Pose of the TCP in the base link, for one position per variable of the chain.
    ///
    /// Allocates nothing.
    ///
    /// # Errors
    /// [`KinematicsError::PositionCount`] if the length does not fit,
    /// [`KinematicsError::NotFinite`] if a position is infinite or not a number.
    pub fn forward(&self, positions: &[f64]) -> Result<Isometry3<f64>, KinematicsError> {
        self.check_count(positions)?;
        let (R, p) = self.pass(positions, |_, _| {})?;
        Ok(isometry(&R, &p))
    }

    /// Pose of the TCP in the base link, and the geometric Jacobian of the TCP in the base's axes.
    ///
    /// One pass over the joints; allocates nothing.
    ///
    /// # Errors
    /// Those of [`Chain::forward`].
    pub fn forward_and_jacobian(
        &self,
        positions: &[f64],
    ) -> Result<(Isometry3<f64>, Jacobian), KinematicsError> {
        self.check_count(positions)?;
        let mut jacobian = Jacobian::zeros(self.len());
        let (R, p) = self.evaluate(positions, &mut jacobian)?;
        Ok((isometry(&R, &p), jacobian))
    }

    /// As [`Chain::forward_and_jacobian`] for positions that fit, with the rotation as a matrix and
    /// into a Jacobian of as many columns whose contents do not matter.
    ///
    /// Source: B. Siciliano et al., "Robotics: Modelling, Planning and Control", 2009, section
    /// 3.1.3. Columns are collected as twists of the point of the body that stands in the base's
    /// origin and shifted to the TCP at the end, so that joints driven by one variable add up.
    #[inline]
    pub(crate) fn evaluate(
        &self,
        positions: &[f64],
        jacobian: &mut Jacobian,
    ) -> Result<(Matrix3<f64>, Vector3<f64>), KinematicsError> {
        let columns = jacobian.columns_mut();
        columns.fill([[0.0; 3]; 2]);
        let (R, p) = self.pass(positions, |step, frame| {
            let Some([linear, angular]) = columns.get_mut(step.variable) else { return };
            let z = frame.z * step.multiplier;
            let v = if step.turns { frame.p.cross(&z) } else { z };
            let w = if step.turns { z } else { Vector3::zeros() };
            for axis in 0..3 {
                linear[axis] += v[axis];
                angular[axis] += w[axis];
            }
        })?;
        for [linear, angular] in columns {
            let [x, y, z] = *angular;
            linear[0] += y * p.z - z * p.y;
            linear[1] += z * p.x - x * p.z;
            linear[2] += x * p.y - y * p.x;
        }
        Ok((R, p))
    }

    /// Orientation and position of the TCP; `visit` sees every moving joint with its frame.
    #[inline]
    fn pass(
        &self,
        positions: &[f64],
        mut visit: impl FnMut(&Step, &Frame),
    ) -> Result<(Matrix3<f64>, Vector3<f64>), KinematicsError> {
        let (R, p) = &self.reduced.first;
        let column = |index: usize| R.column(index).into_owned();
        let mut frame = Frame { x: column(0), y: column(1), z: column(2), p: *p };
        // In groups, because several sines at a time are cheaper than one after the other.
        for group in self.reduced.steps.chunks(GROUP) {
            let mut values = [0.0; GROUP];
            let mut angles = [0.0; GROUP];
            for ((step, value), angle) in group.iter().zip(&mut values).zip(&mut angles) {
                let position = positions.get(step.variable).copied().unwrap_or_default();
                *value = step.multiplier * position + step.offset;
                if !value.is_finite() {
                    let (joint, value) = (step.joint, *value);
                    return Err(KinematicsError::NotFinite { joint, value });
                }
                *angle = if step.turns { step.angle + *value } else { step.angle };
            }
            let turns = sin_cos_of(&angles);
            for ((step, &value), &turn) in group.iter().zip(&values).zip(&turns) {
                visit(step, &frame);
                frame.advance(step, if step.turns { 0.0 } else { value }, turn);
            }
        }
        let R_BL = Matrix3::from_columns(&[frame.x, frame.y, frame.z]);
        let (R_LT, p_LT) = &self.last;
        Ok((R_BL * R_LT, frame.p + R_BL * p_LT))
    }
}

impl Frame {
    /// From the frame of a joint to that of the next, with the joint slid by `slide` \[m\] and turned
    /// by the angle of that sine and cosine.
    #[inline]
    fn advance(&mut self, step: &Step, slide: f64, (sin, cos): (f64, f64)) {
        let x = self.x * cos + self.y * sin;
        let y = self.y * cos - self.x * sin;
        self.p += x * step.shift.x + y * step.shift.y + self.z * (step.shift.z + slide);
        let (cos, sin) = step.twist;
        self.x = x;
        self.y = y * cos + self.z * sin;
        self.z = self.z * cos - y * sin;
    }
}
