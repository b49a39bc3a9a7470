//! Adopted causes: what each takes, how firmly it stands, what it is tied with, and what it counts for.

use super::DiagnoseError;
use super::causes::Causes;
use super::curve::curve;
use super::diagnosis::{Adopted, Estimate, Nearest, Part};
use super::intervals::Intervals;
use super::plant::{Model, Term};
use super::search::{Responses, Scored, Screened, Search, VISIBLE};
use super::stability::{Standing, standing};
use super::ties::{Ties, pairs_in_place, shared};
use super::unseen::Unseen;
use super::verdict::Judged;

/// Causes are minor that together remove no more than this share, ...
const MINOR_SHARE: f64 = 0.02;
/// ... those that remove less than this of χ² per value: half the noise, ...
const MINOR_MISFIT: f64 = VISIBLE;
/// ... and those that are chosen in a smaller share of resamples, unless they are tied.
const LEAST_STABILITY: f64 = 0.8;

/// The parameters of term `index` with their intervals.
pub(super) fn estimates(search: &Search, index: usize, term: &Term, found: &Intervals) -> Vec<Estimate> {
    let candidate = &search.estimator.plant.candidates()[term.candidate];
    let first: usize = found.sizes[..index].iter().sum();
    candidate
        .parameters
        .iter()
        .enumerate()
        .map(|(k, free)| {
            let x = term.x[k];
            let [low, high] = found.ends.get(first + k).copied().unwrap_or([x, x]);
            let mut ends = [free.value(low), free.value(high)];
            ends.sort_by(f64::total_cmp);
            Estimate {
                name: free.name.to_owned(),
                value: free.value(x),
                unit: free.unit.to_owned(),
                ci95: ends.map(|end| end.is_finite().then_some(end)),
                at_bound: free.is_at_bound(x),
            }
        })
        .collect()
}

/// A cause with the model that lacks it.
struct Weighed {
    /// The model refitted without the cause.
    without: Scored,
    /// What comes back without it (χ² per value).
    own: f64,
    standing: Standing,
    /// Causes, or sets of two, that the data cannot tell from it.
    tied_with: Vec<String>,
    /// The models with such sets.
    pairs: Vec<Model>,
}

/// Weighs term `index` of `best`, given its screening and what all candidates do beside it.
fn weighed(
    search: &Search,
    (best, screened): (&Scored, &Screened),
    index: usize,
    ties: &Ties,
    responses: &Responses,
) -> Result<Weighed, DiagnoseError> {
    (search.progress)(&format!("the gain of {}", search.id(best.model().terms[index].candidate)));
    let without = search.ranked_at_its_spread(&search.without(best, index)?)?;
    let mut tied_with = ties.of(search, best, index);
    let without_it = search.screened(&without, responses, Some(index));
    let own = comes_back(search, best, &without);
    // One that takes much beside faults needs nothing else, and with those held off it may drown in what they do.
    let kinds = if own < MINOR_MISFIT { search.left_to_faults(best, &without) } else { Vec::new() };
    let (own, standing) = if kinds.is_empty() {
        (own, standing(search, [(best, screened), (&without, &without_it)], index, &ties.rivals_of(index)))
    } else {
        // Faults would do its work: what it takes shows where they are held off, and so does what others would take.
        let [best, without] = [best, &without].map(|scored| search.without_faults(scored, &kinds));
        let (best, without) = (best?, without?);
        let responses = responses_of_rivals(search, best.model())?;
        let [beside, in_place] =
            [(&best, None), (&without, Some(index))].map(|(of, removed)| search.screened(of, &responses, removed));
        (comes_back(search, &best, &without), standing(search, [(&best, &beside), (&without, &in_place)], index, &[]))
    };
    let mut pairs = pairs_in_place(search, best, (&without, &without_it), index, &tied_with);
    pairs.extend(shared(search, best, (screened, responses), index, &tied_with));
    let (sets, pairs): (Vec<String>, Vec<Model>) = pairs.into_iter().unzip();
    tied_with.extend(sets);
    tie_unstable(standing.stability, &mut tied_with, &standing.instead);
    Ok(Weighed { without, own, standing, tied_with, pairs })
}

