//! How often a cause would be chosen if other runs had been measured.

use nalgebra::DVector;

use super::DiagnoseError;
use super::plant::Term;
use super::search::{LEAST_GAIN, Scored, Search, without_directions};

/// Fewest runs that are resampled.
const LEAST_RUNS: usize = 4;

/// Share of resamples, which leave out one or two of the runs, in which term `index` of `best` is chosen: in which it lowers χ² of the model `without` it by
/// more than any other cause, and visibly. Linear in the change of the residuals, so no fit is needed. None with few runs.
///
/// # Errors
/// [`DiagnoseError`] if the model cannot be simulated.
pub(super) fn stability(search: &Search, best: &Scored, without: &Scored, index: usize) -> Result<Option<f64>, DiagnoseError> {
    let runs = search.split.all();
    if runs.len() < LEAST_RUNS {
        return Ok(None);
    }
    let own = search.candidate(&best.model().terms[index]);
    let screened = search.screen(without)?;
    let is_rival = |term: &Term| {
        let other = search.candidate(term);
        other.id != own.id
            && !other.is_free_form
            && !(own.is_free_form && other.places.iter().any(|place| own.places.contains(place)))
    };
    let joined =
        |scored: &Scored| DVector::from_vec(runs.iter().flat_map(|run| scored.residuals[*run].clone()).collect::<Vec<f64>>());
    let column = without_directions(&screened.tangents, &(joined(best) - joined(without)));
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
    Ok(Some(chosen as f64 / resamples.len() as f64))
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
