//! Ties: other causes, or two others together, that explain the data as well as an adopted one.

use super::fit::coordinates;
use super::plant::{Candidate, Model, Term};
use super::search::{LEAST_BIC, Replacement, Responses, Scored, Screened, Search, Trial};

/// Replacements are refitted like the best model if their χ² exceeds its own by no more than this, or than two discretisations of one physics may differ by.
const NEAR_TIE: f64 = 500.0;
/// Two causes together are fitted in the place of one if their linear estimate is at least this share of what it takes.
const PROMISING_PAIR: f64 = 0.9;
/// Sets of two that are fitted in the place of one: as good ones differ in causes that the data cannot tell apart.
const MOST_PAIRS: usize = 3;
/// A cause shares its place with another one if that moves its first parameter by this share of the distance from where it has no effect.
const LEAST_MOVED: f64 = 0.25;

/// A replacement of an adopted cause, compared with it.
struct Compared {
    /// Index of the adopted term.
    index: usize,
    /// The model with the replacement as its last term.
    trial: Trial,
    is_tied: bool,
}

/// Replacements of all adopted causes.
pub(super) struct Ties {
    replacements: Vec<Compared>,
}

impl Ties {
    /// Compares the replacements that the search has fitted with the final model `best`; those near the model whose cause they replace are refitted in the
    /// same way.
    pub(super) fn new(search: &Search, best: &Scored, replaced: &[Replacement]) -> Self {
        let near = NEAR_TIE.max(search.tolerance());
        let compared = |Replacement { removed, trial, excess }: &Replacement| {
            let index = best.model().terms.iter().position(|term| term.candidate == *removed)?;
            let own = trial.scored.model().terms.iter().find(|term| term.candidate == trial.candidate)?;
            let is_there = best.model().terms.iter().any(|term| search.id(term.candidate) == search.id(trial.candidate));
            if is_there {
                return None;
            }
            // The final elimination may have left out terms that the trial has.
            let in_trial =
                |term: &Term| trial.scored.model().terms.iter().find(|other| other.candidate == term.candidate).cloned();
            let terms = best.model().terms.iter().enumerate();
            let terms = terms.map(|(at, term)| if at == index { own.clone() } else { in_trial(term).unwrap_or(term.clone()) });
            let model = Model { terms: terms.collect(), ..best.model().clone() };
            let is_near = coordinates(&model).len() <= best.freedom() && *excess < near;
            let refitted = || search.fitted(&model).ok().map(|scored| search.resolved_if_near(scored, best));
            Some(match is_near.then(refitted).flatten() {
                Some(scored) => {
                    let is_tied = search.is_tied(best, &scored);
                    Compared { index, trial: Trial { scored, ..trial.clone() }, is_tied }
                }
                // With constants that the final elimination has left out it is no rival.
                None if trial.scored.model().terms.len() != model.terms.len() => return None,
                None => Compared { index, trial: trial.clone(), is_tied: false },
            })
        };
        Self { replacements: replaced.iter().filter_map(compared).collect() }
    }

    /// Fitted replacements of term `index`.
    pub(super) fn rivals_of(&self, index: usize) -> Vec<&Trial> {
        self.replacements.iter().filter(|other| other.index == index).map(|other| &other.trial).collect()
    }

    /// Ids of the causes that the data cannot tell from that of term `index` of `best`.
    pub(super) fn of(&self, search: &Search, best: &Scored, index: usize) -> Vec<String> {
        let own = search.id(best.model().terms[index].candidate);
        let tied = self.replacements.iter().filter(|other| other.index == index && other.is_tied);
        let mut ids: Vec<String> = tied.map(|other| search.id(other.trial.candidate).to_owned()).collect();
        ids.sort();
        ids.dedup();
        ids.retain(|id| id != own);
        ids
    }

    /// The models that the data cannot tell from the best one.
    pub(super) fn models(&self) -> impl Iterator<Item = &Scored> {
        self.replacements.iter().filter(|other| other.is_tied).map(|other| &other.trial.scored)
    }

    /// The terms that are tied with an adopted one.
    pub(super) fn terms(&self) -> Vec<&Term> {
        let tied = self.replacements.iter().filter(|other| other.is_tied);
        tied.filter_map(|other| other.trial.scored.model().terms.get(other.index)).collect()
    }
}

/// Ids of two causes with a plus sign, and the model with both.
pub(super) type Pair = (String, Model);

/// Sets of two causes that the data cannot tell from term `index` of `best`, which `without` lacks; none of causes that are tied alone, or that cannot be simulated.
pub(super) fn pairs_in_place(
    search: &Search,
    best: &Scored,
    (without, screened): (&Scored, &Screened),
    index: usize,
    tied: &[String],
) -> Vec<Pair> {
    let own = search.candidate(&best.model().terms[index]);
    let taken = without.total() - best.total();
    // A cause within the noise is not taken apart.
    if own.is_free_form || taken < NEAR_TIE {
        return Vec::new();
    }
    let is_wanted = |term: &Term| {
        let id = search.id(term.candidate);
        id != own.id && !tied.iter().any(|tied| tied == id)
    };
    if let Some(plain) = search.plain_law(best.model(), index) {
        return beside_plain_law(search, best, &plain, own.id, is_wanted).into_iter().collect();
    }
    // One with several parameters of its own is taken apart no further.
    if own.parameters.len() > 1 {
        return Vec::new();
    }
    let sets = search.sets(without.model(), screened, 2, is_wanted);
    let promising = sets.iter().take_while(|(gain, _)| *gain > PROMISING_PAIR * taken).take(MOST_PAIRS);
    // Others are as good only if the best one is.
    let tied = promising.map_while(|(_, pair)| {
        (search.progress)(&format!("two causes in the place of {}", own.id));
        let [.., first, second] = &pair.terms[..] else { return None };
        let set = in_words(search.id(first.candidate), search.id(second.candidate));
        tied_model(search, best, pair, screened).map(|both| (set, both))
    });
    tied.collect()
}

