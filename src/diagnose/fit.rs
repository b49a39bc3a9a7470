//! Bounded least squares by Levenberg and Marquardt, with derivatives by finite differences, in parallel over parameters and runs.
//!
//! ```text
//! χ² = Σ ((y − f(x))/σ)²        minimised over the coordinates x of all terms, within their bounds
//! ```
//!
//! Moments of jumps between rows belong to a run, not to the model ([`Plant::nuisances`]); they are fitted run by run between rounds of the
//! model's own parameters. Every sum runs in a fixed order, so results do not depend on the number of threads.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::plant::{Model, Plant};

/// Step of finite differences as a share of a parameter's scale.
const DIFFERENCE: f64 = 0.02;
/// A round ends when χ² falls by less than this share of the number of values, or by less than this share of itself.
const ENOUGH: f64 = 1e-6;
const ENOUGH_OF_ITSELF: f64 = 1e-4;
const MOST_ROUNDS: usize = 25;
/// Values in a block that structure of the residuals may extend over.
pub(super) const BLOCK: usize = 50;
/// The same where models are only to be ranked.
const ENOUGH_TO_RANK: f64 = 2e-2;
const MOST_ROUNDS_TO_RANK: usize = 8;

/// Values of predictions that are kept for the next time, twice: those used lately and those before them.
const MOST_KEPT: usize = 2_000_000;

/// How far a fit is carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Care {
    /// Far enough to see whether a model is worth more.
    Rank,
    /// To the end.
    Full,
}

/// Nuisances of all runs.
pub type Nuisances = Vec<Vec<f64>>;

/// A fitted model.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model at its best.
    pub model: Model,
    /// χ² over the runs that were fitted.
    pub chi2: f64,
    /// Number of values in them.
    pub count: usize,
    /// JᵀJ of the coordinates, in units of 1/σ² = 1.
    pub information: DMatrix<f64>,
}

/// The loop's view of a plant: which values count, and what is taken for each run's nuisances.
pub struct Bench<'a> {
    /// The plant.
    pub plant: &'a dyn Plant,
    /// Moments of jumps and the like, as they are taken at present.
    pub nuisances: Nuisances,
    /// Which values of each run count.
    pub used: Vec<Vec<bool>>,
    kept: Mutex<Kept>,
}

/// Predictions by what they were made from. Fits begin where others ended, so one in five is asked for again.
#[derive(Default)]
struct Kept {
    lately: HashMap<Vec<u64>, Arc<Vec<f64>>>,
    before: HashMap<Vec<u64>, Arc<Vec<f64>>>,
    values: usize,
}

impl Kept {
    fn get(&self, key: &[u64]) -> Option<Arc<Vec<f64>>> {
        self.lately.get(key).or_else(|| self.before.get(key)).cloned()
    }

    fn put(&mut self, key: Vec<u64>, predicted: &Arc<Vec<f64>>) {
        if self.values > MOST_KEPT {
            self.before = std::mem::take(&mut self.lately);
            self.values = 0;
        }
        self.values += predicted.len();
        self.lately.insert(key, predicted.clone());
    }
}

/// Everything that a prediction depends on.
fn key(model: &Model, run: usize, nuisances: &[f64]) -> Vec<u64> {
    let terms = model.terms.iter().flat_map(|term| {
        let numbers = term.x.iter().map(|x| x.to_bits());
        [term.candidate as u64, term.x.len() as u64].into_iter().chain(numbers)
    });
    let whole = [run as u64, model.resolution.to_bits(), u64::from(model.fine)];
    whole.into_iter().chain(terms).chain(nuisances.iter().map(|x| x.to_bits())).collect()
}

/// Residuals of one run in standard deviations.
pub type Residuals = Vec<f64>;

impl<'a> Bench<'a> {
    /// A plant with its nuisances at the ends of their intervals: a command is held until the row that shows its change.
    pub fn new(plant: &'a dyn Plant) -> Self {
        let nuisances = (0..plant.signals().len()).map(|run| vec![1.0; plant.nuisances(run)]).collect();
        let used = plant.signals().iter().map(|signal| vec![true; signal.values.len()]).collect();
        Self { plant, nuisances, used, kept: Mutex::default() }
    }

    fn predict(&self, model: &Model, run: usize, nuisances: &[f64]) -> Result<Arc<Vec<f64>>, String> {
        let key = key(model, run, nuisances);
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept().get(&key);
        if let Some(known) = known {
            return Ok(known);
        }
        let predicted = Arc::new(self.plant.predict(model, run, nuisances)?);
        kept().put(key, &predicted);
        Ok(predicted)
    }

