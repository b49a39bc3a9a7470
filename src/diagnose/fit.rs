//! Bounded least squares by Levenberg and Marquardt, with derivatives by finite differences, in parallel over parameters and runs.
//!
//! ```text
//! χ² = Σ ((y − f(x))/σ)²        minimised over the coordinates x of all terms within their bounds
//! ```
//!
//! The nuisance parameters of a run ([`Plant::nuisances`]), such as times of jumps between rows, are fitted run by run, in turn with the model's
//! parameters. Every sum has a fixed order, so results do not depend on the number of threads.
//!
//! The file is long because fits, nuisance parameters, faults of the bench and variances share the state of one estimator.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::DiagnoseError;
use super::bench::{self, Columns, Spread};
use super::blocks::blocks;
use super::budget::Budget;
use super::kept::Kept;
use super::noise::Noise;
use super::plant::{Model, Nuisance, Plant, Term};

/// Step of finite differences as a share of a parameter's scale.
const DIFFERENCE: f64 = 0.02;
/// Steps, in its place, that are tried one after the other where a model cannot be simulated after it, as shares of it.
const STEPS_OF_EDGES: [f64; 3] = [-1.0, 0.1, -0.1];
/// A fit has converged when χ² falls by less than this share of the number of values, ...
const TOLERANCE: f64 = 1e-6;
/// ... or by less than this share of χ² beyond the number of values: for full convergence, and to rank models.
const RELATIVE_TOLERANCE: f64 = 1e-4;
const RELATIVE_TOLERANCE_TO_RANK: f64 = 2e-2;
/// Most evaluations of the derivatives by finite differences: for full convergence, and to rank models.
const MOST_ITERATIONS: usize = 25;
const MOST_ITERATIONS_TO_RANK: usize = 8;
/// A step is trusted, so that the derivatives follow it, if χ² falls by more than this share of what they promise, ...
const LEAST_KEPT: f64 = 0.5;
/// ... up to this number of steps.
const MOST_STEPS: usize = 60;

/// Two-sided 95 % quantiles of Student's distribution of 1, 2, ... degrees of freedom.
const STUDENT_95: [f64; 12] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179];

/// Two-sided 95 % quantile of Student's distribution; that of 12 degrees of freedom for more, and that of 1 for none.
pub(super) fn student_95(freedom: usize) -> f64 {
    STUDENT_95[freedom.saturating_sub(1).min(STUDENT_95.len() - 1)]
}

/// Convergence of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convergence {
    /// Enough to rank models.
    Rank,
    /// Full.
    Full,
}

/// Nuisance parameters of every run.
pub type Nuisances = Vec<Nuisance>;

/// χ² about a model.
struct Linearised {
    /// Runs × values.
    residuals: Vec<Residuals>,
    derivatives: Derivatives,
    chi2: f64,
    /// Half the gradient of χ².
    gradient: DVector<f64>,
    /// JᵀJ.
    information: DMatrix<f64>,
    /// False for derivatives from a model close by or that follow the residuals.
    is_by_differences: bool,
}

/// A step to a lower χ².
struct Step {
    model: Model,
    /// By coordinate.
    by: DVector<f64>,
    residuals: Vec<Residuals>,
    chi2: f64,
    /// The fall of χ² by the derivatives.
    promised: f64,
}

impl Linearised {
    fn new((residuals, derivatives): (Vec<Residuals>, Derivatives), is_by_differences: bool) -> Self {
        let chi2 = residuals.iter().map(|r| sum_of_squares(r)).sum();
        let (gradient, information) = normal_equations(&residuals, &derivatives);
        Self { residuals, derivatives, chi2, gradient, information, is_by_differences }
    }

    /// What half the gradient of χ² is at the end of a step beyond what the derivatives promise.
    fn bend(&self, step: &Step) -> DVector<f64> {
        let after = DVector::from_iterator(step.by.len(), self.derivatives.iter().map(|column| dot(column, &step.residuals)));
        after - &self.gradient - &self.information * &step.by
    }

    /// Squared length of a step, in units of what each coordinate does.
    fn squared_length(&self, by: &DVector<f64>) -> f64 {
        by.iter().enumerate().map(|(k, by)| self.information[(k, k)] * by * by).sum()
    }

    /// Moves to the end of a step: the least change of the derivatives, in units of what they do, that gives the residuals there (Broyden 1965).
    fn follow(&mut self, step: Step) {
        let weighted: Vec<f64> = step.by.iter().enumerate().map(|(k, by)| self.information[(k, k)] * by).collect();
        let size = self.squared_length(&step.by);
        for (run, after) in step.residuals.iter().enumerate() {
            for (value, after) in after.iter().enumerate() {
                let promised: f64 = self.derivatives.iter().zip(step.by.iter()).map(|(column, by)| column[run][value] * by).sum();
                let missed = (after - self.residuals[run][value] - promised) / size.max(f64::MIN_POSITIVE);
                for (column, weighted) in self.derivatives.iter_mut().zip(&weighted) {
                    column[run][value] += missed * weighted;
                }
            }
        }
        let derivatives = std::mem::take(&mut self.derivatives);
        *self = Self::new((step.residuals, derivatives), false);
    }
}

