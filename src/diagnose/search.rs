//! Selection of causes: screening, backward elimination and replacement. Forward selection is in `forward.rs`.
//!
//! Models are fitted to the fit runs and compared on the select runs. The constants of the nominal model are free from the beginning, so that a
//! cause is credited only with what re-tuned constants cannot explain; the final elimination includes them.
//!
//! The file is long because screening, starts of fits, elimination and replacement share the state of one search.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::DiagnoseError;
use super::blocks::blocks;
use super::budget::{Phase, first_resolution};
use super::fit::{Convergence, Derivatives, Estimator, Fit, Residuals, coordinates, normal_equations, sum_of_squares};
use super::naming::LEAST_TAKEN;
use super::noise;
use super::plant::{Candidate, Free, Model, Plant, Term};
use super::projection::{tangents, without_directions};
use super::split::Split;
use super::subset::Subset;

/// A cause is adopted if χ² of the select runs falls by at least this share of the number of values, a misfit of σ/6 (rms), nearly what two
/// discretisations of the same physics differ by; ...
pub(super) const LEAST_GAIN: f64 = 0.03;
/// ... and by this share of what re-tuned constants leave unexplained, since other causes could fit the trace of one whose equation is not quite
/// right; ...
const LEAST_SHARE: f64 = 0.004;
/// ... and by this number of standard errors of the difference, ...
const LEAST_SIGMAS: f64 = 3.0;
/// ... and if BIC falls by at least this.
pub(super) const LEAST_BIC: f64 = 10.0;
/// Nothing more is sought once no more than this share of what re-tuned constants leave is left, and less than [`VISIBLE`]: further causes would be
/// minor, and would parcel out what the laws of the others do not follow.
pub(super) const SOUGHT: f64 = 0.02;
/// Misfit (χ² per value above 1) of half the noise.
pub(super) const VISIBLE: f64 = 0.25;
/// A cause that no select run shows is tried on another split if it lowers the fit runs' χ² by this share of the number of values.
const SEEN_BY_FIT: f64 = 0.1;
/// A cause whose linear estimate exceeds that by this factor is not left out on trial.
const CLEARLY: f64 = 3.0;
/// Two models are tied if their χ² differ by less than this or by less than these standard errors.
const TIED_CHI2: f64 = 12.0;
const TIED_SIGMAS: f64 = 2.0;
/// Forms of one cause that are fitted after screening.
const FORMS: usize = 2;
/// Candidates are fitted in the place of a cause whose linear estimate is at least this share of its own.
pub(super) const PROMISING_IN_PLACE: f64 = 0.3;
/// Candidates are screened in the place of a cause whose linear estimate from what they do beside it is at least this share of its own.
const LIKELY_IN_PLACE: f64 = 0.15;
/// Replacements that leave less than this multiple of what a model leaves get a discretisation of their own.
const NEARLY: f64 = 2.0;
/// Terms that are left out on trial in a round of elimination, the least significant ones.
const LEAST_SIGNIFICANT: usize = 3;
/// Share of the diagonal by which the linear estimate of a start is regularised.
const LEAST_RIDGE: f64 = 1e-6;
/// Cosine of two changes of the residuals from which on they are nearly the same.
const ALIKE: f64 = 0.9;
/// Starts are moved nearer to where a cause has no effect if what is missing is less than this share of what they change, ...
const ENOUGH: f64 = 0.5;
/// ... unless they then change less than this share of what is missing, as a limit beyond the range does.
const STILL_THERE: f64 = 0.3;
/// A fit begins on the way to a given start if the one by a linear estimate lowers χ² by less than this share of what it should: a limit beyond the range of the data does nothing,
/// and has no derivatives to begin with.
const AS_EXPECTED: f64 = 0.05;
/// Most alternations between nuisance parameters and the model.
const MOST_TURNS: usize = 10;
/// Turns are extrapolated if each goes on by at least this share of the one before, as if by no more than the other.
const LEAST_RATIO: f64 = 0.3;
const MOST_RATIO: f64 = 0.95;
/// Most alternations between the spread of the bench's faults and the model.
const MOST_SPREADS: usize = 3;

/// A fitted model with its residuals on all runs.
#[derive(Debug, Clone)]
pub struct Scored {
    /// The fit to the fit runs.
    pub fit: Fit,
    /// Residuals of all runs, whitened.
    pub residuals: Vec<Residuals>,
    /// Residuals of all runs in the given σ, without the bench's faults.
    pub plain: Vec<Residuals>,
    /// What the spread of the bench's faults costs in each run (log det of [`bench`](super::bench)).
    pub spread_costs: Vec<f64>,
    /// Cost of the runs that are selected on: χ² and that of the spread.
    pub select: f64,
    /// Cost of the fit runs.
    pub fitted: f64,
}

impl Scored {
    /// Cost of all runs.
    pub fn total(&self) -> f64 {
        self.select + self.fitted
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.fit.model
    }

    /// Number of fitted coordinates.
    pub fn freedom(&self) -> usize {
        coordinates(&self.fit.model).len()
    }

    /// Bayesian information criterion of the fit runs: χ² + k ln N.
    pub fn bic(&self) -> f64 {
        self.fitted + self.freedom() as f64 * (self.fit.count as f64).ln()
    }
}

/// The search's state.
pub struct Search<'a> {
    /// The plant with its nuisance parameters.
    pub estimator: Estimator<'a>,
    /// The runs.
    pub split: Split,
    /// χ² per value above 1 of re-tuned constants on the select runs.
    pub unexplained: f64,
    /// Models with one cause, and with two or more, that cost more are given up; infinite for none.
    pub limits: [f64; 2],
    /// The phase that is under way; no free form is a candidate in those by names.
    pub(super) phase: Phase,
    /// The places of which candidates are added; none for all.
    pub(super) places: Option<Vec<&'static str>>,
    /// Receives the current task, in words.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

/// A candidate fitted on top of the constants.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Index of the candidate.
    pub candidate: usize,
    /// The model with the candidate.
    pub scored: Scored,
}

/// A candidate fitted in the place of a term.
#[derive(Debug, Clone)]
pub struct Replacement {
    /// The candidate of the term.
    pub removed: usize,
    /// The candidate in its place, with the model.
    pub trial: Trial,
    /// By how much χ² of all runs exceeds that of the model with the term.
    pub excess: f64,
}

/// What a model's coordinates and the candidates do to the residuals of all runs, to first order about the model.
pub(super) struct Responses {
    /// The model.
    about: Model,
    /// Derivatives by its coordinates.
    derivatives: Derivatives,
    /// The change by every start of every candidate.
    starts: Changes,
}

/// Starts with their changes of the residuals.
type Changes = Vec<(Term, DVector<f64>)>;

/// Linearised effect of the candidates.
pub struct Screened {
    /// Every start of every candidate: its linear estimate of the fall of χ², and the model to fit from; best first.
    pub ranked: Vec<(f64, Model)>,
    /// Every start with its change of the residuals, orthogonal to the model's tangents.
    pub(super) columns: Changes,
    /// The residuals, orthogonal to the model's tangents.
    pub(super) rest: DVector<f64>,
    /// The model's tangents, orthonormal.
    pub(super) tangents: Vec<DVector<f64>>,
    /// The derivatives by the model's coordinates, of all runs.
    derivatives: Derivatives,
    /// The model's residuals, and the number of its terms.
    residuals: Vec<Residuals>,
    terms: usize,
}

impl Responses {
    /// By how much a coordinate of the model moves, to first order, if a term of a screening is added.
    pub(super) fn shift(&self, term: &Term, coordinate: usize, search: &Search) -> Option<f64> {
        let (start, change) = self.starts.iter().find(|(start, _)| start.candidate == term.candidate)?;
        // How far along the line from the start's off value the term is.
        let parameters = &search.candidate(term).parameters;
        let shares = start.x.iter().zip(&term.x).zip(parameters);
        let along = shares
            .filter_map(|((start, x), free)| Some((x - free.off?) / (start - free.off?)))
            .find(|along| along.is_finite())?;
        let columns: Vec<DVector<f64>> = self.derivatives.iter().map(|column| DVector::from_vec(column.concat())).collect();
        let n = columns.len();
        let mut information = DMatrix::from_fn(n, n, |i, j| columns[i].dot(&columns[j]));
        (0..n).for_each(|k| information[(k, k)] *= 1.0 + LEAST_RIDGE);
        let right = DVector::from_fn(n, |k, _| -along * columns[k].dot(change));
        Some(information.lu().solve(&right)?[coordinate])
    }

    /// True if a term of a screening does nearly what a coordinate of the model does, beside the others.
    pub(super) fn is_alike(&self, term: &Term, coordinate: usize) -> bool {
        let Some((_, change)) = self.starts.iter().find(|(start, _)| start.candidate == term.candidate) else { return false };
        let mut others = self.derivatives.clone();
        let own = DVector::from_vec(others.remove(coordinate).concat());
        let others = tangents(&others);
        let [own, change] = [&own, change].map(|column| without_directions(&others, column));
        own.dot(&change).abs() > ALIKE * own.norm() * change.norm()
    }
}

