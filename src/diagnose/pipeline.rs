//! The diagnosis of a plant, from its measured runs to a [`Diagnosis`].
//!
//! In stages, each of which takes values and returns values: constants and noise (`Prepared`), causes (`find`), what they leave and what the data
//! doubt (`judge`, `doubtful`), ties, what each cause takes and how firmly it stands (`adopted`), and the report of all that.

use super::DiagnoseError;
use super::adopted::{Adoption, adopted, estimates};
use super::budget::first_resolution;
use super::causes::{Causes, find};
use super::combinations::combinations;
use super::dataset::Role;
use super::diagnosis::{Adopted, Diagnosis, Estimate, Nearest, Part, Ranked, RunError, Stage, Verdict};
use super::faults;
use super::fit::Residuals;
use super::intervals::{Intervals, intervals_of};
use super::names;
use super::plant::{Model, Plant, Signal};
use super::prediction::{Missed, prediction};
use super::residual_tests::{describe, residual_tests};
use super::search::{SOUGHT, Scored, Search, Trial};
use super::split::{Split, split};
use super::summary::{Findings, failing, summary};
use super::ties::Ties;
use super::unseen::Unseen;
use super::verdict::{Judged, LEFT_OVER, doubtful, insufficient_data, is_at_its_place, judge};
use crate::number::significant;

/// The next experiment where the data are insufficient.
const MORE_RUNS: &str = "measure three runs or more under inputs of different size and speed, with a hundred rows each or more";

/// Said where the search ended before it had tried all.
const CUT_SHORT: &str = "the search was ended after as many simulations as it may take: further causes, and names in the place of these, were not all tried";

/// The diagnosis with its models, for figures and for the extended experiment.
pub struct Outcome {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The nominal model.
    pub nominal: Scored,
    /// The nominal model with re-tuned constants and refined discretisation.
    pub calibrated: Scored,
    /// The model with all adopted causes.
    pub extended: Scored,
    /// Models that the data cannot tell from the extended one.
    pub tied: Vec<Scored>,
    /// What each run is for.
    pub split: Split,
    /// Fitted nuisance parameters.
    pub nuisances: super::fit::Nuisances,
    /// True for the values that counted, runs × values.
    pub used: Vec<Vec<bool>>,
}

