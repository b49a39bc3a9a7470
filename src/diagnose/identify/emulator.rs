//! Quadratic models of predictions over a region of the search, with the scatter about them.
//!
//! Contact makes predictions rough: a measure y(x) is a smooth function and a scatter that no small change of the constants repeats. Over a region
//!
//! ```text
//! y_j(x) = a_j + b_j·u + u·C_j u + e_j,   e_j of standard deviation s_j,   u = (x − centre)/half width
//! ```
//!
//! fitted by least squares to runs at scattered points (response surface methodology; Box and Wilson 1951). s_j holds what the quadratic lacks as well, so wide regions
//! decide little.

use nalgebra::{DMatrix, DVector};

use super::region::Region;

/// Fewest runs per coefficient.
const RUNS_PER_COEFFICIENT: f64 = 1.6;

/// The quadratic model of one observation.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    coefficients: DVector<f64>,
    /// Scatter about the model, with the uncertainty of the model's mean (the measure's unit).
    pub scatter: f64,
}

/// The models of all observations over a region; `None` for one that too few runs have.
#[derive(Debug, Clone)]
pub(super) struct Emulator {
    pub region: Region,
    pub surfaces: Vec<Option<Surface>>,
}

/// 1, u_i, u_i u_k.
fn terms(u: &[f64]) -> Vec<f64> {
    let pairs = (0..u.len()).flat_map(|i| (0..=i).map(move |k| (i, k)));
    std::iter::once(1.0).chain(u.iter().copied()).chain(pairs.map(|(i, k)| u[i] * u[k])).collect()
}

/// Number of coefficients over `constants` coordinates.
pub(super) fn coefficients(constants: usize) -> usize {
    1 + constants + constants * (constants + 1) / 2
}

impl Emulator {
    /// Fits the models to the `runs` (coordinates, predictions) that lie in the region.
    pub fn fit<'a>(region: Region, runs: impl Iterator<Item = (&'a [f64], &'a [Option<f64>])>, observations: usize) -> Self {
        let inside: Vec<(Vec<f64>, &[Option<f64>])> =
            runs.filter(|(x, _)| region.holds(x)).map(|(x, values)| (terms(&region.scaled(x)), values)).collect();
        let surface = |observation: usize| {
            let there: Vec<(&Vec<f64>, f64)> =
                inside.iter().filter_map(|(terms, values)| Some((terms, values[observation]?))).collect();
            let (rows, columns) = (there.len(), coefficients(region.low.len()));
            if (rows as f64) < RUNS_PER_COEFFICIENT * columns as f64 || 2 * rows < inside.len() {
                return None;
            }
            let a = DMatrix::from_fn(rows, columns, |row, column| there[row].0[column]);
            let y = DVector::from_fn(rows, |row, _| there[row].1);
            let coefficients = a.clone().svd(true, true).solve(&y, 1e-9).ok()?;
            let squares = (&y - a * &coefficients).norm_squared();
            let scatter = (squares / (rows - columns) as f64 * (1.0 + columns as f64 / rows as f64)).sqrt();
            Some(Surface { coefficients, scatter })
        };
        let surfaces = (0..observations).map(surface).collect();
        Self { region, surfaces }
    }

    /// The model's value for an observation, and its derivatives by the coordinates.
    pub fn at(&self, surface: &Surface, x: &[f64]) -> (f64, Vec<f64>) {
        let u = self.region.scaled(x);
        let c = &surface.coefficients;
        let value = terms(&u).iter().zip(c.iter()).map(|(term, c)| term * c).sum();
        let mut slopes: Vec<f64> = (0..u.len()).map(|i| c[1 + i]).collect();
        let mut at = 1 + u.len();
        for i in 0..u.len() {
            for k in 0..=i {
                slopes[i] += c[at] * u[k];
                slopes[k] += c[at] * u[i];
                at += 1;
            }
        }
        slopes.iter_mut().zip(&self.region.half_widths()).for_each(|(slope, half)| *slope /= half);
        (value, slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_with_scatter_is_found_with_its_slopes() {
        let region = Region { low: vec![0.2, 0.1], high: vec![0.6, 0.9] };
        let y = |x: &[f64]| 3.0 - 2.0 * x[0] + 4.0 * x[0] * x[1] + x[1] * x[1];
        // A rank-1 lattice and a scatter of ±0.01.
        let runs: Vec<(Vec<f64>, Vec<Option<f64>>)> = (0..60)
            .map(|i| {
                let x = vec![0.2 + 0.4 * (f64::from(i) / 60.0), 0.1 + 0.8 * ((f64::from(i) * 0.618_034) % 1.0)];
                let value = y(&x) + if i % 2 == 0 { 0.01 } else { -0.01 };
                (x, vec![Some(value), (i < 20).then_some(value)])
            })
            .collect();
        let emulator = Emulator::fit(region, runs.iter().map(|(x, y)| (&x[..], &y[..])), 2);
        let surface = emulator.surfaces[0].as_ref().unwrap();
        let (value, slopes) = emulator.at(surface, &[0.4, 0.5]);
        // ±0.01 of 60 runs, six coefficients: 0.01 √(6/60) in the mean.
        assert!((value - y(&[0.4, 0.5])).abs() < 0.01, "{value}");
        assert!((slopes[0] - 0.0).abs() < 0.1 && (slopes[1] - 2.6).abs() < 0.1, "{slopes:?}");
        assert!((surface.scatter / 0.01 - 1.0).abs() < 0.2, "{}", surface.scatter);
        assert!(emulator.surfaces[1].is_none(), "a third of the runs is too few");
    }
}