impl<'a> Search<'a> {
    /// A search that has not begun yet.
    pub fn new(plant: &'a dyn Plant, split: Split, progress: &'a (dyn Fn(&str) + Sync)) -> Self {
        let estimator = Estimator::new(plant);
        Self { estimator, split, progress, unexplained: 0.0, limits: [f64::INFINITY; 2], phase: Phase::Plain, places: None }
    }
}

impl Search<'_> {
    /// Enters a phase, unless causes are sought by names only: then all is of that one.
    pub(super) fn enter(&mut self, phase: Phase) {
        if self.phase != Phase::ByNames {
            self.phase = phase;
        }
    }

    /// True if something new may be begun; otherwise the search is cut short.
    pub(super) fn may_go_on(&self) -> bool {
        self.estimator.budget.allows(self.phase)
    }

    /// The candidate's name.
    pub fn id(&self, candidate: usize) -> &'static str {
        self.estimator.plant.candidates()[candidate].id
    }

    /// χ² of the runs that the search sees, without the cost of the spread.
    pub(super) fn chi2(&self, scored: &Scored) -> f64 {
        self.split.all().iter().map(|run| sum_of_squares(&scored.residuals[*run])).sum()
    }

    /// χ² per value above 1.
    pub(super) fn above(&self, scored: &Scored) -> f64 {
        (self.chi2(scored) / self.estimator.count(&self.split.all()) as f64 - 1.0).max(0.0)
    }

    /// Cost of a model on all runs, with ln N for each coordinate.
    pub fn cost(&self, scored: &Scored) -> f64 {
        scored.total() + scored.freedom() as f64 * (self.estimator.count(&self.split.all()) as f64).ln()
    }

    /// True if a model costs more than one with so many causes may.
    pub fn is_given_up(&self, scored: &Scored) -> bool {
        let limit = self.causes(scored).checked_sub(1).map_or(f64::INFINITY, |further| self.limits[further.min(1)]);
        self.cost(scored) > limit
    }

    /// Number of causes of a model that are no constants.
    pub(super) fn causes(&self, scored: &Scored) -> usize {
        scored.model().terms.iter().filter(|term| !self.candidate(term).is_constant).count()
    }

    /// Scores a fitted model on all runs.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated, as for all fits.
    pub fn score(&self, fit: Fit) -> Result<Scored, DiagnoseError> {
        let all: Vec<usize> = (0..self.estimator.plant.signals().len()).collect();
        let (residuals, spread_costs): (Vec<_>, Vec<_>) = self.estimator.costs_of(&fit.model, &all)?.into_iter().unzip();
        let sum = |runs: &[usize]| runs.iter().map(|run| sum_of_squares(&residuals[*run]) + spread_costs[*run]).sum();
        Ok(Scored {
            select: sum(&self.split.select),
            fitted: sum(&self.split.fit),
            plain: self.estimator.plain_residuals(&fit.model)?,
            fit,
            residuals,
            spread_costs,
        })
    }

    /// A scored model with its residuals on the runs that judge, under their present nuisance parameters.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn with_judged(&self, mut scored: Scored) -> Result<Scored, DiagnoseError> {
        for run in &self.split.judge {
            scored.residuals[*run] = self.estimator.residuals(&scored.fit.model, *run)?;
            scored.plain[*run] = self.estimator.plain_residuals_of(&scored.fit.model, *run)?;
        }
        Ok(scored)
    }

    /// Fits a model and scores it.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn fitted(&self, model: &Model) -> Result<Scored, DiagnoseError> {
        self.with_spread(self.estimator.fit(model, &self.split.fit, Convergence::Full)?, Convergence::Full)
    }

    /// Fits a model with its spread of the bench's faults as it is, and scores it.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn fitted_at_its_spread(&self, model: &Model) -> Result<Scored, DiagnoseError> {
        self.score(self.estimator.fit(model, &self.split.fit, Convergence::Full)?)
    }

    /// [`fitted_at_its_spread`](Self::fitted_at_its_spread) to the convergence of [`Convergence::Rank`].
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn ranked_at_its_spread(&self, model: &Model) -> Result<Scored, DiagnoseError> {
        self.score(self.estimator.fit(model, &self.split.fit, Convergence::Rank)?)
    }

    /// Fits the spread of the bench's faults and a model in turn, from a first fit of the model, and scores it.
    fn with_spread(&self, first: Fit, convergence: Convergence) -> Result<Scored, DiagnoseError> {
        let mut best = self.score(first)?;
        for _ in 0..MOST_SPREADS {
            let spread = self.estimator.spread(best.model(), &self.split.all())?;
            if spread == best.model().spread {
                break;
            }
            let model = Model { spread, ..best.model().clone() };
            best = self.score(self.estimator.fit(&model, &self.split.fit, convergence)?)?;
        }
        Ok(best)
    }

    /// Fits a model to the convergence of [`Convergence::Rank`] and scores it.
    pub(super) fn ranked(&self, model: &Model) -> Result<Scored, DiagnoseError> {
        self.with_spread(self.estimator.fit(model, &self.split.fit, Convergence::Rank)?, Convergence::Rank)
    }

    /// [`ranked`](Self::ranked) for a model with terms beyond those that were screened.
    pub(super) fn ranked_beyond(&self, model: &Model, screened: &Screened) -> Result<Scored, DiagnoseError> {
        let start = self.start_beyond(model, screened)?;
        let known = self.known(screened);
        self.with_spread(self.estimator.fit_beyond(&start, &self.split.fit, &known)?, Convergence::Rank)
    }

    /// The derivatives of a screening on the fit runs.
    fn known(&self, screened: &Screened) -> Derivatives {
        let all = self.split.all();
        let at: Vec<usize> = self.split.fit.iter().filter_map(|run| all.binary_search(run).ok()).collect();
        let of_fit_runs = |column: &Vec<Residuals>| at.iter().map(|run| column[*run].clone()).collect();
        screened.derivatives.iter().map(of_fit_runs).collect()
    }

    /// The start of a fit with terms beyond those that were screened: where the terms and the model's own coordinates together lower χ² most, by
    /// linear estimates, or on the way there. A term that does what others did for it before leads uphill if these stay as they are.
    ///
    /// # Errors
    /// [`DiagnoseError`] if `model` cannot be simulated.
    pub(super) fn start_beyond(&self, model: &Model, screened: &Screened) -> Result<Model, DiagnoseError> {
        let runs = &self.split.fit;
        let before: Vec<Residuals> = runs.iter().map(|run| screened.residuals[*run].clone()).collect();
        let chi2 = |residuals: &[Residuals]| residuals.iter().map(|r| sum_of_squares(r)).sum::<f64>();
        let moved = self.estimator.residuals_of(model, runs)?;
        let expected = screened.ranked.iter().find(|(_, ranked)| ranked == model).map_or(0.0, |(gain, _)| *gain);
        let change = moved.iter().zip(&before).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
        let columns: Derivatives = std::iter::once(change).chain(self.known(screened)).collect();
        let (gradient, mut information) = normal_equations(&before, &columns);
        (0..columns.len()).for_each(|k| information[(k, k)] *= 1.0 + LEAST_RIDGE);
        let mut best = (chi2(&moved), model.clone());
        let by = information.lu().solve(&-gradient).filter(|by| by[0] > 0.0 && by.iter().all(|by| by.is_finite()));
        for (by, share) in by.iter().flat_map(|by| [1.0, 0.5, 0.25].map(|share| (by, share))) {
            let start = self.on_the_way(model, screened.terms, &(by * share));
            // A point that cannot be simulated is none to start from.
            let Ok(residuals) = self.estimator.residuals_of(&start, runs) else { continue };
            if chi2(&residuals) < best.0 {
                best = (chi2(&residuals), start);
            }
        }
        let is_as_expected = chi2(&before) - best.0 >= AS_EXPECTED * expected;
        let given = if is_as_expected { None } else { self.given_start(model, best.0) };
        Ok(given.unwrap_or(best.1))
    }

    /// The model with its last term on the way from a given start to where it has no effect, where that leaves less than `chi2` of the fit runs, and the least.
    fn given_start(&self, model: &Model, chi2: f64) -> Option<Model> {
        let (last, before) = model.terms.split_last()?;
        let Candidate { starts, parameters, is_free_form, .. } = self.candidate(last);
        let on_the_way = |x: &Vec<f64>, share: f64| {
            let moved = x.iter().zip(parameters).map(|(x, free)| free.off.map_or(*x, |off| off + share * (x - off)));
            let term = Term { candidate: last.candidate, x: moved.collect() };
            let start = Model { terms: before.iter().cloned().chain([term]).collect(), ..model.clone() };
            let residuals = self.estimator.residuals_of(&start, &self.split.fit).ok()?;
            Some((residuals.iter().map(|r| sum_of_squares(r)).sum::<f64>(), start))
        };
        let starts = starts.iter().filter(|_| !is_free_form).flat_map(|x| [1.0, 0.8, 0.6, 0.4, 0.2].map(|share| (x, share)));
        let least = starts.filter_map(|(x, share)| on_the_way(x, share)).min_by(|a, b| a.0.total_cmp(&b.0));
        least.filter(|(left, _)| *left < chi2).map(|(_, start)| start)
    }

    /// A model with its terms from `first` on moved from their off values by the share `by[0]` of the way to where they are, and the coordinates of the
    /// terms before moved by the rest of `by`, within their bounds.
    fn on_the_way(&self, model: &Model, first: usize, by: &DVector<f64>) -> Model {
        let mut start = model.clone();
        for (k, (term, parameter)) in coordinates(model).into_iter().enumerate() {
            let Free { off, bounds: [low, high], .. } = self.candidate(&model.terms[term]).parameters[parameter];
            let x = &mut start.terms[term].x[parameter];
            *x = match off {
                _ if term < first => (*x + by[k + 1]).clamp(low, high),
                Some(off) => (off + by[0] * (*x - off)).clamp(low, high),
                None => *x,
            };
        }
        start
    }

    /// Alternates fits of nuisance parameters and model until χ² has converged. The two may be nearly collinear, as the times of jumps and a driver's slew rate,
    /// and each turn then comes nearer by the same small part: where two turns in a row go the same way, the sum of all further ones is added (Aitken 1926).
    ///
    /// # Errors
    /// [`DiagnoseError`] if a model cannot be simulated.
    pub fn settle(&mut self, scored: Scored) -> Result<Scored, DiagnoseError> {
        let mut scored = scored;
        let all = self.split.all();
        let mut last: Option<DVector<f64>> = None;
        for _ in 0..MOST_TURNS {
            let before = scored.total();
            self.estimator.set_faults(scored.model())?;
            let from = self.estimator.shares();
            self.estimator.fit_nuisances(scored.model(), &all)?;
            let step = self.estimator.shares() - from;
            scored = self.fitted(scored.model())?;
            let ratio = last.as_ref().map_or(0.0, |last| step.dot(last) / last.norm_squared());
            if (LEAST_RATIO..1.0).contains(&ratio) {
                scored = self.extrapolated(scored, &step * (ratio.min(MOST_RATIO) / (1.0 - ratio.min(MOST_RATIO))))?;
                last = None;
            } else {
                last = Some(step);
            }
            if before - scored.total()
                < 1e-3 * (before - self.estimator.count(&all) as f64).max(self.estimator.count(&all) as f64)
            {
                break;
            }
        }
        Ok(scored)
    }

    /// The model with the shares of all runs moved by `step`, if that leaves less.
    fn extrapolated(&mut self, scored: Scored, step: DVector<f64>) -> Result<Scored, DiagnoseError> {
        let before = self.estimator.state();
        self.estimator.move_shares(&step);
        match self.fitted(scored.model()) {
            Ok(moved) if moved.total() < scored.total() => Ok(moved),
            _ => {
                self.estimator.restore(before);
                Ok(scored)
            }
        }
    }

    /// Δχ² of `worse` over `better` on `runs`: in standard errors, and as it is.
    ///
    /// With a the residuals of the better model and d the difference of the predictions, both in σ, Δχ² = Σ (2 a d + d²). Its standard error is
    /// 2 |d| for independent noise, and 2 √Σ (Σ a d)² with inner sums over blocks within which a may be correlated; the larger counts.
    pub fn gap(&self, better: &Scored, worse: &Scored, runs: &[usize]) -> (f64, f64) {
        let (mut sum, mut apart, mut structure) = (0.0, 0.0, 0.0);
        for run in runs {
            let (better, worse) = (&better.residuals[*run], &worse.residuals[*run]);
            for block in blocks(&self.estimator.plant.signals()[*run], &self.estimator.noise, better.len()) {
                let mut along = 0.0;
                for (a, b) in better[block.clone()].iter().zip(&worse[block]) {
                    sum += b * b - a * a;
                    apart += (b - a) * (b - a);
                    along += a * (b - a);
                }
                structure += along * along;
            }
        }
        sum += runs.iter().map(|run| worse.spread_costs[*run] - better.spread_costs[*run]).sum::<f64>();
        (sum / (2.0 * f64::max(apart, structure).sqrt()).max(1e-9), sum)
    }

    /// True if `more` is worth its additional parameters over `less`.
    pub fn is_worth(&self, more: &Scored, less: &Scored) -> bool {
        self.takes_much(more, less) && self.is_significant(more, less)
    }

    /// True if χ² of the select runs falls by as much from `less` to `more` as is worth a cause.
    pub(super) fn takes_much(&self, more: &Scored, less: &Scored) -> bool {
        let runs = if self.split.select.is_empty() { &self.split.fit } else { &self.split.select };
        self.gap(more, less, runs).1 > self.worth(runs)
    }

    /// The least fall of χ² of `runs` for which a cause is adopted.
    fn worth(&self, runs: &[usize]) -> f64 {
        self.estimator.count(runs) as f64 * LEAST_GAIN.max(LEAST_SHARE * self.unexplained)
    }

    /// By how much χ² of two discretisations of one physics may differ.
    pub(super) fn tolerance(&self) -> f64 {
        LEAST_GAIN * self.estimator.count(&self.split.all()) as f64
    }

    /// True if the additional parameters of `more` over `less` are beyond chance, however little they change.
    pub(super) fn is_significant(&self, more: &Scored, less: &Scored) -> bool {
        let runs = if self.split.select.is_empty() { &self.split.fit } else { &self.split.select };
        self.is_significant_on(runs, more, less)
    }

    pub(super) fn is_significant_on(&self, runs: &[usize], more: &Scored, less: &Scored) -> bool {
        self.gap(more, less, runs).0 > LEAST_SIGMAS && more.bic() < less.bic() - LEAST_BIC
    }

    /// True if a further parameter is beyond chance on the select runs, or takes more than what is left with it, or the fit runs need it and the select runs, which may
    /// hardly show it, do not speak against it.
    pub(super) fn is_shown(&self, more: &Scored, less: &Scored) -> bool {
        let is_against = || self.gap(less, more, &self.split.select).0 > TIED_SIGMAS;
        self.is_significant(more, less)
            || self.takes_more_than_it_leaves(more, less)
            || (self.is_seen_by_fit(more, less) && self.is_significant_on(&self.split.fit, more, less) && !is_against())
    }

    /// True if `more` takes more than it leaves: that cannot stand for it, though on the select runs, which have to show it too, it may be so much that all could be chance.
    pub(super) fn takes_more_than_it_leaves(&self, more: &Scored, less: &Scored) -> bool {
        self.takes_much(more, less) && self.above(less) > 2.0 * self.above(more)
    }

    /// True if `more` is worth its additional parameters over `less`, which has another cause in its place: as is worth a cause, or as the fit runs need, or
    /// beyond chance where `less` leaves no more than another discretisation may.
    pub(super) fn is_worth_in_place(&self, more: &Scored, less: &Scored) -> bool {
        self.is_worth(more, less)
            || (self.is_shown(more, less) && self.is_seen_by_fit(more, less))
            || (self.above(less) < LEAST_GAIN && self.is_significant_on(&self.split.all(), more, less))
    }

    /// The candidate of a term.
    pub fn candidate(&self, term: &Term) -> &Candidate {
        &self.estimator.plant.candidates()[term.candidate]
    }

    /// True if the last term of a model is a free form.
    pub(super) fn ends_free(&self, model: &Model) -> bool {
        model.terms.last().is_some_and(|term| self.candidate(term).is_free_form)
    }

    /// True if the runs cannot tell two models apart.
    pub fn is_tied(&self, better: &Scored, other: &Scored) -> bool {
        let (sigmas, gap) = self.gap(better, other, &self.split.all());
        gap < TIED_CHI2 || sigmas < TIED_SIGMAS
    }

    /// Sets the noise to that of what does not repeat in the residuals of `scored`, if it differs from the present one; true if it does.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub fn measure_noise(&mut self, scored: &Scored) -> Result<bool, DiagnoseError> {
        let estimator = &mut self.estimator;
        let mut seen = estimator.used.clone();
        self.split.judge.iter().for_each(|run| seen[*run].fill(false));
        let Some(noise) = noise::estimate(estimator.plant.signals(), &seen, &scored.plain) else { return Ok(false) };
        if !noise.differs(&estimator.noise) {
            return Ok(false);
        }
        estimator.noise = noise;
        estimator.set_faults(scored.model())?;
        Ok(true)
    }

    /// All constants at their nominal values, as terms.
    fn constants(&self) -> Vec<Term> {
        // Motion depends on areal mass only through its ratio to the stiffness.
        let candidates = self.estimator.plant.candidates().iter().enumerate();
        let constants = candidates.filter(|(_, c)| c.is_constant && c.id != "areal-mass");
        constants
            .map(|(candidate, c)| Term { candidate, x: c.parameters.iter().map(|p| p.off.unwrap_or(p.bounds[0])).collect() })
            .collect()
    }

    /// The model with all constants free; missing ones come first.
    pub fn with_constants(&self, model: &Model) -> Model {
        Model { terms: [self.missing_constants(model), model.terms.clone()].concat(), ..model.clone() }
    }

    fn missing_constants(&self, model: &Model) -> Vec<Term> {
        self.constants().into_iter().filter(|c| model.terms.iter().all(|term| term.candidate != c.candidate)).collect()
    }

    /// The model with those of the missing constants that are significant beside its causes.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated with all constants.
    pub fn with_significant_constants(&self, from: Scored) -> Result<Scored, DiagnoseError> {
        let own = from.model().terms.len();
        let missing = self.missing_constants(from.model());
        let is_missing = |c: &Candidate| missing.iter().any(|term| self.id(term.candidate) == c.id);
        let screened = self.screen_of(&from, is_missing)?;
        let of = |term: &Term| screened.columns.iter().find(|(start, _)| start.candidate == term.candidate);
        let columns: Vec<_> = missing.iter().filter_map(of).collect();
        let estimate = least_squares(&columns, &screened.rest);
        let Some((_, weights)) = estimate.filter(|(gain, _)| *gain > LEAST_BIC) else { return Ok(from) };
        let starts = columns.iter().zip(weights.iter()).map(|((start, _), along)| self.moved(start, *along).0);
        let mut all = self.fitted(&with(from.model(), starts))?;
        while all.model().terms.len() > own {
            let without = |index: usize| self.ranked(&self.without(&all, index).ok()?).ok();
            let shorter = (own..all.model().terms.len()).filter_map(without);
            let Some(least) = shorter.min_by(|a, b| a.total().total_cmp(&b.total())) else { return Ok(from) };
            if self.is_significant(&all, &least) {
                return Ok(all);
            }
            all = self.fitted(least.model())?;
        }
        Ok(from)
    }

    /// The nominal model with its constants fitted.
    ///
    /// # Errors
    /// [`DiagnoseError`] if a model cannot be simulated.
    pub fn calibrated(&mut self, resolution: f64) -> Result<Scored, DiagnoseError> {
        let scored = self.fitted(&Model::new(self.constants(), resolution, false))?;
        let scored = self.settle(scored)?;
        self.set_unexplained(&scored);
        Ok(scored)
    }

    /// Linear estimates of how far every start of those candidates that are wanted would lower χ² on all runs, beyond a refit of the model's own coordinates.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn screen_of(&self, from: &Scored, is_wanted: impl Fn(&Candidate) -> bool) -> Result<Screened, DiagnoseError> {
        Ok(self.screened(from, &self.responses(from.model(), |_, c| is_wanted(c))?, None))
    }

    /// What the coordinates of a model do, and those candidates that are wanted and not in it yet, with the time steps of the search.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn responses(
        &self,
        about: &Model,
        is_wanted: impl Fn(usize, &Candidate) -> bool,
    ) -> Result<Responses, DiagnoseError> {
        let runs = self.split.all();
        let about = Model { fine: false, ..about.clone() };
        let used: Vec<&str> = about.terms.iter().map(|term| self.id(term.candidate)).collect();
        let candidates = self.estimator.plant.candidates().iter().enumerate();
        let wanted = candidates.filter(|(index, c)| is_wanted(*index, c) && !used.contains(&c.id));
        // Free forms are linear in their weights: each start is by itself.
        let of_candidate = |(candidate, c): (usize, &Candidate)| -> Vec<Vec<Term>> {
            let starts: Vec<Term> = c.starts.iter().map(|x| Term { candidate, x: x.clone() }).collect();
            if c.is_free_form { starts.into_iter().map(|start| vec![start]).collect() } else { vec![starts] }
        };
        let groups: Vec<Vec<Term>> = wanted.flat_map(of_candidate).collect();
        let derivatives = self.estimator.derivatives(&about, &runs)?;
        let plain = DVector::from_vec(self.estimator.residuals_of(&about, &runs)?.concat());
        let change = |term: &Term| {
            let residuals = self.estimator.residuals_of(&with(&about, [term.clone()]), &runs).ok()?;
            Some(DVector::from_vec(residuals.concat()) - &plain)
        };
        let starts = groups.into_par_iter().flat_map_iter(|starts| self.sized(&starts, plain.norm(), &change)).collect();
        Ok(Responses { about, derivatives, starts })
    }

    /// Starts of one law with the `change` of the residuals by each. One that changes them by far more than what is `missing`, the norm of the residuals, is moved nearer to where the cause has
    /// no effect, until it changes them by about as much: what a cause does near a resonance is proportional to its parameters only as long as it is small.
    fn sized(&self, starts: &[Term], missing: f64, change: &impl Fn(&Term) -> Option<DVector<f64>>) -> Changes {
        let mut sized = Changes::new();
        let mut far: Vec<&Term> = Vec::new();
        for start in starts {
            let own = self.candidate(start);
            // One that is further out than another that was too far already.
            if far.iter().any(|near| is_beyond(start, near, &own.parameters)) {
                continue;
            }
            let Some(by) = change(start) else { continue };
            let share = missing / by.norm();
            if own.is_free_form || share > ENOUGH {
                sized.push((start.clone(), by));
                continue;
            }
            let nearer = |(x, free): (&f64, &Free)| free.off.map_or(*x, |off| off + share * (x - off));
            let term = Term { candidate: start.candidate, x: start.x.iter().zip(&own.parameters).map(nearer).collect() };
            match change(&term).filter(|less| less.norm() > STILL_THERE * missing) {
                Some(less) => {
                    far.push(start);
                    sized.push((term, less));
                }
                None => sized.push((start.clone(), by)),
            }
        }
        sized
    }

    /// Linear estimates of how far every start would lower χ² of `from`, beyond a refit of its own coordinates. `from` is the model of the responses, or
    /// that one without its term `removed`: then the estimates are rough, as near resonance what a candidate does depends on what is there already.
    pub(super) fn screened(&self, from: &Scored, responses: &Responses, removed: Option<usize>) -> Screened {
        let (base, candidates) = (from.model(), self.estimator.plant.candidates());
        let of_base = coordinates(&responses.about).into_iter().zip(&responses.derivatives);
        let derivatives: Derivatives =
            of_base.filter(|((term, _), _)| Some(*term) != removed).map(|(_, column)| column.clone()).collect();
        let own = tangents(&derivatives);
        let rest = without_directions(&own, &joined(from, &self.split.all()));
        let column = |(term, change): &(Term, DVector<f64>)| {
            let column = without_directions(&own, change);
            (column.norm_squared() > 1e-12).then_some((term.clone(), column))
        };
        let columns: Changes = responses.starts.par_iter().filter_map(column).collect();
        let mut ranked = Vec::new();
        for (candidate, _) in candidates.iter().enumerate().filter(|(_, c)| c.is_free_form) {
            let own: Vec<_> = columns.iter().filter(|(term, _)| term.candidate == candidate).collect();
            ranked.extend(self.free_start(&own, &rest).map(|(gain, term)| (gain, with(base, [term]))));
        }
        for (term, column) in columns.iter().filter(|(term, _)| !candidates[term.candidate].is_free_form) {
            let along = -rest.dot(column) / column.norm_squared();
            let (moved, right) = self.moved(term, along);
            let gain = if right { rest.dot(column).powi(2) / column.norm_squared() } else { 0.0 };
            ranked.push((gain, with(base, [moved])));
        }
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (residuals, terms) = (from.residuals.clone(), base.terms.len());
        Screened { ranked, columns, rest, tangents: own, derivatives, residuals, terms }
    }

    /// The linear estimate of a free form's weights within their bounds, with the fall of χ²: least squares of −`rest` on the `columns` of its starts,
    /// without those that leave their bounds, one after the other. None if nothing is left.
    fn free_start(&self, columns: &[&(Term, DVector<f64>)], rest: &DVector<f64>) -> Option<(f64, Term)> {
        let mut kept: Vec<&(Term, DVector<f64>)> = columns.to_vec();
        while let Some((first, _)) = kept.first() {
            let (gain, weights) = least_squares(&kept, rest)?;
            let mut term = Term { candidate: first.candidate, x: vec![0.0; first.x.len()] };
            for ((start, _), weight) in kept.iter().zip(weights.iter()) {
                term.x.iter_mut().zip(&start.x).for_each(|(x, by)| *x += weight * by);
            }
            let parameters = &self.candidate(&term).parameters;
            let excess = |k: usize| {
                let at = kept[k].0.x.iter().position(|x| *x != 0.0).unwrap_or(0);
                let [low, high] = parameters[at].bounds;
                (low - term.x[at]).max(term.x[at] - high) / parameters[at].scale
            };
            match (0..kept.len()).filter(|k| excess(*k) > 0.0).max_by(|a, b| excess(*a).total_cmp(&excess(*b))) {
                Some(worst) => {
                    kept.remove(worst);
                }
                None => return Some((gain, term)),
            }
        }
        None
    }

    /// Sets of `size` wanted causes of a screening that would lower χ² most together, by linear estimates, each with the model to fit from; best first,
    /// one for each choice of causes.
    pub(super) fn sets(
        &self,
        base: &Model,
        screened: &Screened,
        size: usize,
        is_wanted: impl Fn(&Term) -> bool,
    ) -> Vec<(f64, Model)> {
        let is_law = |term: &Term| !self.candidate(term).is_free_form && !self.candidate(term).is_variant && is_wanted(term);
        let columns: Vec<_> = screened.columns.iter().filter(|(term, _)| is_law(term)).collect();
        let norms: Vec<f64> = columns.iter().map(|(_, column)| column.norm()).collect();
        let cosines =
            DMatrix::from_fn(columns.len(), columns.len(), |i, j| columns[i].1.dot(&columns[j].1) / (norms[i] * norms[j]));
        let right: Vec<f64> = columns.iter().zip(&norms).map(|((_, column), norm)| -column.dot(&screened.rest) / norm).collect();
        let mut found = BTreeMap::<Vec<&str>, (f64, Model)>::new();
        let mut open = vec![Subset::default()];
        while let Some(subset) = open.pop() {
            if subset.members.len() < size {
                let first = subset.members.last().map_or(0, |last| last + 1);
                let has = |k: usize| {
                    subset.members.iter().any(|own| self.id(columns[*own].0.candidate) == self.id(columns[k].0.candidate))
                };
                open.extend((first..columns.len()).filter(|k| !has(*k)).filter_map(|k| subset.with(k, &cosines, right[k])));
                continue;
            }
            let mut ids: Vec<&str> = subset.members.iter().map(|k| self.id(columns[*k].0.candidate)).collect();
            ids.sort_unstable();
            if found.get(&ids).is_some_and(|(gain, _)| *gain >= subset.gain) {
                continue;
            }
            let moved = |(k, weight): (&usize, f64)| {
                let (term, is_right) = self.moved(&columns[*k].0, weight / norms[*k]);
                is_right.then_some(term)
            };
            if let Some(terms) = subset.members.iter().zip(subset.weights()).map(moved).collect::<Option<Vec<Term>>>() {
                found.insert(ids, (subset.gain, with(base, terms)));
            }
        }
        let mut sets: Vec<(f64, Model)> = found.into_values().collect();
        sets.sort_by(|a, b| b.0.total_cmp(&a.0));
        sets
    }

    /// A start moved along the line from its off value, and true if the bounds allow the direction: a cause of one sign that the data need with the
    /// other one is not moved.
    pub(super) fn moved(&self, start: &Term, along: f64) -> (Term, bool) {
        let parameters = &self.estimator.plant.candidates()[start.candidate].parameters;
        if parameters.iter().all(|p| p.off.is_none_or(|off| off <= p.bounds[0] || off >= p.bounds[1])) && along < 0.05 {
            return (start.clone(), false);
        }
        let moved = |(x, p): (&f64, &Free)| match p.off {
            Some(off) => (off + along.clamp(-1.5, 2.0) * (x - off)).clamp(p.bounds[0], p.bounds[1]),
            None => *x,
        };
        (Term { candidate: start.candidate, x: start.x.iter().zip(parameters).map(moved).collect() }, true)
    }

    /// The best screened starts of `count` different candidates, at most [`FORMS`] of one cause.
    pub(super) fn finalists<'m>(&self, screened: impl IntoIterator<Item = &'m (f64, Model)>, count: usize) -> Vec<Model> {
        let mut chosen: Vec<Model> = Vec::new();
        for model in first_of_each(screened, usize::MAX, |term| term.candidate) {
            let id = |model: &Model| model.terms.last().map(|term| self.id(term.candidate));
            if chosen.len() < count && chosen.iter().filter(|other| id(other) == id(&model)).count() < FORMS {
                chosen.push(model);
            }
        }
        chosen
    }

    /// The criterion of ranking: χ² of the select runs, or BIC where there are none.
    pub fn judged(&self, scored: &Scored) -> f64 {
        if self.split.select.is_empty() { scored.bic() } else { scored.select }
    }

    /// The model with the plain law of the cause of term `index`, unless its own law is significantly better or the plain one cannot be fitted.
    pub(super) fn with_its_plain_law(&self, scored: Scored, index: usize) -> Scored {
        let Some(model) = self.plain_law(scored.model(), index) else { return scored };
        (self.progress)(&format!("the plain law of {}", self.id(model.terms[index].candidate)));
        match self.fitted_at_its_spread(&model) {
            Ok(plain) if !self.is_shown(&scored, &plain) => plain,
            _ => scored,
        }
    }

    /// The model with the plain law of the cause of term `index`; none if it has that already.
    pub(super) fn plain_law(&self, model: &Model, index: usize) -> Option<Model> {
        let term = &model.terms[index];
        let own = self.candidate(term);
        let of_plain = |candidate: usize| {
            let plain = &self.estimator.plant.candidates()[candidate];
            let at = |free: &Free| own.parameters.iter().position(|p| p.name == free.name).map(|at| term.x[at]);
            let x = plain.parameters.iter().map(at).collect::<Option<Vec<f64>>>()?;
            (plain.id == own.id && !plain.is_variant).then_some(Term { candidate, x })
        };
        let plain = (0..self.estimator.plant.candidates().len()).find_map(of_plain).filter(|_| own.is_variant)?;
        let mut model = model.clone();
        model.terms[index] = plain;
        Some(model)
    }

    /// The starts of a model with other laws of the cause of term `index` than its plain one; what both laws have in common stays as it is.
    pub(super) fn other_laws(&self, model: &Model, index: usize) -> Vec<Model> {
        let term = &model.terms[index];
        let own = self.candidate(term);
        let value = |name: &str| own.parameters.iter().position(|p| p.name == name).map(|at| term.x[at]);
        let mut found: Vec<Model> = Vec::new();
        for (candidate, variant) in self.estimator.plant.candidates().iter().enumerate() {
            if variant.id != own.id || !variant.is_variant {
                continue;
            }
            for start in &variant.starts {
                let x = start.iter().zip(&variant.parameters).map(|(x, p)| value(p.name).unwrap_or(*x)).collect();
                let mut other = model.clone();
                other.terms[index] = Term { candidate, x };
                if !found.contains(&other) {
                    found.push(other);
                }
            }
        }
        found
    }

    /// Sets what re-tuned constants leave to what `constants` leaves.
    pub fn set_unexplained(&mut self, constants: &Scored) {
        let (chi2, runs) = self.chi2_to_judge_by(constants);
        self.unexplained = (chi2 / self.estimator.count(runs).max(1) as f64 - 1.0).max(0.0);
    }

    /// True if more is sought: a model leaves a visible share of what re-tuned constants leave, or more than half the noise.
    pub(super) fn is_sought(&self, scored: &Scored) -> bool {
        self.share_left(scored) > SOUGHT || self.above(scored) > VISIBLE
    }

    /// What a model leaves, as a share of what re-tuned constants leave.
    pub(super) fn share_left(&self, scored: &Scored) -> f64 {
        let (chi2, runs) = self.chi2_to_judge_by(scored);
        let left = chi2 / self.estimator.count(runs).max(1) as f64 - 1.0;
        if self.unexplained > 0.0 { left / self.unexplained } else { 1.0 }
    }

    /// χ² of the select runs, or of the fit runs where there are none.
    pub(super) fn chi2_to_judge_by(&self, scored: &Scored) -> (f64, &[usize]) {
        if self.split.select.is_empty() { (scored.fitted, &self.split.fit) } else { (scored.select, &self.split.select) }
    }

    /// True if the fit runs need what `less` leaves out.
    pub(super) fn is_seen_by_fit(&self, more: &Scored, less: &Scored) -> bool {
        less.fitted - more.fitted > self.least_seen()
    }

    /// Least rise of χ² by which the fit runs need a cause.
    fn least_seen(&self) -> f64 {
        SEEN_BY_FIT.max(LEAST_SHARE * self.unexplained) * self.estimator.count(&self.split.fit) as f64
    }

    /// Backward elimination: removes terms that are not worth it, the least needed first.
    ///
    /// # Errors
    /// [`DiagnoseError`] if a model cannot be simulated.
    pub fn backward(&self, from: Scored) -> Result<Scored, DiagnoseError> {
        let (mut best, mut kept) = (from, Vec::new());
        loop {
            let shorter = |index: usize| {
                (self.progress)(&format!("doing without {}", self.id(best.model().terms[index].candidate)));
                self.ranked(&self.without(&best, index)?)
            };
            // First those within the error of the discretisation, or of the one that the search began with: a finer one and a constant may stand together for one between.
            // They stay where more than half the noise comes back in the discretisation that suits the model without them, too.
            let plant = self.estimator.plant;
            let resolution = best.model().resolution.min(first_resolution(plant));
            let is_idle = |term: &Term| !plant.is_credible(term, resolution) && !kept.contains(&term.candidate);
            if let Some(idle) = best.model().terms.iter().position(is_idle) {
                let most = self.above(&best) + VISIBLE;
                let without = self.fitted(shorter(idle)?.model())?;
                let without = if self.above(&without) < most { without } else { self.resolve(without, Convergence::Full) };
                if self.above(&without) < most {
                    best = without;
                } else {
                    kept.push(best.model().terms[idle].candidate);
                }
                continue;
            }
            // A term without which the model diverges is needed, and so is one whose work would go to faults of the bench.
            let shorter = self.least_significant(&best).into_iter().filter_map(|index| shorter(index).ok());
            let shorter = shorter.filter(|shorter| self.left_to_faults(&best, shorter).is_empty());
            let least = shorter.min_by(|a, b| a.total().total_cmp(&b.total()));
            let Some(Ok(least)) = least.map(|least| self.fitted(least.model())) else { return Ok(best) };
            if self.is_needed(&best, &least) || self.is_seen_by_fit(&best, &least) {
                return Ok(best);
            }
            best = least;
        }
    }

    /// The kinds of the bench's faults that have a mean over the runs beyond chance without a term of `best`, and none with it: a delay of all runs is no offset of their clocks.
    pub(super) fn left_to_faults(&self, best: &Scored, without: &Scored) -> Vec<usize> {
        let shared = |scored: &Scored| self.estimator.shared_faults(scored.model(), &self.split.all()).unwrap_or_default();
        let mut kinds = shared(without);
        if !kinds.is_empty() {
            let with = shared(best);
            kinds.retain(|kind| !with.contains(kind));
        }
        kinds
    }

    /// A model with faults of the bench of some kinds held off.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn without_faults(&self, scored: &Scored, kinds: &[usize]) -> Result<Scored, DiagnoseError> {
        let mut model = scored.model().clone();
        kinds.iter().for_each(|kind| model.spread.of[*kind] = 0.0);
        self.ranked_at_its_spread(&model)
    }

    /// True if a term of a model does more than its discretisation may be wrong by.
    pub(super) fn is_credible(&self, scored: &Scored, term: &Term) -> bool {
        self.estimator.plant.is_credible(term, scored.model().resolution)
    }

    /// A model without term `index`, whose other coordinates make up for it as far as they can by the linear estimate, if that lowers χ².
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model without the term cannot be simulated.
    pub(super) fn without(&self, best: &Scored, index: usize) -> Result<Model, DiagnoseError> {
        let model = best.model();
        let information = &best.fit.information;
        let (own, others): (Vec<_>, Vec<_>) =
            coordinates(model).into_iter().enumerate().partition(|(_, (term, _))| *term == index);
        let mut plain = model.clone();
        let removed = plain.terms.remove(index);
        if others.is_empty() || information.nrows() != own.len() + others.len() {
            return Ok(plain);
        }
        let parameters = &self.candidate(&removed).parameters;
        let by = DVector::from_iterator(own.len(), removed.x.iter().zip(parameters).map(|(x, p)| p.off.unwrap_or(*x) - x));
        let of = |rows: &[(usize, (usize, usize))], columns: &[(usize, (usize, usize))]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| information[(rows[i].0, columns[j].0)])
        };
        let mut among_others = of(&others, &others);
        (0..others.len()).for_each(|k| among_others[(k, k)] *= 1.0 + LEAST_RIDGE);
        let Some(shift) = among_others.lu().solve(&-(of(&others, &own) * by)) else { return Ok(plain) };
        let moved = self.estimator.moved_by(&plain, &shift).0;
        let chi2 = |model: &Model| -> Result<f64, DiagnoseError> {
            Ok(self.estimator.residuals_of(model, &self.split.fit)?.iter().map(|r| sum_of_squares(r)).sum())
        };
        let of_plain = chi2(&plain)?;
        Ok(if chi2(&moved).is_ok_and(|of_moved| of_moved < of_plain) { moved } else { plain })
    }

    /// The [`LEAST_SIGNIFICANT`] terms by Wald's statistic dᵀ C⁻¹ d, with d the distances of a term's coordinates from their off values and C their
    /// covariance; without those that are [`CLEARLY`] seen in the fit runs.
    fn least_significant(&self, best: &Scored) -> Vec<usize> {
        let covariance = covariance(&best.fit.information);
        let mut first = 0;
        let mut order: Vec<(f64, usize)> = Vec::new();
        for (index, term) in best.model().terms.iter().enumerate() {
            let parameters = &self.candidate(term).parameters;
            let own: Vec<(usize, f64)> =
                (0..term.x.len()).filter_map(|k| Some((first + k, term.x[k] - parameters[k].off?))).collect();
            first += term.x.len();
            let part = DMatrix::from_fn(own.len(), own.len(), |i, j| covariance[(own[i].0, own[j].0)]);
            let d = DVector::from_iterator(own.len(), own.iter().map(|(_, d)| *d));
            let wald = part.lu().solve(&d).map_or(0.0, |solved| d.dot(&solved));
            order.push((if wald.is_finite() { wald } else { 0.0 }, index));
        }
        order.retain(|(wald, _)| *wald < CLEARLY * self.least_seen());
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.into_iter().take(LEAST_SIGNIFICANT).map(|(_, index)| index).collect()
    }

    /// True if `less`, a model with one term less, leaves out too much: new physics has to be worth it on the select runs, a constant has to be significant
    /// only, on all runs, as one run may show it more than the others.
    fn is_needed(&self, more: &Scored, less: &Scored) -> bool {
        let kept = |term: &Term| less.model().terms.iter().any(|other| other.candidate == term.candidate);
        let is_constant = more.model().terms.iter().any(|term| !kept(term) && self.candidate(term).is_constant);
        if is_constant { self.is_significant_on(&self.split.all(), more, less) } else { self.is_worth(more, less) }
    }

    /// Replaces every cause by other candidates, `most` of each.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the derivatives of a model cannot be simulated.
    pub fn replacements(&self, best: &Scored, most: usize) -> Result<Vec<Replacement>, DiagnoseError> {
        let mut found: Vec<(usize, Trial)> = Vec::new();
        (self.progress)("screening all candidates beside the causes");
        let responses = self.responses(best.model(), |_, candidate| !(candidate.is_free_form || candidate.is_variant))?;
        for (index, removed) in best.model().terms.iter().enumerate() {
            if !self.may_go_on() {
                break;
            }
            (self.progress)(&format!("trying others in the place of {}", self.id(removed.candidate)));
            // On the same bench: faults could stand in for the cause.
            let without = self.without(best, index).and_then(|model| self.ranked_at_its_spread(&model));
            let Ok(without) = without else { continue };
            // What candidates do beside the cause leads to those that are worth a screening without it; other laws of a cause cannot be tried beside it.
            let own = without.total() - best.total();
            // A constant that is freed beside a cause may take less than a cause has to, or be within the error of the discretisation.
            if own < self.worth(&self.split.all()) || !self.is_credible(best, removed) {
                continue;
            }
            if self.candidate(removed).is_constant {
                found.extend(self.laws_in_place(&without, removed, best));
            }
            let beside = self.screened(&without, &responses, Some(index));
            let likely = beside.ranked.iter().take_while(|(gain, _)| *gain >= LIKELY_IN_PLACE * own);
            let likely: Vec<usize> = likely.filter_map(|(_, model)| Some(model.terms.last()?.candidate)).collect();
            let is_law = |c: &Candidate| c.id == self.id(removed.candidate) && !c.is_free_form;
            let is_likely = |at: usize, c: &Candidate| at != removed.candidate && (likely.contains(&at) || is_law(c));
            let screened = self.screened(&without, &self.responses(without.model(), is_likely)?, None);
            let promising = screened.ranked.iter().filter(|(gain, _)| *gain >= PROMISING_IN_PLACE * own);
            // Other laws of another cause are tried where its plain one is nearly as good, or once it has the place.
            for model in first_of_each(promising, most, |term| self.id(term.candidate)) {
                let Some(candidate) = model.terms.last().map(|term| term.candidate) else { continue };
                let Ok(scored) = self.ranked_beyond(&model, &screened) else { continue };
                let scored = self.in_its_resolution(scored, best);
                let is_nearly_as_good =
                    self.is_nearly_as_good(&scored, best) || without.total() - scored.total() > LEAST_TAKEN * own;
                if is_nearly_as_good && !self.estimator.plant.candidates()[candidate].is_variant {
                    let other = self.with_its_law(scored.clone(), model.terms.len() - 1);
                    let law = other.model().terms.last().map(|term| term.candidate).filter(|law| *law != candidate);
                    found.extend(law.map(|candidate| (removed.candidate, Trial { candidate, scored: other })));
                }
                found.push((removed.candidate, Trial { candidate, scored }));
            }
        }
        let replacement = |(removed, trial): (usize, Trial)| {
            let excess = trial.scored.total() - best.total();
            Replacement { removed, trial, excess }
        };
        Ok(found.into_iter().map(replacement).collect())
    }

    /// Other laws of the causes of the model `without` a constant: next to a plain law it may stand for a further parameter, as damping does for that of a clamp.
    fn laws_in_place(&self, without: &Scored, removed: &Term, best: &Scored) -> Vec<(usize, Trial)> {
        let plain = (0..without.model().terms.len()).filter(|index| {
            let candidate = self.candidate(&without.model().terms[*index]);
            !(candidate.is_variant || candidate.is_free_form)
        });
        let models = plain.flat_map(|index| self.other_laws(without.model(), index).into_iter().map(move |model| (index, model)));
        let trial = |(index, model): (usize, Model)| {
            let scored = self.ranked_at_its_spread(&model).ok()?;
            let scored = self.in_its_resolution(scored, best);
            Some((removed.candidate, Trial { candidate: model.terms[index].candidate, scored }))
        };
        models.filter_map(trial).collect()
    }

    /// A replacement in the discretisation that suits it, if it is nearly as good as `best`, the discretisation of which may stand for what a wrong cause lacks.
    fn in_its_resolution(&self, trial: Scored, best: &Scored) -> Scored {
        if self.is_nearly_as_good(&trial, best) { self.resolve(trial, Convergence::Rank) } else { trial }
    }

    /// True if a replacement leaves little more than `best`, which leaves something.
    fn is_nearly_as_good(&self, trial: &Scored, best: &Scored) -> bool {
        let left = self.above(best);
        left > LEAST_GAIN && self.above(trial) < NEARLY * left
    }

    /// The discretisation with the least χ² over all runs, by steps from the present one. To rank models, steps end where they lower χ² by less than half
    /// of what a cause would have to: finer models cost more, and the error that is left is adopted as no cause. Derivatives
    /// hardly depend on the discretisation, so a step is fitted with those of the model first, and in full if that lowers χ².
    pub fn resolve(&self, best: Scored, convergence: Convergence) -> Scored {
        let least = match convergence {
            Convergence::Rank => 0.5 * self.worth(&self.split.all()),
            Convergence::Full => 0.0,
        };
        let Ok(derivatives) = self.estimator.derivatives(best.model(), &self.split.fit) else { return best };
        let resolutions = self.estimator.plant.resolutions();
        let mut best = best;
        let mut tried = vec![best.model().resolution];
        loop {
            let Some(at) = resolutions.iter().position(|r| *r == best.model().resolution) else { return best };
            let neighbours = [at.checked_sub(1), Some(at + 1)].into_iter().flatten().filter_map(|k| resolutions.get(k).copied());
            let mut moved = false;
            for resolution in neighbours.filter(|r| !tried.contains(r)).collect::<Vec<_>>() {
                tried.push(resolution);
                (self.progress)(&format!("{resolution} joints per actuator"));
                // A discretisation in which the model diverges is none for it.
                let model = Model { resolution, ..best.model().clone() };
                let near = self.estimator.fit_beyond(&model, &self.split.fit, &derivatives).and_then(|fit| self.score(fit));
                let Some(near) = near.ok().filter(|near| near.total() < best.total()) else { continue };
                let Ok(other) = self.fitted(near.model()) else { continue };
                if other.total() < best.total() - least {
                    best = other;
                    moved = true;
                    break;
                }
            }
            if !moved {
                return best;
            }
        }
    }

    /// A rival of the model `best` in the discretisation that suits it as the best one's does, if another one may make up for what it leaves beyond that.
    pub(super) fn resolved_if_near(&self, rival: Scored, best: &Scored) -> Scored {
        if rival.total() < best.total() + self.tolerance() { self.resolve(rival, Convergence::Full) } else { rival }
    }
}

