//! Identification of constants from single measured numbers at many settings, as the speeds of a walking robot over frequency.
//!
//! The path, for every combination of the constants that have only some values:
//!
//! 1. *Globally*: runs scattered over all ranges, then CMA-ES (Hansen and Ostermeier 2001) on a sum of ln(1 + r²/2s²), which counts the numbers that are met and does not
//!    care by how much others are missed: chaos may spoil some. s is the number's standard deviation and a fifth of the rms of its measure: with the first alone the sum is
//!    rugged, for small speeds are known to small errors, and all but the right constants miss them by far.
//! 2. *Locally*, in waves: runs scattered over a region, quadratic models with the scatter about them, the region in which their likelihood is not negligible, again,
//!    until it shrinks no more (history matching; Craig et al. 1997). While even the best misses the numbers, χ² per degree of freedom above one, less is excluded
//!    by that factor.
//! 3. If the best misses the numbers by more than noise does once in a thousand, the basin was wrong: both again, CMA-ES from elsewhere. If it still does, there are no ranges.
//! 4. Waves with a quarter of the time step, from where those of before ended: what long steps do to the numbers is nothing that constants should make up for.
//! 5. The best points are confirmed by ensembles of runs.
//! 6. Ranges by the profile likelihood, ties by the information matrix, what decides and what the rest foretells by leaving out each number, and which setting
//!    of a similar measurement would be worth most.

mod confirm;
mod constants;
mod emulator;
#[cfg(feature = "view")]
mod page;
mod profile;
mod region;
mod results;

pub(in crate::diagnose) use constants::Space;
pub use constants::{Identify, Searched};
#[cfg(feature = "view")]
pub use page::page;
pub use results::{Corner, Fact, Identification, Identified, Listed, Proposal};

use std::sync::{Mutex, PoisonError};

use cmaes::{CMAESOptions, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use self::constants::Point;
use self::emulator::{Emulator, Surface, coefficients};
use self::profile::Likelihood;
use self::region::Region;
use super::DiagnoseError;
use super::dataset::{Dataset, Observation};
use crate::experiment::Config;

/// Scattered runs per constant and one more, of every combination.
const SCATTERED: usize = 24;
/// Runs in a generation of CMA-ES, and generations.
const POPULATION: usize = 12;
const GENERATIONS: usize = 12;
/// Searches at most, each from another start.
const SEARCHES: u64 = 3;
/// Starts of CMA-ES differ by this much in one coordinate at least: twice its first standard deviation.
const APART: f64 = 0.3;
/// First standard deviation of CMA-ES.
const FIRST_STEP: f64 = 0.15;
/// Combinations go on whose best point is this much above the best of all.
const HOPEFUL: f64 = 8.0;
/// Points up to this much above the best of a combination make its first region.
const NEAR: f64 = 3.0;
/// Share of a measure's rms that the search everywhere adds to the standard deviations.
const COARSE: f64 = 0.2;
/// Rise of −2 ln L at the edge of the next region: five standard deviations of a single constant.
const KEPT: f64 = 25.0;
/// Runs per coefficient of the quadratic models in a wave, at least so many in all, and waves at most.
const RUNS_PER_COEFFICIENT: usize = 8;
const LEAST_RUNS: usize = 90;
const WAVES: u64 = 10;
/// Waves after which a combination is left that misses the numbers where another one meets them.
const TRIALS: u64 = 3;
/// A region that shrinks to no less than this share is the last.
const SETTLED: f64 = 0.7;
/// Divisor of the time step in the last waves, which cost as much more, and their runs per coefficient.
const FINER: u64 = 4;
const FINE_RUNS_PER_COEFFICIENT: usize = 6;
/// Probability of a smaller χ² by noise alone, up to which the numbers are met.
const NOISE: f64 = 0.999;
/// Residual (σ) of a number that no run gives.
const MISSING: f64 = 50.0;

/// A point with what every observation would be there.
#[derive(Debug, Clone)]
struct Run {
    point: Point,
    values: Vec<Option<f64>>,
}

/// Which waves: of a combination, in which search, with time steps divided by what, and whether another combination meets the numbers already.
struct Stage {
    level: usize,
    search: u64,
    finer: u64,
    is_met_elsewhere: bool,
}

/// The search at work.
struct Search<'a> {
    nominal: &'a Config,
    space: &'a Space,
    /// The observations that are fitted.
    fitted: Vec<&'a Observation>,
    /// Their values and standard deviations.
    observed: Vec<(f64, f64)>,
    /// The same, with the standard deviations of the search everywhere.
    coarse: Vec<(f64, f64)>,
    seed: u64,
    /// The current task, ...
    task: Mutex<String>,
    /// ... and who hears of it, once more with every simulation: whoever wants the work to end can end it there.
    progress: &'a (dyn Fn(&str) + Sync),
}