/// The `plain` law of the cause `own` with another cause beside it, for which the law with a further parameter in `best` may stand.
fn beside_plain_law(search: &Search, best: &Scored, plain: &Model, own: &str, is_wanted: impl Fn(&Term) -> bool) -> Option<Pair> {
    (search.progress)(&format!("another cause beside the plain law of {own}"));
    let plain = search.ranked_at_its_spread(plain).ok()?;
    let screened = search.screen_of(&plain, |candidate| !(candidate.is_free_form || candidate.is_variant)).ok()?;
    let promising = PROMISING_PAIR * (plain.total() - best.total());
    let is_other = |model: &Model| model.terms.last().is_some_and(&is_wanted);
    let (_, model) = screened.ranked.iter().find(|(gain, model)| *gain > promising && is_other(model))?;
    let set = in_words(own, search.id(model.terms.last()?.candidate));
    tied_model(search, best, model, &screened).map(|both| (set, both))
}

/// A cause with another one beside it that does much of its work: the other one lowers χ² beyond chance, if not by as much as is worth a cause, and moves the
/// first parameter of term `index` of `best` by [`LEAST_MOVED`]. The best such set, and those that the data cannot tell from it; none of causes that are `tied` alone.
pub(super) fn shared(
    search: &Search,
    best: &Scored,
    (screened, responses): (&Screened, &Responses),
    index: usize,
    tied: &[String],
) -> Vec<Pair> {
    let own = search.candidate(&best.model().terms[index]);
    let with_off = own.parameters.iter().enumerate().find_map(|(k, free)| Some((k, free.off?)));
    let Some((at, off)) = with_off.filter(|_| !own.is_free_form) else { return Vec::new() };
    let Some(coordinate) = coordinates(best.model()).iter().position(|of| *of == (index, at)) else { return Vec::new() };
    let moved = |model: &Model| {
        let x = model.terms[index].x[at];
        (x - best.model().terms[index].x[at]).abs() / (best.model().terms[index].x[at] - off).abs().max(f64::MIN_POSITIVE)
    };
    let is_wanted = |term: &Term| {
        let Candidate { id, is_free_form, is_variant, .. } = search.candidate(term);
        !(*is_free_form || *is_variant || *id == own.id || tied.iter().any(|tied| tied == id))
    };
    // The model with another cause beside this one, the linear estimate of its gain, and whether it does nearly what this one does.
    let promising = |(gain, model): &(f64, Model)| {
        let term = model.terms.last().filter(|term| is_wanted(term))?;
        let mut with = best.model().clone();
        with.terms[index].x[at] += responses.shift(term, coordinate, search)?;
        let is_alike = responses.is_alike(term, coordinate);
        (is_alike || moved(&with) > LEAST_MOVED).then(|| (*gain, is_alike, model.clone()))
    };
    let others = screened.ranked.iter().take_while(|(gain, _)| *gain > LEAST_BIC).filter_map(promising);
    let mut others: Vec<(f64, bool, Model)> = others.collect();
    // What is alike is small beside this cause, and so is not well known by a linear estimate.
    let least = others.first().map_or(0.0, |(gain, ..)| PROMISING_PAIR * gain);
    others.retain(|(gain, is_alike, _)| *is_alike || *gain > least);
    let with = |(_, _, model): &(f64, bool, Model)| {
        let other = search.id(model.terms.last()?.candidate);
        (search.progress)(&format!("{other} beside {}", own.id));
        let start = search.start_beyond(model, screened).ok()?;
        let both = search.fitted_at_its_spread(&start).ok()?;
        let is_shared = moved(both.model()) > LEAST_MOVED && search.is_significant_on(&search.split.all(), &both, best);
        is_shared.then(|| (in_words(own.id, other), both))
    };
    let mut found: Vec<(String, Scored)> = others.iter().take(MOST_PAIRS).map_while(with).collect();
    found.sort_by(|a, b| a.1.total().total_cmp(&b.1.total()));
    let Some((_, least)) = found.first().cloned() else { return Vec::new() };
    found.retain(|(_, both)| search.is_tied(&least, both));
    found.into_iter().map(|(set, both)| (set, both.model().clone())).collect()
}

/// Two ids in alphabetic order, with a plus sign.
fn in_words(a: &str, b: &str) -> String {
    format!("{}+{}", a.min(b), a.max(b))
}

/// A model with terms beyond those that were screened, fitted, if the data cannot tell it from `best`.
fn tied_model(search: &Search, best: &Scored, model: &Model, screened: &Screened) -> Option<Model> {
    let start = search.start_beyond(model, screened).ok()?;
    let near = search.ranked_at_its_spread(&start).ok().filter(|both| both.total() < best.total() + NEAR_TIE)?;
    let both = search.fitted_at_its_spread(near.model()).ok()?;
    search.is_tied(best, &both).then(|| both.model().clone())
}