    /// Residuals of a run.
    pub fn residuals(&self, model: &Model, run: usize) -> Result<Residuals, String> {
        self.residuals_with(model, run, &self.nuisances[run])
    }

    fn residuals_with(&self, model: &Model, run: usize, nuisances: &[f64]) -> Result<Residuals, String> {
        let signal = &self.plant.signals()[run];
        let predicted = self.predict(model, run, nuisances)?;
        let each = signal.values.iter().zip(&*predicted).zip(&signal.sigmas).zip(&self.used[run]);
        Ok(each.map(|(((y, f), sigma), used)| if *used { (y - f) / sigma } else { 0.0 }).collect())
    }

    /// Residuals of several runs.
    pub fn residuals_of(&self, model: &Model, runs: &[usize]) -> Result<Vec<Residuals>, String> {
        runs.par_iter().map(|run| self.residuals(model, *run)).collect()
    }

    /// χ² of each of several runs.
    pub fn chi2_of(&self, model: &Model, runs: &[usize]) -> Result<Vec<f64>, String> {
        Ok(self.residuals_of(model, runs)?.iter().map(|r| square(r)).collect())
    }

    /// Number of values in runs.
    pub fn count(&self, runs: &[usize]) -> usize {
        runs.iter().map(|run| self.used[*run].iter().filter(|used| **used).count()).sum()
    }

    /// The coordinate's step for a finite difference: away from the nearer bound.
    pub(super) fn step(&self, model: &Model, (term, parameter): (usize, usize)) -> f64 {
        let free = &self.plant.candidates()[model.terms[term].candidate].parameters[parameter];
        let x = model.terms[term].x[parameter];
        let step = DIFFERENCE * free.scale;
        if x + step > free.bounds[1] { -step } else { step }
    }

    /// Residuals and their derivatives by all coordinates, run by run.
    fn linearised(&self, model: &Model, runs: &[usize]) -> Result<(Vec<Residuals>, Vec<Vec<Residuals>>), String> {
        let places = places(model);
        let tasks: Vec<(usize, usize)> =
            (0..=places.len()).flat_map(|column| runs.iter().map(move |run| (column, *run))).collect();
        let results: Vec<Residuals> = tasks
            .par_iter()
            .map(|(column, run)| {
                let mut model = model.clone();
                if let Some(place) = column.checked_sub(1).map(|at| places[at]) {
                    let step = self.step(&model, place);
                    model.terms[place.0].x[place.1] += step;
                }
                self.residuals(&model, *run)
            })
            .collect::<Result<_, _>>()?;
        let mut columns = results.chunks(runs.len()).map(<[Residuals]>::to_vec);
        let plain = columns.next().unwrap_or_default();
        let derivatives = columns
            .zip(&places)
            .map(|(shifted, place)| {
                let step = self.step(model, *place);
                let of_run = |(a, b): (&Residuals, &Residuals)| a.iter().zip(b).map(|(a, b)| (a - b) / step).collect();
                shifted.iter().zip(&plain).map(of_run).collect()
            })
            .collect();
        Ok((plain, derivatives))
    }

    /// Fits a model's coordinates to `runs`, from where they are.
    ///
    /// # Errors
    /// If the start cannot be simulated.
    pub fn fit(&self, start: &Model, runs: &[usize], care: Care) -> Result<Fit, String> {
        self.fit_held(start, runs, care, None)
    }