/// What was found for one combination of values.
struct Found {
    level: usize,
    emulator: Emulator,
    /// The likeliest coordinates, and −2 ln L there.
    best: (Vec<f64>, f64),
    /// False if the region still changed in the last wave.
    is_settled: bool,
    /// What every number is more with finer steps, if there were waves with them.
    moved: Vec<Option<f64>>,
}

/// Coordinates of a search without bounds within 0 to 1, and what is added to its objective for those beyond.
fn clamped(x: &[f64]) -> (Vec<f64>, f64) {
    let inside: Vec<f64> = x.iter().map(|x| x.clamp(0.0, 1.0)).collect();
    let outside: f64 = x.iter().zip(&inside).map(|(x, inside)| (x - inside).powi(2)).sum();
    (inside, 100.0 * outside)
}

/// Identifies the constants of `[identify]` from the data set's observations.
///
/// # Errors
/// [`DiagnoseError`] if no run of the search gives the measured numbers.
pub fn identify(dataset: &Dataset, progress: &(dyn Fn(&str) + Sync)) -> Result<Identification, DiagnoseError> {
    let Some((identify, space)) = &dataset.identify else { return Err("the data set has no [identify]".into()) };
    let fitted: Vec<&Observation> = dataset.observations.iter().filter(|observation| !observation.is_foretold()).collect();
    let observed = fitted.iter().map(|observation| (observation.value, observation.sigma)).collect();
    let coarse = |observation: &&Observation| {
        let alike: Vec<f64> =
            fitted.iter().filter(|other| other.measure == observation.measure).map(|other| other.value).collect();
        let rms = (alike.iter().map(|value| value * value).sum::<f64>() / alike.len() as f64).sqrt();
        (observation.value, observation.sigma.hypot(COARSE * rms))
    };
    let coarse = fitted.iter().map(coarse).collect();
    let task = Mutex::default();
    let search = Search { nominal: &dataset.nominal, space, fitted, observed, coarse, seed: identify.seed, task, progress };
    let mut runs = Vec::new();
    let mut found: Vec<Found> = Vec::new();
    let mut starts = Vec::new();
    for at in 0..SEARCHES {
        let mut hopeful = Vec::new();
        for level in 0..space.levels.len() {
            search.begin(format!("searching everywhere, {} of {}", level + 1, space.levels.len()));
            let first = runs.len();
            search.everywhere(level, at, &mut runs, &mut starts);
            let scores: Vec<f64> = runs[first..].iter().map(|run| search.coarse_score(run)).collect();
            let best = scores.iter().copied().fold(f64::INFINITY, f64::min);
            let near = runs[first..].iter().zip(&scores).filter(|(_, score)| **score <= best + NEAR);
            hopeful.extend(Region::around(near.map(|(run, _)| &run.point.x[..]), 0.1, 0.06).map(|region| (best, level, region)));
        }
        let best = runs.iter().map(|run| search.coarse_score(run)).fold(f64::INFINITY, f64::min);
        hopeful.retain(|(score, ..)| *score <= best + HOPEFUL);
        hopeful.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, level, region) in hopeful {
            let is_met = found.iter().any(|found| search.is_met(found));
            found.extend(search.closely(&Stage { level, search: at, finer: 1, is_met_elsewhere: is_met }, region, &mut runs));
        }
        found.sort_by(|a, b| a.best.1.total_cmp(&b.best.1));
        if space.constants.is_empty() || found.first().is_some_and(|best| search.is_met(best)) {
            break;
        }
    }
    let least = found.first().map_or(f64::INFINITY, |best| best.best.1);
    let mut fine = Vec::new();
    for found in found.iter_mut().filter(|found| found.best.1 <= least + KEPT) {
        search.finely(found, &mut fine);
    }
    found.sort_by(|a, b| a.best.1.total_cmp(&b.best.1));
    results::results(&search, dataset, &found, &runs, fine.len())
}