/// True if a start lies on the line from where a law has no effect through another start, beyond that.
fn is_beyond(start: &Term, near: &Term, parameters: &[Free]) -> bool {
    let pairs = || parameters.iter().zip(start.x.iter().zip(&near.x));
    let is_same = pairs().all(|(free, (x, near))| free.off.is_some() || x == near);
    let mut ratios = pairs().filter_map(|(free, (x, near))| free.off.map(|off| (x - off) / (near - off)));
    let Some(along) = ratios.next() else { return false };
    is_same && along > 1.0 && ratios.all(|ratio| (ratio / along - 1.0).abs() < 1e-9)
}

/// A model with more terms.
fn with(base: &Model, terms: impl IntoIterator<Item = Term>) -> Model {
    let mut model = base.clone();
    model.terms.extend(terms);
    model
}

/// The first `count` models whose last terms differ in `key`.
fn first_of_each<'m, K: PartialEq>(
    screened: impl IntoIterator<Item = &'m (f64, Model)>,
    count: usize,
    key: impl Fn(&Term) -> K,
) -> Vec<Model> {
    let mut chosen: Vec<Model> = Vec::new();
    let last = |model: &Model| model.terms.last().map(&key);
    for (_, model) in screened {
        if chosen.len() < count && !chosen.iter().any(|other| last(other) == last(model)) {
            chosen.push(model.clone());
        }
    }
    chosen
}

