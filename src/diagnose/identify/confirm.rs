//! A constant set that is simulated again and again, so that what it is said to meet it does meet.
//!
//! Quadratic models say which constants are likely; over wide regions their scatter hides what they lack. Hence the most likely points, and the best of all
//! that were simulated, are run as ensembles of points close by. If none has means near every number, and there are few numbers, CMA-ES searches on with the means of such
//! ensembles.

use std::sync::Mutex;

use cmaes::{CMAESOptions, DVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ContinuousCDF, Normal};

use super::constants::Point;
use super::{MISSING, POPULATION, Run, Search, clamped};
use crate::experiment::Spread;

/// Members of an ensemble, and the standard deviation of their coordinates.
const MEMBERS: usize = 8;
const JITTER: f64 = 0.002;
/// Points that are confirmed.
const POINTS: usize = 12;
/// Probability with which noise alone leaves all means within the distance up to which they meet their numbers.
const MET: f64 = 0.95;
/// Combinations from which means are searched at most.
const STARTS: usize = 3;
/// Most simulations of a search by means.
const MOST_RUNS: usize = 11_520;
/// Generations below which that search is not begun: it is for few numbers, which quadratic models with scatter can all meet in many ways.
const LEAST_GENERATIONS: usize = 12;

/// A point with the spread of every fitted number over its ensemble.
#[derive(Debug, Clone)]
pub(super) struct Confirmed {
    pub point: Point,
    pub spreads: Vec<Option<Spread>>,
}

/// Distance (standard deviations) up to which a mean meets its number, one of `numbers` (each as often as all together ask for; Šidák 1967): 1.96 for one, 2.57 for five, 2.93 for fifteen.
pub(super) fn met(numbers: usize) -> f64 {
    Normal::standard().inverse_cdf(0.5 + 0.5 * MET.powf(1.0 / numbers as f64))
}

impl Confirmed {
    /// Distance of number `at` from the mean over the standard deviation of the measurement and `share` of the members' variance.
    fn distance(&self, search: &Search, at: usize, share: f64) -> f64 {
        let (value, sigma) = search.observed[at];
        self.spreads[at].map_or(MISSING, |spread| (value - spread.mean) / sigma.hypot(share.sqrt() * spread.sd))
    }

    /// The same over the standard deviation of both: the measured number is one run, which scatters as the members do.
    pub fn off(&self, search: &Search, at: usize) -> f64 {
        self.distance(search, at, 1.0 + 1.0 / MEMBERS as f64)
    }

    /// The same over that of the mean alone, which finds constants whose motion does not scatter.
    fn off_mean(&self, search: &Search, at: usize) -> f64 {
        self.distance(search, at, 1.0 / MEMBERS as f64)
    }

    pub fn meets(&self, search: &Search, at: usize) -> bool {
        self.off(search, at).abs() <= met(search.fitted.len())
    }

    pub fn meets_all(&self, search: &Search) -> bool {
        (0..search.fitted.len()).all(|at| self.meets(search, at))
    }

    /// Whether every mean, scatter aside, is as near as noise leaves all of them.
    fn is_near(&self, search: &Search) -> bool {
        (0..search.fitted.len()).all(|at| self.off_mean(search, at).abs() <= met(search.fitted.len()))
    }

    fn misfit(&self, search: &Search) -> f64 {
        (0..search.fitted.len()).map(|at| self.off_mean(search, at).powi(2)).sum()
    }
}

impl Search<'_> {
    /// Runs the ensemble of a point.
    fn confirm(&self, point: &Point, random: &mut ChaCha8Rng) -> Confirmed {
        let mut member = |index: usize| {
            let mut near = |x: &f64| {
                let z: f64 = StandardNormal.sample(random);
                if index == 0 { *x } else { (x + JITTER * z).clamp(0.0, 1.0) }
            };
            Point { level: point.level, x: point.x.iter().map(&mut near).collect() }
        };
        let runs = self.evaluate((0..MEMBERS).map(&mut member).collect());
        let spread = |at: usize| {
            let values: Vec<f64> = runs.iter().filter_map(|run| run.values[at]).collect();
            (2 * values.len() > MEMBERS).then(|| Spread::of(&values))
        };
        Confirmed { point: point.clone(), spreads: (0..self.fitted.len()).map(spread).collect() }
    }

    /// The point whose ensemble is closest to the numbers: one of the `likely`, of the best `runs`, or of a search from there.
    pub(super) fn confirmed(&self, likely: impl Iterator<Item = Point>, runs: &[Run]) -> Option<Confirmed> {
        let mut sorted: Vec<&Run> = runs.iter().collect();
        let score = |run: &Run| Search::score(&self.observed, &run.values);
        sorted.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let points: Vec<Point> = likely.chain(sorted.iter().map(|run| run.point.clone())).take(POINTS).collect();
        let mut random = self.random(0, 800);
        let mut all: Vec<Confirmed> = points.iter().map(|point| self.confirm(point, &mut random)).collect();
        all.sort_by(|a, b| a.misfit(self).total_cmp(&b.misfit(self)));
        let mut best = all.first()?.clone();
        let generations = MOST_RUNS / (POPULATION * MEMBERS * self.fitted.len());
        if best.point.x.is_empty() || generations < LEAST_GENERATIONS {
            return Some(best);
        }
        // From the best of every combination.
        let mut levels = Vec::new();
        all.retain(|one| {
            let is_first = !levels.contains(&one.point.level);
            levels.push(one.point.level);
            is_first
        });
        for start in all.iter().take(STARTS) {
            if best.is_near(self) {
                break;
            }
            let found = self.search_by_means(start, generations);
            if found.misfit(self) < best.misfit(self) {
                best = found;
            }
        }
        Some(best)
    }

    /// CMA-ES from a point on the distance of ensembles.
    fn search_by_means(&self, from: &Confirmed, generations: usize) -> Confirmed {
        let level = from.point.level;
        let best = Mutex::new(from.clone());
        let objective = |x: &DVector<f64>| {
            let (inside, penalty) = clamped(x.as_slice());
            // The same perturbations at every point, whatever the order of threads.
            let confirmed = self.confirm(&Point { level, x: inside }, &mut self.random(level, 801));
            let misfit = confirmed.misfit(self);
            let mut best = best.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let there = (misfit, &confirmed.point.x);
            let here = (best.misfit(self), &best.point.x);
            if there.0.total_cmp(&here.0).then_with(|| there.1.partial_cmp(here.1).unwrap_or(std::cmp::Ordering::Equal)).is_lt() {
                *best = confirmed;
            }
            misfit + penalty
        };
        let options = CMAESOptions::new(from.point.x.clone(), 0.08)
            .population_size(POPULATION)
            .max_generations(generations)
            .fun_target(0.5 * self.fitted.len() as f64)
            .seed(self.seed);
        if let Ok(mut search) = options.build(objective) {
            search.run_parallel();
        }
        best.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::met;

    /// Of the standard normal distribution: Φ(1.96) = 0.975, and Φ(2.5688) = 1 − (1 − 0.95^(1/5))/2.
    #[test]
    fn more_numbers_may_be_further_off() {
        assert!((met(1) - 1.959_964).abs() < 1e-6 && (met(5) - 2.5688).abs() < 1e-3, "{} {}", met(1), met(5));
    }
}