/// Diagnoses a plant's measured runs.
///
/// `name` and `quality` (remarks on the data) are passed on to the diagnosis; `roles` fix the roles of runs; `progress` receives the current task in
/// words; `separate` proposes the next measurement for tied models.
///
/// # Errors
/// [`DiagnoseError`] if the nominal model cannot be simulated.
pub fn diagnose(
    plant: &dyn Plant,
    name: &str,
    roles: &[Role],
    quality: Vec<String>,
    progress: &(dyn Fn(&str) + Sync),
    separate: &dyn Fn(&[Model]) -> Option<String>,
) -> Result<Outcome, DiagnoseError> {
    let Prepared { mut search, nominal, calibrated, nominal_resolution, mut spikes } = prepare(plant, roles, progress)?;
    let insufficient = insufficient_data(plant, &search.split);
    let causes = find(&mut search, &calibrated, insufficient.is_some())?;
    spikes += causes.spikes;
    // The refined nominal model: its misfit is what the causes have to explain.
    let bare = search.fitted_at_its_spread(&Model { terms: Vec::new(), ..causes.best.model().clone() })?;
    // What constants take that are too small to be causes is not unexplained.
    let tuned = search.above(&search.fitted_at_its_spread(&search.with_constants(bare.model()))?);
    let Decided { judged, doubts, insufficient: too_few, dropped } =
        decide(&search, causes.best.clone(), &bare, [causes.open, tuned], nominal_resolution)?;
    search.estimator.fit_nuisances(judged.best.model(), &search.split.judge)?;
    let [nominal, calibrated, best] = [nominal, calibrated, judged.best].map(|scored| search.with_judged(scored));
    let (nominal, calibrated, mut judged) = (nominal?, calibrated?, Judged { best: best?, ..judged });
    progress("tied causes");
    let ties = Ties::new(&search, &judged.best, &causes.replaced);
    let Adoption { mut effects, unseen, pairs } = adopted(&search, &judged, &bare, &causes, &ties)?;
    // What leaves structure and predicts other runs worse than constants alone is no explanation.
    let by_constants = Unseen::of(&search, &calibrated, &[], &[])?;
    let is_no_better = !is_nothing(&effects) && unseen.is_clearly_worse_than(&by_constants, &search);
    judged.is_unexplained |= is_no_better && judged.left > LEFT_OVER;
    let is_located = judged.is_unexplained && !is_no_better && is_located_by_name(&search, &judged, &causes, &mut effects);
    let insufficient = insufficient.or(too_few.filter(|_| is_nothing(&effects)));
    let mut remarks = doubts;
    if spikes > 0 {
        remarks.insert(0, format!("{spikes} single values far off their neighbours' residuals were left out"));
    }
    if search.estimator.budget.is_cut() {
        remarks.push(CUT_SHORT.to_owned());
    }
    remarks.extend(judged.remark.clone());
    remarks.extend(insufficient.clone().filter(|insufficient| !remarks.contains(insufficient)));
    let report = Report {
        search: &search,
        judged: &judged,
        causes: &causes,
        ties: &ties,
        unseen,
        by_constants,
        is_no_better,
        nominal: &nominal,
        calibrated: &calibrated,
    };
    let verdict = verdict(&search, &judged, &effects, insufficient.is_some(), is_located);
    let tied_models = ties.models().map(|scored| scored.model().clone()).chain(pairs);
    let models: Vec<Model> = std::iter::once(judged.best.model().clone()).chain(tied_models).collect();
    let is_open =
        matches!(verdict, Verdict::Named | Verdict::Tied) && physics(&effects).any(|effect| !effect.tied_with.is_empty());
    let next_experiment = match (is_open, dropped, &insufficient) {
        (true, ..) => separate(&models),
        // With and without the last cause that was dropped.
        (_, Some(dropped), _) => separate(&[judged.best.model().clone(), dropped]),
        (_, None, Some(_)) => Some(MORE_RUNS.to_owned()),
        _ => None,
    };
    let diagnosis = Diagnosis {
        dataset: name.to_owned(),
        next_experiment,
        remarks,
        ..report.diagnosis(verdict, effects, insufficient.as_deref(), quality)?
    };
    let tied = ties.models().cloned().collect();
    Ok(Outcome {
        diagnosis,
        nominal,
        calibrated,
        extended: judged.best,
        tied,
        nuisances: search.estimator.nuisances.clone(),
        used: search.estimator.used.clone(),
        split: search.split,
    })
}

/// The search with the nominal model, its re-tuned constants and the noise.
struct Prepared<'a> {
    search: Search<'a>,
    nominal: Scored,
    /// The nominal model with re-tuned constants.
    calibrated: Scored,
    nominal_resolution: f64,
    /// Number of single values that were masked.
    spikes: usize,
}

/// Re-tunes the constants, and measures the noise of what they leave.
fn prepare<'a>(plant: &'a dyn Plant, roles: &[Role], progress: &'a (dyn Fn(&str) + Sync)) -> Result<Prepared<'a>, DiagnoseError> {
    let nominal_resolution = plant.resolutions().first().copied().unwrap_or(1.0);
    let start = first_resolution(plant);
    let mut search = Search::new(plant, split(plant, roles), progress);
    progress("the nominal model");
    let nominal = search.fitted(&Model::new(Vec::new(), nominal_resolution, true))?;
    progress("constants of the nominal model");
    let mut calibrated = search.calibrated(start)?;
    let spikes = search.estimator.leave_out_spikes(calibrated.model())?;
    if spikes > 0 {
        calibrated = search.calibrated(start)?;
    }
    progress("the noise");
    if search.measure_noise(&calibrated)? {
        calibrated = search.calibrated(start)?;
    }
    Ok(Prepared { search, nominal, calibrated, nominal_resolution, spikes })
}

