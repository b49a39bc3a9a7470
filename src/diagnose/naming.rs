//! From a place to a name: the named causes of a place in the stead of its free form.
//!
//! The search adopts a free form where it is worth more than any name: then the place is known and the misfit is taken, whatever the law. Afterwards
//! each named cause of the place is fitted instead. A name stands if it takes at least [`LEAST_TAKEN`] of what the free form takes on runs that no
//! parameter was fitted to (detection, localisation, characterisation: Kerschen, Worden, Vakakis, Golinval 2006). Where no single name does, or one
//! does that leaves more than the free form, two or three stand together if they cost no more than the free form, or hardly more: the others may be of other places.

use super::DiagnoseError;
use super::bench::Spread;
use super::diagnosis::Nearest;
use super::fit::Convergence;
use super::plant::{Candidate, Model, Term};
use super::search::{PROMISING_IN_PLACE, SOUGHT, Scored, Search, VISIBLE};

/// A name stands if it takes this share of what the free form takes on select runs.
pub(super) const LEAST_TAKEN: f64 = 0.95;
/// Held-out runs show a place if the free form takes there this share of what it takes in all, both per value.
const LEAST_SHOWN: f64 = 0.1;
/// Named candidates of a place that are fitted in the stead of its free form.
const MOST_NAMES: usize = 7;
/// Names to which a second one is added where none stands alone, and second ones of other places for each.
const MOST_FIRST: usize = 2;
const MOST_ELSEWHERE: usize = 3;
/// Sets of two and of three names that are fitted, by linear estimates, where that does not do.
const MOST_SETS: usize = 3;

/// A model with names where they stand, and the names tried for its free forms, nearest first.
pub struct Naming {
    /// The model.
    pub best: Scored,
    /// The places of every free form, and the names that were tried in its stead, nearest first.
    pub nearest: Vec<(Vec<&'static str>, Vec<Nearest>)>,
}

/// Tries the named causes of every free form's place in its stead.
///
/// # Errors
/// [`DiagnoseError`] if a model without one of its terms cannot be simulated.
pub fn name(search: &mut Search, open: Scored) -> Result<Naming, DiagnoseError> {
    let mut best = open;
    let mut nearest = Vec::new();
    let frees: Vec<Term> = best.model().terms.iter().filter(|term| search.candidate(term).is_free_form).cloned().collect();
    for free in &frees {
        let Some(index) = best.model().terms.iter().position(|term| term.candidate == free.candidate) else { continue };
        let (named, tried) = Place::new(search, &best, index)?.named()?;
        nearest.push((search.candidate(free).places.clone(), tried));
        best = named.unwrap_or(best);
    }
    if !frees.is_empty() {
        best = search.settle(best)?;
    }
    Ok(Naming { best, nearest })
}

/// A model with a single name in the stead of its free form `free`, with nothing else beside it, if that costs no more, or hardly more; otherwise as it is.
///
/// # Errors
/// [`DiagnoseError`] if a model without one of its terms cannot be simulated.
pub(super) fn alone(search: &Search, open: Scored, free: Term) -> Result<Naming, DiagnoseError> {
    let place = Place::of(search, open.clone(), free)?;
    let (tried, nearest) = place.tried()?;
    let standing = tried.into_iter().filter(|attempt| attempt.taken >= LEAST_TAKEN && place.is_as_good(attempt)).collect();
    let nearest = vec![(search.candidate(&place.free).places.clone(), nearest)];
    Ok(Naming { best: place.simplest(standing).map_or(open, |one| one.scored), nearest })
}

/// A free form of a model, to be replaced by names.
struct Place<'a> {
    search: &'a Search<'a>,
    /// The model with the free form, and as a rule with all constants: what the free form does in the place of a constant is not its own.
    best: Scored,
    /// The free form.
    free: Term,
    /// The model without the free form and without named causes of its place, which give way to a single name.
    bare: Scored,
}

/// A model with a name in the stead of a free form, and the share of what that takes which it takes too.
struct Attempt {
    name: &'static str,
    taken: f64,
    scored: Scored,
}

impl<'a> Place<'a> {
    /// Without faults of the bench but given ones, where the free form does without them: a camera's scale that differs from run to run is linear about
    /// the model with the free form, and could stand in for what a name lacks. Faults without which more is left than a name may leave stay.
    fn new(search: &'a Search<'a>, best: &Scored, index: usize) -> Result<Self, DiagnoseError> {
        let place = Self::with_spread(search, best, index, search.estimator.given_spread())?;
        let lost = place.best.total() - best.total();
        if lost > (1.0 - LEAST_TAKEN) * (place.bare.total() - place.best.total()) {
            return Self::with_spread(search, best, index, best.model().spread);
        }
        Ok(place)
    }