/// A fitted model.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The fitted model.
    pub model: Model,
    /// χ² of the fitted runs.
    pub chi2: f64,
    /// Number of values in the fitted runs.
    pub count: usize,
    /// Information JᵀJ, coordinates × coordinates, of residuals in σ.
    pub information: DMatrix<f64>,
}

/// A plant with the mask of its values and the current nuisance parameters.
pub struct Estimator<'a> {
    /// The plant.
    pub plant: &'a dyn Plant,
    /// Current nuisance parameters.
    pub nuisances: Nuisances,
    /// True for the values that count, runs × values.
    pub used: Vec<Vec<bool>>,
    /// Spread of the bench's faults while it is not estimated.
    pub held_spread: Option<Spread>,
    /// True once the constants are calibrated: a fault that is on is no longer switched off because all runs share it.
    pub is_calibrated: bool,
    /// Columns of the bench's faults of each run; none before the first [`set_faults`](Self::set_faults).
    faults: Vec<Columns>,
    /// The noise that residuals are whitened for.
    pub noise: Noise,
    kept: Kept,
    /// What predictions have cost.
    pub(super) budget: Budget,
}

/// What an [`Estimator`] has found out of the data beside the model.
#[derive(Debug, Clone)]
pub struct State {
    nuisances: Nuisances,
    used: Vec<Vec<bool>>,
    faults: Vec<Columns>,
    noise: Noise,
}

/// The bits of all that a prediction depends on.
fn key(model: &Model, run: usize, nuisance: &Nuisance) -> Vec<u64> {
    let terms = model.terms.iter().flat_map(Term::bits);
    let whole = [run as u64, model.resolution.to_bits(), u64::from(model.fine)];
    let nuisance = nuisance.shares.iter().chain(&nuisance.base);
    whole.into_iter().chain(terms).chain(nuisance.map(|x| x.to_bits())).collect()
}

/// Residuals of a run, in σ, 0 for values that do not count; behind those of the values, the bench's faults in their standard deviations.
pub type Residuals = Vec<f64>;

/// Derivatives of residuals: coordinates × runs × values.
pub(super) type Derivatives = Vec<Vec<Residuals>>;

impl<'a> Estimator<'a> {
    /// A plant with all values, and shares of 1: a command is held until the row that shows its change.
    pub fn new(plant: &'a dyn Plant) -> Self {
        let nuisances = (0..plant.signals().len())
            .map(|run| Nuisance { shares: vec![1.0; plant.nuisances(run)], ..Nuisance::default() })
            .collect();
        let used = plant.signals().iter().map(|signal| vec![true; signal.values.len()]).collect();
        Self {
            plant,
            nuisances,
            used,
            held_spread: None,
            is_calibrated: false,
            faults: Vec::new(),
            noise: Noise::default(),
            kept: Kept::default(),
            budget: Budget::new(plant),
        }
    }

    fn spend(&self, model: &Model, runs: &[usize], times: usize) {
        runs.iter().for_each(|run| self.budget.spend(self.plant, model, *run, times));
    }

    fn predict(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Arc<Vec<f64>>, DiagnoseError> {
        self.kept.get_or(key(model, run, nuisance), || self.plant.predict(model, run, nuisance))
    }

    /// Residuals of a run, in σ.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn residuals(&self, model: &Model, run: usize) -> Result<Residuals, DiagnoseError> {
        self.residuals_with(model, run, &self.nuisance(model, run))
    }

    /// The nuisance parameters of a run in a model: without clock offsets where their spread is 0.
    fn nuisance(&self, model: &Model, run: usize) -> Nuisance {
        let Nuisance { shares, base } = self.nuisances[run].clone();
        Nuisance { shares, base: model.spread.keep(base) }
    }