/// A judged model without the causes that the data doubt.
struct Decided {
    judged: Judged,
    /// Why each of them was dropped.
    doubts: Vec<String>,
    /// The first of them that is for want of data, not for what the model leaves.
    insufficient: Option<String>,
    /// The model with the last one that was dropped.
    dropped: Option<Model>,
}

/// Judges a model, and drops causes whose intervals contain their off values. The model with free forms leaves `open`, the one with constants alone `tuned` (χ² per value above
/// 1), which counts where no cause is left.
fn decide(
    search: &Search,
    best: Scored,
    bare: &Scored,
    [open, tuned]: [f64; 2],
    nominal_resolution: f64,
) -> Result<Decided, DiagnoseError> {
    let known = |best: &Scored| if search.causes(best) == 0 { tuned } else { f64::INFINITY };
    let open = open.min(known(&best));
    let mut judged = judge(search, best, bare, open, nominal_resolution)?;
    let (mut doubts, mut insufficient, mut dropped, remark) = (Vec::new(), None, None, judged.remark.take());
    while let Some((index, words)) = doubtful(search, &judged)? {
        let model = search.without(&judged.best, index)?;
        dropped = Some(judged.best.model().clone());
        if !judged.is_unexplained {
            insufficient.get_or_insert_with(|| words.clone());
        }
        doubts.push(words);
        // What is left out may have stood in for constants.
        let without = search.with_significant_constants(search.fitted(&model)?)?;
        let open = known(&without);
        judged = judge(search, without, bare, open, nominal_resolution)?;
    }
    judged.remark = remark.or(judged.remark);
    Ok(Decided { judged, doubts, insufficient, dropped })
}

/// The causes beside the discretisation that are no minor ones.
fn physics(effects: &[Adopted]) -> impl Iterator<Item = &Adopted> {
    effects.iter().filter(|effect| is_cause(effect))
}

fn is_cause(effect: &Adopted) -> bool {
    effect.role == Part::Cause && effect.id != "discretisation"
}

/// True if the place of what is missing is known by a single cause that is no free form and tied with no other: it is the nearest name then.
fn is_located_by_name(search: &Search, judged: &Judged, causes: &Causes, effects: &mut [Adopted]) -> bool {
    let mut single = effects.iter_mut().filter(|effect| is_cause(effect));
    let (Some(effect), None) = (single.next(), single.next()) else { return false };
    let tried = causes.trials.iter().chain(causes.replaced.iter().map(|other| &other.trial));
    if effect.curve.is_some() || effect.is_tied() || !is_at_its_place(search, judged, &effect.id, tried) {
        return false;
    }
    effect.nearest = vec![Nearest { id: effect.id.clone(), left: judged.unexplained_fraction }];
    true
}

fn is_nothing(effects: &[Adopted]) -> bool {
    physics(effects).next().is_none()
}

fn verdict(search: &Search, judged: &Judged, effects: &[Adopted], is_insufficient: bool, is_located: bool) -> Verdict {
    match () {
        () if is_located => Verdict::Located,
        () if judged.is_unexplained => Verdict::Unexplained,
        () if is_nothing(effects) && is_insufficient && search.above(&judged.best) > LEFT_OVER => Verdict::Unexplained,
        () if is_nothing(effects) => Verdict::None,
        () if physics(effects).any(|effect| effect.curve.is_some()) => Verdict::Located,
        () if physics(effects).any(Adopted::is_tied) => Verdict::Tied,
        () => Verdict::Named,
    }
}

/// What a diagnosis is written from.
struct Report<'r, 'a> {
    search: &'r Search<'a>,
    judged: &'r Judged,
    causes: &'r Causes,
    ties: &'r Ties,
    /// The extended model on the runs that judge it.
    unseen: Unseen,
    /// The re-tuned nominal model on these runs.
    by_constants: Unseen,
    /// True if causes predict these runs clearly worse than re-tuned constants do.
    is_no_better: bool,
    nominal: &'r Scored,
    calibrated: &'r Scored,
}

