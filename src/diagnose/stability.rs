//! How firmly a cause stands: how often it would be chosen if other runs had been measured, and whether the law of another could do its work.

use nalgebra::DVector;

use super::fit::sum_of_squares;
use super::naming::LEAST_TAKEN;
use super::plant::{Candidate, Model, Term};
use super::projection::without_directions;
use super::search::{LEAST_GAIN, Scored, Screened, Search, Trial, joined};

/// Fewest runs that are resampled.
const LEAST_RUNS: usize = 4;

/// A constant may make up for what the law of another cause lacks if that place's free form would take this share of what it takes.
const TAKEN_BY_LAW: f64 = 0.9;
/// ... and beside the constant it still takes this share of what the constant takes: a constant that is no law's rest leaves nothing to it.
const LEFT_BY_CONSTANT: f64 = 0.02;

/// How firmly a cause stands.
pub(super) struct Standing {
    /// Share of resamples in which it is chosen; none with few runs.
    pub(super) stability: Option<f64>,
    /// Causes that are chosen instead in some resamples, and take nearly as much of all runs.
    pub(super) instead: Vec<&'static str>,
    /// Folds of the cross-validation without which it would not be worth it. Where a rival would be chosen, it stands for the rival.
    pub(super) needs: Vec<usize>,
    /// True for a constant in the stead of which the free form of another cause's place would do as well, and beside which it still finds something: the
    /// constant may be what the law of that cause lacks.
    pub(super) is_left_by_law: bool,
}

/// How firmly term `index` of `best` stands against the model `without` it and against its `fitted` replacements; other rivals by the linear estimates of
/// a screening of each of the two.
pub(super) fn standing(search: &Search, [best, without]: [(&Scored, &Screened); 2], index: usize, fitted: &[&Trial]) -> Standing {
    let is_constant = search.candidate(&best.0.model().terms[index]).is_constant;
    let is_left_by_law = is_constant && is_left_by_law(search, best, without, index);
    let runs = search.split.all();
    if runs.len() < LEAST_RUNS {
        return Standing { stability: None, instead: Vec::new(), needs: Vec::new(), is_left_by_law };
    }
    let contest = Contest::new(search, best.0, without, index, fitted);
    let resamples: Vec<[usize; 2]> = (0..runs.len()).flat_map(|a| (0..=a).map(move |b| [a, b])).collect();
    let chosen = resamples.iter().filter(|left_out| contest.chooses(&left_out[..])).count();
    let mut instead: Vec<&str> = resamples.iter().flat_map(|left_out| contest.chosen_instead(&left_out[..])).collect();
    instead.sort_unstable();
    instead.dedup();
    let places = |fold: &[usize]| -> Vec<usize> { (0..runs.len()).filter(|at| fold.contains(&runs[*at])).collect() };
    let folds = search.split.folds();
    let is_lost_without = |fold: &usize| !contest.shows(&places(&folds[*fold]));
    Standing {
        stability: Some(chosen as f64 / resamples.len() as f64),
        instead,
        needs: (0..folds.len()).filter(is_lost_without).collect(),
        is_left_by_law,
    }
}

fn is_left_by_law(
    search: &Search,
    (best, beside): (&Scored, &Screened),
    (without, screened): (&Scored, &Screened),
    index: usize,
) -> bool {
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
    most(screened) > TAKEN_BY_LAW * gain && most(beside) > LEFT_BY_CONSTANT * gain
}