    fn residuals_with(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Residuals, DiagnoseError> {
        let mut residuals = self.misfit(model, run, nuisance)?;
        self.eliminate(model, run, &mut residuals);
        Ok(residuals)
    }

    /// Whitened residuals of a run with the bench's faults in them.
    fn misfit(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Residuals, DiagnoseError> {
        let mut residuals = self.plain(model, run, nuisance)?;
        self.noise.whiten(&self.plant.signals()[run], &self.used[run], &mut residuals);
        Ok(residuals)
    }

    /// Differences of a run from its prediction, in σ.
    fn plain(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Residuals, DiagnoseError> {
        let signal = &self.plant.signals()[run];
        let predicted = self.predict(model, run, nuisance)?;
        let each = signal.values.iter().zip(&*predicted).zip(&signal.sigmas).zip(&self.used[run]);
        Ok(each.map(|(((y, f), sigma), used)| if *used { (y - f) / sigma } else { 0.0 }).collect())
    }

    /// Eliminates the bench's faults from residuals; returns log det of their prior covariance times their information.
    fn eliminate(&self, model: &Model, run: usize, residuals: &mut Residuals) -> f64 {
        self.faults.get(run).map_or(0.0, |columns| columns.eliminate(&model.spread, residuals))
    }

    /// Residuals of several runs, and what the spread of the bench's faults costs each (log det of [`mod@bench`]).
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn costs_of(&self, model: &Model, runs: &[usize]) -> Result<Vec<(Residuals, f64)>, DiagnoseError> {
        self.spend(model, runs, 1);
        let of = |run: &usize| {
            let mut residuals = self.misfit(model, *run, &self.nuisance(model, *run))?;
            let cost = self.eliminate(model, *run, &mut residuals);
            Ok((residuals, cost))
        };
        runs.par_iter().map(of).collect()
    }

    /// Residuals of all runs, in given σ and not whitened, without the bench's faults.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn plain_residuals(&self, model: &Model) -> Result<Vec<Residuals>, DiagnoseError> {
        (0..self.plant.signals().len()).into_par_iter().map(|run| self.plain_residuals_of(model, run)).collect()
    }

    /// [`plain_residuals`](Self::plain_residuals) of one run.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn plain_residuals_of(&self, model: &Model, run: usize) -> Result<Residuals, DiagnoseError> {
        let nuisance = self.nuisance(model, run);
        let mut residuals = self.plain(model, run, &nuisance)?;
        if let Some(columns) = self.faults.get(run) {
            columns.take_from(&model.spread, &self.misfit(model, run, &nuisance)?, &mut residuals);
        }
        Ok(residuals)
    }

    /// Residuals of several runs, in σ.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn residuals_of(&self, model: &Model, runs: &[usize]) -> Result<Vec<Residuals>, DiagnoseError> {
        self.spend(model, runs, 1);
        runs.par_iter().map(|run| self.residuals(model, *run)).collect()
    }

    /// Number of values that count in several runs.
    pub fn count(&self, runs: &[usize]) -> usize {
        runs.iter().map(|run| self.used[*run].iter().filter(|used| **used).count()).sum()
    }

    /// The finite-difference step of a coordinate, within its bounds.
    pub(super) fn step(&self, model: &Model, (term, parameter): (usize, usize)) -> f64 {
        let free = &self.plant.candidates()[model.terms[term].candidate].parameters[parameter];
        let x = model.terms[term].x[parameter];
        let step = DIFFERENCE * free.scale;
        if x + step > free.bounds[1] { -step } else { step }
    }

    /// Derivatives of the residuals (coordinates × runs × values) by a model's coordinates.
    ///
    /// # Errors
    /// [`DiagnoseError`] if a step of the finite differences cannot be simulated.
    pub(super) fn derivatives(&self, model: &Model, runs: &[usize]) -> Result<Derivatives, DiagnoseError> {
        Ok(self.linearised(model, runs, &[])?.1)
    }

    /// The information JᵀJ of a model's coordinates in `runs`.
    ///
    /// # Errors
    /// As [`derivatives`](Self::derivatives).
    pub(super) fn information(&self, model: &Model, runs: &[usize]) -> Result<DMatrix<f64>, DiagnoseError> {
        Ok(Linearised::new(self.linearised(model, runs, &[])?, true).information)
    }

    /// Residuals (runs × values) and their derivatives (coordinates × runs × values), of which those by the first coordinates may be `known`.
    fn linearised(
        &self,
        model: &Model,
        runs: &[usize],
        known: &[Vec<Residuals>],
    ) -> Result<(Vec<Residuals>, Derivatives), DiagnoseError> {
        let coordinates = &coordinates(model)[known.len()..];
        self.spend(model, runs, 1 + coordinates.len());
        let tasks: Vec<(usize, usize)> =
            (0..=coordinates.len()).flat_map(|column| runs.iter().map(move |run| (column, *run))).collect();
        // Residuals after a step, and the step: backward or shorter where a model cannot be simulated, as at the edge of a robot's equilibria.
        let results: Vec<(Residuals, f64)> = tasks
            .par_iter()
            .map(|(column, run)| {
                let Some((term, parameter)) = column.checked_sub(1).map(|at| coordinates[at]) else {
                    return Ok((self.residuals(model, *run)?, 0.0));
                };
                let after = |step: f64| {
                    let mut moved = model.clone();
                    moved.terms[term].x[parameter] += step;
                    Ok((self.residuals(&moved, *run)?, step))
                };
                let step = self.step(model, (term, parameter));
                let others = |error: DiagnoseError| STEPS_OF_EDGES.iter().find_map(|share| after(share * step).ok()).ok_or(error);
                after(step).or_else(others)
            })
            .collect::<Result<_, DiagnoseError>>()?;
        let mut columns = results.chunks(runs.len());
        let plain: Vec<Residuals> = columns.next().unwrap_or_default().iter().map(|(residuals, _)| residuals.clone()).collect();
        let own = columns.map(|shifted| {
            let of_run = |((a, step), b): (&(Residuals, f64), &Residuals)| a.iter().zip(b).map(|(a, b)| (a - b) / step).collect();
            shifted.iter().zip(&plain).map(of_run).collect()
        });
        let derivatives = known.iter().cloned().chain(own).collect();
        Ok((plain, derivatives))
    }