impl Report<'_, '_> {
    /// The diagnosis, without name, remarks and the next experiment.
    fn diagnosis(
        &self,
        verdict: Verdict,
        effects: Vec<Adopted>,
        insufficient: Option<&str>,
        mut quality: Vec<String>,
    ) -> Result<Diagnosis, DiagnoseError> {
        let Self { search, judged, .. } = self;
        let Judged { best, left, unexplained_fraction, is_unexplained, intervals, .. } = judged;
        let has_rest = *left > LEFT_OVER && *unexplained_fraction > SOUGHT;
        let noise = &search.estimator.noise;
        let bench = faults::found(&search.estimator, best.model())?;
        quality.extend(faults::remarks(&bench.faults, noise, search.estimator.plant));
        let [baseline, calibrated, extended] = self.stages()?;
        let unit = search.estimator.plant.unit();
        let unseen = self.is_no_better.then(|| {
            let [own, tuned] = [&extended, &calibrated].map(|stage| format!("{} {unit}", significant(stage.rmse_heldout_mm, 2)));
            format!("it predicts runs that were left out worse than re-tuned constants do (rms error {own} against {tuned})")
        });
        let failed = failing(&extended.residual_tests);
        let combinations = combinations(search, best, &self.ties.terms())?;
        let judged_by = Unseen::by(search);
        let findings = Findings {
            effects: &effects,
            combinations: &combinations,
            place_in_words: &|place| search.estimator.plant.place_in_words(place),
            left: *unexplained_fraction,
            has_rest,
            insufficient,
            resolution: best.model().resolution,
            refined: judged.refined,
            failing: failed.as_deref(),
            unseen: unseen.as_deref(),
            judged_by,
            runs: search.split.all().len(),
        };
        let is_open = *is_unexplained || has_rest;
        let is_cut = search.estimator.budget.is_cut();
        Ok(Diagnosis {
            schema: 2,
            dataset: String::new(),
            verdict,
            complete: verdict != Verdict::Unexplained && failed.is_none() && unseen.is_none() && !(has_rest || is_cut),
            summary: summary(verdict, &findings),
            // Where no structure is left, the share of a small misfit is meaningless: it is limited to the share of the noise.
            unexplained_fraction: if is_open { *unexplained_fraction } else { unexplained_fraction.min(left.min(1.0)) },
            unexplained: if is_open {
                describe(search.estimator.plant, &search.estimator.used, &best.residuals)
            } else {
                Vec::new()
            },
            noise_mm: self.noise_level(),
            noise_correlated: noise.correlated,
            judged_by: Some(judged_by),
            bench,
            baseline,
            calibrated,
            extended,
            prediction: prediction(&self.missed()),
            candidates: self.causes.trials.iter().map(|trial| self.ranked(trial)).collect(),
            correlations: intervals.correlations.clone(),
            combinations,
            condition: intervals.condition,
            effects,
            next_experiment: None,
            data_quality: quality,
            remarks: Vec::new(),
        })
    }

    /// The nominal, the re-tuned and the extended model beside the data.
    fn stages(&self) -> Result<[Stage; 3], DiagnoseError> {
        let Self { search, judged, by_constants, nominal, calibrated, .. } = self;
        let constants = intervals_of(search, calibrated, &[])?;
        Ok([
            self.stage(nominal, &Unseen::of(search, nominal, &[], &[])?, Vec::new()),
            self.stage(calibrated, by_constants, self.parameters(calibrated, &constants)),
            self.stage(&judged.best, &self.unseen, self.parameters(&judged.best, &judged.intervals)),
        ])
    }

    fn parameters(&self, scored: &Scored, found: &Intervals) -> Vec<Estimate> {
        let terms = scored.model().terms.iter().enumerate();
        terms.flat_map(|(index, term)| estimates(self.search, index, term, found)).collect()
    }

    /// Mean standard deviation of all values, in the plant's unit.
    fn noise_level(&self) -> f64 {
        let sigmas: Vec<f64> = self.search.estimator.plant.signals().iter().flat_map(|signal| self.sigmas(signal)).collect();
        sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64
    }