/// What a cause and its rivals take, run by run.
struct Contest {
    /// Number of values of each run.
    counts: Vec<f64>,
    /// Fall of χ² in each run by the cause, ...
    own: Vec<f64>,
    /// ... and the parts of its linear estimate.
    own_parts: Vec<[f64; 2]>,
    /// Fall of χ² in each run by each rival that was fitted.
    fitted: Vec<(&'static str, Vec<f64>)>,
    /// Parts of the linear estimate of each other rival.
    linear: Vec<(&'static str, Vec<[f64; 2]>)>,
}

impl Contest {
    fn new(search: &Search, best: &Scored, (without, screened): (&Scored, &Screened), index: usize, fitted: &[&Trial]) -> Self {
        let runs = search.split.all();
        let own = search.candidate(&best.model().terms[index]);
        let is_rival = |candidate: usize| {
            let other = &search.estimator.plant.candidates()[candidate];
            other.id != own.id
                && !(other.is_free_form || other.is_variant)
                && !(own.is_free_form && other.places.iter().any(|place| own.places.contains(place)))
        };
        let falls = |scored: &Scored| -> Vec<f64> {
            let of = |run: &usize| sum_of_squares(&without.residuals[*run]) - sum_of_squares(&scored.residuals[*run]);
            runs.iter().map(of).collect()
        };
        let column = without_directions(&screened.tangents, &(joined(best, &runs) - joined(without, &runs)));
        let lengths: Vec<usize> = runs.iter().map(|run| without.residuals[*run].len()).collect();
        let of = |column: &DVector<f64>| parts(column, &screened.rest, &lengths);
        let is_linear = |term: &Term, column: &DVector<f64>| {
            is_rival(term.candidate)
                && fitted.iter().all(|trial| trial.candidate != term.candidate)
                && search.moved(term, -screened.rest.dot(column) / column.norm_squared()).1
        };
        Self {
            counts: runs.iter().map(|run| search.estimator.count(&[*run]) as f64).collect(),
            own: falls(best),
            own_parts: of(&column),
            fitted: fitted
                .iter()
                .filter(|trial| is_rival(trial.candidate))
                .map(|trial| (search.id(trial.candidate), falls(&trial.scored)))
                .collect(),
            linear: screened
                .columns
                .iter()
                .filter(|(term, column)| is_linear(term, column))
                .map(|(term, column)| (search.id(term.candidate), of(column)))
                .collect(),
        }
    }

    /// Weights of the runs without those `left_out` (by their places in the list of runs).
    fn weights(&self, left_out: &[usize]) -> Vec<f64> {
        (0..self.counts.len()).map(|run| if left_out.contains(&run) { 0.0 } else { 1.0 }).collect()
    }

    /// True if the cause lowers χ² visibly without the runs `left_out`.
    fn shows(&self, left_out: &[usize]) -> bool {
        let weights = self.weights(left_out);
        weighted(&self.own, &weights).max(fall(&self.own_parts, &weights)) > LEAST_GAIN * weighted(&self.counts, &weights)
    }

    /// True if the cause lowers χ² most of all without the runs `left_out`, and visibly.
    fn chooses(&self, left_out: &[usize]) -> bool {
        let weights = self.weights(left_out);
        let (own, linear) = (weighted(&self.own, &weights), fall(&self.own_parts, &weights));
        self.shows(left_out)
            && self.fitted.iter().all(|(_, falls)| weighted(falls, &weights) < own)
            && self.linear.iter().all(|(_, parts)| fall(parts, &weights) < linear)
    }

    /// The rivals that lower χ² further than the cause without the runs `left_out`, and nearly as far with them.
    fn chosen_instead(&self, left_out: &[usize]) -> Vec<&'static str> {
        let (some, all) = (self.weights(left_out), self.weights(&[]));
        let is_rival = |of: &dyn Fn(&[f64]) -> [f64; 2]| {
            let ([own, other], [own_of_all, other_of_all]) = (of(&some), of(&all));
            other >= own && other_of_all > LEAST_TAKEN * own_of_all
        };
        let fitted = self.fitted.iter().filter(|(_, falls)| is_rival(&|w| [weighted(&self.own, w), weighted(falls, w)]));
        let linear = self.linear.iter().filter(|(_, parts)| is_rival(&|w| [fall(&self.own_parts, w), fall(parts, w)]));
        fitted.map(|(id, _)| *id).chain(linear.map(|(id, _)| *id)).collect()
    }
}

fn weighted(values: &[f64], weights: &[f64]) -> f64 {
    values.iter().zip(weights).map(|(value, weight)| weight * value).sum()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_chosen_without_some_runs_and_takes_as_much_of_all_is_tied() {
        let contest = |rival: [f64; 3]| Contest {
            counts: vec![100.0; 3],
            own: vec![50.0, 50.0, 20.0],
            own_parts: vec![[0.0, 1.0]; 3],
            fitted: vec![("rival", rival.to_vec())],
            linear: Vec::new(),
        };
        // Without the first run the rival takes 72 against 70, of all runs 116 against 120.
        let near = contest([44.0, 50.0, 22.0]);
        assert!(near.chooses(&[]) && !near.chooses(&[0]));
        assert_eq!((near.chosen_instead(&[0]), near.chosen_instead(&[])), (vec!["rival"], Vec::new()));
        // Of all runs 82 only.
        let far = contest([10.0, 50.0, 22.0]);
        assert!(!far.chooses(&[0]) && far.chosen_instead(&[0]).is_empty());
    }
}