    /// Fits a model's coordinates to `runs`, from those of `start`.
    ///
    /// # Errors
    /// [`DiagnoseError`] if `start` or a step of the finite differences cannot be simulated.
    pub fn fit(&self, start: &Model, runs: &[usize], convergence: Convergence) -> Result<Fit, DiagnoseError> {
        self.fit_held(start, runs, convergence, None, &[])
    }

    /// [`fit`](Self::fit) to the convergence of [`Convergence::Rank`] with the derivatives by the first coordinates `known` from a model close by.
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub(super) fn fit_beyond(&self, start: &Model, runs: &[usize], known: &[Vec<Residuals>]) -> Result<Fit, DiagnoseError> {
        self.fit_held(start, runs, Convergence::Rank, None, known)
    }

    /// [`fit`](Self::fit) with one coordinate, term and parameter, held.
    ///
    /// Between evaluations by finite differences the derivatives follow the residuals by Broyden's update (1965), as long as steps keep
    /// [`LEAST_KEPT`] of what they promise. A full fit that converges ends with derivatives by finite differences; the information of one to rank by may
    /// be that of derivatives that follow.
    fn fit_held(
        &self,
        start: &Model,
        runs: &[usize],
        convergence: Convergence,
        fixed: Option<(usize, usize)>,
        known: &[Vec<Residuals>],
    ) -> Result<Fit, DiagnoseError> {
        let (tolerance, most) = match convergence {
            Convergence::Rank => (RELATIVE_TOLERANCE_TO_RANK, MOST_ITERATIONS_TO_RANK),
            Convergence::Full => (RELATIVE_TOLERANCE, MOST_ITERATIONS),
        };
        let count = self.count(runs);
        let least = |chi2: f64| (tolerance * (chi2 - count as f64).max(TOLERANCE * count as f64)).max(TOLERANCE * count as f64);
        let mut model = start.clone();
        let mut here = Linearised::new(self.linearised(&model, runs, known)?, known.is_empty());
        let mut lambda = 1e-3;
        let (mut linearisations, mut steps) = (1, 0);
        loop {
            steps += 1;
            let better = self.step_down(&model, &here, runs, fixed, &mut lambda);
            let (is_done, is_trusted) = match &better {
                Some(step) => {
                    let gain = here.chi2 - step.chi2;
                    (gain < least(step.chi2), gain > LEAST_KEPT * step.promised && steps < MOST_STEPS)
                }
                None => (true, false),
            };
            let is_last = is_done && (here.is_by_differences || (convergence == Convergence::Rank && better.is_some()));
            if let Some(step) = better {
                let chi2 = step.chi2;
                model = step.model.clone();
                if is_last || (linearisations == most && !is_trusted) {
                    return Ok(Fit { model, chi2, count, information: here.information });
                }
                if is_trusted && !is_done {
                    here.follow(step);
                    continue;
                }
            } else if is_last || linearisations == most {
                return Ok(Fit { model, chi2: here.chi2, count, information: here.information });
            }
            here = Linearised::new(self.linearised(&model, runs, &[])?, true);
            linearisations += 1;
        }
    }

