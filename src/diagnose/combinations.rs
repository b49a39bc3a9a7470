//! What parameters determine together that the data hardly tell apart.

use nalgebra::DMatrix;
use serde::Serialize;

use super::DiagnoseError;
use super::fit::coordinates;
use super::names;
use super::plant::{Free, Model, Plant, Term};
use super::search::{Scored, Search, covariance};
use crate::number::significant;

/// Parameters are hardly told apart if their estimates are correlated by more than this.
pub(super) const CORRELATED: f64 = 0.95;
/// A combination is determined if its standard error is at most this share of that of either parameter.
const DETERMINED: f64 = 0.2;
/// A power this near to −1 or 1 makes a ratio or a product, a factor a difference or a sum.
const NEAR_ONE: f64 = 0.1;

/// A combination of two parameters that is determined where each alone is not: `a·bᵖ` of factors, `a + p·b` of values of one unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Combination {
    /// The two, as cause and parameter.
    pub of: [String; 2],
    /// p.
    pub power: f64,
    /// Unit of the standard error; `%` for factors.
    pub unit: String,
    /// Standard error of the combination, ...
    pub error: f64,
    /// ... and of each alone.
    pub errors_alone: [f64; 2],
}

/// A coordinate of a model.
struct Coordinate<'a> {
    id: &'static str,
    free: &'a Free,
    x: f64,
}

impl Coordinate<'_> {
    /// Whether it is a factor, which has no effect at 1.
    fn is_factor(&self) -> bool {
        self.free.unit.is_empty() && self.free.off == Some(1.0) && self.x > 0.0
    }

    /// Standard errors per unit of the coordinate: in per cent of a factor, or in the parameter's unit.
    fn scale(&self) -> f64 {
        match self.is_factor() {
            true if self.free.inverse => -100.0 / self.x,
            true => 100.0 / self.x,
            false => 1.0,
        }
    }

    /// The unit in which the two can be combined, if they can.
    fn unit_with(&self, other: &Self) -> Option<&'static str> {
        if self.is_factor() && other.is_factor() {
            return Some("%");
        }
        let is_value = |c: &Self| c.free.off == Some(0.0) && !c.free.inverse && !c.free.unit.is_empty();
        (is_value(self) && is_value(other) && self.free.unit == other.free.unit).then_some(self.free.unit)
    }
}

impl Combination {
    /// The combination of `a` and `b` with the least variance, from the coordinates' `variances` and their `covariance`; none if it is no better known
    /// than either, or neither a ratio, a product, a sum nor a difference.
    fn of(a: &Coordinate, b: &Coordinate, variances: [f64; 2], covariance: f64) -> Option<Self> {
        let unit = a.unit_with(b)?;
        let (of_a, of_b) = (a.scale(), b.scale());
        let [first, second, both] = [variances[0] * of_a * of_a, variances[1] * of_b * of_b, covariance * of_a * of_b];
        let least = -both / second;
        let power = least.signum();
        // False for infinite variances, whose quotient is not a number.
        let is_simple = (least - power).abs() < NEAR_ONE;
        let error = (first + 2.0 * power * both + second).max(0.0).sqrt();
        let errors_alone = [first, second].map(f64::sqrt);
        let is_determined = is_simple && errors_alone.iter().all(|alone| error <= DETERMINED * alone);
        let of = [a, b].map(|c| format!("{} {}", c.id, c.free.name));
        is_determined.then(|| Self { of, power, unit: unit.into(), error, errors_alone })
    }

    /// In words: "bending stiffness over mass per area is known to 0.1 %, each alone is not".
    pub fn words(&self) -> String {
        let [a, b] =
            self.of.each_ref().map(|of| of.split_once(' ').map_or_else(|| of.clone(), |(id, name)| names::parameter(id, name)));
        let known = |error: f64| format!("{} {}", significant(1.96 * error, 2), self.unit);
        let both = match (self.unit == "%", self.power > 0.0) {
            (true, true) => format!("{a} times {b}"),
            (true, false) => format!("{a} over {b}"),
            (false, true) => format!("the sum of {a} and {b}"),
            (false, false) => format!("{a} less {b}"),
        };
        format!("{both} is known to {}, each alone is not", known(self.error))
    }
}

