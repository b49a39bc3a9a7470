//! What a model with causes leaves, which of its causes the data doubt, and the verdict.

use super::DiagnoseError;
use super::adopted::estimates;
use super::blocks::BLOCK;
use super::intervals::{Intervals, intervals_of, numerics};
use super::names;
use super::plant::{Model, Plant, Term};
use super::search::{Scored, Search, Trial, VISIBLE};
use super::smoothing::smoothed;
use super::split::Split;

/// Structure is left if χ² per value exceeds 1 by this (a misfit of σ/2), ...
pub(super) const LEFT_OVER: f64 = VISIBLE;
/// ... and the verdict is unexplained if it is also by this share of what the refined nominal model leaves: a name stands with 95 % of what its place
/// takes. For n causes, three or more, the share is divided by n − 1: many causes that still leave structure stand in for one that is not in the library.
pub(super) const LEFT_SHARE: f64 = 0.05;
/// What a single name leaves belongs to its place up to this share, ...
const MOST_LEFT_AT_PLACE: f64 = 0.2;
/// ... if whatever was fitted at another place leaves more than this multiple of it.
const FARTHER: f64 = 2.0;
/// No cause is named if a larger share is left.
const NOTHING_NAMED: f64 = 0.5;
/// 95 % quantiles of χ² of one to four degrees of freedom.
const CHI2_95: [f64; 4] = [3.841, 5.991, 7.815, 9.488];
/// Fewest values to fit and to judge by, in whole blocks of correlated residuals.
const LEAST_FITTED: usize = 2 * BLOCK;
const LEAST_SELECTED: usize = BLOCK;

/// A model with all causes, and the misfit that it leaves.
pub(super) struct Judged {
    pub(super) best: Scored,
    /// The same with the nominal discretisation.
    pub(super) coarse: Scored,
    /// True if the data need another discretisation than the nominal one.
    pub(super) refined: bool,
    /// χ² per value above 1.
    pub(super) left: f64,
    /// The same as a share of the refined nominal model's, at most 1.
    pub(super) unexplained_fraction: f64,
    /// True if structure is left.
    pub(super) is_unexplained: bool,
    pub(super) intervals: Intervals,
    /// The remark that no cause is named, if so.
    pub(super) remark: Option<String>,
}

/// Judges `best` against `bare`, the refined nominal model: the misfit left, the need of refinement, and the intervals of the causes. `open` is what
/// the model with free forms left (χ² per value above 1), or the one with constants alone: what a name leaves beyond the former is known to belong to its place.
///
/// # Errors
/// [`DiagnoseError`] if a model cannot be simulated.
pub(super) fn judge(
    search: &Search,
    mut best: Scored,
    bare: &Scored,
    open: f64,
    nominal_resolution: f64,
) -> Result<Judged, DiagnoseError> {
    let plant = search.estimator.plant;
    let above = |scored: &Scored| search.above(scored);
    let (left, whole) = (above(&best), above(bare));
    let unexplained_fraction = if whole > 0.0 { (left / whole).min(1.0) } else { 0.0 };
    let is_cause = |term: &&Term| !plant.candidates()[term.candidate].is_constant;
    let cause_count = best.model().terms.iter().filter(is_cause).count().max(2) as f64 - 1.0;
    let least = left.min(open);
    let is_unexplained = least > LEFT_OVER && least > LEFT_SHARE / cause_count * whole;
    let unnamed = is_unexplained && unexplained_fraction > NOTHING_NAMED;
    let mut remark = None;
    if unnamed && !best.model().terms.is_empty() {
        let names: Vec<_> = best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
        remark = Some(format!(
            "no cause is named: the best model, with {}, leaves {:.0} % of the misfit",
            names.join(" and "),
            100.0 * unexplained_fraction
        ));
        best = bare.clone();
    }

    // The nominal discretisation is kept unless the data need another.
    let coarse = search.fitted(&Model { resolution: nominal_resolution, ..best.model().clone() })?;
    let refined = best.model().resolution != nominal_resolution && search.is_worth(&best, &coarse);
    if best.model().resolution != nominal_resolution && !refined && above(&coarse) <= above(&best) + 0.01 {
        best = coarse.clone();
    }

    best = smoothed(search, best);
    let mut numerics = numerics(search, &best)?;
    // Unexplained structure may bias the coordinates, at most by its share of what the causes explain.
    let free = best.model().terms.iter().flat_map(|term| {
        let parameters = &plant.candidates()[term.candidate].parameters;
        term.x.iter().zip(parameters).map(|(x, p)| x - p.off.unwrap_or(*x))
    });
    for (numerics, distance) in numerics.iter_mut().zip(free) {
        *numerics = numerics.hypot(distance * unexplained_fraction.sqrt());
    }
    let intervals = intervals_of(search, &best, &numerics)?;
    Ok(Judged { best, coarse, refined, left, unexplained_fraction, is_unexplained, intervals, remark })
}

