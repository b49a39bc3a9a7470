//! Least squares on subsets of many columns: adding a column to a subset costs a row of the Cholesky factor of their cosines, so that all subsets of two
//! or three of a hundred columns are gone through in no time.

use nalgebra::DMatrix;

use super::fit::{inner, sum_of_squares};

/// Columns are collinear if the determinant of their cosines is below this: of two, the squared sine.
const LEAST_ANGLE: f64 = 1e-3;

/// Some of many unit columns, with the least squares on them. An empty one grows by [`with`](Self::with).
#[derive(Default)]
pub(super) struct Subset {
    /// Indices of the columns, in rising order.
    pub(super) members: Vec<usize>,
    /// Lower triangle of the factor.
    rows: Vec<Vec<f64>>,
    /// The factor's lower triangle solved for the right side.
    lower: Vec<f64>,
    /// Determinant of the cosines.
    determinant: f64,
    /// Fall of χ².
    pub(super) gain: f64,
}

impl Subset {
    /// The subset with column `k`, whose inner product with what is to be explained is `right`; none if the columns are collinear.
    pub(super) fn with(&self, k: usize, cosines: &DMatrix<f64>, right: f64) -> Option<Self> {
        let mut row: Vec<f64> = Vec::with_capacity(self.members.len() + 1);
        for (i, own) in self.members.iter().enumerate() {
            row.push((cosines[(*own, k)] - inner(&self.rows[i][..i], &row)) / self.rows[i][i]);
        }
        let square = 1.0 - sum_of_squares(&row);
        let determinant = square * if self.members.is_empty() { 1.0 } else { self.determinant };
        if determinant < LEAST_ANGLE {
            return None;
        }
        let lower = (right - inner(&row, &self.lower)) / square.sqrt();
        row.push(square.sqrt());
        let and = |all: &[f64], last: f64| all.iter().copied().chain([last]).collect();
        Some(Self {
            members: self.members.iter().copied().chain([k]).collect(),
            rows: self.rows.iter().cloned().chain([row]).collect(),
            lower: and(&self.lower, lower),
            determinant,
            gain: self.gain + lower * lower,
        })
    }

    /// The weights of its columns.
    pub(super) fn weights(&self) -> Vec<f64> {
        let n = self.members.len();
        let mut weights = self.lower.clone();
        for i in (0..n).rev() {
            for j in i + 1..n {
                weights[i] -= self.rows[j][i] * weights[j];
            }
            weights[i] /= self.rows[i][i];
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn a_subset_has_the_gain_and_the_weights_of_least_squares() {
        let columns: Vec<DVector<f64>> = (0..4)
            .map(|k| DVector::from_fn(30, |at, _| ((1.0 + k as f64) * at as f64 * 0.2 + k as f64).sin()).normalize())
            .collect();
        let aim = DVector::from_fn(30, |at, _| (at as f64).cos() + 0.1 * at as f64);
        let cosines = DMatrix::from_fn(4, 4, |i, j| columns[i].dot(&columns[j]));
        let start = Subset::default();
        let subset = [0, 2, 3].iter().try_fold(start, |subset, k| subset.with(*k, &cosines, columns[*k].dot(&aim))).unwrap();
        let matrix = DMatrix::from_columns(&[columns[0].clone(), columns[2].clone(), columns[3].clone()]);
        let direct = (matrix.transpose() * &matrix).lu().solve(&(matrix.transpose() * &aim)).unwrap();
        assert!(
            subset.weights().iter().zip(direct.iter()).all(|(a, b)| (a - b).abs() < 1e-12),
            "{:?} {direct}",
            subset.weights()
        );
        let fall = aim.norm_squared() - (&aim - matrix * direct).norm_squared();
        assert!((subset.gain - fall).abs() < 1e-12 * fall, "{} {fall}", subset.gain);
        // The same column twice.
        assert!(subset.with(2, &cosines, 0.0).is_none());
    }
}