    fn with_spread(search: &'a Search<'a>, best: &Scored, index: usize, spread: Spread) -> Result<Self, DiagnoseError> {
        let model = search.with_constants(&Model { spread, ..best.model().clone() });
        Self::of(search, search.fitted_at_its_spread(&model)?, best.model().terms[index].clone())
    }

    /// Beside the terms that the model has.
    fn of(search: &'a Search<'a>, best: Scored, free: Term) -> Result<Self, DiagnoseError> {
        let mut model = best.model().clone();
        let is_of_place = |term: &Term| is_of(search, &free, term) && !search.candidate(term).is_constant;
        model.terms.retain(|term| term.candidate != free.candidate && !is_of_place(term));
        (search.progress)("the place without its free form");
        Ok(Self { bare: search.fitted_at_its_spread(&model)?, search, best, free })
    }

    /// The model with the best name or the best few, if they stand, and all names that were tried, nearest first.
    fn named(&self) -> Result<(Option<Scored>, Vec<Nearest>), DiagnoseError> {
        let (tried, nearest) = self.tried()?;
        let (standing, others): (Vec<_>, Vec<_>) = tried.into_iter().partition(|attempt| attempt.taken >= LEAST_TAKEN);
        let standing = self.simplest(standing).map(|one| self.resolved(one));
        let found = match &standing {
            Some(one) if self.is_as_good(one) => standing,
            // What a name leaves beyond the free form may be another cause, or what its law does not follow.
            Some(one) => {
                let several = self.several(std::slice::from_ref(one));
                several.filter(|several| self.search.is_worth_in_place(&several.scored, &one.scored)).or(standing)
            }
            None => self.elsewhere().or_else(|| self.several(&others)),
        };
        let found = found.map(|found| found.scored);
        Ok((if found.is_some() { found } else { self.alone()? }, nearest))
    }

    /// The single names of the place, and what they leave, nearest first.
    fn tried(&self) -> Result<(Vec<Attempt>, Vec<Nearest>), DiagnoseError> {
        let mut tried = self.single()?;
        tried.sort_by(|a, b| b.taken.total_cmp(&a.taken));
        let mut nearest: Vec<Nearest> = Vec::new();
        for Attempt { name, taken, .. } in &tried {
            if nearest.iter().all(|other| other.id != *name) {
                nearest.push(Nearest { id: (*name).into(), left: (1.0 - taken).clamp(0.0, 1.0) });
            }
        }
        Ok((tried, nearest))
    }