/// χ² per value that comes back without a cause.
fn comes_back(search: &Search, best: &Scored, without: &Scored) -> f64 {
    (search.chi2(without) - search.chi2(best)).max(0.0) / search.estimator.count(&search.split.all()) as f64
}

/// What all rivals of causes do beside a model. Free forms count in the stead of constants only.
fn responses_of_rivals(search: &Search, model: &Model) -> Result<Responses, DiagnoseError> {
    let has_constants = model.terms.iter().any(|term| search.candidate(term).is_constant);
    search.responses(model, |_, c| if c.is_free_form { has_constants } else { !c.is_variant })
}

/// Ties a cause of this `stability` with those that are chosen `instead` or do its work, if it is unstable; ties in alphabetic order.
fn tie_unstable(stability: Option<f64>, tied_with: &mut Vec<String>, instead: &[&str]) {
    if stability.is_some_and(|share| share < LEAST_STABILITY) {
        tied_with.extend(instead.iter().map(|id| (*id).to_owned()));
    }
    tied_with.sort_unstable();
    tied_with.dedup();
}

/// Adopted causes and the judgement of the model with all of them.
pub(super) struct Adoption {
    /// All causes, the discretisation among them, with their shares and roles.
    pub(super) effects: Vec<Adopted>,
    /// The model on the runs that judge it.
    pub(super) unseen: Unseen,
    /// Models with two causes in the place of one, which the data cannot tell from it.
    pub(super) pairs: Vec<Model>,
}

/// Weighs all causes of a model.
///
/// # Errors
/// [`DiagnoseError`] if a model cannot be simulated.
pub(super) fn adopted(
    search: &Search,
    judged: &Judged,
    bare: &Scored,
    causes: &Causes,
    ties: &Ties,
) -> Result<Adoption, DiagnoseError> {
    let best = &judged.best;
    let terms = &best.model().terms;
    let responses = responses_of_rivals(search, best.model())?;
    let screened = search.screened(best, &responses, None);
    let weighed: Vec<Weighed> = (0..terms.len())
        .map(|index| weighed(search, (best, &screened), index, ties, &responses))
        .collect::<Result<_, DiagnoseError>>()?;
    let needs: Vec<&[usize]> = weighed.iter().map(|weighed| weighed.standing.needs.as_slice()).collect();
    // Gains are of causes, not of the constants that are free where a fold leaves one out.
    let tuned = needs.concat();
    let unseen = Unseen::of(search, best, &needs, &tuned)?;
    // Constants that make up for the discretisation.
    let free = causes.best.model().terms.iter();
    let within: Vec<usize> = free.filter(|term| !search.is_credible(&causes.best, term)).map(|term| term.candidate).collect();
    let mut effects = Vec::new();
    if judged.refined {
        let coarse = Unseen::of(search, &judged.coarse, &needs, &tuned)?;
        effects.push(discretisation(search, best, unseen.gain_over(&coarse, search)));
    }
    let (whole, mut taken) = (Whole::of(search, best, bare)?, vec![0.0; effects.len()]);
    for (index, Weighed { without, own, standing, tied_with, .. }) in weighed.iter().enumerate() {
        let mut others = needs.clone();
        others.remove(index);
        let gain_heldout = unseen.gain_over(&Unseen::of(search, without, &others, &tuned)?, search);
        let mut effect = effect(search, judged, index, standing, tied_with);
        taken.push(*own);
        effect.share = whole.share(search, best, index, *own);
        effect.gain_heldout = gain_heldout;
        if within.contains(&terms[index].candidate) {
            effect.role = Part::Minor;
        }
        let is_of = |tried: &Nearest| tried.id == effect.id || effect.curve.is_some();
        let of_place =
            causes.nearest.iter().find(|(places, tried)| places.contains(&effect.place.as_str()) && tried.iter().any(is_of));
        effect.nearest = of_place.map(|(_, tried)| tried.clone()).unwrap_or_default();
        effects.push(effect);
    }
    let first = effects.len() - terms.len();
    let is_small = |index: &usize| effects[first + index].share <= MINOR_SHARE || taken[first + index] < MINOR_MISFIT;
    let small: Vec<usize> = (0..terms.len()).filter(is_small).collect();
    for Needed { index, own, instead } in needed_together(search, best, &whole, small) {
        taken[first + index] = own;
        let effect = &mut effects[first + index];
        effect.share = whole.share(search, best, index, own);
        let instead: Vec<&str> = instead.iter().map(|other| search.id(terms[*other].candidate)).collect();
        tie_unstable(effect.stability, &mut effect.tied_with, &instead);
    }
    let is_convention = |k: usize| k >= first && search.estimator.plant.is_convention(terms, k - first, search.above(best));
    set_roles(&mut effects, &taken, is_convention);
    let pairs = weighed.into_iter().flat_map(|weighed| weighed.pairs).collect();
    Ok(Adoption { effects, unseen, pairs })
}

