//! Errors on runs that neither parameters nor selection saw.
//!
//! With enough runs some are kept to judge by, and seen once, at the end. With few runs the judgement is a nested cross-validation: each fold of the runs
//! in turn is left out, the causes that would not be worth it without it are left out as well, the parameters (where a cause is left out with all constants)
//! are fitted to all other runs, and the fold is judged.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::DiagnoseError;
use super::diagnosis::JudgedBy;
use super::fit::{Convergence, Residuals, coordinates, normal_equations, sum_of_squares};
use super::plant::Model;
use super::search::{Scored, Search, VISIBLE};

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

    /// Judges a model; `needs` holds for each of its terms the folds without which it would not be worth it. In the folds `tuned` all constants are free, as they are
    /// before any cause is sought: those in which the model that is judged, or the one that it is compared with, lacks a cause. A run that cannot be simulated with what was
    /// fitted to others is judged by the nominal model: there the causes are worth nothing.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the nominal model cannot be simulated.
    pub(super) fn of(search: &Search, scored: &Scored, needs: &[&[usize]], tuned: &[usize]) -> Result<Self, DiagnoseError> {
        let (mut runs, mut models) = (Vec::new(), Vec::new());
        for run in &search.split.judge {
            runs.push(*run);
            models.push(scored.model().clone());
        }
        for (fold, left_out) in search.split.folds().into_iter().enumerate() {
            let model = Self::without(search, scored.model(), (fold, &left_out), needs, tuned.contains(&fold))?;
            models.extend(left_out.iter().map(|_| model.clone()));
            runs.extend(left_out);
        }
        let judged = |(run, model): (&usize, &Model)| {
            let of = |model: &Model| {
                let chi2 = sum_of_squares(&search.estimator.residuals(model, *run)?);
                Ok((search.estimator.plain_residuals_of(model, *run)?, chi2))
            };
            of(model).or_else(|_: DiagnoseError| of(&Model { terms: Vec::new(), ..model.clone() }))
        };
        let judged: Vec<(Residuals, f64)> = runs.par_iter().zip(&models).map(judged).collect::<Result<_, DiagnoseError>>()?;
        let (plain, chi2): (Vec<_>, Vec<f64>) = judged.into_iter().unzip();
        Ok(Self { runs, plain, chi2: chi2.iter().sum() })
    }

    /// χ² of every fold by what the others say, to first order about the model, but for what a fold tells of more than all others together: a run near a resonance, or the only one
    /// with so large amplitudes, is no test of that.
    ///
    /// ```text
    /// χ² = Σ r² − Σ (v·Jᵀr)²/(1 + λ) over all v with λ > 1,  JᵀJ v = λ K v,  v·K v = 1,  K = Σ JᵀJ of the others + 1/scale² of each coordinate
    /// ```
    ///
    /// with residuals r, about the fit to the others, and derivatives J of the fold, in σ: the sum is what a fit to all would make up for in the directions v.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated.
    pub(super) fn missed(search: &Search, model: &Model) -> Result<f64, DiagnoseError> {
        let runs = search.split.all();
        let residuals = search.estimator.residuals_of(model, &runs)?;
        if model.terms.is_empty() {
            return Ok(residuals.iter().map(|r| sum_of_squares(r)).sum());
        }
        let derivatives = search.estimator.derivatives(model, &runs)?;
        let (gradient, mut information) = normal_equations(&residuals, &derivatives);
        for (k, (term, parameter)) in coordinates(model).into_iter().enumerate() {
            information[(k, k)] += search.candidate(&model.terms[term]).parameters[parameter].scale.powi(-2);
        }
        let mut sum = 0.0;
        for fold in search.split.folds() {
            let of_fold = |whole: &[Residuals]| -> Vec<Residuals> {
                fold.iter().filter_map(|run| Some(whole[runs.binary_search(run).ok()?].clone())).collect()
            };
            let of_residuals = of_fold(&residuals);
            let (own_gradient, own) = normal_equations(&of_residuals, &derivatives.iter().map(|of| of_fold(of)).collect());
            let others = (&information - &own).cholesky().ok_or("derivatives that are no numbers")?;
            let by = -others.solve(&(&gradient - &own_gradient));
            let plain = of_residuals.iter().map(|r| sum_of_squares(r)).sum::<f64>();
            sum += plain + 2.0 * own_gradient.dot(&by) + by.dot(&(&own * &by));
            let lower = others.l();
            let scaled = |columns: &DMatrix<f64>| lower.solve_lower_triangular(columns).ok_or("derivatives that are no numbers");
            let slope = scaled(&DMatrix::from_columns(&[own_gradient + &own * by]))?;
            let relative = scaled(&scaled(&own)?.transpose())?.symmetric_eigen();
            for (lambda, along) in relative.eigenvalues.iter().zip(relative.eigenvectors.column_iter()) {
                if *lambda > 1.0 {
                    sum -= along.dot(&slope.column(0)).powi(2) / (1.0 + lambda);
                }
            }
        }
        Ok(sum)
    }

    /// The model as it is found without a fold.
    fn without(
        search: &Search,
        model: &Model,
        (fold, left_out): (usize, &[usize]),
        needs: &[&[usize]],
        is_tuned: bool,
    ) -> Result<Model, DiagnoseError> {
        let is_found = |index: &usize| needs.get(*index).is_none_or(|needs| !needs.contains(&fold));
        let terms = (0..model.terms.len()).filter(is_found).map(|index| model.terms[index].clone()).collect();
        let others: Vec<usize> = search.split.all().into_iter().filter(|other| !left_out.contains(other)).collect();
        let found = Model { terms, ..model.clone() };
        let model = if is_tuned { search.with_constants(&found) } else { found };
        // Nothing can be fitted without another run.
        if others.is_empty() || model.terms.is_empty() {
            return Ok(model);
        }
        Ok(search.estimator.fit(&model, &others, Convergence::Rank)?.model)
    }

    /// True if this model leaves more than another one by more than half the noise, in χ² per value.
    pub(super) fn is_clearly_worse_than(&self, other: &Self, search: &Search) -> bool {
        self.chi2 > other.chi2 + VISIBLE * search.estimator.count(&self.runs) as f64
    }

    /// Share of χ² above the noise that this model removes from another one's (0 to 1).
    pub(super) fn gain_over(&self, without: &Self, search: &Search) -> f64 {
        let above = without.chi2 - search.estimator.count(&self.runs) as f64;
        if above > 0.0 { ((without.chi2 - self.chi2) / above).clamp(0.0, 1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::{Candidate, Free, Nuisance, Plant, Signal, Term};
    use crate::diagnose::search::Search;
    use crate::diagnose::split::Split;

    /// y = x + noise of 1, −1, ... in each run; the mean of the runs differs. The first run cannot be simulated beyond an `edge`.
    struct Means {
        edge: f64,
        signals: Vec<Signal>,
        candidates: Vec<Candidate>,
    }

    impl Plant for Means {
        fn signals(&self) -> &[Signal] {
            &self.signals
        }

        fn channels(&self) -> Vec<String> {
            vec!["y".into()]
        }

        fn unit(&self) -> &'static str {
            ""
        }

        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }

        fn predict(&self, model: &Model, run: usize, _: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
            let x: f64 = model.terms.iter().map(|term| term.x[0]).sum();
            if run == 0 && x > self.edge {
                return Err("beyond the edge".into());
            }
            Ok(vec![x; self.signals[run].values.len()])
        }
    }

    fn plant(means: &[f64]) -> Means {
        let signal = |mean: &f64| Signal {
            values: (0..4).map(|at| mean + if at % 2 == 0 { 1.0 } else { -1.0 }).collect(),
            sigmas: vec![1.0; 4],
            times: (0..4).map(f64::from).collect(),
            channels: vec![0; 4],
            inputs: vec![0.0; 4],
            ..Signal::default()
        };
        let free = Free { name: "x", unit: "", off: Some(0.0), bounds: [-100.0, 100.0], scale: 1.0, inverse: false };
        let candidate = Candidate {
            id: "mean",
            kind: "test",
            cause: "A mean.",
            places: vec!["test"],
            is_free_form: false,
            is_variant: false,
            is_constant: false,
            parameters: vec![free],
            fixed: Vec::new(),
            starts: vec![vec![1.0]],
        };
        Means { edge: f64::INFINITY, signals: means.iter().map(signal).collect(), candidates: vec![candidate] }
    }

    fn search<'a>(plant: &'a Means, split: Split, progress: &'a (dyn Fn(&str) + Sync)) -> Search<'a> {
        Search::new(plant, split, progress)
    }

    #[test]
    fn a_model_that_follows_one_run_is_clearly_worse_than_none() {
        // Without run k the mean of the others is 15, 15 and 0, which leaves 15² + 15² + 30² where none leaves 30²; of the second runs the mean of two leaves as
        // much as none, to within half the noise.
        for (means, is_worse) in [([0.0, 0.0, 30.0], true), ([0.0, 0.0, 0.3], false)] {
            let plant = plant(&means);
            let search = search(&plant, Split { fit: vec![0, 1], select: vec![2], judge: vec![] }, &|_| {});
            let of = |terms| Unseen::of(&search, &search.fitted(&Model::new(terms, 1.0, false)).unwrap(), &[], &[]).unwrap();
            let (mean, none) = (of(vec![Term { candidate: 0, x: vec![1.0] }]), of(Vec::new()));
            assert_eq!(mean.is_clearly_worse_than(&none, &search), is_worse, "{means:?}");
        }
    }

    #[test]
    fn a_run_is_no_test_of_what_it_tells_more_of_than_all_others() {
        let split = || Split { fit: vec![0, 1], select: vec![2], judge: vec![] };
        let mean = Model::new(vec![Term { candidate: 0, x: vec![6.0] }], 1.0, false);
        let plain = self::plant(&[3.0, 6.0, 9.0]);
        let mut rough = self::plant(&[3.0, 6.0, 9.0]);
        rough.signals[1..].iter_mut().for_each(|signal| signal.sigmas = vec![10.0; 4]);
        // The mean of two runs of four values, beside that of the scale of 1 about 6: (8·7.5 + 6)/9 without the first one, 6, and (8·4.5 + 6)/9.
        let by_others = 3.0 * 4.0 + 2.0 * 4.0 * (13.0_f64 / 3.0).powi(2);
        // Runs with a hundredth of the weight leave the first one to itself, which tells more than these and the scale: without it the mean is 6.6/1.08. Without one
        // of them it is (4·3 + 0.04·9 + 6)/5.04 or (4·3 + 0.04·6 + 6)/5.04.
        let others = |by: f64, mean: f64| 0.04 * (1.0 + (by - mean).powi(2));
        let apart = 6.6_f64 / 1.08 - 3.0;
        let first = 4.0 + 4.0 * apart.powi(2) - (4.0 * apart).powi(2) / 5.08;
        let of_rough = first + others(18.36 / 5.04, 6.0) + others(18.24 / 5.04, 9.0);
        for (plant, expected) in [(&plain, by_others), (&rough, of_rough)] {
            let found = Unseen::missed(&search(plant, split(), &|_| {}), &mean).unwrap();
            assert!((found - expected).abs() < 1e-4 * expected, "{found} {expected}");
        }
        let none = Unseen::missed(&search(&plain, split(), &|_| {}), &Model::new(Vec::new(), 1.0, false)).unwrap();
        assert!((none - (12.0 + 4.0 * (9.0 + 36.0 + 81.0))).abs() < 1e-9, "{none}");
    }

    #[test]
    fn each_run_is_judged_by_what_the_others_say() {
        let plant = plant(&[3.0, 6.0, 9.0]);
        let search = search(&plant, Split { fit: vec![0, 1], select: vec![2], judge: vec![] }, &|_| {});
        let mean = Model::new(vec![Term { candidate: 0, x: vec![4.5] }], 1.0, false);
        let (with, without) = (search.fitted(&mean).unwrap(), search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap());
        assert_eq!(Unseen::by(&search), JudgedBy::CrossValidation);
        // Without run k the mean of the others is 7.5, 6 and 4.5: off by −4.5, 0 and 4.5.
        let unseen = Unseen::of(&search, &with, &[&[]], &[]).unwrap();
        let means: Vec<f64> = unseen.plain.iter().map(|r| r.iter().sum::<f64>() / 4.0).collect();
        assert!(means.iter().zip([-4.5, 0.0, 4.5]).all(|(a, b)| (a - b).abs() < 1e-6), "{means:?}");
        // χ² is 4 (m² + 1) a run: 12 + 162 of the model, 12 + 504 without it, of which 12 are noise.
        let gain = unseen.gain_over(&Unseen::of(&search, &without, &[], &[]).unwrap(), &search);
        assert!((gain - 342.0 / 504.0).abs() < 1e-6, "{gain}");
        // A fold without which the cause is not worth it is judged without the cause.
        let unseen = Unseen::of(&search, &with, &[&[2]], &[2]).unwrap();
        assert!((unseen.plain[2].iter().sum::<f64>() / 4.0 - 9.0).abs() < 1e-9);
        // With a constant that does the same it is judged by the mean of the others.
        let mut tuned = self::plant(&[3.0, 6.0, 9.0]);
        tuned.candidates.push(Candidate { id: "constant", is_constant: true, ..tuned.candidates[0].clone() });
        let unseen = Unseen::of(&self::search(&tuned, search.split.clone(), &|_| {}), &with, &[&[2]], &[2]).unwrap();
        assert!((unseen.plain[2].iter().sum::<f64>() / 4.0 - 4.5).abs() < 1e-6);
        // What the constant does there is no gain of the cause.
        let of = |scored: &Scored, needs: &[&[usize]]| {
            Unseen::of(&self::search(&tuned, search.split.clone(), &|_| {}), scored, needs, &[0, 1, 2])
        };
        assert!(of(&with, &[&[0, 1, 2]]).unwrap().gain_over(&of(&without, &[]).unwrap(), &search).abs() < 1e-9);
    }

    #[test]
    fn a_run_beyond_the_edge_is_judged_by_the_nominal_model_and_a_fit_from_the_edge_goes_back() {
        let plant = Means { edge: 6.5, ..plant(&[3.0, 6.0, 9.0]) };
        let search = search(&plant, Split { fit: vec![0, 1, 2], select: vec![], judge: vec![] }, &|_| {});
        let start = Model::new(vec![Term { candidate: 0, x: vec![6.5] }], 1.0, false);
        let with = search.fitted(&start).unwrap();
        assert!((with.model().terms[0].x[0] - 6.0).abs() < 1e-6, "{:?}", with.model());
        // The other runs say 7.5, with which the first one cannot be simulated.
        let first = &Unseen::of(&search, &with, &[&[]], &[]).unwrap().plain[0];
        assert!((first.iter().sum::<f64>() / 4.0 - 3.0).abs() < 1e-9, "{first:?}");
    }

    #[test]
    fn runs_that_judge_are_seen_by_nothing_else() {
        let plant = plant(&[3.0, 5.0, 4.0, 90.0]);
        let search = search(&plant, Split { fit: vec![0, 1], select: vec![2], judge: vec![3] }, &|_| {});
        let scored = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![0.0] }], 1.0, false)).unwrap();
        assert!((scored.model().terms[0].x[0] - 4.0).abs() < 1e-6);
        let unseen = Unseen::of(&search, &scored, &[&[]], &[]).unwrap();
        assert_eq!((Unseen::by(&search), unseen.runs.clone()), (JudgedBy::JudgeRuns, vec![3]));
        assert!((unseen.plain[0].iter().sum::<f64>() / 4.0 - 86.0).abs() < 1e-6);
    }
}
