//! The causes of a misfit: selected without and with faults of the bench, named at their places, and refitted.
//!
//! The file is long because selection, naming, replacement and the final refit hand on one search with its causes; a third of it is tests of these.

use super::DiagnoseError;
use super::budget::Phase;
use super::diagnosis::{JudgedBy, Nearest};
use super::fit::{Convergence, State, sum_of_squares};
use super::naming::{self, LEAST_TAKEN, Naming};
use super::plant::{Candidate, Model, Term};
use super::search::{LEAST_GAIN, PROMISING_IN_PLACE, Replacement, SOUGHT, Scored, Search, Trial, VISIBLE};
use super::smoothing::smoothed;
use super::split::Split;
use super::unseen::Unseen;
use super::verdict::LEFT_SHARE;

/// A model selected without the bench's faults counts if its cost, with ln N for each coordinate, is lower by this.
const LEAST_COST: f64 = 10.0;

/// Where the bench's faults leave next to nothing of what constants leave without them, causes without faults are given up if the first one leaves more than this share.
const MOST_LEFT_BY_FIRST: f64 = 0.5;

/// A cause takes the place of another with which it is tied if χ² is lower by this.
const LIKELIER: f64 = 4.0;

/// Replacements that are fitted of each cause, and most causes that are replaced one after the other.
const REPLACEMENTS: usize = 4;
const MOST_REPLACED: usize = 2;

/// Free forms that are fitted to the end in the place of several terms.
const FREE_FORMS: usize = 2;