/// Term `index` as an adopted cause, without its share and gain.
fn effect(search: &Search, judged: &Judged, index: usize, standing: &Standing, tied_with: &[String]) -> Adopted {
    let best = &judged.best;
    let term = &best.model().terms[index];
    let candidate = search.candidate(term);
    // The actuator was found by trying all of them; other given parameters are the form of the equation.
    let (found_by_trying, form): (Vec<_>, Vec<_>) = candidate.fixed.iter().copied().partition(|(name, _)| *name == "actuator");
    let which = found_by_trying.into_iter().map(|(name, value)| Estimate {
        name: name.to_owned(),
        value,
        unit: String::new(),
        ci95: [Some(value); 2],
        at_bound: false,
    });
    Adopted {
        id: candidate.id.to_owned(),
        kind: candidate.kind.to_owned(),
        place: candidate.places.first().copied().unwrap_or(candidate.kind).to_owned(),
        cause: candidate.cause.to_owned(),
        parameters: which.chain(estimates(search, index, term, &judged.intervals)).collect(),
        tied_with: tied_with.to_vec(),
        share: 0.0,
        role: if standing.is_left_by_law { Part::Minor } else { Part::Cause },
        stability: standing.stability,
        curve: curve(search, best, index, &judged.intervals),
        nearest: Vec::new(),
        gain_heldout: 0.0,
        fixed: form.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
    }
}

/// What causes have to explain, as χ² per value above that of the model with all of them.
struct Whole {
    /// Left by the refined nominal model.
    bare: f64,
    /// Left by the refined nominal model with re-tuned constants.
    tuned: f64,
    /// Of a constant with another cause at its place: left without constants and the causes of that place.
    of_place: Vec<Option<f64>>,
}

impl Whole {
    fn of(search: &Search, best: &Scored, bare: &Scored) -> Result<Self, DiagnoseError> {
        let tuned = search.with_constants(&Model { terms: Vec::new(), ..best.model().clone() });
        let tuned = search.fitted_at_its_spread(&tuned)?;
        let count = search.estimator.count(&search.split.all()) as f64;
        let left = |scored: &Scored| ((search.chi2(scored) - search.chi2(best)) / count).max(f64::MIN_POSITIVE);
        let terms = &best.model().terms;
        let of_place = |own: &Term| {
            let own = search.candidate(own);
            let is_law = |term: &Term| search.candidate(term).places.iter().any(|place| own.places.contains(place));
            let (laws, others): (Vec<_>, Vec<_>) =
                terms.iter().filter(|term| !search.candidate(term).is_constant).partition(|term| is_law(term));
            if !own.is_constant || laws.is_empty() {
                return Ok(None);
            }
            let others = Model { terms: others.into_iter().cloned().collect(), ..best.model().clone() };
            Ok(Some(left(&search.ranked_at_its_spread(&others)?)))
        };
        let of_place = terms.iter().map(of_place).collect::<Result<_, DiagnoseError>>()?;
        Ok(Self { bare: left(bare), tuned: left(&tuned), of_place })
    }