    /// Standard deviations of a run's values as they were found, in the plant's unit.
    fn sigmas(&self, signal: &Signal) -> Vec<f64> {
        let noise = &self.search.estimator.noise;
        let factor = |channel: usize| noise.factors.get(channel).copied().unwrap_or(1.0);
        signal.sigmas.iter().zip(&signal.channels).map(|(sigma, channel)| sigma * factor(*channel)).collect()
    }

    /// What the extended model missed in the runs that judge it.
    fn missed(&self) -> Vec<Missed> {
        let of = |(run, plain): (&usize, &Residuals)| {
            let [sum, count] = self.squares(plain, *run);
            let sigmas = self.sigmas(&self.search.estimator.plant.signals()[*run]);
            let noise = sigmas.iter().map(|sigma| sigma * sigma).sum::<f64>() / sigmas.len().max(1) as f64;
            (count > 0.0).then(|| Missed { residual: sum / count, noise })
        };
        self.unseen.runs.iter().zip(&self.unseen.plain).filter_map(of).collect()
    }

    fn ranked(&self, trial: &Trial) -> Ranked {
        let Self { search, calibrated, .. } = self;
        let candidate = &search.estimator.plant.candidates()[trial.candidate];
        Ranked {
            id: candidate.id.to_owned(),
            form: names::form(candidate.id, &candidate.fixed, candidate.parameters.iter().map(|p| p.name)),
            rmse_heldout_mm: self.rmse(&trial.scored.plain, &search.split.select),
            delta_bic: trial.scored.bic() - calibrated.bic(),
        }
    }

    /// Sum of squared residuals of a run, in the plant's unit, and number of values.
    fn squares(&self, residuals: &Residuals, run: usize) -> [f64; 2] {
        let signal = &self.search.estimator.plant.signals()[run];
        let values = residuals.iter().zip(&signal.sigmas).zip(&self.search.estimator.used[run]).filter(|(_, used)| **used);
        values.fold([0.0, 0.0], |[sum, count], ((r, sigma), _)| [sum + (r * sigma) * (r * sigma), count + 1.0])
    }

    /// Root mean square residual of runs, in the plant's unit.
    fn rmse(&self, residuals: &[Residuals], runs: &[usize]) -> f64 {
        root_mean(runs.iter().map(|run| self.squares(&residuals[*run], *run)))
    }