    /// The same with one coordinate held.
    fn fit_held(&self, start: &Model, runs: &[usize], care: Care, fixed: Option<(usize, usize)>) -> Result<Fit, String> {
        let (enough, most) = match care {
            Care::Rank => (ENOUGH_TO_RANK, MOST_ROUNDS_TO_RANK),
            Care::Full => (ENOUGH_OF_ITSELF, MOST_ROUNDS),
        };
        let mut model = start.clone();
        let places = places(&model);
        let count = self.count(runs);
        let n = places.len();
        let mut lambda = 1e-3;
        let mut chi2 = f64::INFINITY;
        let mut information = DMatrix::zeros(n, n);
        let mut rounds = 0;
        'rounds: while rounds < most {
            rounds += 1;
            let (residuals, derivatives) = self.linearised(&model, runs)?;
            chi2 = residuals.iter().map(|r| square(r)).sum();
            let gradient = DVector::from_fn(n, |i, _| dot(&derivatives[i], &residuals));
            information = DMatrix::from_fn(n, n, |i, j| if i <= j { dot(&derivatives[i], &derivatives[j]) } else { 0.0 });
            information.fill_lower_triangle_with_upper_triangle();
            if n == 0 {
                break;
            }
            loop {
                // Coordinates that push against their bounds stay there.
                let bounds =
                    |k: usize| self.plant.candidates()[model.terms[places[k].0].candidate].parameters[places[k].1].bounds;
                let x = |k: usize| model.terms[places[k].0].x[places[k].1];
                let held: Vec<bool> = (0..n)
                    .map(|k| {
                        let [low, high] = bounds(k);
                        Some(places[k]) == fixed || (x(k) <= low && gradient[k] > 0.0) || (x(k) >= high && gradient[k] < 0.0)
                    })
                    .collect();
                let mut matrix = information.clone();
                let mut right = -gradient.clone();
                for k in 0..n {
                    matrix[(k, k)] += lambda * information[(k, k)].max(1e-12);
                    if held[k] || information[(k, k)] <= 0.0 {
                        (0..n).for_each(|j| {
                            matrix[(k, j)] = 0.0;
                            matrix[(j, k)] = 0.0;
                        });
                        matrix[(k, k)] = 1.0;
                        right[k] = 0.0;
                    }
                }
                let Some(step) = matrix.lu().solve(&right) else { break 'rounds };
                let mut trial = model.clone();
                for (k, (term, parameter)) in places.iter().enumerate() {
                    let [low, high] = bounds(k);
                    let slot = &mut trial.terms[*term].x[*parameter];
                    *slot = (*slot + step[k]).clamp(low, high);
                }
                let found = self.chi2_of(&trial, runs).map_or(f64::INFINITY, |each| each.iter().sum());
                if found < chi2 {
                    let gain = chi2 - found;
                    model = trial;
                    chi2 = found;
                    lambda = (lambda * 0.1).max(1e-9);
                    if gain < ENOUGH * count as f64 || gain < enough * (found - count as f64).max(0.0).max(ENOUGH * count as f64)
                    {
                        break 'rounds;
                    }
                    break;
                }
                lambda *= 10.0;
                if lambda > 1e6 || trial == model {
                    break 'rounds;
                }
            }
        }
        Ok(Fit { model, chi2, count, information })
    }

    /// χ² of a model with one coordinate held where it is and all others fitted again, from near where they are best: where much is left that no
    /// coordinate explains, χ² is known to a part of that.
    ///
    /// # Errors
    /// If it cannot be simulated.
    pub fn profile(&self, start: &Model, held: (usize, usize), runs: &[usize]) -> Result<f64, String> {
        Ok(self.fit_held(start, runs, Care::Rank, Some(held))?.chi2)
    }

    /// How much larger than for independent noise the variance of each coordinate is, from the residuals as they are: with blocks b of values that
    /// may hang together, C Σ (J_bᵀ r_b)(J_bᵀ r_b)ᵀ C against C = (JᵀJ)⁻¹. Blocks are fifty values, and whole runs (of R, by R/(R − 1) more): the
    /// larger counts, and it is at least 1, and at least χ² per value.
    ///
    /// # Errors
    /// If the model cannot be simulated.
    pub fn inflation(&self, model: &Model, runs: &[usize], covariance: &DMatrix<f64>) -> Result<Vec<f64>, String> {
        let (residuals, derivatives) = self.linearised(model, runs)?;
        let n = derivatives.len();
        let ratios = |block: usize| -> Vec<f64> {
            let mut meat = DMatrix::zeros(n, n);
            for run in 0..runs.len() {
                let values = residuals[run].len();
                for from in (0..values).step_by(block) {
                    let to = from.saturating_add(block).min(values);
                    let score =
                        DVector::from_fn(n, |k, _| (from..to).map(|i| derivatives[k][run][i] * residuals[run][i]).sum::<f64>());
                    meat += &score * score.transpose();
                }
            }
            let sandwich = covariance * meat * covariance;
            (0..n).map(|k| sandwich[(k, k)] / covariance[(k, k)]).collect()
        };
        let few = runs.len() as f64 / (runs.len() as f64 - 1.0).max(1.0);
        let count = self.count(runs).max(1) as f64;
        let least = (residuals.iter().map(|r| square(r)).sum::<f64>() / count).max(1.0);
        let (short, whole) = (ratios(BLOCK), ratios(usize::MAX));
        // Where the runs say nothing of a coordinate its ratio is not a number, and `max` takes the other.
        Ok(short.into_iter().zip(whole).map(|(short, whole)| least.max(short).max(few * whole)).collect())
    }