    /// The share of term `index`, which removes `own` (χ² per value), of what re-tuned constants leave. Constants among themselves, which leave nothing, share what the
    /// nominal model leaves. One at the place of another cause, as a gain beside one that depends on the voltage, may be what that one's law lacks: it shares what
    /// comes back without the two and other constants.
    fn share(&self, search: &Search, best: &Scored, index: usize, own: f64) -> f64 {
        let is_constant = search.candidate(&best.model().terms[index]).is_constant;
        let of_constants = if is_constant && self.tuned < MINOR_MISFIT { self.bare } else { self.tuned };
        (own / self.of_place[index].unwrap_or(of_constants)).clamp(0.0, 1.0)
    }
}

/// A small term without which much comes back once others are left out.
#[derive(Debug)]
struct Needed {
    index: usize,
    /// What comes back (χ² per value).
    own: f64,
    /// The terms that did its work before they were left out.
    instead: Vec<usize>,
}

/// Those of the `small` terms without which much comes back once the others are left out: causes that can each do another one's work, as a stiffness a tip mass's,
/// are not minor together. The least needed are left out first.
fn needed_together(search: &Search, best: &Scored, whole: &Whole, mut small: Vec<usize>) -> Vec<Needed> {
    let candidate_of = |index: &usize| best.model().terms[*index].candidate;
    let (mut needed, mut rest, mut left_out) = (Vec::new(), best.clone(), Vec::new());
    // One alone is as small as it is.
    if small.len() == 1 {
        return needed;
    }
    let without = |from: &Scored, index: &usize| {
        let at = from.model().terms.iter().position(|term| term.candidate == candidate_of(index))?;
        // A model that cannot be simulated leaves the roles as they are.
        search.ranked_at_its_spread(&search.without(from, at).ok()?).ok()
    };
    // Another term does a term's work if much comes back without the two.
    let is_instead = |other: &usize, index: usize| {
        let both = without(best, other).and_then(|rest| without(&rest, &index));
        both.is_none_or(|both| comes_back(search, best, &both) >= MINOR_MISFIT)
    };
    while !small.is_empty() {
        let shorter = small.iter().enumerate().filter_map(|(at, index)| Some((at, without(&rest, index)?)));
        let Some((at, least)) = shorter.min_by(|a, b| a.1.total().total_cmp(&b.1.total())) else { break };
        let index = small.remove(at);
        let own = comes_back(search, &rest, &least);
        if own >= MINOR_MISFIT && whole.share(search, best, index, own) > MINOR_SHARE {
            let is_one = left_out.len() == 1;
            let instead = left_out.iter().copied().filter(|other| is_one || is_instead(other, index)).collect();
            needed.push(Needed { index, own, instead });
        } else {
            rest = least;
            left_out.push(index);
        }
    }
    needed
}

/// Sets the roles of causes, from their shares, what each removes (χ² per value), and whether the value of one is a convention.
fn set_roles(effects: &mut [Adopted], taken: &[f64], is_convention: impl Fn(usize) -> bool) {
    let mut order: Vec<usize> = (0..effects.len()).filter(|k| effects[*k].id != "discretisation").collect();
    order.sort_by(|a, b| effects[*a].share.total_cmp(&effects[*b].share));
    let mut sum = 0.0;
    for k in order {
        sum += effects[k].share;
        let effect = &mut effects[k];
        // A tied one says what else may be chosen.
        let is_unstable = effect.stability.is_some_and(|share| share < LEAST_STABILITY) && effect.tied_with.is_empty();
        let is_small = sum <= MINOR_SHARE || taken[k] < MINOR_MISFIT;
        if is_small || is_unstable || is_convention(k) {
            effect.role = Part::Minor;
        }
    }
}