impl Search<'_> {
    /// Says what is done from now on.
    fn begin(&self, task: String) {
        (self.progress)(&task);
        *self.task.lock().unwrap_or_else(PoisonError::into_inner) = task;
    }

    /// What an observation would be at a point, with time steps divided by `finer`.
    fn predict(&self, observation: &Observation, point: &Point, finer: u64) -> Option<f64> {
        let task = self.task.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (self.progress)(&task);
        self.space.predict(self.nominal, observation, point, finer)
    }

    /// What every fitted observation would be at the points, in parallel.
    fn evaluate(&self, points: Vec<Point>) -> Vec<Run> {
        self.evaluate_with(points, 1)
    }

    /// The same with time steps divided by `finer`.
    fn evaluate_with(&self, points: Vec<Point>, finer: u64) -> Vec<Run> {
        let run = |point: Point| {
            let predict = |observation: &&Observation| self.predict(observation, &point, finer);
            let values = self.fitted.par_iter().map(predict).collect();
            Run { point, values }
        };
        points.into_par_iter().with_max_len(1).map(run).collect()
    }

    /// Σ ln(1 + r²/2), r the residual over the standard deviation of the `numbers`.
    fn score(numbers: &[(f64, f64)], values: &[Option<f64>]) -> f64 {
        let of = |(predicted, (value, sigma)): (&Option<f64>, &(f64, f64))| {
            let residual = predicted.map_or(MISSING, |predicted| (predicted - value) / sigma);
            (0.5 * residual * residual).ln_1p()
        };
        values.iter().zip(numbers).map(of).sum()
    }

    fn coarse_score(&self, run: &Run) -> f64 {
        Self::score(&self.coarse, &run.values)
    }

    /// χ² per degree of freedom, and the degrees.
    fn reduced_chi2(&self, emulator: &Emulator, x: &[f64]) -> (f64, f64) {
        let likelihood = Likelihood { emulator, observed: &self.observed, without: None };
        let (chi2, count) = likelihood.chi2(x);
        let freedom = count.saturating_sub(self.space.constants.len()).max(1) as f64;
        (chi2 / freedom, freedom)
    }

    /// Whether what was found meets the numbers but for noise and scatter.
    fn is_met(&self, found: &Found) -> bool {
        let (chi2, freedom) = self.reduced_chi2(&found.emulator, &found.best.0);
        ChiSquared::new(freedom).is_ok_and(|of_noise| chi2 * freedom <= of_noise.inverse_cdf(NOISE))
    }

    fn random(&self, level: usize, stage: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(1000 * level as u64 + stage);
        random
    }

    /// Adds runs scattered over all ranges, and those of CMA-ES from the best run that is apart from all `starts`.
    fn everywhere(&self, level: usize, search: u64, runs: &mut Vec<Run>, starts: &mut Vec<Point>) {
        let constants = self.space.constants.len();
        if constants == 0 {
            return runs.extend(self.evaluate(vec![Point { level, x: Vec::new() }]));
        }
        let mut random = self.random(level, 100 * search);
        let scattered = Region::whole(constants).scattered(SCATTERED * (constants + 1), &mut random);
        runs.extend(self.evaluate(scattered.into_iter().map(|x| Point { level, x }).collect()));
        let is_apart = |x: &[f64], start: &Point| x.iter().zip(&start.x).any(|(a, b)| (a - b).abs() > APART);
        let is_free = |run: &&Run| {
            run.point.level == level && starts.iter().all(|start| start.level != level || is_apart(&run.point.x, start))
        };
        let by_score = |a: &&Run, b: &&Run| self.coarse_score(a).total_cmp(&self.coarse_score(b));
        let Some(start) = runs.iter().filter(is_free).min_by(by_score).map(|run| run.point.clone()) else { return };
        let seen = Mutex::new(Vec::new());
        let objective = |x: &DVector<f64>| {
            let (inside, penalty) = clamped(x.as_slice());
            let run = self.evaluate(vec![Point { level, x: inside }]).remove(0);
            let score = self.coarse_score(&run) + penalty;
            seen.lock().unwrap_or_else(PoisonError::into_inner).push(run);
            score
        };
        let options = CMAESOptions::new(start.x.clone(), FIRST_STEP)
            .population_size(POPULATION)
            .max_generations(GENERATIONS)
            .seed(self.seed);
        if let Ok(mut search) = options.build(objective) {
            search.run_parallel();
        }
        let mut seen = seen.into_inner().unwrap_or_else(PoisonError::into_inner);
        // In an order that does not depend on threads.
        let compare = |a: &Run, b: &Run| a.point.x.iter().zip(&b.point.x).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
        seen.sort_by(|a, b| compare(a, b).unwrap_or(std::cmp::Ordering::Equal));
        starts.push(start);
        starts.extend(seen.iter().min_by(by_score).map(|run| run.point.clone()));
        runs.extend(seen);
    }

    /// Waves with finer steps from where the others ended.
    fn finely(&self, found: &mut Found, runs: &mut Vec<Run>) {
        let region = found.emulator.region.clone();
        let stage = Stage { level: found.level, search: SEARCHES, finer: FINER, is_met_elsewhere: false };
        let Some(mut fine) = self.closely(&stage, region, runs) else { return };
        let before = &found.emulator;
        let moved = |(fine_surface, surface): (&Option<Surface>, &Option<Surface>)| {
            let x = &fine.best.0;
            Some(fine.emulator.at(fine_surface.as_ref()?, x).0 - before.at(surface.as_ref()?, x).0)
        };
        fine.moved = fine.emulator.surfaces.iter().zip(&before.surfaces).map(moved).collect();
        *found = fine;
    }

    /// Waves of runs in ever smaller regions around the likely points, at most a few if they miss the numbers and another combination meets them; `None` if they
    /// give no measures.
    fn closely(&self, stage: &Stage, mut region: Region, runs: &mut Vec<Run>) -> Option<Found> {
        let Stage { level, search, finer, is_met_elsewhere } = *stage;
        let constants = self.space.constants.len();
        let mut found = None;
        for wave in 1..=WAVES {
            let steps = if finer > 1 { " with finer steps" } else { "" };
            self.begin(format!("wave {wave}{steps} around the best, {} runs so far", runs.len()));
            let count = match finer {
                1 => LEAST_RUNS.max(RUNS_PER_COEFFICIENT * coefficients(constants)),
                _ => FINE_RUNS_PER_COEFFICIENT * coefficients(constants),
            };
            let inside = runs.iter().filter(|run| run.point.level == level && region.holds(&run.point.x)).count();
            let fresh =
                region.scattered(count.saturating_sub(inside).max(count / 2), &mut self.random(level, 100 * search + wave));
            runs.extend(self.evaluate_with(fresh.into_iter().map(|x| Point { level, x }).collect(), finer));
            let own = || runs.iter().filter(|run| run.point.level == level);
            let emulator = Emulator::fit(region.clone(), own().map(|run| (&run.point.x[..], &run.values[..])), self.fitted.len());
            let likelihood = Likelihood { emulator: &emulator, observed: &self.observed, without: None };
            // From the best runs within the region.
            let mut starts: Vec<&Run> = own().filter(|run| region.holds(&run.point.x)).collect();
            starts.sort_by(|a, b| likelihood.misfit(&a.point.x).total_cmp(&likelihood.misfit(&b.point.x)));
            let best = likelihood.best(starts.iter().take(6).map(|run| run.point.x.clone()))?;
            let kept = KEPT * self.reduced_chi2(&emulator, &best.0).0.max(1.0);
            let ends: Vec<_> = (0..constants).flat_map(|at| likelihood.range(&best, at, kept)).collect();
            let mut next = Region::around(ends.iter().map(|end| &end.x[..]), 0.1, 0.0)?;
            let mut is_wider = false;
            for (at, pair) in ends.chunks_exact(2).enumerate() {
                let width = region.high[at] - region.low[at];
                // The likely points go on beyond the region.
                if pair[0].is_edge && region.low[at] > 0.0 {
                    (next.low[at], is_wider) = ((region.low[at] - 0.4 * width).max(0.0), true);
                }
                if pair[1].is_edge && region.high[at] < 1.0 {
                    (next.high[at], is_wider) = ((region.high[at] + 0.4 * width).min(1.0), true);
                }
            }
            let is_settled = !is_wider && next.volume() > SETTLED * region.volume();
            let there = Found { level, emulator, best, is_settled, moved: Vec::new() };
            let is_left = is_met_elsewhere && wave >= TRIALS && !self.is_met(&there);
            found = Some(there);
            if is_settled || is_left || constants == 0 {
                break;
            }
            region = next;
        }
        found
    }
}