/// True if what a model leaves belongs to the place of its only cause, `id`: a law of it is missing that is none of those that are known. The cause takes most of the misfit,
/// and whatever was promising enough at other places to be fitted, of `tried`, leaves far more.
pub(super) fn is_at_its_place<'t>(search: &Search, judged: &Judged, id: &str, tried: impl Iterator<Item = &'t Trial>) -> bool {
    let mut terms = judged.best.model().terms.iter().map(|term| search.candidate(term));
    let Some(own) = terms.find(|candidate| candidate.id == id && !candidate.is_constant) else { return false };
    let is_elsewhere = |trial: &&Trial| {
        let places = &search.estimator.plant.candidates()[trial.candidate].places;
        !places.iter().any(|place| own.places.contains(place))
    };
    let nearest = tried.filter(is_elsewhere).map(|trial| search.above(&trial.scored)).min_by(f64::total_cmp);
    judged.unexplained_fraction <= MOST_LEFT_AT_PLACE && nearest.is_none_or(|nearest| nearest > FARTHER * judged.left)
}

/// A term that the data do not tell from its absence, the least certain one if there are several, with a remark in words.
///
/// The 95 % intervals of all its parameters with an off value contain that value. Several parameters may compensate each other, so χ² without the term
/// has to agree.
///
/// # Errors
/// [`DiagnoseError`] if a model cannot be simulated.
pub(super) fn doubtful(search: &Search, judged: &Judged) -> Result<Option<(usize, String)>, DiagnoseError> {
    let Judged { best, intervals, .. } = judged;
    let mut first = 0;
    let mut found: Option<(f64, usize, String)> = None;
    for (index, term) in best.model().terms.iter().enumerate() {
        let own = first..first + term.x.len();
        first = own.end;
        let candidate = &search.estimator.plant.candidates()[term.candidate];
        let switches: Vec<(usize, f64)> =
            own.clone().zip(&candidate.parameters).filter_map(|(k, free)| Some((k, free.off?))).collect();
        let holds = |(k, off): &(usize, f64)| (intervals.ends[*k][0]..=intervals.ends[*k][1]).contains(off);
        if switches.is_empty() || !switches.iter().all(holds) {
            continue;
        }
        let without = search.fitted(&search.without(best, index)?)?;
        // What is left cannot stand for a cause that takes more than that.
        if judged.is_unexplained && search.above(&without) > 2.0 * search.above(best) {
            continue;
        }
        let inflation = own.map(|k| intervals.inflation[k]).fold(1.0, f64::max);
        let gain = (without.fitted - best.fitted) / inflation;
        let needed = CHI2_95[(term.x.len() - 1).min(CHI2_95.len() - 1)];
        if term.x.len() > 1 && gain > needed {
            continue;
        }
        let numbers: Vec<String> =
            estimates(search, index, term, intervals).iter().map(|e| names::words(candidate.id, e)).collect();
        let cause = format!("{} ({})", names::cause(candidate.id), numbers.join("; "));
        let words = if judged.is_unexplained {
            // What is left widens the intervals, however many the data are.
            format!(
                "{cause} is not named: {:.0} % of the misfit is left with it, and its interval contains the value at which it has no effect",
                100.0 * judged.unexplained_fraction
            )
        } else {
            format!(
                "the data are insufficient to name a cause: they are explained as well without {cause}, whose interval contains the value at which it \
                 has no effect"
            )
        };
        if found.as_ref().is_none_or(|(least, ..)| gain < *least) {
            found = Some((gain, index, words));
        }
    }
    Ok(found.map(|(_, index, words)| (index, words)))
}

/// Why the data are insufficient to tell causes apart, if so.
pub(super) fn insufficient_data(plant: &dyn Plant, split: &Split) -> Option<String> {
    let signals = plant.signals();
    if signals.len() < 2 || split.select.is_empty() {
        return Some(format!(
            "{} run is too little to tell causes apart: a cause has to be judged on a run that it was not fitted to",
            signals.len()
        ));
    }
    let values = |runs: &[usize]| runs.iter().map(|run| signals[*run].values.len()).sum::<usize>();
    let (fitted, selected) = (values(&split.fit), values(&split.select));
    if fitted < LEAST_FITTED || selected < LEAST_SELECTED {
        return Some(format!(
            "{fitted} values to fit and {selected} to judge by are too little to tell causes apart: {LEAST_FITTED} and {LEAST_SELECTED} are needed at least"
        ));
    }
    let is_constant = |run: &usize| {
        let inputs = &signals[*run].inputs;
        !plant.moves_unaided(*run) && inputs.iter().all(|u| (u - inputs[0]).abs() < 1e-9)
    };
    let levels: Vec<f64> = signals.iter().filter_map(|signal| signal.inputs.first().copied()).collect();
    if split.all().iter().all(is_constant) && levels.iter().all(|level| (level - levels[0]).abs() < 1e-9) {
        return Some("the input is constant and the same in all runs: these data determine no more than an offset".into());
    }
    None
}
