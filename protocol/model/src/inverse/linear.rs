//! Six equations with a symmetric positive matrix.

use crate::MAX_JOINTS;

/// Task-space columns of the variables: six rows each.
pub(super) type Columns = [[f64; 6]; MAX_JOINTS];

/// `J J^T + damping` factored as `L L^T` (Cholesky), with the reciprocal of the diagonal of `L`.
pub(super) struct Factored {
    lower: [[f64; 6]; 6],
    inverse: [f64; 6],
}

impl Factored {
    /// From the columns of `J` that `free` lets through.
    #[inline]
    pub(super) fn of<'c>(columns: impl Iterator<Item = &'c [f64; 6]>, damping: f64) -> Self {
        let mut a = [[0.0; 6]; 6];
        for (i, row) in a.iter_mut().enumerate() {
            row[i] = damping;
        }
        for column in columns {
            for (i, row) in a.iter_mut().enumerate() {
                for j in 0..=i {
                    row[j] += column[i] * column[j];
                }
            }
        }
        let mut inverse = [0.0; 6];
        for j in 0..6 {
            let squares: f64 = a[j][..j].iter().map(|x| x * x).sum();
            // Damping keeps it above zero; rounding could not take away more than it adds.
            let diagonal = (a[j][j] - squares).max(f64::MIN_POSITIVE).sqrt();
            inverse[j] = 1.0 / diagonal;
            for i in j + 1..6 {
                let (upper, below) = a.split_at_mut(i);
                let products: f64 =
                    upper[j][..j].iter().zip(&below[0][..j]).map(|(x, y)| x * y).sum();
                below[0][j] = (below[0][j] - products) * inverse[j];
            }
        }
        Self { lower: a, inverse }
    }

    /// Solution for the right side `b`.
    #[inline]
    pub(super) fn solve(&self, b: &[f64; 6]) -> [f64; 6] {
        let mut x = *b;
        for i in 0..6 {
            let known: f64 = (0..i).map(|j| self.lower[i][j] * x[j]).sum();
            x[i] = (x[i] - known) * self.inverse[i];
        }
        for i in (0..6).rev() {
            let known: f64 = (i + 1..6).map(|j| self.lower[j][i] * x[j]).sum();
            x[i] = (x[i] - known) * self.inverse[i];
        }
        x
    }
}

/// Scalar product.
#[inline]
pub(super) fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_solves_the_equations() {
        let columns: Vec<[f64; 6]> = (0_u32..7)
            .map(|k| std::array::from_fn(|i| (f64::from(k) * 1.7 + i as f64 * 2.3).sin()))
            .collect();
        let b = [1.0, -2.0, 0.5, 3.0, -1.0, 0.2];
        let x = Factored::of(columns.iter(), 1e-3).solve(&b);
        for i in 0..6 {
            let product: f64 = columns.iter().map(|column| column[i] * dot(column, &x)).sum();
            assert!((product + 1e-3 * x[i] - b[i]).abs() < 1e-12, "row {i}");
        }
    }

    #[test]
    fn rows_without_columns_stay_bounded() {
        let x = Factored::of([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]].iter(), 1e-9).solve(&[1.0; 6]);
        assert!((x[0] - 1.0 / (1.0 + 1e-9)).abs() < 1e-15 && (x[5] - 1e9).abs() < 1e-3, "{x:?}");
    }
}