/// Result of the search.
pub(super) struct Causes {
    /// The model with all causes, after the final refit.
    pub(super) best: Scored,
    /// The candidates on top of re-tuned constants, best first.
    pub(super) trials: Vec<Trial>,
    /// Replacements of every cause.
    pub(super) replaced: Vec<Replacement>,
    /// Number of single values that were masked.
    pub(super) spikes: usize,
    /// Share of what re-tuned constants leave that the causes leave before faults of the bench.
    pub(super) share_left: f64,
    /// What re-tuned constants leave on the bench that the causes were selected on, with or without faults ([`Search::unexplained`]).
    unexplained: f64,
    /// Cost of the model with faults of the bench where they do not explain what it leaves; infinite if there is none.
    cost_with_faults: f64,
    /// χ² per value above 1 of the model with free forms; infinite without any.
    pub(super) open: f64,
    /// The places of every free form, and the names that were tried in its stead.
    pub(super) nearest: Vec<(Vec<&'static str>, Vec<Nearest>)>,
}

/// The causes, after the final refit; none where the data are insufficient.
///
/// A cause that differs from run to run, such as a gain that depends on the voltage, looks like a fault of the bench, and many small faults look like a
/// cause. So causes are selected first without the bench's faults in the way. If faults are left after that, they are selected again with faults in
/// the way, and the less costly model counts.
///
/// A model with free forms that predicts runs left out worse than re-tuned constants do has followed single runs: causes are selected again by names only, of its places
/// first.
///
/// # Errors
/// [`DiagnoseError`] if a model cannot be simulated.
pub(super) fn find(search: &mut Search, calibrated: &Scored, is_insufficient: bool) -> Result<Causes, DiagnoseError> {
    let before = (search.estimator.state(), search.split.clone());
    search.estimator.is_calibrated = true;
    let without = search.estimator.given_spread();
    let has_faults = calibrated.model().spread != without;
    search.estimator.held_spread = has_faults.then_some(without);
    let start = if has_faults {
        search.settle(search.fitted(&Model { spread: without, ..calibrated.model().clone() })?)?
    } else {
        calibrated.clone()
    };
    search.set_unexplained(&start);
    search.limits = [f64::INFINITY; 2];
    if has_faults && search.share_left(calibrated) <= LEFT_SHARE {
        // A first cause that takes less than that follows the faults.
        search.limits[0] = MOST_LEFT_BY_FIRST * search.cost(&start);
        // Two causes that cost more than the faults alone are not what is missing where these leave nothing to see. Faults that follow what a driver does from run to run
        // leave a small share of much, and yet structure.
        search.limits[1] = if search.above(calibrated) <= VISIBLE { search.cost(calibrated) } else { search.limits[0] };
    }
    // Constants that stand in for faults may lead to where nothing can be simulated.
    let plain = match select(search, &start, calibrated, is_insufficient) {
        Err(_) if has_faults => None,
        plain => Some(plain?),
    };
    search.limits = [f64::INFINITY; 2];
    // Causes that leave next to nothing without any fault are no faults.
    let may_be_faults = |causes: &Causes| {
        let own = search.cost(&causes.best);
        let is_dearer = causes.best.model().spread != without || own > causes.cost_with_faults.min(search.cost(calibrated));
        has_faults && causes.share_left > SOUGHT && is_dearer
    };
    let mut causes = match plain {
        Some(plain) if !may_be_faults(&plain) => plain,
        plain => {
            (search.progress)("causes with faults of the bench in the way");
            let cost = plain.as_ref().map_or(f64::INFINITY, |plain| search.cost(&plain.best));
            let above = plain.as_ref().map_or(f64::INFINITY, |plain| search.above(&plain.best));
            let after = (search.estimator.state(), search.split.clone());
            search.enter(Phase::WithFaults);
            search.estimator.restore(before.0.clone());
            search.estimator.held_spread = None;
            search.split = before.1.clone();
            search.set_unexplained(calibrated);
            let other = select(search, calibrated, calibrated, is_insufficient)?;
            match plain {
                Some(plain)
                    if search.cost(&other.best) > cost + LEAST_COST
                        || (plain.best.model().spread == without && !do_faults_explain(search, &other.best, above)) =>
                {
                    search.estimator.restore(after.0);
                    search.split = after.1;
                    search.unexplained = plain.unexplained;
                    if is_insufficient || plain.best.model().spread == without || has_free_forms(search, &plain.best) {
                        plain
                    } else {
                        let (best, replaced) = replace(search, plain.best, calibrated.model().resolution)?;
                        Causes { best, replaced, ..plain }
                    }
                }
                _ => other,
            }
        }
    };
    search.enter(Phase::Naming);
    // What a name leaves, and what a cause takes, is no fault of the bench.
    search.estimator.held_spread = Some(causes.best.model().spread);
    name_causes(search, &mut causes, calibrated.model().resolution)?;

    (search.progress)("the final refit");
    let mut best = search.fitted(&Model { fine: true, ..causes.best.model().clone() })?;
    best = search.resolve(best, Convergence::Full);
    best = least_with_fine_steps(search, best, &mut causes);
    best = search.backward(best)?;
    causes.best = search.settle(best)?;
    if follows_single_runs(search, &causes.best, calibrated)? {
        return by_names(search, calibrated, &causes.best, before, is_insufficient);
    }
    one_free_form(search, &mut causes, calibrated)?;
    Ok(causes)
}

/// The causes by names only, selected in the state `before`: of the places of `open`, a model with free forms that follow single runs, as they hold for the place if not for its
/// curve; of all places where those leave what one would see and the budget allows it.
fn by_names(
    search: &mut Search,
    calibrated: &Scored,
    open: &Scored,
    before: (State, Split),
    is_insufficient: bool,
) -> Result<Causes, DiagnoseError> {
    (search.progress)("causes by names only");
    search.phase = Phase::ByNames;
    let causes = open.model().terms.iter().map(|term| search.candidate(term)).filter(|cause| !cause.is_constant);
    search.places = Some(causes.flat_map(|cause| cause.places.clone()).collect());
    search.estimator.restore(before.0.clone());
    search.split = before.1.clone();
    let of_places = find(search, calibrated, is_insufficient)?;
    search.places = None;
    // By the given noise: the search has measured one that holds what the model leaves.
    let runs = search.split.all();
    let count = search.estimator.count(&runs) as f64;
    let left = |scored: &Scored| runs.iter().map(|run| sum_of_squares(&scored.plain[*run])).sum::<f64>() / count - 1.0;
    if left(&of_places.best) <= VISIBLE || !search.may_go_on() {
        return Ok(of_places);
    }
    let after = (search.estimator.state(), search.split.clone(), search.unexplained);
    search.estimator.restore(before.0);
    search.split = before.1;
    let of_all = find(search, calibrated, is_insufficient)?;
    let cost = |causes: &Causes| left(&causes.best) + causes.best.freedom() as f64 * count.ln() / count;
    if cost(&of_all) < cost(&of_places) {
        return Ok(of_all);
    }
    search.estimator.restore(after.0);
    (search.split, search.unexplained) = (after.1, after.2);
    Ok(of_places)
}

/// True if faults of the bench explain what a model without them leaves above the noise (χ² per value): but for what nobody sees, or [`LEAST_TAKEN`] of it. Others stand
/// for a cause, which they follow from run to run, or for what its law does not follow.
fn do_faults_explain(search: &Search, with: &Scored, left_without: f64) -> bool {
    search.above(with) <= VISIBLE.max((1.0 - LEAST_TAKEN) * left_without)
}

/// True if a model with free forms predicts runs that are left out worse than re-tuned constants do. Runs that judge are not looked at.
fn follows_single_runs(search: &Search, best: &Scored, calibrated: &Scored) -> Result<bool, DiagnoseError> {
    if !has_free_forms(search, best) || Unseen::by(search) == JudgedBy::JudgeRuns {
        return Ok(false);
    }
    let missed = |scored: &Scored| Unseen::missed(search, scored.model());
    Ok(missed(&smoothed(search, best.clone()))? > missed(calibrated)?)
}

fn has_free_forms(search: &Search, scored: &Scored) -> bool {
    scored.model().terms.iter().any(|term| search.candidate(term).is_free_form)
}

/// Puts names in the stead of free forms where they stand.
fn name_causes(search: &mut Search, causes: &mut Causes, resolution: f64) -> Result<(), DiagnoseError> {
    if !has_free_forms(search, &causes.best) {
        return Ok(());
    }
    causes.open = search.above(&causes.best);
    let Naming { best, nearest } = naming::name(search, causes.best.clone())?;
    causes.nearest = nearest;
    let best = search.backward(best)?;
    let best = with_further_names(search, best, &causes.best)?;
    (causes.best, causes.replaced) = replace(search, best, resolution)?;
    Ok(())
}

/// A free form of a cause's place in the stead of the names there and of what else it makes needless, if that costs less, with fine time steps, and does not follow single runs:
/// a further cause, or a constant, may stand for what the law of the first one does not follow. The names are at a bound of their ranges, or leave twice as much above the noise.
fn one_free_form(search: &mut Search, causes: &mut Causes, calibrated: &Scored) -> Result<(), DiagnoseError> {
    let best = &causes.best;
    if best.model().terms.len() < 2 || has_free_forms(search, best) || search.phase == Phase::ByNames || !search.may_go_on() {
        return Ok(());
    }
    (search.progress)("a free form in the place of several terms");
    let most = search.cost(best) - LEAST_COST;
    let terms = best.model().terms.len();
    let open = |open: Scored| search.backward(search.resolve(open, Convergence::Rank)).ok();
    // A law at a bound of its range stands for another one.
    let is_bounded = |term: &Term| term.x.iter().zip(&search.candidate(term).parameters).any(|(x, free)| free.is_at_bound(*x));
    let are_bounded = best.model().terms.iter().any(is_bounded);
    let is_one = |open: &Scored| {
        let is_wanted = are_bounded || search.above(best) > 2.0 * search.above(open);
        has_free_forms(search, open) && open.model().terms.len() < terms && search.cost(open) < most && is_wanted
    };
    let mut forms = in_place_of_names(search, best)?;
    forms.sort_by(|a, b| a.total().total_cmp(&b.total()));
    let forms = forms.into_iter().take(FREE_FORMS).filter_map(open).filter(is_one);
    let Some(open) = forms.min_by(|a, b| search.cost(a).total_cmp(&search.cost(b))) else { return Ok(()) };
    let is_wanted = |search: &Search, open: &Scored| {
        search.cost(open) < most && !follows_single_runs(search, open, calibrated).unwrap_or(true)
    };
    let Some(open) = search.settled_if(open, is_wanted) else { return Ok(()) };
    let Some(free) = open.model().terms.iter().find(|term| search.candidate(term).is_free_form).cloned() else { return Ok(()) };
    causes.open = search.above(&open);
    let Naming { best, nearest } = naming::alone(search, open, free)?;
    causes.nearest = nearest;
    let coarse = search.ranked(&Model { fine: false, ..best.model().clone() })?;
    causes.replaced = replacements(search, &coarse, Vec::new());
    causes.best = best;
    Ok(())
}

/// A model with a free form of each place of its named causes in the stead of these, where it may do their work.
fn in_place_of_names(search: &Search, best: &Scored) -> Result<Vec<Scored>, DiagnoseError> {
    let is_named = |term: &Term| !search.candidate(term).is_constant;
    let mut found = Vec::new();
    for (candidate, form) in search.estimator.plant.candidates().iter().enumerate().filter(|(_, form)| form.is_free_form) {
        let is_of_place = |term: &Term| is_named(term) && naming::is_of(search, &Term { candidate, x: Vec::new() }, term);
        let mut rest = best.model().clone();
        rest.terms.retain(|term| !is_of_place(term));
        if rest.terms.len() == best.model().terms.len() {
            continue;
        }
        let bare = search.ranked_at_its_spread(&search.with_constants(&rest))?;
        let screened = search.screen_of(&bare, |candidate| candidate.id == form.id)?;
        let least = PROMISING_IN_PLACE * (bare.total() - best.total());
        let promising = screened.ranked.first().filter(|(gain, _)| *gain >= least);
        // What cannot be simulated is none.
        found.extend(promising.and_then(|(_, model)| search.ranked_beyond(model, &screened).ok()));
    }
    Ok(found)
}

/// The model `named` with further causes where it leaves what one would see, if with these it costs no more than the model with free forms did, or hardly more: a free form
/// may do the work of several causes. What a law of another form leaves is parcelled out at a higher cost.
fn with_further_names(search: &mut Search, named: Scored, open: &Scored) -> Result<Scored, DiagnoseError> {
    if has_free_forms(search, &named) || search.above(&named) <= VISIBLE {
        return Ok(named);
    }
    (search.progress)("further causes beside the names");
    let before = (search.estimator.state(), search.split.clone());
    let (further, _) = search.forward(named.clone())?;
    if further.freedom() > named.freedom() && search.cost(&further) <= search.cost(open) + search.tolerance() {
        return search.backward(further);
    }
    search.estimator.restore(before.0);
    search.split = before.1;
    Ok(named)
}

/// Forward selection, backward elimination and replacement; no causes where the data are insufficient. Re-tuned constants are `calibrated`, and `with_faults` on a
/// bench with faults, by which causes are measured once these explain what causes leave.
fn select(
    search: &mut Search,
    calibrated: &Scored,
    with_faults: &Scored,
    is_insufficient: bool,
) -> Result<Causes, DiagnoseError> {
    let (mut best, trials) = if is_insufficient {
        (search.fitted(&Model { terms: Vec::new(), ..calibrated.model().clone() })?, Vec::new())
    } else {
        search.forward(calibrated.clone())?
    };
    if search.is_given_up(&best) {
        search.estimator.held_spread = None;
        return Ok(Causes {
            best,
            trials,
            replaced: Vec::new(),
            spikes: 0,
            share_left: 1.0,
            unexplained: search.unexplained,
            cost_with_faults: f64::INFINITY,
            open: f64::INFINITY,
            nearest: Vec::new(),
        });
    }
    let spikes = search.estimator.leave_out_spikes(best.model())?;
    if spikes > 0 {
        best = search.settle(best)?;
    }
    best = search.resolve(best, Convergence::Rank);
    best = search.backward(best)?;
    best = search.resolve(best, Convergence::Rank);
    let share_left = search.share_left(&best);
    // Faults of the bench could stand in for causes that leave next to nothing without them: they come last then.
    let held = search.estimator.held_spread;
    let (mut cost_with_faults, mut faults_come_last) = (f64::INFINITY, held.is_some());
    if share_left > SOUGHT && faults_come_last {
        let before = search.estimator.state();
        search.estimator.held_spread = None;
        let with = search.settle(best.clone())?;
        faults_come_last = false;
        // Causes that cost more without faults than faults alone stand on a bench with faults, whatever else is missing.
        let is_dearer = search.cost(&best) > search.cost(with_faults).max(search.cost(&with)) + LEAST_COST;
        if is_dearer || do_faults_explain(search, &with, search.above(&best)) {
            search.set_unexplained(with_faults);
            best = search.backward(with)?;
        } else {
            cost_with_faults = search.cost(&with);
            search.estimator.restore(before);
            search.estimator.held_spread = held;
        }
    }

    // Causes are replaced once free forms have got their names, for which others are tried then anyway, and those with faults let in once they are better than what is
    // found with faults from the beginning.
    let are_faults_let_in = held.is_some_and(|held| best.model().spread != held);
    let (mut best, replaced) = if is_insufficient || are_faults_let_in || has_free_forms(search, &best) {
        (best, Vec::new())
    } else {
        let phase = search.phase;
        search.phase = phase.of_replacements();
        let replaced = replace(search, best, calibrated.model().resolution)?;
        search.phase = phase;
        replaced
    };
    if faults_come_last {
        search.estimator.held_spread = None;
    }
    if search.measure_noise(&best)? || faults_come_last {
        best = search.settle(best)?;
    }
    search.estimator.held_spread = None;
    let unexplained = search.unexplained;
    Ok(Causes {
        best,
        trials,
        replaced,
        spikes,
        share_left,
        unexplained,
        cost_with_faults,
        open: f64::INFINITY,
        nearest: Vec::new(),
    })
}

/// The model with free constants at the `resolution` that the search began with, if it costs less: another discretisation shifts the resonances as a
/// stiffness does, and may stand for one that was not looked for yet when it was chosen.
fn constants_for_discretisation(search: &Search, best: Scored, resolution: f64) -> Scored {
    if best.model().resolution == resolution || search.above(&best) < LEAST_GAIN {
        return best;
    }
    (search.progress)("constants in the place of the discretisation");
    let other = search.ranked(&Model { resolution, ..search.with_constants(best.model()) });
    // Constants that nothing needs are none.
    let other = other.and_then(|other| search.backward(search.resolve(other, Convergence::Rank)));
    other.ok().filter(|other| search.cost(other) < search.cost(&best)).unwrap_or(best)
}

/// One cause in the place of all causes and constants of a model, in its own discretisation and with the law that suits it, if that costs less: several causes
/// and a discretisation may stand together for one that was not the best one at first.
fn one_for_all(search: &mut Search, best: &Scored) -> Option<Scored> {
    if best.model().terms.len() < 2 || !search.may_go_on() {
        return None;
    }
    (search.progress)("one cause in the place of all");
    let bare = search.ranked_at_its_spread(&Model { terms: Vec::new(), ..best.model().clone() }).ok()?;
    let is_name = |candidate: &Candidate| !(candidate.is_variant || candidate.is_free_form || candidate.is_constant);
    let screened = search.screen_of(&bare, is_name).ok()?;
    let own = PROMISING_IN_PLACE * (bare.total() - best.total());
    let mut ones = search.finalists(screened.ranked.iter().filter(|(gain, _)| *gain >= own), REPLACEMENTS);
    // Those at the places of the causes, too, which a linear estimate may miss without any cause.
    let places: Vec<&str> = best.model().terms.iter().flat_map(|term| search.candidate(term).places.clone()).collect();
    for (candidate, of) in search.estimator.plant.candidates().iter().enumerate() {
        let is_of_place = of.places.iter().any(|place| places.contains(place));
        if is_name(of) && is_of_place && ones.iter().all(|model| model.terms[0].candidate != candidate) {
            let start = of.starts.first().map(|x| Term { candidate, x: x.clone() });
            ones.extend(start.map(|start| Model { terms: vec![start], ..bare.model().clone() }));
        }
    }
    // Only the nearest ones in the discretisation that suits them.
    let mut nearest: Vec<Scored> = ones.iter().filter_map(|model| search.ranked_beyond(model, &screened).ok()).collect();
    nearest.sort_by(|a, b| a.total().total_cmp(&b.total()));
    nearest.truncate(REPLACEMENTS);
    let one = |scored: Scored| {
        let plain = search.resolve(scored, Convergence::Rank);
        if bare.total() - plain.total() < own {
            return None;
        }
        let candidate = plain.model().terms[0].candidate;
        let other = search.with_its_law(plain, 0);
        // Another law in the discretisation that suits it.
        Some(if other.model().terms[0].candidate == candidate { other } else { search.resolve(other, Convergence::Rank) })
    };
    let least = nearest.into_iter().filter_map(one).min_by(|a, b| search.cost(a).total_cmp(&search.cost(b)));
    let least = least.filter(|least| search.cost(least) < search.cost(best))?;
    search.settled_if(least, |_, _| true)
}

/// Replaces causes by others that leave less, or that need fewer parameters and leave hardly more, and the discretisation by constants at the `resolution` that the
/// search began with: the model, and the replacements of its causes.
fn replace(search: &mut Search, best: Scored, resolution: f64) -> Result<(Scored, Vec<Replacement>), DiagnoseError> {
    let mut best = constants_for_discretisation(search, best, resolution);
    let mut replaced = replacements(search, &best, Vec::new());
    for _ in 0..MOST_REPLACED {
        let better = replaced
            .iter()
            .filter(|other| is_better(search, other, &best))
            .min_by(|a, b| a.trial.scored.total().total_cmp(&b.trial.scored.total()));
        let Some(better) = better else { break };
        best = search.settle(better.trial.scored.clone())?;
        best = search.backward(best)?;
        // A cause in a constant's place lets the constant stay free beside it.
        best = search.with_significant_constants(best)?;
        best = constants_for_discretisation(search, best, resolution);
        replaced = replacements(search, &best, replaced);
    }
    if let Some(one) = one_for_all(search, &best) {
        best = one;
        replaced = replacements(search, &best, replaced);
    }
    if let Some(fewer) = fewer_for_all(search, &best)? {
        best = fewer;
        replaced = replacements(search, &best, replaced);
    }
    Ok((best, replaced))
}

/// Replacements of the causes of a model; those of an `earlier` one where the search has to end. A model at the edge of what can be simulated has no derivatives to compare
/// others by, and so none.
fn replacements(search: &Search, best: &Scored, earlier: Vec<Replacement>) -> Vec<Replacement> {
    if best.model().terms.is_empty() {
        return Vec::new();
    }
    if search.may_go_on() { search.replacements(best, REPLACEMENTS).unwrap_or_default() } else { earlier }
}

/// Those of the causes that take [`LEAST_TAKEN`] of what all take, where all of them still leave so much that the verdict would be unexplained: the others stand for what the
/// laws of these do not follow. None if all are needed.
fn fewer_for_all(search: &mut Search, best: &Scored) -> Result<Option<Scored>, DiagnoseError> {
    if search.causes(best) < 2 || search.above(best) <= VISIBLE || search.share_left(best) <= LEFT_SHARE {
        return Ok(None);
    }
    (search.progress)("fewer causes, as all of them leave much");
    let tuned = search.with_constants(&Model { terms: Vec::new(), ..best.model().clone() });
    let tuned = search.ranked_at_its_spread(&tuned)?;
    let least = LEAST_TAKEN * (tuned.total() - best.total());
    let mut fewer: Option<Scored> = None;
    while let Some(from) = Some(fewer.as_ref().unwrap_or(best)).filter(|from| search.causes(from) > 1) {
        let is_cause = |index: &usize| !search.candidate(&from.model().terms[*index]).is_constant;
        let without = |index: usize| search.ranked_at_its_spread(&search.with_constants(&search.without(from, index).ok()?)).ok();
        let shorter = (0..from.model().terms.len()).filter(is_cause).filter_map(without);
        let shorter = shorter.min_by(|a, b| a.total().total_cmp(&b.total()));
        let Some(shorter) = shorter.filter(|shorter| tuned.total() - shorter.total() >= least) else { break };
        fewer = Some(shorter);
    }
    let settled = fewer.and_then(|fewer| search.settled_if(fewer, |_, _| true));
    settled.map(|settled| search.backward(settled)).transpose()
}

/// The model `best`, one with another law of a cause in the place of that cause and a constant that leaves hardly more, or one with another cause in the place of one of its own that
/// leaves less. What tells a delay from a lag of the driver, or a damping beside a quadratic drag from a linear part of the drag, may be less than what the time steps of the search
/// are wrong by, or the number of joints that suits one of the two: those that differ by no more are refitted with fine steps, each in the discretisation that suits it.
fn least_with_fine_steps(search: &Search, best: Scored, causes: &mut Causes) -> Scored {
    let is_near = |other: &&Replacement| {
        search.id(other.removed) != search.id(other.trial.candidate)
            && other.trial.scored.freedom() <= best.freedom()
            && other.excess < search.tolerance()
            && best.model().terms.iter().any(|term| term.candidate == other.removed)
    };
    let fine = |other: &Replacement| {
        let Replacement { removed, trial: Trial { candidate, scored }, .. } = other;
        (search.progress)(&format!("{} in the place of {} with fine steps", search.id(*candidate), search.id(*removed)));
        let model = Model { fine: true, ..scored.model().clone() };
        let scored = search.resolved_if_near(search.fitted_at_its_spread(&model).ok()?, &best);
        let excess = scored.total() - best.total();
        Some(Replacement { removed: *removed, trial: Trial { candidate: *candidate, scored }, excess })
    };
    let mut others: Vec<Replacement> = causes.replaced.iter().filter(is_near).filter_map(fine).collect();
    others.sort_by(|a, b| a.excess.total_cmp(&b.excess));
    let is_shorter = |other: &Replacement| other.trial.scored.model().terms.len() < best.model().terms.len();
    if let Some(at) = others.iter().position(|other| is_shorter(other) && other.excess < search.tolerance()) {
        let Replacement { removed, trial: Trial { candidate, scored }, .. } = others.swap_remove(at);
        // What was tried in the place of the plain law is now in that of the other one.
        let is_plain = |other: usize| search.id(other) == search.id(candidate);
        causes.replaced.retain(|other| other.removed != removed);
        causes.replaced.iter_mut().filter(|other| is_plain(other.removed)).for_each(|other| other.removed = candidate);
        return scored;
    }
    let least = others.into_iter().next().filter(|least| least.excess < -LIKELIER);
    let Some(Replacement { removed, trial: Trial { candidate, scored }, excess }) = least else { return best };
    // The others in the place of the cause are now in that of the other one, and the cause is one of them.
    causes.replaced.retain(|other| other.removed != removed || search.id(other.trial.candidate) != search.id(candidate));
    causes.replaced.iter_mut().filter(|other| other.removed == removed).for_each(|other| other.removed = candidate);
    let trial = Trial { candidate: removed, scored: best };
    causes.replaced.push(Replacement { removed: candidate, trial, excess: -excess });
    scored
}

/// True if a replacement is to be preferred to the model `best`.
fn is_better(search: &Search, Replacement { removed, trial, .. }: &Replacement, best: &Scored) -> bool {
    let other = &trial.scored;
    // A law with a further parameter gives way to another cause that does without one and leaves hardly more.
    let has_further = best.model().terms.iter().any(|t| t.candidate == *removed && search.candidate(t).is_variant)
        && search.id(trial.candidate) != search.id(*removed);
    let simpler = other.freedom() < best.freedom()
        && (search.is_tied(best, other) || (has_further && !search.is_worth_in_place(best, other)));
    // Of tied causes the likelier one leads; more parameters have to be worth it.
    let likelier = other.freedom() <= best.freedom() && other.total() < best.total() - LIKELIER;
    let better = other.total() < best.total() && !search.is_tied(other, best);
    simpler || likelier || (better && search.is_worth_in_place(other, best))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::Term;
    use crate::diagnose::waves::{Waves, candidate, search};

    #[test]
    fn a_free_form_that_follows_single_runs_gives_way_to_names() {
        for (hidden, follows) in [("other", false), ("once", true)] {
            let mut plant = Waves::new(&[(hidden, 3.0)]);
            let term = Term { candidate: 0, x: vec![1.0] };
            let is_found = |plant: &Waves| {
                let search = search(plant);
                let constants = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
                let best = search.fitted(&Model::new(vec![term.clone()], 1.0, false)).unwrap();
                follows_single_runs(&search, &best, &constants).unwrap()
            };
            assert!(!is_found(&plant), "no free form");
            plant.candidates[0].is_free_form = true;
            assert_eq!(is_found(&plant), follows, "{hidden}");
        }
    }

    #[test]
    fn names_only_leave_free_forms_out() {
        let mut plant = Waves::new(&[("other", 1.0)]);
        plant.candidates[0].is_free_form = true;
        for (phase, count) in [(Phase::Plain, 1), (Phase::Naming, 0), (Phase::ByNames, 0)] {
            let mut search = search(&plant);
            search.phase = phase;
            let calibrated = search.calibrated(1.0).unwrap();
            assert_eq!(search.forward(calibrated).unwrap().0.model().terms.len(), count);
        }
    }

    #[test]
    fn names_of_the_places_that_were_found_come_first() {
        // Without the wave of the one place 0.18 per value is left, without that of the other one 2.
        for (place, expected) in [("test", vec!["other"]), ("of late", vec!["other", "late"])] {
            let mut plant = Waves::new(&[("other", 2.0), ("late", 0.6)]);
            plant.candidates = ["other", "late", "first"].map(candidate).to_vec();
            plant.candidates[1].places = vec!["of late"];
            plant.candidates[2].is_free_form = true;
            plant.candidates[2].places = vec![place];
            let mut search = search(&plant);
            let calibrated = search.calibrated(1.0).unwrap();
            let open = search.fitted(&Model::new(vec![Term { candidate: 2, x: vec![1.0] }], 1.0, false)).unwrap();
            let before = (search.estimator.state(), search.split.clone());
            let found = by_names(&mut search, &calibrated, &open, before, false).unwrap().best;
            let ids: Vec<&str> = found.model().terms.iter().map(|term| search.id(term.candidate)).collect();
            assert_eq!(ids, expected, "{place}");
        }
    }

    #[test]
    fn one_free_form_takes_the_place_of_names_that_cost_more_and_leave_something_or_are_at_a_bound() {
        // The free form of the first one's place does what the first two do, with one number; the third one does what the second one does, nearly.
        for (hidden, names, least, is_by_names, expected) in [
            (vec![("between", 3.0)], vec![0, 2], -100.0, false, vec!["between"]),
            (vec![("between", 3.0)], vec![0, 2], -100.0, true, vec!["other", "second"]),
            (vec![("other", 3.0), ("second", -1.8)], vec![0, 2], -100.0, false, vec!["other", "second"]),
            // More names than are needed cost more, but leave nothing: unless one is at a bound.
            (vec![("between", 3.0)], vec![0, 1, 2], -100.0, false, vec!["other", "first", "second"]),
            (vec![("between", 3.0)], vec![0, 1, 2], 0.4, false, vec!["between"]),
        ] {
            let mut plant = Waves::new(&hidden);
            plant.candidates = ["other", "first", "second", "between"].map(candidate).to_vec();
            plant.candidates[1..3].iter_mut().for_each(|other| other.places = vec!["of another"]);
            plant.candidates[2].parameters[0].bounds[0] = least;
            plant.candidates[3].is_free_form = true;
            let mut search = search(&plant);
            let calibrated = search.calibrated(1.0).unwrap();
            let before = search.estimator.state();
            let mut causes = select(&mut search, &calibrated, &calibrated, true).unwrap();
            search.estimator.restore(before);
            let terms: Vec<Term> = names.iter().map(|candidate| Term { candidate: *candidate, x: vec![1.0] }).collect();
            causes.best = search.fitted(&Model::new(terms, 1.0, true)).unwrap();
            if is_by_names {
                search.phase = Phase::ByNames;
            }
            one_free_form(&mut search, &mut causes, &calibrated).unwrap();
            let ids: Vec<&str> = causes.best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
            assert_eq!(ids, expected, "{hidden:?}");
            let nearest: Vec<&str> = causes.nearest.iter().flat_map(|(_, of)| of).map(|near| near.id.as_str()).collect();
            assert_eq!(nearest == ["other"], expected.len() == 1, "{nearest:?}");
        }
    }

    /// The causes that are selected without faults of the bench first, where `waves` and zeros of ±`zero` are hidden.
    fn select_beside_zeros(
        waves: &[(&str, f64)],
        zero: f64,
        candidates: &[&'static str],
        check: impl Fn(&Search, &Causes, &Scored),
    ) {
        let mut plant = Waves::new(waves);
        for (run, signal) in plant.signals.iter_mut().enumerate() {
            signal.values.iter_mut().for_each(|value| *value += if run % 2 == 0 { zero } else { -zero });
        }
        plant.candidates = candidates.iter().map(|id| candidate(id)).collect();
        let mut search = search(&plant);
        let with_faults = search.calibrated(1.0).unwrap();
        let off = search.estimator.given_spread();
        assert_ne!(with_faults.model().spread, off);
        search.estimator.held_spread = Some(off);
        let start = search.fitted(&Model { spread: off, ..with_faults.model().clone() }).unwrap();
        search.set_unexplained(&start);
        let causes = select(&mut search, &start, &with_faults, false).unwrap();
        check(&search, &causes, &with_faults);
    }

    #[test]
    fn causes_are_measured_by_what_constants_leave_with_faults_where_faults_explain_it() {
        // Zeros leave 2500 per value, of which 0.4 % would be worth a cause; the wave takes 4.5.
        select_beside_zeros(&[("other", 3.0)], 50.0, &["other"], |search, causes, with_faults| {
            assert_ne!(causes.best.model().spread, search.estimator.given_spread());
            let with_wave = Model { terms: vec![Term { candidate: 0, x: vec![1.0] }], ..with_faults.model().clone() };
            let kept = search.backward(search.fitted(&with_wave).unwrap()).unwrap();
            assert_eq!(kept.model().terms.len(), 1);
        });
    }

    #[test]
    fn faults_stay_where_causes_cost_more_without_them_than_constants_do_with_them() {
        // No candidate follows a wave that leaves 4 per value. The one that a candidate follows takes 32, zeros take 49 or 16.
        for (zero, stays) in [(7.0, true), (4.0, false)] {
            select_beside_zeros(&[("other", 8.0), ("first", 3.0)], zero, &["other"], |search, causes, _| {
                assert_eq!(causes.best.model().terms.len(), 1);
                assert_eq!(causes.best.model().spread != search.estimator.given_spread(), stays);
            });
        }
    }

    #[test]
    fn causes_beside_faults_that_were_let_in_are_not_replaced_before_they_are_chosen() {
        // As above; either candidate may stand for the other one.
        for (zero, is_replaced) in [(7.0, false), (4.0, true)] {
            select_beside_zeros(&[("other", 8.0), ("first", 3.0)], zero, &["other", "between"], |search, causes, _| {
                assert_eq!(causes.best.model().terms.len(), 1);
                assert_eq!(causes.best.model().spread == search.estimator.given_spread(), is_replaced);
                assert_eq!(!causes.replaced.is_empty(), is_replaced, "{zero}");
            });
        }
    }

    #[test]
    fn further_causes_stand_beside_names_if_all_are_as_good_as_the_free_form_was() {
        // The free form does what the name and `late` do, of which 2 per value are left without a candidate; `first` would take 0.5 then.
        for (is_known, found) in [(true, vec![1, 2, 3]), (false, vec![1])] {
            let mut plant = Waves::new(&[("other", 15.0), ("late", 2.0), ("first", 1.0)]);
            let free = Candidate { id: "late", is_free_form: true, is_variant: false, ..plant.candidates[3].clone() };
            plant.candidates = vec![free, candidate("name"), candidate("first")];
            plant.candidates.extend(is_known.then(|| candidate("late")));
            let mut search = search(&plant);
            // A zero and a drift of each run would follow the slow wave.
            search.estimator.held_spread = Some(search.estimator.given_spread());
            let constants = search.calibrated(1.0).unwrap();
            search.set_unexplained(&constants);
            search.enter(Phase::Naming);
            let fitted = |candidate, x| search.fitted(&Model::new(vec![Term { candidate, x }], 1.0, false)).unwrap();
            let (open, named) = (fitted(0, vec![1.0, 1.0]), fitted(1, vec![1.0]));
            let model = with_further_names(&mut search, named, &open).unwrap();
            let mut causes: Vec<usize> = model.model().terms.iter().map(|term| term.candidate).collect();
            causes.sort_unstable();
            assert_eq!(causes, found);
        }
    }

    #[test]
    fn one_cause_takes_the_place_of_two_that_stand_for_it() {
        // The second cause by its other law does what both do, or nearly.
        for (hidden, found) in [("second", vec![3]), ("first", vec![1, 0])] {
            let plant = Waves::new(&[(hidden, 5.0), ("other", 1.0)]);
            let mut search = search(&plant);
            let terms = [1, 0].map(|candidate| Term { candidate, x: vec![1.0] });
            let best = search.fitted(&Model::new(terms.to_vec(), 1.0, false)).unwrap();
            let one = one_for_all(&mut search, &best).unwrap_or(best);
            let candidates: Vec<usize> = one.model().terms.iter().map(|term| term.candidate).collect();
            assert_eq!(candidates, found, "{hidden}");
        }
    }

    #[test]
    fn small_causes_beside_a_large_one_are_left_out_only_where_much_is_left_with_them() {
        // The cause `other` takes 0.5 or 50 per value, beside 200; no candidate follows `late`, of which 18 or 5 are left.
        for (other, late, found) in [(1.0, 6.0, vec![2]), (1.0, 3.0, vec![0, 2]), (10.0, 6.0, vec![0, 2])] {
            let plant = Waves::new(&[("second", 20.0), ("other", other), ("late", late)]);
            let mut search = search(&plant);
            let constants = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            search.set_unexplained(&constants);
            let terms = [0, 2].map(|candidate| Term { candidate, x: vec![1.0] });
            let best = search.fitted(&Model::new(terms.to_vec(), 1.0, false)).unwrap();
            let fewer = fewer_for_all(&mut search, &best).unwrap().unwrap_or(best);
            let candidates: Vec<usize> = fewer.model().terms.iter().map(|term| term.candidate).collect();
            assert_eq!(candidates, found, "{other} {late}");
        }
    }

    #[test]
    fn faults_of_the_bench_count_that_leave_nothing_to_see_or_a_twentieth() {
        for (late, before, explain) in [(0.5, 1.0, true), (1.0, 1.0, false), (1.0, 20.0, true)] {
            // An amplitude of 1 leaves 0.5 per value.
            let plant = Waves::new(&[("late", late)]);
            let search = search(&plant);
            let with = search.fitted(&Model::new(Vec::new(), 1.0, false)).unwrap();
            assert_eq!(do_faults_explain(&search, &with, before), explain, "{late} of {before}");
        }
    }

    #[test]
    fn constants_take_the_place_of_a_discretisation_that_stands_for_them_in_part() {
        // A resolution of 2 does what an amplitude of 1 does.
        for (hidden, resolution) in [(3.0, 1.0), (1.0, 2.0)] {
            let mut plant = Waves::new(&[("other", hidden)]);
            plant.candidates[0].is_constant = true;
            plant.resolutions = vec![1.0, 2.0];
            let search = search(&plant);
            let best = search.fitted(&Model::new(Vec::new(), 2.0, false)).unwrap();
            let found = constants_for_discretisation(&search, best, 1.0);
            let model = found.model();
            let amplitude = model.terms.iter().map(|term| term.x[0]).sum::<f64>() + model.resolution - 1.0;
            assert!((amplitude - hidden).abs() < 0.1, "{amplitude}");
            assert_eq!(model.resolution, resolution, "{hidden}");
        }
    }

    /// A model with what stands in the place of its causes.
    fn with_rivals(best: &Scored, replaced: Vec<Replacement>) -> Causes {
        Causes {
            best: best.clone(),
            trials: Vec::new(),
            replaced,
            spikes: 0,
            share_left: 0.0,
            unexplained: 0.0,
            cost_with_faults: f64::INFINITY,
            open: f64::INFINITY,
            nearest: Vec::new(),
        }
    }

    #[test]
    fn another_law_takes_the_place_of_a_plain_one_and_a_constant() {
        // The other law of `second` has a part of `other`, and none of `late`.
        for (constant, found) in [("other", vec![3]), ("late", vec![0, 2])] {
            let mut plant = Waves::new(&[("second", 5.0), (constant, 1.0)]);
            plant.candidates[0] = Candidate { is_constant: true, ..candidate(constant) };
            let search = search(&plant);
            let terms = [0, 2].map(|candidate| Term { candidate, x: vec![1.0] });
            let best = search.fitted(&Model::new(terms.to_vec(), 1.0, true)).unwrap();
            let mut causes = with_rivals(&best, search.replacements(&best, 1).unwrap());
            let best = least_with_fine_steps(&search, best, &mut causes);
            let candidates: Vec<usize> = best.model().terms.iter().map(|term| term.candidate).collect();
            assert_eq!(candidates, found, "{constant}");
            assert!(causes.replaced.iter().all(|other| candidates.contains(&other.removed)), "{constant}");
        }
    }

    #[test]
    fn near_rivals_are_compared_in_the_discretisation_that_suits_each() {
        // A resolution of 1.2 does what is missing beside either cause; without it the right one leaves more than the other one with it.
        for (hidden, found) in [("first", 1), ("second", 2)] {
            let mut plant = Waves::new(&[(hidden, 1.5), ("other", 0.2)]);
            plant.resolutions = vec![1.0, 1.2];
            let search = search(&plant);
            let fitted = |candidate: usize, resolution: f64, fine: bool| {
                search.fitted(&Model::new(vec![Term { candidate, x: vec![1.0] }], resolution, fine)).unwrap()
            };
            let (best, other) = (fitted(2, 1.2, true), fitted(1, 1.0, false));
            let excess = other.total() - fitted(2, 1.2, false).total();
            let trial = Trial { candidate: 1, scored: other };
            let mut causes = with_rivals(&best, vec![Replacement { removed: 2, trial, excess }]);
            let least = least_with_fine_steps(&search, best, &mut causes);
            assert_eq!((least.model().terms[0].candidate, least.model().resolution), (found, 1.2), "{hidden}");
            // The other one of the two is what stands in its place.
            let [Replacement { removed, trial, .. }] = &causes.replaced[..] else { panic!("{:?}", causes.replaced) };
            assert_eq!((*removed, trial.candidate), (found, 3 - found), "{hidden}");
        }
    }

    #[test]
    fn replacements_stay_known_where_the_search_has_to_end() {
        // With the second number a fit costs more than a search may spend.
        for (work, is_cut) in [(1, false), (100_000, true)] {
            let mut plant = Waves::new(&[("first", 3.0)]);
            plant.work = work;
            let search = search(&plant);
            let best = search.fitted(&Model::new(vec![Term { candidate: 1, x: vec![1.0] }], 1.0, false)).unwrap();
            let trial = Trial { candidate: 0, scored: best.clone() };
            let earlier = vec![Replacement { removed: 1, trial, excess: 7.0 }];
            let found: Vec<usize> = replacements(&search, &best, earlier).iter().map(|other| other.trial.candidate).collect();
            assert_eq!((found == [0], found.contains(&2)), (is_cut, !is_cut), "{found:?}");
        }
    }
}