/// Least squares of −`rest` on the columns of starts: the fall of χ², and the weights; none without columns.
fn least_squares(columns: &[&(Term, DVector<f64>)], rest: &DVector<f64>) -> Option<(f64, DVector<f64>)> {
    let n = Some(columns.len()).filter(|n| *n > 0)?;
    let mut information = DMatrix::from_fn(n, n, |i, j| columns[i].1.dot(&columns[j].1));
    (0..n).for_each(|k| information[(k, k)] *= 1.0 + LEAST_RIDGE);
    let right = DVector::from_fn(n, |k, _| -columns[k].1.dot(rest));
    let weights = information.lu().solve(&right)?;
    Some((right.dot(&weights), weights))
}

/// The residuals of runs, one after the other.
pub(super) fn joined(scored: &Scored, runs: &[usize]) -> DVector<f64> {
    DVector::from_vec(runs.iter().flat_map(|run| scored.residuals[*run].iter().copied()).collect())
}

/// Covariance of a fit's coordinates (coordinates × coordinates); infinite variances for those that the data do not determine.
pub fn covariance(information: &DMatrix<f64>) -> DMatrix<f64> {
    let n = information.nrows();
    if n == 0 {
        return information.clone();
    }
    let scale: Vec<f64> = (0..n).map(|k| information[(k, k)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let by = scale[i] * scale[j];
        if by > 0.0 { information[(i, j)] / by } else { f64::from(u8::from(i == j)) }
    });
    let eigen = scaled.symmetric_eigen();
    let mut result = DMatrix::zeros(n, n);
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        let v = eigen.eigenvectors.column(k);
        result += v * v.transpose() / value.max(1e-12);
    }
    DMatrix::from_fn(n, n, |i, j| {
        let by = scale[i] * scale[j];
        if by > 0.0 {
            result[(i, j)] / by
        } else if i == j {
            f64::INFINITY
        } else {
            0.0
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::bench::Spread;
    use crate::diagnose::waves::{Waves, candidate, search};

    fn found(plant: &Waves) -> Vec<&'static str> {
        let mut search = search(plant);
        let plain = search.calibrated(1.0).unwrap();
        let (best, _) = search.forward(plain).unwrap();
        best.model().terms.iter().map(|term| search.id(term.candidate)).collect()
    }

    #[test]
    fn a_model_with_all_constants_gets_no_more_of_them() {
        let mut plant = Waves::new(&[("other", 3.0)]);
        plant.candidates[0].is_constant = true;
        let search = search(&plant);
        let all = search.fitted(&search.with_constants(&Model::new(Vec::new(), 1.0, false))).unwrap();
        let same = search.with_significant_constants(all.clone()).unwrap();
        assert_eq!(same.model().terms.len(), all.model().terms.len());
    }

    #[test]
    fn two_causes_that_mask_one_another_are_found_together() {
        // Together they make a wave of amplitude 0.12 × 12; one of them alone can take up 0.4 % of its square.
        let mut both = found(&Waves::new(&[("first", 12.0), ("second", 12.0)]));
        both.sort_unstable();
        assert_eq!(both, ["first", "second"]);
    }

    #[test]
    fn one_cause_stays_one_and_noise_stays_noise() {
        assert_eq!(found(&Waves::new(&[("other", 1.0)])), ["other"]);
        assert_eq!(found(&Waves::new(&[("first", 1.0)])), ["first"]);
        assert!(found(&Waves::new(&[])).is_empty());
    }

    #[test]
    fn starts_are_as_large_as_what_is_missing() {
        // What is missing is noise of one unit; a wave of amplitude 2.1 and more is twice as much.
        let mut plant = Waves::new(&[]);
        plant.candidates[0].starts = vec![vec![50.0], vec![100.0], vec![1.0], vec![-50.0]];
        let search = search(&plant);
        let responses = search.responses(&Model::new(Vec::new(), 1.0, false), |candidate, _| candidate == 0).unwrap();
        let starts: Vec<f64> = responses.starts.iter().map(|(start, _)| start.x[0]).collect();
        let [outer, given, other] = starts[..] else { panic!("{starts:?}") };
        assert!((1.3..1.6).contains(&outer) && (outer + other).abs() < 1e-9 && given == 1.0, "{starts:?}");
        // One that does nothing below 40 stays where it does something.
        let sized = search.sized(&[Term { candidate: 0, x: vec![50.0] }], 1.0, &|term: &Term| {
            Some(DVector::from_element(10, (term.x[0] - 40.0).max(0.0)))
        });
        assert_eq!(sized[0].0.x, [50.0]);
    }

    #[test]
    fn a_fit_of_a_limit_begins_where_it_does_something() {
        // What is above 2.5 is missing; from a limit of 1 the linear estimate leads to one above 3, which does nothing.
        let mut plant = Waves::new(&[("limit", 0.4)]);
        plant.candidates = vec![candidate("limit")];
        plant.candidates[0].parameters[0].bounds = [0.0, 10.0];
        let search = search(&plant);
        let plain = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
        let screened = search.screen_of(&plain, |_| true).unwrap();
        let model = &screened.ranked[0].1;
        assert!(model.terms[0].x[0] < 1.0 / 3.0, "{model:?}");
        let limit = 1.0 / search.ranked_beyond(model, &screened).unwrap().model().terms[0].x[0];
        assert!((limit - 2.5).abs() < 0.1, "{limit}");
    }

    #[test]
    fn a_law_with_a_further_parameter_is_tried_in_the_place_of_a_constant() {
        let mut plant = Waves::new(&[("second", 5.0), ("other", 1.0)]);
        plant.candidates[0].is_constant = true;
        let search = search(&plant);
        let terms = [0, 2].map(|candidate| Term { candidate, x: vec![1.0] });
        let best = search.fitted(&Model::new(terms.to_vec(), 1.0, false)).unwrap();
        let replaced = search.replacements(&best, 1).unwrap();
        let law = replaced.iter().find(|other| (other.removed, other.trial.candidate) == (0, 3));
        assert!((law.unwrap().trial.scored.total() - best.total()).abs() < 1.0);
    }

    #[test]
    fn a_law_with_a_further_parameter_is_tried_in_the_place_of_a_cause_where_the_plain_one_is_nearly_as_good() {
        let plant = Waves::new(&[("second", 5.0), ("other", 1.0)]);
        let search = search(&plant);
        let best = search.fitted(&Model::new(vec![Term { candidate: 1, x: vec![1.0] }], 1.0, false)).unwrap();
        let replaced = search.replacements(&best, 1).unwrap();
        let [plain, law] =
            [2, 3].map(|of| replaced.iter().find(|other| (other.removed, other.trial.candidate) == (1, of)).unwrap());
        assert!(search.above(&plain.trial.scored) > 0.4 && search.above(&law.trial.scored) < 0.1, "{replaced:?}");
    }

    /// Two models that leave nothing but noise and a wave of that amplitude, the first one with all residuals smaller by shares of the fit and the select runs.
    fn pair(search: &Search, [fit, select]: [f64; 2]) -> [Scored; 2] {
        let less = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
        let mut more = less.clone();
        for (runs, share) in [(&search.split.fit, fit), (&search.split.select, select)] {
            runs.iter().for_each(|run| more.residuals[*run].iter_mut().for_each(|residual| *residual *= share));
        }
        more.fitted *= fit * fit;
        more.select *= select * select;
        [more, less]
    }

    #[test]
    fn a_further_parameter_is_shown_by_select_runs_or_by_fit_runs_where_those_do_not_speak_against_it() {
        let plant = Waves::new(&[]);
        let search = search(&plant);
        for (shares, shown) in [([0.9, 1.0], true), ([0.96, 1.0], false), ([0.9, 1.1], false), ([0.96, 0.9], true)] {
            let [more, less] = pair(&search, shares);
            assert_eq!(search.is_shown(&more, &less), shown, "{shares:?}");
        }
    }

    #[test]
    fn a_law_that_takes_more_than_it_leaves_is_shown_though_that_may_be_chance() {
        // The further parameter takes 4.5 per value; 4 or 8 are left, which follow it for half a period in each block.
        for (late, shown) in [(3.0, true), (4.0, false)] {
            let plant = Waves::new(&[("second", 5.0), ("other", 3.0), ("late", late)]);
            let mut search = search(&plant);
            search.estimator.held_spread = Some(search.estimator.given_spread());
            (search.split.fit, search.split.select) = (vec![1, 3], vec![0]);
            let plain = search.fitted(&Model::new(vec![Term { candidate: 2, x: vec![1.0] }], 1.0, false)).unwrap();
            let law = search.fitted(&Model::new(vec![Term { candidate: 3, x: vec![1.0, 1.0] }], 1.0, false)).unwrap();
            let is_significant = |runs: &[usize]| search.is_significant_on(runs, &law, &plain);
            assert!(!is_significant(&search.split.select) && !is_significant(&search.split.fit), "{late}");
            assert_eq!(search.with_its_law(plain, 0).model().terms[0].candidate == 3, shown, "{late}");
            assert_eq!(search.with_its_plain_law(law, 0).model().terms[0].candidate == 3, shown, "{late}");
        }
    }

    #[test]
    fn what_is_beyond_chance_counts_in_the_place_of_another_cause_where_nothing_else_is_left() {
        for (amplitude, is_worth) in [(0.0, true), (1.0, false)] {
            let plant = Waves::new(&[("other", amplitude)]);
            let search = search(&plant);
            let [more, less] = pair(&search, [0.993; 2]);
            assert!(search.is_significant_on(&search.split.all(), &more, &less) && !search.is_worth(&more, &less));
            assert_eq!(search.is_worth_in_place(&more, &less), is_worth, "{amplitude}");
        }
    }

    #[test]
    fn constants_within_the_discretisation_s_error_stay_where_much_comes_back_without_them() {
        // Half of the squares: 4.5 and 0.18 times the noise.
        for (amplitude, stays) in [(3.0, true), (0.6, false)] {
            let mut plant = Waves::new(&[("other", amplitude)]);
            plant.candidates[0].is_constant = true;
            plant.tolerance = 10.0;
            let search = search(&plant);
            let best = search.fitted(&search.with_constants(&Model::new(Vec::new(), 1.0, false))).unwrap();
            assert_eq!(search.backward(best).unwrap().model().terms.len() == 1, stays, "{amplitude}");
        }
    }

    #[test]
    fn what_all_runs_share_is_not_left_to_faults_that_differ_from_run_to_run() {
        // Zeros of ±0.4, which a further 1 in all runs or in none makes 0.6 and 1.4: they cost less than a cause has to take.
        for (offset, stays) in [(1.0, true), (0.0, false)] {
            let mut plant = Waves::new(&[("offset", offset)]);
            plant.candidates = vec![candidate("offset")];
            for (run, signal) in plant.signals.iter_mut().enumerate() {
                signal.values.iter_mut().for_each(|value| *value += if run % 2 == 0 { 0.4 } else { -0.4 });
            }
            let mut search = search(&plant);
            let bare = search.calibrated(1.0).unwrap();
            search.estimator.is_calibrated = true;
            let zeros = Spread { of: [0.0, 0.0, 0.0, 0.0, 0.4, 0.0] };
            let term = Term { candidate: 0, x: vec![1.0] };
            let with = search.fitted(&Model { spread: zeros, ..Model::new(vec![term], 1.0, false) }).unwrap();
            let without = search.fitted(&Model { spread: zeros, ..bare.model().clone() }).unwrap();
            assert!(!search.is_needed(&with, &without) && !search.is_seen_by_fit(&with, &without), "{offset}");
            assert_eq!(search.backward(with).unwrap().model().terms.len() == 1, stays, "{offset}");
        }
    }

    #[test]
    fn a_constant_and_a_finer_discretisation_that_stand_for_one_between_are_none() {
        // A resolution of 2 adds an amplitude of 1, which the constant takes off again; the first one adds none.
        for (first, stays) in [(1.0, false), (2.0, true)] {
            let mut plant = Waves::new(&[]);
            plant.candidates[0].is_constant = true;
            (plant.resolutions, plant.tolerance) = (vec![first, 2.0], 1.5 * first);
            let search = search(&plant);
            let best = search.fitted(&search.with_constants(&Model::new(Vec::new(), 2.0, false))).unwrap();
            assert!((best.model().terms[0].x[0] + 1.0).abs() < 0.1);
            let found = search.backward(best).unwrap();
            assert_eq!((found.model().terms.len() == 1, found.model().resolution), (stays, first), "{first}");
        }
    }

    #[test]
    fn a_law_with_a_further_parameter_gives_way_where_it_is_not_needed() {
        for (other, stays) in [(0.0, false), (1.0, true)] {
            let plant = Waves::new(&[("second", 5.0), ("other", other)]);
            let search = search(&plant);
            let scored = search.fitted(&Model::new(vec![Term { candidate: 3, x: vec![1.0, 1.0] }], 1.0, false)).unwrap();
            let term = search.with_its_plain_law(scored, 0).model().terms[0].clone();
            assert_eq!(term.x.len() == 2, stays, "{term:?}");
            assert!((term.x[0] - 5.0).abs() < 0.2, "{term:?}");
        }
    }
}
