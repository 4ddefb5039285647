//! How a tool centre point moves with the joints.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::singular::SingularValues;
use super::twist::Twist;
use crate::{JointVector, MAX_JOINTS};

/// Geometric Jacobian of a chain's tool centre point, TCP: a 6 x n matrix.
///
/// Column `k` is the twist of the TCP per velocity 1 of variable `k`; in the first three rows the
/// velocity of the TCP's origin \[m/s\], in the last three the angular velocity \[rad/s\], both in the
/// axes of the base link. It takes no heap: there is room for [`MAX_JOINTS`] columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian {
    len: usize,
    /// Linear and angular part of each column.
    columns: [[[f64; 3]; 2]; MAX_JOINTS],
}

/// A force \[N\] at the TCP and a torque \[Nm\], in the axes of the base link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench {
    /// Force at the TCP's origin \[N\].
    pub force: Vector3<f64>,
    /// Torque about the TCP's origin \[Nm\].
    pub torque: Vector3<f64>,
}

impl Jacobian {
    /// A Jacobian of `len` columns, at most [`MAX_JOINTS`], all zero.
    pub(crate) const fn zeros(len: usize) -> Self {
        let len = if len < MAX_JOINTS { len } else { MAX_JOINTS };
        Self { len, columns: [[[0.0; 3]; 2]; MAX_JOINTS] }
    }

    /// Linear and angular part of each column.
    #[inline]
    pub(crate) fn columns(&self) -> &[[[f64; 3]; 2]] {
        &self.columns[..self.len]
    }

    #[inline]
    pub(crate) fn columns_mut(&mut self) -> &mut [[[f64; 3]; 2]] {
        &mut self.columns[..self.len]
    }

    /// Number of columns: of variables of the chain.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a chain has at least one variable")]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Twist of the TCP per velocity 1 of variable `index`; `None` if there is no such variable.
    #[must_use]
    pub fn column(&self, index: usize) -> Option<Twist> {
        let [linear, angular] = self.columns().get(index)?;
        Some(Twist::new(Vector3::from(*linear), Vector3::from(*angular)))
    }

    /// Element in row 0 to 5 and column `column`; `None` outside.
    #[must_use]
    pub fn element(&self, row: usize, column: usize) -> Option<f64> {
        self.columns().get(column)?.as_flattened().get(row).copied()
    }

    /// Twist of the TCP in the base's axes, for one velocity per variable \[rad/s or m/s\].
    ///
    /// Velocities that are missing count as zero, those beyond the last variable are not read.
    #[must_use]
    pub fn twist(&self, velocities: &[f64]) -> Twist {
        let mut sum = [0.0; 6];
        for (column, &velocity) in self.columns().iter().zip(velocities) {
            for (slot, element) in sum.iter_mut().zip(column.as_flattened()) {
                *slot += element * velocity;
            }
        }
        Twist::from_vector(&Vector6::from(sum))
    }

    /// Torques \[Nm\] and forces \[N\] of the joints that balance `wrench`, which the TCP exerts:
    /// the transposed Jacobian times it.
    #[must_use]
    pub fn transposed_times(&self, wrench: &Wrench) -> JointVector {
        let (f, t) = (&wrench.force, &wrench.torque);
        let efforts = JointVector::zeros(self.len).unwrap_or_default();
        efforts.map_indexed(|index, _| {
            self.columns().get(index).map_or(0.0, |[v, w]| {
                v[0] * f.x + v[1] * f.y + v[2] * f.z + w[0] * t.x + w[1] * t.y + w[2] * t.z
            })
        })
    }

    /// Yoshikawa's manipulability: the product of the singular values, zero where a direction is
    /// lost.
    ///
    /// For six or more variables `sqrt(det(J J^T))`, for fewer `sqrt(det(J^T J))`. It mixes metres
    /// and radians, so it compares postures of one arm, not arms.
    ///
    /// Source: T. Yoshikawa, "Manipulability of Robotic Mechanisms", Int. J. of Robotics Research
    /// 4(2), 1985.
    #[must_use]
    pub fn manipulability(&self) -> f64 {
        self.singular_values(1.0).iter().product()
    }

    /// Singular values and their directions, with lengths measured in units of `length` \[m\].
    ///
    /// The linear rows are divided by `length`, so that all rows are in \[rad/s\] and compare: a
    /// `length` of 1 leaves the numbers as they are; the arm's reach, or the distance from TCP to
    /// wrist, makes a metre weigh as much as the turn that moves that far. Lengths that are not
    /// above zero count as 1.
    #[must_use]
    pub fn singular_values(&self, length: f64) -> SingularValues {
        SingularValues::of(self, length)
    }

    /// Smallest singular value: zero at a singularity, where the TCP cannot move in one direction.
    ///
    /// It is the exact distance, in the norm of matrices, to the nearest Jacobian of lower rank.
    /// `length` is that of [`Jacobian::singular_values`]. Chains of fewer than six variables never
    /// move in all directions; theirs is the smallest of as many values as they have variables.
    ///
    /// Source: G. Golub and C. Van Loan, "Matrix Computations", 4th edition, theorem 2.4.8.
    #[must_use]
    pub fn distance_to_singularity(&self, length: f64) -> f64 {
        self.singular_values(length).smallest()
    }

    /// Direction of motion in the base's axes that takes most joint velocity, or is lost.
    ///
    /// The linear part is in \[m/s\], with lengths weighed by `length` as in
    /// [`Jacobian::singular_values`]: `(linear / length, angular)` has norm 1. Its sign means nothing.
    #[must_use]
    pub fn weakest_direction(&self, length: f64) -> Twist {
        self.singular_values(length).weakest_direction()
    }

    /// `J J^T`.
    #[must_use]
    pub fn gram(&self) -> Matrix6<f64> {
        let mut gram = Matrix6::zeros();
        for column in self.columns() {
            let column = Vector6::from_column_slice(column.as_flattened());
            gram.ger(1.0, &column, &column, 1.0);
        }
        gram
    }
}