    /// The attempt that costs the least.
    fn least(&self, attempts: Vec<Attempt>) -> Option<Attempt> {
        let cost = |attempt: &Attempt| self.search.cost(&attempt.scored);
        attempts.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))
    }

    /// The attempt that costs the least, or the best one of another cause that has fewer coordinates and costs hardly more.
    fn simplest(&self, attempts: Vec<Attempt>) -> Option<Attempt> {
        let cost = |attempt: &Attempt| self.search.cost(&attempt.scored);
        let mut attempts = attempts;
        attempts.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        let best = attempts.first()?;
        let is_simpler = |other: &Attempt| {
            other.name != best.name
                && other.scored.freedom() < best.scored.freedom()
                && cost(other) <= cost(best) + self.search.tolerance()
        };
        let at = attempts.iter().position(is_simpler).unwrap_or(0);
        Some(attempts.swap_remove(at))
    }

    /// An attempt in the discretisation that suits it, if it takes as much as a name has to but is not as good as the free form: the discretisation of that may make up
    /// for what the form follows and should not.
    fn resolved(&self, attempt: Attempt) -> Attempt {
        if attempt.taken < LEAST_TAKEN || self.is_as_good(&attempt) {
            return attempt;
        }
        let scored = self.search.resolve(attempt.scored, Convergence::Rank);
        Attempt { name: attempt.name, taken: self.taken(&scored), scored }
    }

    /// True if an attempt costs less than the free form, or hardly more.
    fn is_as_good(&self, attempt: &Attempt) -> bool {
        self.search.cost(&attempt.scored) <= self.search.cost(&self.best) + self.search.tolerance()
    }

    /// Single names: the promising ones, and those that are in the model beside the free form.
    fn single(&self) -> Result<Vec<Attempt>, DiagnoseError> {
        let mut tried = self.promising(|candidate| self.is_name(candidate), 1)?;
        if let Some(kept) = self.kept() {
            let of_place = kept.terms.iter().rfind(|term| is_of(self.search, &self.free, term));
            let name = of_place.map(|term| self.search.candidate(term).id);
            tried.extend(self.attempt(&kept).map(|kept| Attempt { name: name.unwrap_or(kept.name), ..kept }));
        }
        Ok(tried)
    }

    /// A single name of another place that is as good as the free form. Near a resonance, memories of the joints, of the voltage and of the driver do nearly the
    /// same, and each has a free form.
    fn elsewhere(&self) -> Option<Attempt> {
        if !self.search.may_go_on() {
            return None;
        }
        let tried = self.promising(|candidate| !(candidate.is_free_form || self.is_name(candidate)), 0).ok()?;
        self.simplest(tried).map(|one| self.resolved(one)).filter(|attempt| self.is_as_good(attempt))
    }

    /// Promising single ones of those candidates that are wanted, and the first `least` even if they are far.
    fn promising(&self, is_wanted: impl Fn(&Candidate) -> bool, least: usize) -> Result<Vec<Attempt>, DiagnoseError> {
        let screened = self.search.screen_of(&self.bare, is_wanted)?;
        let own = PROMISING_IN_PLACE * (self.bare.total() - self.best.total());
        let ranked = screened.ranked.iter().enumerate();
        let promising = ranked.filter(|(at, (gain, _))| *at < least || *gain >= own).map(|(_, ranked)| ranked);
        let models = self.search.finalists(promising, MOST_NAMES);
        let start = |model: &Model| self.search.start_beyond(model, &screened).ok();
        Ok(models.iter().filter_map(|model| self.attempt(&start(model)?)).collect())
    }

    /// Two or three names that are as good as the free form, none if none are, or if much is left with it, which several names could follow: beside the best single
    /// ones of `tried`, then those that would take most together. They may be of other places, as what a free form takes need not be of its place alone. Models that
    /// cannot be simulated are none.
    fn several(&self, tried: &[Attempt]) -> Option<Attempt> {
        let is_much_left = self.search.share_left(&self.best) > SOUGHT && self.search.above(&self.best) > VISIBLE;
        if is_much_left || !self.search.may_go_on() {
            return None;
        }
        let mut firsts: Vec<&Attempt> = Vec::new();
        for attempt in tried {
            if firsts.len() < MOST_FIRST && firsts.iter().all(|other| other.name != attempt.name) {
                firsts.push(attempt);
            }
        }
        let mut found = Vec::new();
        for first in firsts {
            found.extend(self.beside(&first.scored).unwrap_or_default());
        }
        let mut found = self.least(found).map(|pair| self.resolved(pair));
        if found.as_ref().is_some_and(|pair| self.is_as_good(pair)) {
            return found;
        }
        // Beside the named causes of the place that are in the model.
        let kept = self.kept().and_then(|model| self.search.fitted_at_its_spread(&model).ok());
        let base = kept.as_ref().unwrap_or(&self.bare);
        let screened = self.search.screen_of(base, |candidate| !(candidate.is_free_form || candidate.is_variant)).ok()?;
        for size in [2, 3] {
            let sets = self.search.sets(base.model(), &screened, size, |_| true);
            let sets = sets.iter().take(MOST_SETS).filter_map(|(_, model)| self.search.start_beyond(model, &screened).ok());
            found =
                self.least(sets.filter_map(|start| self.attempt(&start)).chain(found).collect()).map(|set| self.resolved(set));
            if found.as_ref().is_some_and(|set| self.is_as_good(set)) {
                return found;
            }
        }
        let near = found.filter(|set| self.is_near(set))?;
        // The free form may have made up for a wrong cause elsewhere, as a delay of the camera in the place of one of the driver.
        let replaced = self.search.replacements(&near.scored, MOST_NAMES).ok()?.into_iter();
        let others = replaced.map(|other| Attempt { scored: other.trial.scored, ..near });
        self.least(others.collect()).filter(|set| self.is_as_good(set))
    }

    /// True if what an attempt leaves beyond the free form would be minor.
    fn is_near(&self, attempt: &Attempt) -> bool {
        let beyond = attempt.scored.total() - self.best.total();
        beyond < SOUGHT * (self.bare.total() - self.best.total())
            && beyond < VISIBLE * self.search.estimator.count(&self.search.split.all()) as f64
    }

    /// A name with a second one beside it.
    fn beside(&self, first: &Scored) -> Result<Vec<Attempt>, DiagnoseError> {
        let is_wanted = |candidate: &Candidate| self.is_name(candidate) || !(candidate.is_free_form || candidate.is_variant);
        let screened = self.search.screen_of(first, is_wanted)?;
        // Beside a first name that stretches to do the work of two, a linear estimate may miss the second one: those of the place are few.
        let (of_place, others): (Vec<_>, Vec<_>) = screened.ranked.iter().partition(|(_, model)| self.is_rival(model));
        let mut seconds = self.search.finalists(of_place, MOST_NAMES);
        seconds.extend(self.search.finalists(others, MOST_ELSEWHERE));
        let start = |model: &Model| self.search.start_beyond(model, &screened).ok();
        Ok(seconds.iter().filter_map(|model| self.attempt(&start(model)?)).collect())
    }

    /// The model without the free form, with the named causes of its place; none without any.
    fn kept(&self) -> Option<Model> {
        let mut without = self.best.model().clone();
        without.terms.retain(|term| term.candidate != self.free.candidate);
        (without.terms.len() > self.bare.model().terms.len()).then_some(without)
    }

    /// The free form without named causes of its place, if there are some and it takes as much as a name would have to.
    fn alone(&self) -> Result<Option<Scored>, DiagnoseError> {
        let mut model = self.bare.model().clone();
        if model.terms.len() + 1 == self.best.model().terms.len() {
            return Ok(None);
        }
        model.terms.push(self.free.clone());
        let alone = self.search.fitted_at_its_spread(&model)?;
        Ok(Some(alone).filter(|alone| self.taken(alone) >= LEAST_TAKEN))
    }

    /// Share of what the free form takes that another model takes: the smaller one of those on all runs and on select runs, where these show the place. A saturation
    /// of negative voltages takes all that select runs show if these have no others.
    fn taken(&self, scored: &Scored) -> f64 {
        let count = |runs: &[usize]| self.search.estimator.count(runs).max(1) as f64;
        let whole = (self.bare.total() - self.best.total()) / count(&self.search.split.all());
        let held = (self.bare.select - self.best.select) / count(&self.search.split.select);
        let share = |of: &dyn Fn(&Scored) -> f64| {
            (of(&self.bare) - of(scored)) / (of(&self.bare) - of(&self.best)).max(f64::MIN_POSITIVE)
        };
        let of_all = share(&Scored::total);
        if held > LEAST_SHOWN * whole { of_all.min(share(&|scored| scored.select)) } else { of_all }
    }

    /// A model whose last term is the name, the other causes with their plain laws if these do; none if it cannot be fitted.
    ///
    /// What a free form misses of the true curve can make another law of another cause significant, which then stands in the way of the right name.
    fn attempt(&self, model: &Model) -> Option<Attempt> {
        let name = self.search.candidate(model.terms.last()?).id;
        (self.search.progress)(&format!("{name} in the stead of {}", self.search.candidate(&self.free).id));
        let mut scored = self.search.fitted_at_its_spread(model).ok()?;
        for index in 0..scored.model().terms.len() - 1 {
            scored = self.search.with_its_plain_law(scored, index);
        }
        Some(Attempt { name, taken: self.taken(&scored), scored })
    }

    /// True for named causes of the place.
    fn is_name(&self, candidate: &Candidate) -> bool {
        !candidate.is_free_form && is_of_place(self.search, &self.free, candidate)
    }

    /// True if a model's last term is a named cause of the place.
    fn is_rival(&self, model: &Model) -> bool {
        model.terms.last().is_some_and(|term| self.is_name(self.search.candidate(term)))
    }
}