    /// Leaves out values whose residuals stand far above those around them in their channel: what a tracker lost for a row or two. Returns how many.
    pub fn leave_out_spikes(&mut self, model: &Model) -> Result<usize, String> {
        const FAR: f64 = 6.0;
        const AROUND: usize = 8;
        let mut count = 0;
        for run in 0..self.used.len() {
            let residuals = self.residuals(model, run)?;
            let channels = &self.plant.signals()[run].channels;
            for at in 0..residuals.len() {
                let near = at.saturating_sub(AROUND)..(at + AROUND + 1).min(residuals.len());
                let mut around: Vec<f64> = near
                    .filter(|k| *k != at && channels[*k] == channels[at] && self.used[run][*k])
                    .map(|k| residuals[k].abs())
                    .collect();
                around.sort_by(f64::total_cmp);
                // Beyond what three quarters of the neighbours show, so that a true jump or peak stays.
                let usual = around.get(3 * around.len() / 4).copied().unwrap_or(f64::INFINITY);
                if self.used[run][at] && residuals[at].abs() > FAR + 3.0 * usual {
                    self.used[run][at] = false;
                    count += 1;
                }
            }
        }
        Ok(count)
    }

    /// Fits what belongs to each run on its own, for a model as it is.
    ///
    /// # Errors
    /// If the model cannot be simulated.
    pub fn fit_nuisances(&mut self, model: &Model, runs: &[usize]) -> Result<(), String> {
        const STEP: f64 = 0.05;
        for &run in runs {
            for _ in 0..3 {
                let shares = self.nuisances[run].clone();
                if shares.is_empty() {
                    break;
                }
                let shifted = |k: usize| {
                    let step = if shares[k] > 0.5 { -STEP } else { STEP };
                    let mut shifted = shares.clone();
                    shifted[k] += step;
                    (shifted, step)
                };
                let plain = self.residuals(model, run)?;
                let columns: Vec<Residuals> = (0..shares.len())
                    .into_par_iter()
                    .map(|k| {
                        let (moved, step) = shifted(k);
                        let r = self.residuals_with(model, run, &moved)?;
                        Ok(r.iter().zip(&plain).map(|(a, b)| (a - b) / step).collect())
                    })
                    .collect::<Result<_, String>>()?;
                let n = shares.len();
                let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let gradient: Vec<f64> = columns.iter().map(|column| inner(column, &plain)).collect();
                let held: Vec<bool> =
                    (0..n).map(|k| (shares[k] >= 1.0 && gradient[k] < 0.0) || (shares[k] <= 0.0 && gradient[k] > 0.0)).collect();
                let matrix = DMatrix::from_fn(n, n, |i, j| {
                    if i == j {
                        1e-9 + inner(&columns[i], &columns[i])
                    } else if held[i] || held[j] {
                        0.0
                    } else {
                        inner(&columns[i], &columns[j])
                    }
                });
                let right = DVector::from_fn(n, |k, _| if held[k] { 0.0 } else { -gradient[k] });
                let Some(step) = matrix.lu().solve(&right) else { break };
                let before = square(&plain);
                let mut better = None;
                for part in [1.0, 0.3, 0.1] {
                    let trial: Vec<f64> = shares.iter().zip(step.iter()).map(|(x, by)| (x + part * by).clamp(0.0, 1.0)).collect();
                    let chi2 = square(&self.residuals_with(model, run, &trial)?);
                    if chi2 < before {
                        better = Some((trial, chi2));
                        break;
                    }
                }
                let Some((trial, chi2)) = better else { break };
                self.nuisances[run] = trial;
                if before - chi2 < 1.0 {
                    break;
                }
            }
        }
        Ok(())
    }
}

/// Term and parameter of every coordinate.
pub fn places(model: &Model) -> Vec<(usize, usize)> {
    model.terms.iter().enumerate().flat_map(|(term, t)| (0..t.x.len()).map(move |parameter| (term, parameter))).collect()
}

/// Sum of squares.
pub fn square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

fn dot(a: &[Residuals], b: &[Residuals]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()).sum()
}
