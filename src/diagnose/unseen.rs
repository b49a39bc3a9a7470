//! Errors on runs that neither parameters nor selection saw.
//!
//! With enough runs some are kept to judge by, and seen once, at the end. With few runs the judgement is a nested cross-validation: each run in turn is
//! left out, the causes that would not be chosen without it are left out as well, the parameters are fitted to all other runs, and the run is judged.

use rayon::prelude::*;

use super::DiagnoseError;
use super::diagnosis::JudgedBy;
use super::fit::{Convergence, Residuals, sum_of_squares};
use super::plant::Model;
use super::search::{Scored, Search};

/// Residuals of a model on the runs that judge it.
pub(super) struct Unseen {
    /// The runs, ...
    pub(super) runs: Vec<usize>,
    /// ... their residuals in given σ, ...
    pub(super) plain: Vec<Residuals>,
    /// ... and χ² of whitened ones.
    chi2: f64,
}

impl Unseen {
    /// What judges the models of a search.
    pub(super) fn by(search: &Search) -> JudgedBy {
        if search.split.judge.is_empty() { JudgedBy::CrossValidation } else { JudgedBy::JudgeRuns }
    }

    /// Judges a model; `needs` holds for each of its terms the runs without which it would not be chosen.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn of(search: &Search, scored: &Scored, needs: &[&[usize]]) -> Result<Self, DiagnoseError> {
        let runs = if search.split.judge.is_empty() { search.split.all() } else { search.split.judge.clone() };
        let judged = |run: &usize| {
            let model = Self::without(search, scored.model(), *run, needs)?;
            let chi2 = sum_of_squares(&search.estimator.residuals(&model, *run)?);
            Ok((search.estimator.plain_residuals_of(&model, *run)?, chi2))
        };
        let judged: Vec<(Residuals, f64)> = runs.par_iter().map(judged).collect::<Result<_, DiagnoseError>>()?;
        let (plain, chi2): (Vec<_>, Vec<f64>) = judged.into_iter().unzip();
        Ok(Self { runs, plain, chi2: chi2.iter().sum() })
    }

    /// The model as it is found without `run`.
    fn without(search: &Search, model: &Model, run: usize, needs: &[&[usize]]) -> Result<Model, DiagnoseError> {
        if search.split.judge.contains(&run) {
            return Ok(model.clone());
        }
        let is_found = |index: &usize| needs.get(*index).is_none_or(|needs| !needs.contains(&run));
        let terms = (0..model.terms.len()).filter(is_found).map(|index| model.terms[index].clone()).collect();
        let others: Vec<usize> = search.split.all().into_iter().filter(|other| *other != run).collect();
        let model = Model { terms, ..model.clone() };
        // Nothing can be fitted without another run.
        if others.is_empty() || model.terms.is_empty() {
            return Ok(model);
        }
        Ok(search.estimator.fit(&model, &others, Convergence::Rank)?.model)
    }

    /// Share of χ² above the noise that this model removes from another one's (0 to 1).
    pub(super) fn gain_over(&self, without: &Self, search: &Search) -> f64 {
        let above = without.chi2 - search.estimator.count(&self.runs) as f64;
        if above > 0.0 { ((without.chi2 - self.chi2) / above).clamp(0.0, 1.0) } else { 0.0 }
    }
}