    /// The first of the steps of Levenberg and Marquardt, with more and more damping `lambda`, that lowers χ²; only one step where the derivatives are
    /// not by differences. Coordinates at a bound with the gradient pointing outwards are held.
    ///
    /// Where a step does not lower χ², one is tried that follows the curve of the residuals along it, as far as one step tells: in a curved valley all straight steps
    /// have to be short (the geodesic acceleration of Transtrum and Sethna, arXiv:1201.5885, with a difference over the whole step).
    fn step_down(
        &self,
        model: &Model,
        here: &Linearised,
        runs: &[usize],
        fixed: Option<(usize, usize)>,
        lambda: &mut f64,
    ) -> Option<Step> {
        let Linearised { information, gradient, .. } = here;
        let n = gradient.len();
        let held = self.held(model, here, fixed);
        let step = |by: &DVector<f64>| {
            let (model, by) = self.moved_by(model, by);
            let residuals = self.residuals_of(&model, runs).ok()?;
            let chi2 = residuals.iter().map(|r| sum_of_squares(r)).sum();
            let promised = -2.0 * gradient.dot(&by) - by.dot(&(information * &by));
            Some(Step { model, by, residuals, chi2, promised })
        };
        while n > 0 && *lambda <= 1e6 {
            let damped = |i: usize, j: usize| match i == j {
                true if held[i] => 1.0,
                true => information[(i, i)] + *lambda * information[(i, i)].max(1e-12),
                false if held[i] || held[j] => 0.0,
                false => information[(i, j)],
            };
            let factors = DMatrix::from_fn(n, n, damped).lu();
            let against =
                |gradient: &DVector<f64>| factors.solve(&DVector::from_fn(n, |k, _| if held[k] { 0.0 } else { -gradient[k] }));
            let straight = step(&against(gradient)?);
            let curved = |straight: &Step| {
                let is_shorter = |other: &DVector<f64>| here.squared_length(other) < here.squared_length(&straight.by);
                let correction = against(&here.bend(straight)).filter(is_shorter)?;
                // Nothing is promised for what the derivatives do not tell: they are taken anew at its end.
                Some(Step { promised: f64::INFINITY, ..step(&(&straight.by + correction))? })
            };
            let is_lower = |step: &Step| step.chi2 < here.chi2;
            let is_still = straight.as_ref().is_some_and(|straight| straight.model == *model);
            let is_last = is_still || !here.is_by_differences;
            let lower = match straight {
                Some(straight) if !is_lower(&straight) && !is_last => curved(&straight).filter(is_lower),
                straight => straight.filter(is_lower),
            };
            if lower.is_some() {
                *lambda = (*lambda * 0.1).max(1e-9);
                return lower;
            }
            if is_last {
                return None;
            }
            *lambda *= 10.0;
        }
        None
    }

    /// The coordinates that a step leaves as they are: one that is `fixed`, those at a bound with the gradient pointing outwards, and those that do nothing.
    fn held(
        &self,
        model: &Model,
        Linearised { information, gradient, .. }: &Linearised,
        fixed: Option<(usize, usize)>,
    ) -> Vec<bool> {
        let is_held = |(k, (term, parameter)): (usize, (usize, usize))| {
            let own = &model.terms[term];
            let [low, high] = self.plant.candidates()[own.candidate].parameters[parameter].bounds;
            let x = own.x[parameter];
            let leads_out = (x <= low && gradient[k] > 0.0) || (x >= high && gradient[k] < 0.0);
            Some((term, parameter)) == fixed || leads_out || information[(k, k)] <= 0.0
        };
        coordinates(model).into_iter().enumerate().map(is_held).collect()
    }

    /// A model with its coordinates moved, within their bounds, and by how much they moved.
    pub(super) fn moved_by(&self, model: &Model, by: &DVector<f64>) -> (Model, DVector<f64>) {
        let (mut moved, mut done) = (model.clone(), by.clone());
        for ((term, parameter), by) in coordinates(model).into_iter().zip(done.iter_mut()) {
            let own = &mut moved.terms[term];
            let [low, high] = self.plant.candidates()[own.candidate].parameters[parameter].bounds;
            let before = own.x[parameter];
            own.x[parameter] = (before + *by).clamp(low, high);
            *by = own.x[parameter] - before;
        }
        (moved, done)
    }

    /// Profile χ²: the coordinate `held` (term, parameter) is fixed and all others are fitted, to the convergence of [`Convergence::Rank`].
    ///
    /// # Errors
    /// [`DiagnoseError`] if `start` cannot be simulated.
    pub fn profile(&self, start: &Model, held: (usize, usize), runs: &[usize]) -> Result<f64, DiagnoseError> {
        Ok(self.fit_held(start, runs, Convergence::Rank, Some(held), &[])?.chi2)
    }

