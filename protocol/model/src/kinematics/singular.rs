//! Singular values of a Jacobian.

use arrayvec::ArrayVec;
use nalgebra::Vector6;

use super::jacobian::Jacobian;
use super::twist::Twist;
use crate::MAX_JOINTS;

/// Sweeps over all pairs of rows; six rows take five to eight to full precision.
const MAX_SWEEPS: usize = 30;

/// Cosine between two rows below which they count as orthogonal.
const ORTHOGONAL: f64 = 1e-15;

/// Singular value decomposition of a [`Jacobian`] whose lengths are in units of a given one.
///
/// Values stand in falling order, as many as the lower of 6 and the number of variables.
#[derive(Clone, Debug, PartialEq)]
pub struct SingularValues {
    length: f64,
    values: ArrayVec<f64, 6>,
    /// Unit vectors in the space of twists, one per value.
    directions: ArrayVec<Vector6<f64>, 6>,
    /// Unit vectors in the space of variables times the value.
    rows: ArrayVec<[f64; MAX_JOINTS], 6>,
}

impl SingularValues {
    /// Source: G. Golub and C. Van Loan, "Matrix Computations", 4th edition, section 8.6.3
    /// (one-sided Jacobi): rows are turned in pairs until all are orthogonal. Small values are as
    /// exact as large ones, which `J J^T` would not give.
    pub(super) fn of(jacobian: &Jacobian, length: f64) -> Self {
        let length = if length.is_finite() && length > 0.0 { length } else { 1.0 };
        let n = jacobian.len();
        let mut rows = [[0.0; MAX_JOINTS]; 6];
        for (k, column) in jacobian.columns().iter().enumerate() {
            for (i, row) in rows.iter_mut().enumerate() {
                let unit = if i < 3 { length } else { 1.0 };
                row[k] = column.as_flattened()[i] / unit;
            }
        }
        let mut turns = [[0.0; 6]; 6];
        for (i, turn) in turns.iter_mut().enumerate() {
            turn[i] = 1.0;
        }
        for _ in 0..MAX_SWEEPS {
            if !sweep(&mut rows, &mut turns, n) {
                break;
            }
        }
        sorted(&rows, &turns, length, n)
    }

    /// The values in falling order, without unit.
    pub fn iter(&self) -> impl Iterator<Item = f64> + Clone + '_ {
        self.values.iter().copied()
    }

    /// The smallest value.
    #[must_use]
    pub fn smallest(&self) -> f64 {
        self.values.last().copied().unwrap_or_default()
    }

    /// Largest value divided by the smallest; infinite at a singularity.
    #[must_use]
    pub fn condition(&self) -> f64 {
        self.values.first().copied().unwrap_or_default() / self.smallest()
    }

    /// Direction that belongs to the smallest value, see [`Jacobian::weakest_direction`].
    #[must_use]
    pub fn weakest_direction(&self) -> Twist {
        let direction = self.directions.last().copied().unwrap_or_default();
        let twist = Twist::from_vector(&direction);
        Twist::new(twist.linear * self.length, twist.angular)
    }

    /// Value, direction in units of `length`, and value times joint direction, of each.
    pub(crate) fn parts(
        &self,
    ) -> impl Iterator<Item = (f64, &Vector6<f64>, &[f64; MAX_JOINTS])> + Clone {
        self.values.iter().zip(&self.directions).zip(&self.rows).map(|((&s, u), row)| (s, u, row))
    }

    pub(super) const fn length(&self) -> f64 {
        self.length
    }
}

type Rows = [[f64; MAX_JOINTS]; 6];

/// Makes each pair of rows orthogonal once; whether any was not.
fn sweep(rows: &mut Rows, turns: &mut [[f64; 6]; 6], n: usize) -> bool {
    let mut turned = false;
    for i in 0..5 {
        for j in i + 1..6 {
            let dot = |a: &[f64; MAX_JOINTS], b: &[f64; MAX_JOINTS]| -> f64 {
                a.iter().zip(b).take(n).map(|(a, b)| a * b).sum()
            };
            let (a, b, c) =
                (dot(&rows[i], &rows[i]), dot(&rows[j], &rows[j]), dot(&rows[i], &rows[j]));
            if c.abs() <= ORTHOGONAL * (a * b).sqrt() || c == 0.0 {
                continue;
            }
            turned = true;
            let zeta = (b - a) / (2.0 * c);
            let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cos = 1.0 / t.hypot(1.0);
            turn(rows, (i, j), (cos, cos * t));
            turn(turns, (i, j), (cos, cos * t));
        }
    }
    turned
}

fn turn<const N: usize>(rows: &mut [[f64; N]; 6], (i, j): (usize, usize), (cos, sin): (f64, f64)) {
    let (upper, lower) = rows.split_at_mut(j);
    for (a, b) in upper[i].iter_mut().zip(&mut lower[0]) {
        (*a, *b) = (cos * *a - sin * *b, sin * *a + cos * *b);
    }
}

fn sorted(rows: &Rows, turns: &[[f64; 6]; 6], length: f64, n: usize) -> SingularValues {
    let norm = |row: &[f64; MAX_JOINTS]| row.iter().map(|x| x * x).sum::<f64>().sqrt();
    let norms = rows.map(|row| norm(&row));
    let mut order = [0, 1, 2, 3, 4, 5];
    order.sort_unstable_by(|&i, &j| norms[j].total_cmp(&norms[i]).then(i.cmp(&j)));
    let kept = order.iter().take(n);
    SingularValues {
        length,
        values: kept.clone().map(|&i| norms[i]).collect(),
        directions: kept.clone().map(|&i| Vector6::from(turns[i])).collect(),
        rows: kept.map(|&i| rows[i]).collect(),
    }
}
