//! Directions of residuals: those that a model's coordinates reach, and what is orthogonal to them.

use nalgebra::DVector;

use super::fit::Derivatives;

/// Orthonormal basis of derivatives.
pub fn tangents(derivatives: &Derivatives) -> Vec<DVector<f64>> {
    let mut orthonormal: Vec<DVector<f64>> = Vec::new();
    for column in derivatives.iter().map(|column| DVector::from_vec(column.concat())) {
        let rest = without_directions(&orthonormal, &column);
        let left = rest.norm();
        if left > 1e-6 * column.norm() && left > 0.0 {
            orthonormal.push(rest / left);
        }
    }
    orthonormal
}

/// The part of a vector that is orthogonal to orthonormal ones.
pub fn without_directions(unit: &[DVector<f64>], vector: &DVector<f64>) -> DVector<f64> {
    let mut rest = vector.clone();
    for direction in unit {
        let along = direction.dot(&rest);
        rest.axpy(-along, direction, 1.0);
    }
    rest
}