    /// Variance inflation of each coordinate over that of independent noise, by the sandwich estimator: C Σ (J_bᵀ r_b)(J_bᵀ r_b)ᵀ C against
    /// C = (JᵀJ)⁻¹, summed over blocks b within which residuals may be correlated. Blocks are those of `blocks.rs`, or whole runs (times R/(R − 1) for R
    /// runs); the larger ratio counts, and it is at least 1 and at least χ² per value. What exceeds 1 is known from R runs only: it is multiplied by
    /// (t/1.96)² with the 95 % quantile t of Student's distribution of R − 1 degrees of freedom, 1 at least.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn inflation(&self, model: &Model, runs: &[usize], covariance: &DMatrix<f64>) -> Result<Vec<f64>, DiagnoseError> {
        let (residuals, derivatives) = self.linearised(model, runs, &[])?;
        let n = derivatives.len();
        let ratios = |blocks: &dyn Fn(usize) -> Vec<Range<usize>>| -> Vec<f64> {
            let mut meat = DMatrix::zeros(n, n);
            for (run, residuals) in residuals.iter().enumerate() {
                for block in blocks(run) {
                    let product = |k: usize, i: usize| derivatives[k][run][i] * residuals[i];
                    let score = DVector::from_fn(n, |k, _| block.clone().map(|i| product(k, i)).sum::<f64>());
                    meat += &score * score.transpose();
                }
            }
            let sandwich = covariance * meat * covariance;
            (0..n).map(|k| sandwich[(k, k)] / covariance[(k, k)]).collect()
        };
        let few = runs.len() as f64 / (runs.len() as f64 - 1.0).max(1.0);
        let count = self.count(runs).max(1) as f64;
        let least = (residuals.iter().map(|r| sum_of_squares(r)).sum::<f64>() / count).max(1.0);
        let short = ratios(&|run| blocks(&self.plant.signals()[runs[run]], &self.noise, residuals[run].len()));
        let whole = ratios(&|run| std::iter::once(0..residuals[run].len()).collect());
        let known = (student_95(runs.len().saturating_sub(1)) / 1.96_f64).powi(2);
        // `max` ignores the NaN of a coordinate that the runs do not determine.
        let ratio = |(short, whole): (f64, f64)| 1.0 + known * (least.max(short).max(few * whole) - 1.0);
        Ok(short.into_iter().zip(whole).map(ratio).collect())
    }

    /// All but the cache of predictions, for [`restore`](Self::restore).
    pub fn state(&self) -> State {
        State {
            nuisances: self.nuisances.clone(),
            used: self.used.clone(),
            faults: self.faults.clone(),
            noise: self.noise.clone(),
        }
    }

    /// Restores a [`state`](Self::state).
    pub fn restore(&mut self, State { nuisances, used, faults, noise }: State) {
        (self.nuisances, self.used, self.faults, self.noise) = (nuisances, used, faults, noise);
    }

    /// Sets the base values of each run's faults to their estimates under `model`, and their columns to the model's predictions there.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn set_faults(&mut self, model: &Model) -> Result<(), DiagnoseError> {
        // Halves of central differences, in s and in the gain.
        const HALF_STEP: f64 = 1e-4;
        const HALF_GAIN: f64 = 5e-3;
        let (plant, given) = (self.plant, self.given_spread());
        for (run, faults) in self.faults_of(model)?.into_iter().enumerate() {
            let nuisance = &mut self.nuisances[run];
            nuisance.base = given.base(&faults);
            // The inputs beyond the last row are not known.
            let signal = &plant.signals()[run];
            let end = signal.times.iter().copied().fold(0.0, f64::max);
            let counted = self.used[run].iter_mut().zip(&signal.times);
            counted.filter(|(_, t)| nuisance.time(**t) > end + 1e-9).for_each(|(used, _)| *used = false);
        }
        let columns = |run: usize| -> Result<Columns, DiagnoseError> {
            let signal = &plant.signals()[run];
            let nuisance = &self.nuisances[run];
            let at = |kind: usize, by: f64| {
                let mut moved = nuisance.clone();
                moved.base[kind] += by;
                self.predict(model, run, &moved)
            };
            let now = self.predict(model, run, nuisance)?;
            // One-sided where a model cannot be simulated on the other side.
            let derivative = |kind: usize, half: f64| -> Result<Vec<f64>, DiagnoseError> {
                let (before, after, step) = match (at(kind, -half), at(kind, half)) {
                    (Ok(before), Ok(after)) => (before, after, 2.0 * half),
                    (Err(_), Ok(after)) => (now.clone(), after, half),
                    (Ok(before), Err(_)) => (before, now.clone(), half),
                    (Err(error), Err(_)) => return Err(error),
                };
                Ok(after.iter().zip(&*before).map(|(b, a)| (b - a) / step).collect())
            };
            let has_clock = [Spread::CLOCK, Spread::RATE].into_iter().any(|kind| plant.has_fault(run, kind));
            let rate = if has_clock { derivative(Spread::CLOCK, HALF_STEP)? } else { vec![0.0; now.len()] };
            let by_gain = derivative(Spread::GAIN, HALF_GAIN)?;
            let weights: Vec<f64> =
                signal.sigmas.iter().zip(&self.used[run]).map(|(sigma, used)| if *used { 1.0 / sigma } else { 0.0 }).collect();
            let whiten = |column: &mut [f64]| self.noise.whiten(signal, &self.used[run], column);
            let columns =
                Columns::new(&signal.channels, &signal.times, [&now[..], &rate, &by_gain], &weights, nuisance.base, whiten);
            Ok(columns.only(|kind| plant.has_fault(run, kind)))
        };
        let columns: Vec<Columns> = (0..plant.signals().len()).into_par_iter().map(columns).collect::<Result<_, _>>()?;
        self.faults = columns;
        Ok(())
    }

    /// The bench's faults of every run under `model`: clock offset (s), gain, zeros and drifts; empty before [`set_faults`](Self::set_faults).
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn faults_of(&self, model: &Model) -> Result<Vec<Vec<f64>>, DiagnoseError> {
        let of = |run: usize| match self.faults.get(run) {
            Some(columns) => Ok(columns.faults(&model.spread, &self.misfit(model, run, &self.nuisance(model, run))?)),
            None => Ok(Vec::new()),
        };
        (0..self.plant.signals().len()).into_par_iter().map(of).collect()
    }

    /// The bench's faults of every run under `model` that are not off, with their standard deviations.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn found_faults(&self, model: &Model) -> Result<Vec<Vec<bench::Fault>>, DiagnoseError> {
        let of = |run: usize| match self.faults.get(run) {
            Some(columns) => Ok(columns.found(&model.spread, &self.misfit(model, run, &self.nuisance(model, run))?)),
            None => Ok(Vec::new()),
        };
        (0..self.plant.signals().len()).into_par_iter().map(of).collect()
    }

    /// The spread of the bench's faults with a given prior alone.
    pub fn given_spread(&self) -> Spread {
        Spread { of: self.plant.bench().map(|sd| sd.unwrap_or(0.0)) }
    }

    /// The spread of the bench's faults that suits `model` on `runs` best.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn spread(&self, model: &Model, runs: &[usize]) -> Result<Spread, DiagnoseError> {
        if let Some(held) = self.held_spread {
            return Ok(held);
        }
        let established = if self.is_calibrated { model.spread } else { Spread::default() };
        Ok(bench::spread(&self.moments(model, runs)?, &self.plant.bench(), &established))
    }

    /// The kinds of the bench's faults that have a mean over `runs` beyond chance under `model`: what that does, all runs share.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn shared_faults(&self, model: &Model, runs: &[usize]) -> Result<Vec<usize>, DiagnoseError> {
        Ok(bench::shared(&self.moments(model, runs)?, &model.spread))
    }

    /// What runs contribute to the likelihood of the bench's faults.
    fn moments(&self, model: &Model, runs: &[usize]) -> Result<Vec<bench::Moments<'_>>, DiagnoseError> {
        let with_columns = runs.iter().filter_map(|run| Some((*run, self.faults.get(*run)?)));
        with_columns.map(|(run, columns)| Ok(columns.moments(&self.misfit(model, run, &self.nuisances[run])?))).collect()
    }

    /// Masks single values whose residuals stand far above those around them in their channel, as after a tracker's slip, and returns their number.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn leave_out_spikes(&mut self, model: &Model) -> Result<usize, DiagnoseError> {
        // Least residual (σ), and rows on either side.
        const FAR: f64 = 6.0;
        const AROUND: usize = 8;
        let mut count = 0;
        for run in 0..self.used.len() {
            let residuals = self.residuals(model, run)?;
            let channels = &self.plant.signals()[run].channels;
            for at in 0..channels.len() {
                let near = at.saturating_sub(AROUND)..(at + AROUND + 1).min(channels.len());
                let mut around: Vec<f64> = near
                    .filter(|k| *k != at && channels[*k] == channels[at] && self.used[run][*k])
                    .map(|k| residuals[k].abs())
                    .collect();
                around.sort_by(f64::total_cmp);
                // The upper quartile of the neighbours, so that a true jump or peak stays.
                let usual = around.get(3 * around.len() / 4).copied().unwrap_or(f64::INFINITY);
                if self.used[run][at] && residuals[at].abs() > FAR + 3.0 * usual {
                    self.used[run][at] = false;
                    count += 1;
                }
            }
        }
        Ok(count)
    }

    /// Fits the shares of each run, with the model held.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn fit_nuisances(&mut self, model: &Model, runs: &[usize]) -> Result<(), DiagnoseError> {
        runs.iter().for_each(|run| self.spend(model, &[*run], 2 * (1 + self.nuisances[*run].shares.len())));
        let fitted: Vec<Vec<f64>> = runs.par_iter().map(|run| self.fitted_shares(model, *run)).collect::<Result<_, _>>()?;
        for (run, shares) in runs.iter().zip(fitted) {
            self.nuisances[*run].shares = shares;
        }
        Ok(())
    }

    /// The shares of all runs, one after the other.
    pub fn shares(&self) -> DVector<f64> {
        let shares: Vec<f64> = self.nuisances.iter().flat_map(|nuisance| nuisance.shares.iter().copied()).collect();
        DVector::from_vec(shares)
    }

    /// Moves the shares of all runs by `step`, within their bounds.
    pub fn move_shares(&mut self, step: &DVector<f64>) {
        let shares = self.nuisances.iter_mut().flat_map(|nuisance| nuisance.shares.iter_mut());
        shares.zip(step.iter()).for_each(|(share, by)| *share = (*share + by).clamp(0.0, 1.0));
    }

    /// The shares of a run that fit it best, by some steps of Gauss and Newton.
    fn fitted_shares(&self, model: &Model, run: usize) -> Result<Vec<f64>, DiagnoseError> {
        const MOST_STEPS: usize = 3;
        /// Steps end where they lower χ² by less.
        const LEAST_FALL: f64 = 1.0;
        let mut nuisance = self.nuisance(model, run);
        if nuisance.shares.is_empty() {
            return Ok(nuisance.shares);
        }
        let mut residuals = self.residuals_with(model, run, &nuisance)?;
        for _ in 0..MOST_STEPS {
            let before = sum_of_squares(&residuals);
            let step = self.step_of_shares(model, run, &nuisance, &residuals)?;
            let mut better = None;
            for part in [1.0, 0.3, 0.1] {
                let moved = nuisance.shares.iter().zip(step.iter()).map(|(x, by)| (x + part * by).clamp(0.0, 1.0));
                let trial = Nuisance { shares: moved.collect(), ..nuisance.clone() };
                let of_trial = self.residuals_with(model, run, &trial)?;
                if sum_of_squares(&of_trial) < before {
                    better = Some((trial, of_trial));
                    break;
                }
            }
            let Some((trial, of_trial)) = better else { break };
            (nuisance, residuals) = (trial, of_trial);
            if before - sum_of_squares(&residuals) < LEAST_FALL {
                break;
            }
        }
        Ok(nuisance.shares)
    }

    /// The step of Gauss and Newton of a run's shares, from derivatives by differences; 0 for those at a bound that it would leave, and for all where it is singular.
    fn step_of_shares(
        &self,
        model: &Model,
        run: usize,
        nuisance: &Nuisance,
        residuals: &Residuals,
    ) -> Result<DVector<f64>, DiagnoseError> {
        const STEP: f64 = 0.05;
        let shares = &nuisance.shares;
        let n = shares.len();
        let column = |k: usize| -> Result<Residuals, DiagnoseError> {
            let step = if shares[k] > 0.5 { -STEP } else { STEP };
            let mut moved = nuisance.clone();
            moved.shares[k] += step;
            let moved = self.residuals_with(model, run, &moved)?;
            Ok(moved.iter().zip(residuals).map(|(a, b)| (a - b) / step).collect())
        };
        let columns: Vec<Residuals> = (0..n).into_par_iter().map(column).collect::<Result<_, _>>()?;
        let gradient: Vec<f64> = columns.iter().map(|column| inner(column, residuals)).collect();
        let is_held = |k: usize| (shares[k] >= 1.0 && gradient[k] < 0.0) || (shares[k] <= 0.0 && gradient[k] > 0.0);
        let held: Vec<bool> = (0..n).map(is_held).collect();
        let matrix = DMatrix::from_fn(n, n, |i, j| match () {
            () if i == j => 1e-9 + inner(&columns[i], &columns[i]),
            () if held[i] || held[j] => 0.0,
            () => inner(&columns[i], &columns[j]),
        });
        let right = DVector::from_fn(n, |k, _| if held[k] { 0.0 } else { -gradient[k] });
        Ok(matrix.lu().solve(&right).unwrap_or_else(|| DVector::zeros(n)))
    }
}