    /// Errors and residual tests of a model.
    fn stage(&self, scored: &Scored, unseen: &Unseen, parameters: Vec<Estimate>) -> Stage {
        let Search { estimator, split, .. } = self.search;
        let judged: Vec<[f64; 2]> = unseen.runs.iter().zip(&unseen.plain).map(|(run, r)| self.squares(r, *run)).collect();
        let runs = (0..estimator.plant.signals().len()).map(|run| {
            let r = &scored.plain[run];
            let count = estimator.used[run].iter().filter(|used| **used).count().max(1) as f64;
            RunError {
                id: estimator.plant.signals()[run].id.clone(),
                role: split.role(run),
                rmse_mm: root_mean([self.squares(r, run)]),
                rmse_sigma: (r.iter().map(|r| r * r).sum::<f64>() / count).sqrt(),
            }
        });
        let every = (0..estimator.plant.signals().len()).map(|run| self.squares(&scored.plain[run], run));
        // Jackknife over runs.
        let held = root_mean(judged.iter().copied());
        let left_out =
            |out: usize| root_mean(judged.iter().enumerate().filter(|(at, _)| *at != out).map(|(_, squares)| *squares));
        let n = judged.len() as f64;
        let without: Vec<f64> = (0..judged.len()).map(left_out).collect();
        let mean = without.iter().sum::<f64>() / n.max(1.0);
        let error = ((n - 1.0).max(0.0) / n.max(1.0) * without.iter().map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt();
        Stage {
            rmse_mm: root_mean(every),
            rmse_heldout_mm: held,
            rmse_heldout_ci95_mm: [(held - 1.96 * error).max(0.0), held + 1.96 * error],
            runs: runs.collect(),
            residual_tests: residual_tests(estimator.plant, &estimator.used, &scored.residuals),
            parameters,
        }
    }
}

/// Root of the mean of sums of squares with their numbers of values; 0 of none.
fn root_mean(squares: impl IntoIterator<Item = [f64; 2]>) -> f64 {
    let [sum, count] = squares.into_iter().fold([0.0, 0.0], |[sum, count], [s, n]| [sum + s, count + n]);
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::{Candidate, Term};
    use crate::diagnose::waves::{Waves, candidate, search};

    #[test]
    fn a_cause_that_is_dropped_for_what_its_model_leaves_is_not_for_want_of_data() {
        // With two waves that are nearly the same 25 parts of 61 are left; where nothing is hidden one is in doubt by itself.
        for (hidden, adopted, few) in [(vec![("first", 6.0), ("other", 5.0)], vec![1, 2], false), (vec![], vec![1], true)] {
            let plant = Waves::new(&hidden);
            let search = search(&plant);
            let bare = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            let terms = adopted.iter().map(|candidate| Term { candidate: *candidate, x: vec![1.0] });
            let best = search.fitted(&Model::new(terms.collect(), 1.0, false)).unwrap();
            let decided = decide(&search, best, &bare, [f64::INFINITY; 2], 1.0).unwrap();
            let words = &decided.doubts[0];
            assert_eq!(words.contains("insufficient"), few, "{words}");
            assert_eq!(words.contains("42 % of the misfit is left"), !few, "{words}");
            assert_eq!(decided.insufficient.is_some(), few);
            assert_eq!(decided.judged.best.model().terms.len(), adopted.len() - 1);
        }
    }

    #[test]
    fn a_cause_that_takes_more_than_is_left_is_not_dropped_for_its_range() {
        // One takes 18 per value, with 12.5 left; beside another one the second takes 6, with 8 left.
        for (waves, adopted, kept) in [
            (vec![("first", 6.0), ("other", 5.0)], vec![1], true),
            (vec![("first", 6.0), ("other", 3.5), ("late", 4.0)], vec![1, 0], false),
        ] {
            let plant = Waves::new(&waves);
            let search = search(&plant);
            let bare = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            let terms = adopted.iter().map(|candidate| Term { candidate: *candidate, x: vec![1.0] });
            let best = search.fitted(&Model::new(terms.collect(), 1.0, false)).unwrap();
            let mut judged = judge(&search, best, &bare, f64::INFINITY, 1.0).unwrap();
            // As wide as what is left can make a range.
            judged.intervals.ends.fill([-1.0, 10.0]);
            assert!(judged.is_unexplained);
            assert_eq!(doubtful(&search, &judged).unwrap().is_none(), kept, "{waves:?}");
        }
    }

    #[test]
    fn a_cause_with_several_parameters_is_in_doubt_where_the_data_are_explained_as_well_without_it() {
        for (amplitude, in_doubt) in [(5.0, false), (0.0, true)] {
            let mut plant = Waves::new(&[("second", amplitude)]);
            // A shape, which nothing switches off.
            plant.candidates[3].parameters[1].off = None;
            let search = search(&plant);
            let bare = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            let term = Term { candidate: 3, x: vec![1.0, 1.0] };
            let best = search.fitted(&Model::new(vec![term], 1.0, false)).unwrap();
            let mut judged = judge(&search, best, &bare, f64::INFINITY, 1.0).unwrap();
            // As wide as its shape can make the range of its size.
            judged.intervals.ends.fill([-1.0, 10.0]);
            assert!(!judged.is_unexplained);
            assert_eq!(doubtful(&search, &judged).unwrap().is_some(), in_doubt, "{amplitude}");
        }
    }

    #[test]
    fn what_leaves_structure_and_predicts_other_runs_worse_than_constants_is_unexplained() {
        // Some 0.5 of 32 per value are left; in the runs that judge the cause has the same sign, or the other one.
        for (sign, verdict) in [(1.0, Verdict::Named), (-1.0, Verdict::Unexplained)] {
            let mut plant = Waves::with_runs(&[("other", 8.0), ("late", 1.2)], 12);
            plant.candidates.truncate(1);
            for run in split(&plant, &[Role::Auto; 12]).judge {
                plant.signals[run].values.iter_mut().for_each(|value| *value *= sign);
            }
            let found = diagnose(&plant, "waves", &[Role::Auto; 12], Vec::new(), &|_| {}, &|_| None).unwrap().diagnosis;
            assert_eq!((found.verdict, found.effects.len()), (verdict, 1), "{}", found.summary);
            assert_eq!(found.summary.contains("explains a part"), sign < 0.0, "{}", found.summary);
        }
    }

    #[test]
    fn what_a_name_leaves_belongs_to_its_place_if_it_is_little_and_all_others_leave_far_more() {
        // The name takes 32 per value. Of the 4.5 or 12.5 that it leaves nothing takes any; at another place 36 or 7 are left.
        for (elsewhere, late, verdict) in
            [("first", 3.0, Verdict::Located), ("near", 3.0, Verdict::Unexplained), ("first", 5.0, Verdict::Unexplained)]
        {
            let mut plant = Waves::new(&[("other", 8.0), ("late", late)]);
            plant.candidates = vec![candidate("other"), Candidate { places: vec!["elsewhere"], ..candidate(elsewhere) }];
            let found = diagnose(&plant, "waves", &[Role::Auto; 6], Vec::new(), &|_| {}, &|_| None).unwrap().diagnosis;
            assert_eq!((found.verdict, found.effects.len(), found.complete), (verdict, 1, false), "{}", found.summary);
            let is_located = verdict == Verdict::Located;
            assert_eq!(found.summary.contains("The simulation lacks: another law of"), is_located, "{}", found.summary);
            let nearest: Vec<&str> = found.effects[0].nearest.iter().map(|near| near.id.as_str()).collect();
            assert_eq!(nearest == ["other"], is_located);
        }
    }

    #[test]
    fn what_constants_within_the_discretisation_s_error_take_is_not_unexplained() {
        // 0.32 per value come back without the constant, less than `VISIBLE` beyond the 0.08 that nothing takes; nothing takes any of the other wave.
        for (hidden, verdict) in
            [(vec![("other", 0.66), ("late", 0.4)], Verdict::None), (vec![("late", 0.8)], Verdict::Unexplained)]
        {
            let mut plant = Waves::new(&hidden);
            plant.candidates.truncate(1);
            (plant.candidates[0].is_constant, plant.tolerance) = (true, 10.0);
            let found = diagnose(&plant, "waves", &[Role::Auto; 6], Vec::new(), &|_| {}, &|_| None).unwrap().diagnosis;
            assert_eq!(found.verdict, verdict, "{}", found.summary);
        }
    }

    #[test]
    fn constants_are_free_once_a_cause_is_dropped_that_the_data_doubt() {
        // Nothing of the cause is hidden.
        for is_hidden in [true, false] {
            let mut plant = Waves::new(&[("other", if is_hidden { 3.0 } else { 0.0 })]);
            plant.candidates = ["late", "other"].map(candidate).to_vec();
            plant.candidates[1].is_constant = true;
            let search = search(&plant);
            let best = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![1.0] }], 1.0, true)).unwrap();
            let bare = search.fitted(&Model::new(Vec::new(), 1.0, true)).unwrap();
            let decided = decide(&search, best, &bare, [0.0; 2], 1.0).unwrap();
            let ids: Vec<&str> = decided.judged.best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
            assert_eq!((ids == ["other"], ids.is_empty()), (is_hidden, !is_hidden), "{ids:?}");
        }
    }

    #[test]
    fn a_constant_within_the_discretisation_s_error_is_minor() {
        let minor = |tolerance: f64| {
            let mut plant = Waves::new(&[("other", 3.0)]);
            (plant.candidates[0].is_constant, plant.tolerance) = (true, tolerance);
            let found = diagnose(&plant, "waves", &[Role::Auto; 6], Vec::new(), &|_| {}, &|_| None).unwrap().diagnosis;
            let [effect] = &found.effects[..] else { panic!("{:?}", found.effects) };
            (effect.role == Part::Minor, found.verdict)
        };
        assert_eq!([10.0, 0.1].map(minor), [(true, Verdict::None), (false, Verdict::Named)]);
    }
}
