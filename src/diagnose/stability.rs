//! How firmly a cause stands: how often it would be chosen if other runs had been measured, and whether the law of another could do its work.

use nalgebra::DVector;

use super::DiagnoseError;
use super::plant::{Candidate, Model, Term};
use super::search::{LEAST_GAIN, Scored, Screened, Search, joined, without_directions};

/// Fewest runs that are resampled.
const LEAST_RUNS: usize = 4;

/// A constant may make up for what the law of another cause lacks if that place's free form would take this share of what it takes.
const TAKEN_BY_LAW: f64 = 0.9;
/// ... and beside the constant it still takes this share of what the constant takes: a constant that is no law's rest leaves nothing to it.
const LEFT_BY_CONSTANT: f64 = 0.02;

/// How firmly a cause stands.
pub(super) struct Standing {
    /// Share of resamples in which it is chosen; none with few runs.
    pub stability: Option<f64>,
    /// True for a constant in the stead of which the free form of another cause's place would do as well, and beside which it still finds something: the
    /// constant may be what the law of that cause lacks.
    pub is_left_by_law: bool,
}

/// How firmly term `index` of `best` stands against the model `without` it. Linear in the change of the residuals, so no fit is needed.
///
/// # Errors
/// [`DiagnoseError`] if the model cannot be simulated.
pub(super) fn standing(search: &Search, best: &Scored, without: &Scored, index: usize) -> Result<Standing, DiagnoseError> {
    // Free forms count in the stead of constants only.
    let is_constant = search.candidate(&best.model().terms[index]).is_constant;
    let screened =
        search.screen_of(without, |candidate| if candidate.is_free_form { is_constant } else { !candidate.is_variant })?;
    Ok(Standing {
        stability: stability(search, best, without, index, &screened),
        is_left_by_law: is_constant && is_left_by_law(search, best, without, index, &screened)?,
    })
}

fn is_left_by_law(
    search: &Search,
    best: &Scored,
    without: &Scored,
    index: usize,
    screened: &Screened,
) -> Result<bool, DiagnoseError> {
    let own = search.candidate(&best.model().terms[index]);
    let others = || without.model().terms.iter().map(|term| search.candidate(term)).filter(|other| !other.is_constant);
    let is_law = |free: &Candidate| {
        // A free form of the constant's own place holds the constant.
        let is_of = |candidate: &Candidate| candidate.places.iter().any(|place| free.places.contains(place));
        free.is_free_form && !is_of(own) && others().any(is_of)
    };
    let most = |screened: &Screened| {
        let of_law = |(_, model): &&(f64, Model)| model.terms.last().is_some_and(|term| is_law(search.candidate(term)));
        screened.ranked.iter().filter(of_law).map(|(gain, _)| *gain).fold(0.0, f64::max)
    };
    let gain = without.total() - best.total();
    Ok(most(screened) > TAKEN_BY_LAW * gain && most(&search.screen_of(best, is_law)?) > LEFT_BY_CONSTANT * gain)
}

/// Share of resamples, which leave out one or two of the runs, in which term `index` of `best` is chosen: in which it lowers χ² of the model `without` it by
/// more than any other cause, and visibly.
fn stability(search: &Search, best: &Scored, without: &Scored, index: usize, screened: &Screened) -> Option<f64> {
    let runs = search.split.all();
    if runs.len() < LEAST_RUNS {
        return None;
    }
    let own = search.candidate(&best.model().terms[index]);
    let is_rival = |term: &Term| {
        let other = search.candidate(term);
        other.id != own.id
            && !(other.is_free_form || other.is_variant)
            && !(own.is_free_form && other.places.iter().any(|place| own.places.contains(place)))
    };
    let column = without_directions(&screened.tangents, &(joined(best, &runs) - joined(without, &runs)));
    let lengths: Vec<usize> = runs.iter().map(|run| without.residuals[*run].len()).collect();
    let own_parts = parts(&column, &screened.rest, &lengths);
    let rivals: Vec<Vec<[f64; 2]>> = screened
        .columns
        .iter()
        .filter(|(term, column)| is_rival(term) && search.moved(term, -screened.rest.dot(column) / column.norm_squared()).1)
        .map(|(_, column)| parts(column, &screened.rest, &lengths))
        .collect();
    let counts: Vec<f64> = runs.iter().map(|run| search.estimator.count(&[*run]) as f64).collect();
    let is_chosen = |left_out: &[usize]| {
        let weights: Vec<f64> = (0..runs.len()).map(|run| if left_out.contains(&run) { 0.0 } else { 1.0 }).collect();
        let count: f64 = weights.iter().zip(&counts).map(|(weight, count)| weight * count).sum();
        let gain = fall(&own_parts, &weights);
        gain > LEAST_GAIN * count && rivals.iter().all(|rival| fall(rival, &weights) < gain)
    };
    let resamples: Vec<bool> = (0..runs.len()).flat_map(|a| (0..=a).map(move |b| [a, b])).map(|pair| is_chosen(&pair)).collect();
    let chosen = resamples.iter().filter(|is_chosen| **is_chosen).count();
    Some(chosen as f64 / resamples.len() as f64)
}

/// Per run the inner products of a column with the residuals and with itself.
fn parts(column: &DVector<f64>, rest: &DVector<f64>, lengths: &[usize]) -> Vec<[f64; 2]> {
    let mut from = 0;
    let of = |len: &usize| {
        let own = column.rows(from, *len);
        let part = [own.dot(&rest.rows(from, *len)), own.norm_squared()];
        from += len;
        part
    };
    lengths.iter().map(of).collect()
}

/// Fall of χ² along a column in weighted runs.
fn fall(parts: &[[f64; 2]], weights: &[f64]) -> f64 {
    let sum = |k: usize| parts.iter().zip(weights).map(|(part, weight)| weight * part[k]).sum::<f64>();
    let along = sum(0).min(0.0);
    along * along / sum(1).max(f64::MIN_POSITIVE)
}
