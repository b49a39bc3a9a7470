//! Forward selection: causes are added while they are worth it.

use std::collections::BTreeSet;

use super::DiagnoseError;
use super::budget::Phase;
use super::fit::{Convergence, sum_of_squares};
use super::naming::is_of;
use super::plant::Candidate;
use super::search::{LEAST_BIC, LEAST_GAIN, Scored, Screened, Search, Trial, VISIBLE};

/// Candidates that are fitted after screening, named ones and free forms.
const FINALISTS: usize = 7;
const FREE_FINALISTS: usize = 3;
/// Further names that are fitted beside the best one in the place of a free form.
const FURTHER: usize = 3;
/// Candidates are fitted whose linear estimate is at least this share of the best one's, and free forms among free forms.
const PROMISING: f64 = 0.02;
const PROMISING_FREE: f64 = 0.4;
/// Most causes in addition to the constants.
const MOST_CAUSES: usize = 6;

impl Search<'_> {
    /// Forward selection: adds causes while they are worth it. Returns the last model and the first round's trials.
    ///
    /// # Errors
    /// [`DiagnoseError`] if a model cannot be simulated.
    pub fn forward(&mut self, from: Scored) -> Result<(Scored, Vec<Trial>), DiagnoseError> {
        let mut best = from;
        let mut first: Option<Vec<Trial>> = None;
        for _ in 0..MOST_CAUSES {
            if !(self.is_sought(&best) && self.may_go_on()) {
                break;
            }
            let (trials, screened) = self.trials(&best)?;
            let worthy = match self.top(&trials) {
                Some(top) if self.is_worth(&top, &best) => Some(top),
                top => {
                    let large = top.clone().filter(|top| self.takes_more_than_it_leaves(top, &best));
                    self.shown_otherwise(top, &mut best, &trials).or(large).or_else(|| self.both(&screened, &best))
                }
            };
            let settled = worthy.and_then(|worthy| {
                (self.progress)(&self.adopting(&worthy, &best));
                self.settled(worthy)
            });
            let settled = settled.map(|settled| self.or_another_form_once_settled(settled, &trials));
            let settled = settled.map(|settled| self.or_a_name_once_settled(settled, &trials));
            first.get_or_insert(trials);
            let Some(settled) = settled else { break };
            best = settled;
            if self.is_given_up(&best) {
                break;
            }
        }
        Ok((best, first.unwrap_or_default()))
    }

    /// The trial to adopt: a free form where it is closer than the best name, so that what the name leaves goes to no other cause. Of several such forms, which have
    /// about as many weights, the least costly on all runs: memories of the joints, of the voltage and of the driver differ by little on the select runs alone.
    /// Names of its place are tried with their other laws first: a free form is linear in its weights, and what it misses of a law that is not goes to other causes.
    fn top(&self, trials: &[Trial]) -> Option<Scored> {
        let (free, named): (Vec<&Scored>, Vec<&Scored>) =
            trials.iter().map(|trial| &trial.scored).partition(|scored| self.ends_free(scored.model()));
        let first = named.first().copied();
        let closer = free.into_iter().filter(|free| first.is_none_or(|named| self.is_closer(free, named)));
        let Some(free) = closer.min_by(|a, b| self.cost(a).total_cmp(&self.cost(b))) else {
            return first.cloned();
        };
        let rivals = named.iter().enumerate().filter(|(at, named)| *at == 0 || self.is_name_of(free, named));
        let top = self.or_a_name(free.clone(), rivals.map(|(_, named)| (*named).clone()));
        let one_of_two = first.filter(|name| self.ends_free(top.model()) && self.is_one_of_two(name, free));
        Some(one_of_two.cloned().unwrap_or(top))
    }

    /// A name that leaves less with a further one than a free form does, by what one would see: the free form does a part of two causes' work then, and what it cannot do of
    /// that goes to a third.
    fn is_one_of_two(&self, name: &Scored, free: &Scored) -> bool {
        let most = self.above(free) - VISIBLE;
        if most <= 0.0 {
            return false;
        }
        let is_wanted = |candidate: &Candidate| !(candidate.is_variant || candidate.is_free_form);
        let Ok(screened) = self.screen_of(name, is_wanted) else { return false };
        (self.progress)("two names in the place of a free form");
        let mut two =
            self.finalists(&screened.ranked, FURTHER).into_iter().filter_map(|model| self.ranked_beyond(&model, &screened).ok());
        two.any(|two| self.above(&two) < most && self.judged(&two) < self.judged(free))
    }

    /// A model that ends with a free form, or the best of `named` with their other laws if the free form is not closer.
    fn or_a_name(&self, free: Scored, named: impl Iterator<Item = Scored>) -> Scored {
        let with_laws = named.map(|named| {
            let last = named.model().terms.len() - 1;
            self.with_its_law(named, last)
        });
        let best = with_laws.min_by(|a, b| self.judged(a).total_cmp(&self.judged(b)));
        best.filter(|best| !self.is_closer(&free, best)).unwrap_or(free)
    }

    /// A model, or one with another free form in the place of its last one, if that cost hardly more and costs less with all that suits it: the discretisation of the search
    /// lets the curve of a clamp look better than that of the joints, both of which stand for a part of the stiffness.
    fn or_another_form_once_settled(&mut self, free: Scored, trials: &[Trial]) -> Scored {
        let is_last = |trial: &&Trial| free.model().terms.last().is_some_and(|term| term.candidate == trial.candidate);
        let own = trials.iter().find(is_last).filter(|_| self.ends_free(free.model()));
        let Some(most) = own.map(|own| self.cost(&own.scored) + self.tolerance()) else { return free };
        let is_near = |trial: &&Trial| self.ends_free(trial.scored.model()) && self.cost(&trial.scored) < most;
        let others = trials.iter().filter(|trial| !is_last(trial)).filter(is_near);
        let others: Vec<Scored> = others.map(|trial| trial.scored.clone()).collect();
        others.into_iter().fold(free, |best, other| self.or_once_settled(best, other))
    }

    /// A model, or the best name of its last free form's place with all that suits the name, if the free form leaves much and the name then costs less: times of jumps
    /// that suit the model without a limit of the rate let a linear filter look better.
    fn or_a_name_once_settled(&mut self, free: Scored, trials: &[Trial]) -> Scored {
        let leaves_much = self.ends_free(free.model()) && self.above(&free) > VISIBLE;
        let mut names = trials.iter().map(|trial| &trial.scored);
        match names.find(|name| leaves_much && self.is_name_of(&free, name)) {
            Some(name) => self.or_once_settled(free, name.clone()),
            None => free,
        }
    }

    /// A model, or another one with all that suits it, if that costs less.
    fn or_once_settled(&mut self, best: Scored, other: Scored) -> Scored {
        let before = self.estimator.state();
        match self.settled(other).filter(|other| self.cost(other) < self.cost(&best)) {
            Some(other) => {
                (self.progress)(&self.adopting(&other, &best));
                other
            }
            None => {
                self.estimator.restore(before);
                best
            }
        }
    }

    /// True if the last term of a model is a named cause of the place of the free form that `free` ends with.
    fn is_name_of(&self, free: &Scored, other: &Scored) -> bool {
        let [free, last] = [free, other].map(|scored| scored.model().terms.last());
        !self.ends_free(other.model()) && free.zip(last).is_some_and(|(free, last)| is_of(self, free, last))
    }

    /// A model with all that suits it better: nuisances, discretisation and laws, before another cause could take their errors; another law of its last cause, and
    /// the plain one of those before where the other one is no longer needed. None if some run cannot be simulated with it: then it is no model, and
    /// everything is as before.
    fn settled(&mut self, model: Scored) -> Option<Scored> {
        let settled = self.settled_if(model, |_, _| true)?;
        let mut best = self.resolve(settled, Convergence::Rank);
        let last = best.model().terms.len().saturating_sub(1);
        for index in 0..last {
            best = self.with_its_plain_law(best, index);
        }
        Some(if best.model().terms.is_empty() { best } else { self.with_its_law_once_settled(best, last) })
    }

    /// [`with_its_law`](Self::with_its_law), and where much is left, with nuisance parameters of each law: times of jumps that suit the plain one hide another.
    fn with_its_law_once_settled(&mut self, scored: Scored, index: usize) -> Scored {
        let scored = self.with_its_law(scored, index);
        let has_shares = self.estimator.nuisances.iter().any(|nuisance| !nuisance.shares.is_empty());
        if !has_shares || self.above(&scored) <= VISIBLE {
            return scored;
        }
        if self.candidate(&scored.model().terms[index]).is_variant {
            return self.settled_if(scored.clone(), |_, _| true).unwrap_or(scored);
        }
        // Each law begins with those of the plain one.
        let before = self.estimator.state();
        let laws = self.other_laws(scored.model(), index);
        let mut best = (before.clone(), scored);
        for model in laws {
            (self.progress)(&format!("another law of {} with times and zeros of its own", self.id(model.terms[index].candidate)));
            self.estimator.restore(before.clone());
            let Ok(ranked) = self.ranked(&model) else { continue };
            if let Some(other) = self.settled_if(ranked, |search, other| search.is_shown(other, &best.1)) {
                best = (self.estimator.state(), other);
            }
        }
        self.estimator.restore(best.0);
        best.1
    }

    /// A model with nuisance parameters of its own, if it can be simulated with them and `is_wanted`; otherwise they are as before.
    pub(super) fn settled_if(&mut self, model: Scored, is_wanted: impl Fn(&Self, &Scored) -> bool) -> Option<Scored> {
        let before = self.estimator.state();
        let settled = self.settle(model).ok().filter(|settled| is_wanted(self, settled));
        if settled.is_none() {
            self.estimator.restore(before);
        }
        settled
    }

    /// The model with another law of the cause of term `index`, if that is significantly better, or with the plain law if the one that it has is not.
    pub(super) fn with_its_law(&self, scored: Scored, index: usize) -> Scored {
        let own = self.candidate(&scored.model().terms[index]);
        if own.is_variant {
            return self.with_its_plain_law(scored, index);
        }
        let mut best: Option<Scored> = None;
        for model in self.other_laws(scored.model(), index) {
            (self.progress)(&format!("another law of {}", own.id));
            let Ok(other) = self.ranked(&model) else { continue };
            if best.as_ref().is_none_or(|best| other.total() < best.total()) {
                best = Some(other);
            }
        }
        // One that is no better so far is not fitted to the end, and one that cannot be is none.
        let best = best.filter(|best| best.total() < scored.total()).and_then(|best| self.fitted(best.model()).ok());
        best.filter(|best| self.is_shown(best, &scored)).unwrap_or(scored)
    }

    /// The best screened candidates fitted on top of `from`, best on select runs first, and the screening.
    ///
    /// # Errors
    /// [`DiagnoseError`] if `from` or a leading candidate cannot be simulated.
    fn trials(&self, from: &Scored) -> Result<(Vec<Trial>, Screened), DiagnoseError> {
        (self.progress)("screening all candidates");
        // Other laws of a cause are tried once it is adopted.
        let is_by_names = matches!(self.phase, Phase::Naming | Phase::ByNames);
        let is_of_places = |candidate: &Candidate| {
            self.places.as_ref().is_none_or(|wanted| candidate.places.iter().any(|place| wanted.contains(place)))
        };
        let is_wanted =
            |candidate: &Candidate| is_of_places(candidate) && !(candidate.is_variant || (candidate.is_free_form && is_by_names));
        let screened = self.screen_of(from, is_wanted)?;
        let (free, named): (Vec<_>, Vec<_>) = screened.ranked.iter().partition(|(_, model)| self.ends_free(model));
        let most = screened.ranked.first().map_or(0.0, |(gain, _)| *gain);
        let most_free = free.first().map_or(0.0, |(gain, _)| *gain);
        let mut finalists = self.finalists(named.into_iter().filter(|(gain, _)| *gain >= PROMISING * most), FINALISTS);
        finalists
            .extend(self.finalists(free.into_iter().filter(|(gain, _)| *gain >= PROMISING_FREE * most_free), FREE_FINALISTS));
        let mut trials = Vec::new();
        for model in finalists {
            let Some(term) = model.terms.last() else { continue };
            (self.progress)(&format!("fitting {}", self.id(term.candidate)));
            // A candidate that cannot be fitted is dropped.
            if let Ok(scored) = self.ranked_beyond(&model, &screened) {
                trials.push(Trial { candidate: term.candidate, scored });
            }
        }
        // Possible winners are refitted: an unconverged fit may do better on select runs than a converged one.
        let best = |by: &dyn Fn(&Scored) -> f64, free: bool| {
            let of_kind = (0..trials.len()).filter(|k| self.ends_free(trials[*k].scored.model()) == free);
            of_kind.min_by(|a, b| by(&trials[*a].scored).total_cmp(&by(&trials[*b].scored)))
        };
        let judged = |scored: &Scored| self.judged(scored);
        let mut ahead = vec![best(&judged, false), best(&|scored| scored.total(), false)];
        // A free form that is no better than a name loses anyway.
        for by in [&judged as &dyn Fn(&Scored) -> f64, &Scored::bic] {
            let is_ahead =
                |free: &usize| best(by, false).is_none_or(|named| by(&trials[*free].scored) < by(&trials[named].scored));
            ahead.push(best(by, true).filter(is_ahead));
        }
        let ahead: BTreeSet<usize> = ahead.into_iter().flatten().collect();
        for index in ahead {
            let model = trials[index].scored.model().clone();
            if let Ok(scored) = self.fitted(&model) {
                trials[index].scored = scored;
            }
        }
        trials.sort_by(|a, b| self.judged(&a.scored).total_cmp(&self.judged(&b.scored)));
        Ok((trials, screened))
    }

    /// True if a free form is better than a name on the select runs and by BIC.
    fn is_closer(&self, free: &Scored, named: &Scored) -> bool {
        self.judged(free) < self.judged(named) && free.bic() < named.bic() - LEAST_BIC
    }

    /// The adoption of a model's last term, in words.
    fn adopting(&self, worthy: &Scored, best: &Scored) -> String {
        let (after, runs) = self.chi2_to_judge_by(worthy);
        let count = self.estimator.count(runs).max(1) as f64;
        let name = worthy.model().terms.last().map_or("nothing", |term| self.id(term.candidate));
        format!("adopting {name}: χ² per value from {:.2} to {:.2}", self.chi2_to_judge_by(best).0 / count, after / count)
    }

    /// A pair of causes of which neither is worth it alone; none if it cannot be fitted.
    fn both(&self, screened: &Screened, base: &Scored) -> Option<Scored> {
        // Other pairs are found one cause at a time.
        let least = 2.0 * screened.ranked.first().map_or(0.0, |(gain, _)| *gain);
        let (_, pair) = self.sets(base.model(), screened, 2, |_| true).into_iter().find(|(gain, _)| *gain > least)?;
        if let [.., first, second] = &pair.terms[..] {
            (self.progress)(&format!("fitting {} and {} together", self.id(first.candidate), self.id(second.candidate)));
        }
        let both = self.ranked_beyond(&pair, screened).ok().filter(|both| self.is_worth(both, base))?;
        self.fitted(both.model()).ok()
    }

    /// A cause that is not worth it as it is, but on another split, or with nuisance parameters of its own. Where both are, the less costly one: on another split a law
    /// that is not quite right may end far from where it suits all runs, and with nuisance parameters of its own a cause may do a part of another one's work, as a
    /// delay in the place of a lag.
    fn shown_otherwise(&mut self, top: Option<Scored>, base: &mut Scored, trials: &[Trial]) -> Option<Scored> {
        let before = (self.split.clone(), self.estimator.state(), base.clone());
        let Some(seen) = self.seen_by_fit_runs(base, trials) else { return self.worth_once_settled(top?, base) };
        let Some(top) = top else { return Some(seen) };
        let seen = self.settled_if(seen.clone(), |_, _| true).unwrap_or(seen);
        let after = (self.split.clone(), self.estimator.state());
        self.split = before.0;
        self.estimator.restore(before.1);
        match self.worth_once_settled(top, &before.2).filter(|settled| self.cost(settled) < self.cost(&seen)) {
            Some(settled) => {
                *base = before.2;
                Some(settled)
            }
            None => {
                self.split = after.0;
                self.estimator.restore(after.1);
                Some(seen)
            }
        }
    }

    /// A trial that takes much, but leaves so much that this may be chance, with nuisance parameters of its own: those of the model without a slew rate are far from those
    /// with it.
    fn worth_once_settled(&mut self, trial: Scored, base: &Scored) -> Option<Scored> {
        if !self.takes_much(&trial, base) {
            return None;
        }
        let name = trial.model().terms.last().map_or("nothing", |term| self.id(term.candidate));
        (self.progress)(&format!("{name} with times and zeros of its own"));
        self.settled_if(trial, |search, settled| search.is_worth(settled, base))
    }

    /// A cause, or a free form, that shows in fit runs only: where the run that it improves most is selected on as well, the cause, fitted to the others, has to improve it
    /// too. In the place of a free form a name counts as in [`top`](Self::top). If it does, that run counts in the fit again unless the other select runs are
    /// predicted worse so: it may be the one that shows how large the cause is, or what its law does not follow.
    fn seen_by_fit_runs(&mut self, base: &mut Scored, trials: &[Trial]) -> Option<Scored> {
        let trial = trials.iter().min_by(|a, b| a.scored.bic().total_cmp(&b.scored.bic()))?;
        let gain = |run: &usize| sum_of_squares(&base.residuals[*run]) - sum_of_squares(&trial.scored.residuals[*run]);
        let most = self.split.fit.iter().copied().max_by(|a, b| gain(a).total_cmp(&gain(b)));
        let run = most.filter(|_| self.split.fit.len() > 2 && self.is_seen_by_fit(&trial.scored, base))?;
        (self.progress)(&format!("{} on another split", self.id(trial.candidate)));
        let before = self.split.clone();
        self.split.fit.retain(|other| *other != run);
        self.split.select.push(run);
        self.split.select.sort_unstable();
        let shown = self.shown_by_select_runs(base, trial, trials);
        let other = std::mem::replace(&mut self.split, before);
        let (plain, with) = shown?;
        let on_select =
            |scored: &Scored| -> f64 { self.split.select.iter().map(|run| sum_of_squares(&scored.residuals[*run])).sum() };
        // Hardly worse is no worse: by as much as two discretisations of one physics may differ.
        let most = on_select(&with) + LEAST_GAIN * self.estimator.count(&self.split.select) as f64;
        if let Some(back) = self.fitted(with.model()).ok().filter(|back| on_select(back) <= most) {
            return Some(back);
        }
        self.split = other;
        *base = plain;
        Some(with)
    }

    /// The model `base`, and a trial, or a name in the place of a free form, that is worth it over that, both fitted to the present fit runs.
    fn shown_by_select_runs(&self, base: &Scored, trial: &Trial, trials: &[Trial]) -> Option<(Scored, Scored)> {
        let plain = self.fitted(base.model()).ok()?;
        let with = self.fitted(trial.scored.model()).ok().filter(|with| self.is_worth(with, &plain))?;
        if !self.ends_free(with.model()) {
            return Some((plain, with));
        }
        let names = trials.iter().map(|other| &other.scored).filter(|other| self.is_name_of(&with, other));
        let rivals: Vec<Scored> = names.filter_map(|name| self.ranked(name.model()).ok()).collect();
        Some((plain, self.or_a_name(with, rivals.into_iter())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::{Model, Term};
    use crate::diagnose::waves::{Waves, candidate, search};

    #[test]
    fn of_free_forms_that_are_closer_than_a_name_the_least_costly_on_all_runs_is_adopted() {
        let mut plant = Waves::new(&[("other", 3.0)]);
        plant.candidates[1].is_free_form = true;
        plant.candidates[2].is_free_form = true;
        let search = search(&plant);
        let trial = |candidate: usize, select: f64, fitted: f64| {
            let model = Model::new(vec![Term { candidate, x: vec![1.0] }], 1.0, false);
            Trial { candidate, scored: Scored { select, fitted, ..search.fitted(&model).unwrap() } }
        };
        let adopted = |trials: &[Trial]| search.top(trials).unwrap().model().terms[0].candidate;
        let named = trial(0, 1000.0, 2000.0);
        assert_eq!(adopted(&[trial(1, 900.0, 1800.0), trial(2, 910.0, 1700.0), named.clone()]), 2);
        // One that leaves more than the name on select runs, the least on all, is not.
        assert_eq!(adopted(&[trial(1, 900.0, 1800.0), named.clone(), trial(2, 1010.0, 1500.0)]), 1);
        assert_eq!(adopted(&[named, trial(2, 1010.0, 1500.0)]), 0);
    }

    #[test]
    fn of_free_forms_that_cost_as_much_in_the_first_discretisation_the_least_costly_one_in_its_own_is_adopted() {
        // The finer discretisation has the wave `other`; without it, `first` leaves more than `between` by less than discretisations may differ by, with it nothing.
        let mut plant = Waves::new(&[("first", 1.84), ("other", 1.0)]);
        plant.resolutions = vec![1.0, 2.0];
        plant.candidates = ["between", "first"].map(candidate).to_vec();
        plant.candidates.iter_mut().for_each(|free| free.is_free_form = true);
        let mut search = search(&plant);
        let calibrated = search.calibrated(1.0).unwrap();
        let trials = search.trials(&calibrated).unwrap().0;
        let between = search.top(&trials).unwrap();
        assert_eq!(search.id(between.model().terms[0].candidate), "between");
        let (best, _) = search.forward(calibrated).unwrap();
        let ids: Vec<&str> = best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
        assert_eq!((ids, best.model().resolution), (vec!["first"], 2.0));
    }

    #[test]
    fn names_of_a_place_are_tried_with_their_other_laws_before_its_free_form() {
        let mut plant = Waves::new(&[("second", 5.0), ("other", 2.0)]);
        plant.candidates[1].is_free_form = true;
        let search = search(&plant);
        let trial = |candidate: usize| {
            let model = Model::new(vec![Term { candidate, x: vec![1.0] }], 1.0, false);
            Trial { candidate, scored: search.fitted(&model).unwrap() }
        };
        let named = trial(2);
        for (gain, adopted) in [(0.5, 3), (3.0, 1)] {
            // The other law takes about 2 per value.
            let by = |runs: &[usize]| gain * search.estimator.count(runs) as f64;
            let mut free = trial(1);
            free.scored.select = named.scored.select - by(&search.split.select);
            free.scored.fitted = named.scored.fitted - by(&search.split.fit);
            let top = search.top(&[free, named.clone()]).unwrap();
            assert_eq!(top.model().terms[0].candidate, adopted, "{gain}");
        }

        // Where fit runs alone show it, too: the free form with the least BIC gives way to the law that leaves less.
        let mut free = trial(1);
        free.scored.fitted = 0.0;
        let trials = [free, named];
        let mut search = search;
        let mut base = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
        let seen = search.seen_by_fit_runs(&mut base, &trials).unwrap();
        assert_eq!(seen.model().terms[0].candidate, 3);
    }

    #[test]
    fn a_name_that_leaves_less_with_a_further_one_is_adopted_in_the_place_of_a_free_form() {
        // The free form leaves some 0.5 per value, or nothing; the further name takes all of what the name leaves, or there is none.
        let both = &[("other", 3.0), ("first", 3.0)][..];
        for (hidden, names, adopted) in [
            (both, &["other", "first"][..], "other"),
            (both, &["other"], "between"),
            (&[("between", 3.0)], &["other", "first"], "between"),
        ] {
            let mut plant = Waves::new(hidden);
            plant.candidates = names.iter().map(|id| candidate(id)).collect();
            plant.candidates.push(Candidate { is_free_form: true, ..candidate("between") });
            let search = search(&plant);
            let trial = |candidate: usize| {
                let model = Model::new(vec![Term { candidate, x: vec![1.0] }], 1.0, false);
                Trial { candidate, scored: search.fitted(&model).unwrap() }
            };
            let top = search.top(&[trial(names.len()), trial(0)]).unwrap();
            assert_eq!(search.id(top.model().terms[0].candidate), adopted, "{hidden:?} {names:?}");
        }
    }

    #[test]
    fn a_run_that_shows_a_cause_counts_in_the_fit_unless_select_runs_are_predicted_worse_so() {
        // With twice the amplitude in the first run it is not what the others have.
        for (once, fit) in [(0.0, vec![0, 1, 3, 5]), (3.0, vec![1, 3, 5])] {
            let plant = Waves::new(&[("other", 3.0), ("once", once)]);
            let mut search = search(&plant);
            let mut base = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            let mut scored = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![1.0] }], 1.0, false)).unwrap();
            (scored.fitted, scored.residuals[0]) = (0.0, vec![0.0; scored.residuals[0].len()]);
            let seen = search.seen_by_fit_runs(&mut base, &[Trial { candidate: 0, scored }]).unwrap();
            assert_eq!(search.split.fit, fit, "{once}");
            // But for rounding.
            assert!((seen.total() - search.fitted(seen.model()).unwrap().total()).abs() < 1e-6, "{once}: {}", seen.total());
        }
    }

    #[test]
    fn causes_and_laws_are_judged_with_nuisance_parameters_of_their_own() {
        // With the shares of the model without it, a cause leaves far more than it takes.
        let mut plant = Waves::new(&[("other", 3.0), ("late", 12.0)]);
        plant.lateness = 4.0;
        plant.candidates.truncate(1);
        let mut cause = search(&plant);
        let plain = cause.calibrated(1.0).unwrap();
        let (best, _) = cause.forward(plain).unwrap();
        assert_eq!(best.model().terms.len(), 1);
        assert!(cause.estimator.shares().amax() < 0.1, "{}", cause.estimator.shares());
        // So does another law, or one that is adopted with those of the plain one.
        for lateness in [4.0, 12.0] {
            let mut plant = Waves::new(&[("second", 5.0), ("other", 3.0), ("late", 3.0 * lateness)]);
            plant.lateness = lateness;
            let mut law = search(&plant);
            let plain = law.fitted(&Model::new(vec![Term { candidate: 2, x: vec![1.0] }], 1.0, false)).unwrap();
            let settled = law.settled(plain).unwrap();
            assert_eq!(settled.model().terms[0].candidate, 3);
            assert!(law.above(&settled) < VISIBLE, "{lateness}: {}", law.above(&settled));
        }
    }

    #[test]
    fn a_name_with_nuisance_parameters_of_its_own_is_adopted_where_a_free_form_leaves_much() {
        // With the shares of the model without causes the free form takes most of it.
        let mut plant = Waves::new(&[("other", 3.0), ("late", 12.0)]);
        plant.lateness = 4.0;
        plant.candidates = vec![candidate("other"), Candidate { is_free_form: true, ..candidate("late") }];
        let mut search = search(&plant);
        let plain = search.calibrated(1.0).unwrap();
        let (best, first) = search.forward(plain).unwrap();
        assert_eq!(first[0].candidate, 1);
        assert_eq!(best.model().terms.iter().map(|term| term.candidate).collect::<Vec<_>>(), [0]);
        assert!(search.estimator.shares().amax() < 0.1, "{}", search.estimator.shares());
    }

    #[test]
    fn of_a_cause_on_another_split_and_one_with_nuisance_parameters_of_its_own_the_less_costly_one_is_adopted() {
        for (other, adopted) in [(3.0, 0), (1.0, 1)] {
            let mut plant = Waves::new(&[("other", other), ("late", 12.0)]);
            plant.lateness = 4.0;
            plant.candidates = ["other", "late"].map(candidate).to_vec();
            let mut search = search(&plant);
            let mut base = search.calibrated(1.0).unwrap();
            let trial = |candidate: usize| {
                let model = Model::new(vec![Term { candidate, x: vec![1.0] }], 1.0, false);
                Trial { candidate, scored: search.fitted(&model).unwrap() }
            };
            let (trials, own) = ([trial(1), trial(0)], search.split.select.clone());
            let found = search.shown_otherwise(Some(trials[1].scored.clone()), &mut base, &trials).unwrap();
            assert_eq!(found.model().terms[0].candidate, adopted, "{other}");
            // Only the cause on another split may leave that behind.
            assert!(adopted == 1 || search.split.select == own);
        }
    }

    #[test]
    fn causes_that_cost_more_than_the_limit_for_so_many_are_given_up() {
        let plant = Waves::new(&[("other", 6.0), ("first", 3.0)]);
        // The larger cause takes 18 of 22.5 per value.
        for (limits, count) in [([1.0; 2], 2), ([0.1, 1.0], 1), ([1.0, 0.01], 2)] {
            let mut search = search(&plant);
            let plain = search.calibrated(1.0).unwrap();
            search.limits = limits.map(|share| share * search.cost(&plain));
            let (best, _) = search.forward(plain).unwrap();
            assert_eq!(best.model().terms.len(), count, "{limits:?}");
            assert_eq!(search.is_given_up(&best), limits != [1.0; 2], "{limits:?}");
        }
    }

    #[test]
    fn a_cause_that_takes_more_than_it_leaves_is_adopted_though_that_may_be_chance() {
        // The cause takes 4.5 per value; 3 or 8 are left, which follow it for half a period in each block.
        for (late, count) in [(2.5, 1), (4.0, 0)] {
            let mut plant = Waves::new(&[("other", 3.0), ("late", late)]);
            plant.candidates.truncate(1);
            let mut search = search(&plant);
            search.estimator.held_spread = Some(search.estimator.given_spread());
            (search.split.fit, search.split.select) = (vec![1, 2], vec![0]);
            let plain = search.calibrated(1.0).unwrap();
            let cause = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![1.0] }], 1.0, false)).unwrap();
            assert!(!search.is_worth(&cause, &plain), "{late}");
            assert_eq!(search.forward(plain).unwrap().0.model().terms.len(), count, "{late}");
        }
    }

    #[test]
    fn nuisance_parameters_of_a_model_that_is_not_wanted_are_not_kept() {
        let mut plant = Waves::new(&[("other", 3.0), ("late", 12.0)]);
        plant.lateness = 4.0;
        let mut search = search(&plant);
        let model = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![1.0] }], 1.0, false)).unwrap();
        let before = search.estimator.shares();
        assert!(search.settled_if(model.clone(), |_, _| false).is_none());
        assert_eq!(search.estimator.shares(), before);
        assert!(search.settled_if(model, |_, _| true).is_some() && search.estimator.shares() != before);
    }
}