/// True if a candidate acts at a place of the free form.
fn is_of_place(search: &Search, free: &Term, candidate: &Candidate) -> bool {
    candidate.places.iter().any(|place| search.candidate(free).places.contains(place))
}

/// True if a term acts at a place of the free form.
pub(super) fn is_of(search: &Search, free: &Term, term: &Term) -> bool {
    is_of_place(search, free, search.candidate(term))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::waves::{Waves, candidate, search};

    #[test]
    fn a_name_of_another_place_stands_if_it_is_as_good_as_the_free_form() {
        for (hidden, stands) in [("other", true), ("first", false)] {
            let mut plant = Waves::new(&[(hidden, 3.0)]);
            // A free form without a name at its place, which does what is hidden.
            plant.candidates = vec![Candidate { is_free_form: true, places: vec!["elsewhere"], ..candidate(hidden) }];
            plant.candidates.push(Candidate { id: "name", ..candidate("other") });
            let mut search = search(&plant);
            let term = Term { candidate: 0, x: vec![1.0] };
            let open = search.fitted(&Model::new(vec![term], 1.0, false)).unwrap();
            let named = name(&mut search, open).unwrap().best;
            let names: Vec<_> = named.model().terms.iter().map(|term| term.candidate).collect();
            assert_eq!(names, if stands { [1] } else { [0] }, "{hidden}");
        }
    }

    #[test]
    fn a_name_that_takes_all_that_select_runs_show_has_to_take_what_the_others_do() {
        // The first run, which is not selected on, has the wave with twice the amplitude: a free form takes 18 per value there and 4.5 in each of the others, the name 13.5.
        for (hidden, taken) in [(vec![("other", 3.0)], 1.0), (vec![("other", 3.0), ("once", 3.0)], 36.0 / 40.5)] {
            let mut plant = Waves::new(&hidden);
            let free = Candidate { is_free_form: true, ..candidate("once") };
            plant.candidates = vec![free, candidate("other")];
            let mut search = search(&plant);
            search.split.select.retain(|run| *run > 0);
            search.split.fit = (0..6).filter(|run| !search.split.select.contains(run)).collect();
            let terms = [0, 1].map(|candidate| Term { candidate, x: vec![1.0] });
            let open = search.fitted(&Model::new(terms.to_vec(), 1.0, false)).unwrap();
            let place = Place::new(&search, &open, 0).unwrap();
            let name =
                search.estimator.fit(&Model::new(terms[1..].to_vec(), 1.0, false), &search.split.select, Convergence::Full);
            let name = search.score(name.unwrap()).unwrap();
            assert!((place.taken(&name) - taken).abs() < 0.01, "{hidden:?} {}", place.taken(&name));
        }
    }

    #[test]
    fn a_name_takes_nothing_by_what_a_constant_does() {
        // Nearly all that the free form takes is what the constant does; the first name does that, the second name what `first` does.
        for (hidden, found) in [("late", 2), ("first", 3)] {
            let mut plant = Waves::new(&[(hidden, 1.0), ("other", 10.0)]);
            let of = plant.candidates[3].clone();
            let free = Candidate { id: hidden, is_free_form: true, is_variant: false, ..of };
            plant.candidates =
                vec![Candidate { is_constant: true, ..candidate("other") }, candidate("name"), free, candidate("second")];
            let mut search = search(&plant);
            let open = search.fitted(&Model::new(vec![Term { candidate: 2, x: vec![1.0, 1.0] }], 1.0, false)).unwrap();
            let named = name(&mut search, open).unwrap().best;
            let named = search.backward(named).unwrap();
            let causes: Vec<usize> = named.model().terms.iter().map(|term| term.candidate).filter(|c| *c > 0).collect();
            assert_eq!(causes, [found], "{hidden}");
        }
    }

    #[test]
    fn several_names_stand_unless_much_is_left_with_the_free_form() {
        // Of 114 per value the first name takes 112 and both all that the free form does, which leaves 0.5 or 8 % of all.
        for (left, names) in [(1.0, 2), (4.5, 1)] {
            let plant = &mut Waves::new(&[("other", 15.0), ("late", 2.0), ("first", left)]);
            let free = Candidate { id: "late", is_free_form: true, is_variant: false, ..plant.candidates[3].clone() };
            plant.candidates = vec![free, candidate("name"), candidate("late")];
            let mut search = search(plant);
            search.set_unexplained(&search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap());
            let open = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![1.0, 1.0] }], 1.0, false)).unwrap();
            let named = name(&mut search, open).unwrap().best;
            let causes: Vec<usize> = named.model().terms.iter().map(|term| term.candidate).collect();
            assert_eq!(causes, [1, 2][..names], "{left}");
        }
    }

    #[test]
    fn a_name_is_compared_with_a_free_form_in_the_discretisation_that_suits_it() {
        // A resolution of 2 does what an amplitude of 1 does: the free form is as good with it, the name is not.
        for (least, resolution) in [(2.4, 1.0), (1.5, 2.0)] {
            let mut plant = Waves::new(&[("other", 3.0)]);
            plant.resolutions = vec![1.0, 2.0];
            plant.candidates = vec![Candidate { is_free_form: true, ..candidate("other") }, candidate("name")];
            plant.candidates[1].parameters[0].bounds = [least, 10.0];
            let mut search = search(&plant);
            let open = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![1.0] }], 2.0, false)).unwrap();
            let named = name(&mut search, open).unwrap().best;
            assert_eq!((named.model().terms[0].candidate, named.model().resolution), (1, resolution), "{least}");
        }
    }
}