/// Combinations of parameters of `best` that are correlated, and of its causes with the terms that they are `tied` with.
///
/// # Errors
/// [`DiagnoseError`] if the model cannot be simulated.
pub(super) fn combinations(search: &Search, best: &Scored, tied: &[&Term]) -> Result<Vec<Combination>, DiagnoseError> {
    let mut found = among(search.estimator.plant, best.model(), &covariance(&best.fit.information));
    for other in tied {
        let mut model = best.model().clone();
        if model.terms.iter().any(|term| term.candidate == other.candidate) {
            continue;
        }
        // Beside the cause that it is tied with, without any effect.
        let parameters = &search.candidate(other).parameters;
        let x = other.x.iter().zip(parameters).map(|(x, p)| p.off.unwrap_or(*x)).collect();
        model.terms.push(Term { candidate: other.candidate, x });
        let information = search.estimator.information(&model, &search.split.fit)?;
        let with_other = among(search.estimator.plant, &model, &covariance(&information));
        found.extend(with_other.into_iter().filter(|c| c.of[1].starts_with(search.id(other.candidate))));
    }
    found.dedup_by(|a, b| a.of == b.of);
    Ok(found)
}

/// The combinations that a covariance of the coordinates determines.
fn among(plant: &dyn Plant, model: &Model, covariance: &DMatrix<f64>) -> Vec<Combination> {
    let of = |(term, parameter): (usize, usize)| {
        let Term { candidate, x } = &model.terms[term];
        let candidate = &plant.candidates()[*candidate];
        Coordinate { id: candidate.id, free: &candidate.parameters[parameter], x: x[parameter] }
    };
    let all: Vec<Coordinate> = coordinates(model).into_iter().map(of).collect();
    let pairs = (0..all.len()).flat_map(|k| (0..k).map(move |j| (j, k)));
    let combined = pairs.filter_map(|(j, k)| {
        let [own, other, both] = [covariance[(j, j)], covariance[(k, k)], covariance[(j, k)]];
        let is_correlated = both.abs() > CORRELATED * (own * other).sqrt();
        is_correlated.then(|| Combination::of(&all[j], &all[k], [own, other], both)).flatten()
    });
    combined.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALE: Free = Free { name: "scale", unit: "", off: Some(1.0), bounds: [0.1, 10.0], scale: 0.1, inverse: false };
    const DELAY: Free = Free { name: "delay_s", unit: "s", off: Some(0.0), bounds: [0.0, 0.1], scale: 1e-3, inverse: false };

    fn at(id: &'static str, free: &'static Free, x: f64) -> Coordinate<'static> {
        Coordinate { id, free, x }
    }

    /// Variances and covariance where `known` (gradient, standard error) and the second coordinate (standard error) are independent.
    fn from(known: [f64; 2], known_to: f64, second: f64) -> ([f64; 2], f64) {
        let [da, db] = known;
        // da a + db b = e, with b free: a = (e − db b)/da.
        let variance = (known_to.powi(2) + (db * second).powi(2)) / (da * da);
        ([variance, second * second], -db / da * second * second)
    }

    #[test]
    fn a_ratio_is_known_where_stiffness_and_mass_are_not() {
        let (stiffness, mass) = (at("stiffness", &SCALE, 1.2), at("areal-mass", &SCALE, 0.8));
        // ln stiffness − ln mass is known to 0.1 %, the mass to 10 % of 0.8.
        let (variances, covariance) = from([1.0 / 1.2, -1.0 / 0.8], 1e-3, 0.08);
        let found = Combination::of(&stiffness, &mass, variances, covariance).unwrap();
        assert_eq!(found.power, -1.0);
        assert!((found.error - 0.1).abs() < 1e-6 && (found.errors_alone[1] - 10.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.words(), "bending stiffness over mass per area is known to 0.20 %, each alone is not");
        // Each alone as well known as the ratio: nothing to say.
        let (variances, covariance) = from([1.0 / 1.2, -1.0 / 0.8], 0.03, 0.02);
        assert_eq!(Combination::of(&stiffness, &mass, variances, covariance), None);
        // stiffness/mass² is no ratio.
        let (variances, covariance) = from([1.0 / 1.2, -2.0 / 0.8], 1e-3, 0.08);
        assert_eq!(Combination::of(&stiffness, &mass, variances, covariance), None);
    }

    #[test]
    fn two_delays_are_known_as_their_sum() {
        let (first, second) = (at("time-delay", &DELAY, 0.004), at("sensor-delay", &DELAY, 0.0));
        let (variances, covariance) = from([1.0, 1.0], 5e-5, 2e-3);
        let found = Combination::of(&first, &second, variances, covariance).unwrap();
        assert!(found.power == 1.0 && (found.error - 5e-5).abs() < 1e-9 && found.unit == "s");
        let factor = at("stiffness", &SCALE, 1.0);
        assert_eq!(Combination::of(&first, &factor, variances, covariance), None);
    }
}