/// Term and parameter of every coordinate, in order.
pub fn coordinates(model: &Model) -> Vec<(usize, usize)> {
    model.terms.iter().enumerate().flat_map(|(term, t)| (0..t.x.len()).map(move |parameter| (term, parameter))).collect()
}

/// Sum of squares.
pub fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// Inner product.
pub(super) fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Half the gradient of χ² and the information JᵀJ, of residuals (runs × values) with their derivatives.
pub(super) fn normal_equations(residuals: &[Residuals], derivatives: &Derivatives) -> (DVector<f64>, DMatrix<f64>) {
    let n = derivatives.len();
    let gradient = DVector::from_fn(n, |i, _| dot(&derivatives[i], residuals));
    let mut information = DMatrix::from_fn(n, n, |i, j| if i <= j { dot(&derivatives[i], &derivatives[j]) } else { 0.0 });
    information.fill_lower_triangle_with_upper_triangle();
    (gradient, information)
}

/// Inner product over all runs.
fn dot(a: &[Residuals], b: &[Residuals]) -> f64 {
    a.iter().zip(b).map(|(a, b)| inner(a, b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::{Free, Term};
    use crate::diagnose::waves::{Waves, candidate, power};

    #[test]
    fn a_fit_follows_a_curved_valley_to_its_end() {
        let mut plant = Waves::new(&[]);
        let mut law = candidate("power");
        law.parameters[0] = Free { bounds: [0.0, 1e6], scale: 100.0, ..law.parameters[0] };
        law.parameters.push(Free { name: "exponent", off: None, bounds: [0.1, 4.0], scale: 0.4, ..law.parameters[0] });
        plant.candidates = vec![law];
        for signal in &mut plant.signals {
            signal.values.iter_mut().enumerate().for_each(|(at, value)| *value += power(100.0, 0.2, at));
        }
        let start = Model::new(vec![Term { candidate: 0, x: vec![2000.0, 2.0] }], 1.0, false);
        let fit = Estimator::new(&plant).fit(&start, &[0, 1, 2, 3, 4, 5], Convergence::Full).unwrap();
        // Six standard errors.
        assert!((fit.model.terms[0].x[1] - 0.2).abs() < 0.01, "{:?}", fit.model);
        let per_value = fit.chi2 / fit.count as f64;
        assert!(per_value < 1.1, "{per_value}");
    }
}