/// The refinement as an adopted cause.
fn discretisation(search: &Search, best: &Scored, gain_heldout: f64) -> Adopted {
    let resolutions = search.estimator.plant.resolutions();
    let at = resolutions.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let neighbours = [at.saturating_sub(1), (at + 1).min(resolutions.len() - 1)].map(|k| Some(resolutions[k]));
    Adopted {
        id: "discretisation".into(),
        kind: "numerics".into(),
        place: "numerics/discretisation".into(),
        cause: "Finitely many joints and a finite time step stand for a continuum.".into(),
        parameters: vec![Estimate {
            name: "motors_per_actuator".into(),
            value: best.model().resolution,
            unit: String::new(),
            ci95: neighbours,
            at_bound: at + 1 == resolutions.len(),
        }],
        tied_with: Vec::new(),
        share: 0.0,
        role: Part::Cause,
        stability: None,
        curve: None,
        nearest: Vec::new(),
        gain_heldout,
        fixed: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::bench::Spread;
    use crate::diagnose::waves::{Waves, candidate, search};

    fn cause(id: &str, share: f64, stability: Option<f64>, tied_with: &[&str]) -> Adopted {
        Adopted { share, stability, ..Adopted::of_test(id, tied_with) }
    }

    #[test]
    fn a_set_that_holds_the_cause_itself_is_no_tie() {
        let is_tied = |tied: &[&str]| cause("a", 0.9, None, tied).is_tied();
        assert_eq!([is_tied(&[]), is_tied(&["a+b", "a+c"])], [false; 2]);
        assert_eq!([is_tied(&["b"]), is_tied(&["b+c"]), is_tied(&["a+b", "b"]), is_tied(&["aa+b"])], [true; 4]);
    }

    /// Roles of causes that remove 1 of χ² per value each.
    fn roles(mut effects: Vec<Adopted>) -> Vec<Part> {
        let taken = vec![1.0; effects.len()];
        set_roles(&mut effects, &taken, |_| false);
        effects.iter().map(|effect| effect.role).collect()
    }

    #[test]
    fn small_and_unstable_causes_are_minor_and_tied_ones_are_not() {
        use Part::{Cause, Minor};
        let shares = [0.9, 0.008, 0.011, 0.013].map(|share| cause("a", share, Some(1.0), &[]));
        // The last two per cent: 0.8 and 1.1 % together, not 1.3 % more.
        assert_eq!(roles(shares.to_vec()), [Cause, Minor, Minor, Cause]);
        let stabilities = [cause("a", 0.9, Some(0.79), &[]), cause("b", 0.9, Some(0.79), &["c"]), cause("d", 0.9, None, &[])];
        assert_eq!(roles(stabilities.to_vec()), [Minor, Cause, Cause]);
        let mut within_the_noise = [cause("a", 0.9, Some(1.0), &[])];
        set_roles(&mut within_the_noise, &[0.2], |_| false);
        assert_eq!(within_the_noise[0].role, Minor);
        let mut by_convention = [0.5, 0.5].map(|share| cause("a", share, Some(1.0), &[]));
        set_roles(&mut by_convention, &[1.0; 2], |k| k == 1);
        assert_eq!(by_convention.map(|effect| effect.role), [Cause, Minor]);
    }

    #[test]
    fn unstable_causes_only_are_tied_with_what_is_chosen_instead() {
        for (stability, tied) in [(Some(0.79), vec!["a", "b", "c"]), (Some(0.8), vec!["b"]), (None, vec!["b"])] {
            let mut tied_with = vec!["b".to_owned()];
            tie_unstable(stability, &mut tied_with, &["c", "a", "b"]);
            assert_eq!(tied_with, tied, "{stability:?}");
        }
    }

    #[test]
    fn what_a_cause_takes_is_measured_without_faults_that_would_do_its_work() {
        // Zeros of ±0.4 about an offset: without it they take its place, and little comes back beside them.
        let mut plant = Waves::new(&[("offset", 1.0)]);
        plant.candidates = vec![candidate("offset")];
        for (run, signal) in plant.signals.iter_mut().enumerate() {
            signal.values.iter_mut().for_each(|value| *value += if run % 2 == 0 { 0.4 } else { -0.4 });
        }
        let mut search = search(&plant);
        search.calibrated(1.0).unwrap();
        search.estimator.is_calibrated = true;
        let zeros = Spread { of: [0.0, 0.0, 0.0, 0.0, 0.4, 0.0] };
        let term = Term { candidate: 0, x: vec![1.0] };
        let best = search.fitted(&Model { spread: zeros, ..Model::new(vec![term], 1.0, false) }).unwrap();
        let responses = responses_of_rivals(&search, best.model()).unwrap();
        let screened = search.screened(&best, &responses, None);
        let ties = Ties::new(&search, &best, &[]);
        let Weighed { without, own, standing, .. } = weighed(&search, (&best, &screened), 0, &ties, &responses).unwrap();
        assert!(comes_back(&search, &best, &without) < MINOR_MISFIT);
        // The square of the offset.
        assert!((own - 1.0).abs() < 0.1, "{own}");
        assert_eq!(standing.stability, Some(1.0));
    }

    #[test]
    fn a_constant_shares_what_constants_leave_unless_a_law_of_its_place_may_lack_it() {
        // Without causes some 12.5 per value are left (the constant's wave takes a part of the slow one), without that of the constant's place 4.5; the small waves are less than half the noise.
        for (place, waves, of_all) in
            [("elsewhere", [3.0, 4.0], 12.5), ("test", [3.0, 4.0], 4.5), ("elsewhere", [0.1, 0.0], 1000.0)]
        {
            let mut plant = Waves::new(&[("other", waves[0]), ("late", waves[1])]);
            plant.candidates = ["other", "first", "late"].map(candidate).to_vec();
            plant.candidates[1].is_constant = true;
            plant.candidates[1].places = vec![place];
            plant.candidates[2].places = vec!["of late"];
            let search = search(&plant);
            let terms = [0, 1, 2].map(|candidate| Term { candidate, x: vec![0.0] });
            let best = search.fitted(&Model::new(terms.to_vec(), 1.0, false)).unwrap();
            let whole = Whole { bare: 1000.0, ..Whole::of(&search, &best, &best).unwrap() };
            let late = search.fitted(&Model::new(vec![Term { candidate: 2, x: vec![1.0] }], 1.0, false)).unwrap();
            let without = (search.chi2(&late) - search.chi2(&best)) / 2400.0;
            let share = whole.share(&search, &best, 1, 1.0);
            let exact = [whole.tuned, without, 1000.0].into_iter().find(|all| (all / of_all - 1.0).abs() < 0.3).unwrap();
            assert!((share * exact - 1.0).abs() < 1e-6, "{place} {waves:?}: {share}");
            assert_eq!(whole.share(&search, &best, 0, 1.0), (1.0 / whole.tuned).min(1.0));
        }
    }

    #[test]
    fn causes_that_do_each_others_work_are_not_minor_together() {
        for (amplitude, needed) in [(5.0, 1), (0.0, 0)] {
            let plant = Waves::new(&[("first", amplitude)]);
            let search = search(&plant);
            let bare = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            let all = [0, 1, 2].map(|candidate| Term { candidate, x: vec![1.0] });
            let best = search.fitted(&Model::new(all.to_vec(), 1.0, false)).unwrap();
            let whole = Whole::of(&search, &best, &bare).unwrap();
            let found = needed_together(&search, &best, &whole, vec![0, 1, 2]);
            assert_eq!(found.len(), needed, "{found:?}");
            for Needed { index, own, instead } in found {
                // The mean square of the wave.
                assert!((own / 12.5 - 1.0).abs() < 0.1, "{own}");
                assert_eq!(instead, [3 - index]);
            }
        }
    }
}
