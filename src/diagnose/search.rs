//! Which causes the data ask for: screening, forward and backward selection, and what could stand in for what.
//!
//! Models are fitted to one part of the runs and judged on the other. The constants of the nominal model are free from the beginning, so that a
//! cause is credited only with what re-tuned constants cannot do; in the end everything that the data do not need is taken out again.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::dataset::Role;
use super::fit::{BLOCK, Bench, Care, Fit, Residuals, places, square};
use super::plant::{Free, Model, Plant, Signal, Term};

/// A cause is adopted if the held-out χ² falls by at least this share of the number of values, a misfit of a sixth of the noise (rms): other
/// discretisations of one and the same physics differ by nearly that much; ...
const LEAST_GAIN: f64 = 0.03;
/// ... and by this share of what re-tuned constants leave unexplained: a cause that is not quite of the form of its model leaves traces that
/// others could polish away; ...
const LEAST_SHARE: f64 = 0.004;
/// ... and by so many standard errors of what noise alone does to the difference, ...
const LEAST_SIGMAS: f64 = 3.0;
/// ... and if Bayes's information criterion falls by so much.
const LEAST_BIC: f64 = 10.0;
/// A cause that no held-out run shows is looked at again if it lowers the fit runs' χ² by this share of the number of values.
const SEEN_BY_FIT: f64 = 0.1;
/// Two models are tied if their χ² differ by less than this, or by less than two standard errors.
const TIED_CHI2: f64 = 12.0;
/// Candidates that are fitted after screening.
const FINALISTS: usize = 7;
/// Two causes are no pair if the squared sine of the angle between what they do is below this.
const LEAST_ANGLE: f64 = 1e-3;
/// Most turns between the runs' nuisances and the model.
const MOST_TURNS: usize = 10;
/// Most causes beside constants.
const MOST_CAUSES: usize = 4;

/// Runs by what they are for.
#[derive(Debug, Clone)]
pub struct Split {
    /// Parameters are fitted to these.
    pub fit: Vec<usize>,
    /// Models are judged on these.
    pub held: Vec<usize>,
}

impl Split {
    /// All runs.
    pub fn all(&self) -> Vec<usize> {
        let mut all = [self.fit.as_slice(), &self.held].concat();
        all.sort_unstable();
        all
    }
}

/// A fitted model with its residuals on all runs.
#[derive(Debug, Clone)]
pub struct Scored {
    /// The fit to the fit runs.
    pub fit: Fit,
    /// Residuals of all runs, in standard deviations.
    pub residuals: Vec<Residuals>,
    /// χ² of the held-out runs.
    pub held: f64,
    /// χ² of the fit runs.
    pub fitted: f64,
}

impl Scored {
    /// χ² of all runs.
    pub fn total(&self) -> f64 {
        self.held + self.fitted
    }

    /// χ² per value above 1, of `count` values in all runs.
    pub(super) fn above(&self, count: usize) -> f64 {
        (self.total() / count as f64 - 1.0).max(0.0)
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.fit.model
    }

    /// Number of coordinates.
    pub fn freedom(&self) -> usize {
        places(&self.fit.model).len()
    }

    /// χ² + k ln N of the fit runs.
    pub fn bic(&self) -> f64 {
        self.fitted + self.freedom() as f64 * (self.fit.count as f64).ln()
    }
}

/// The search's state.
pub struct Search<'a> {
    /// Plant and nuisances.
    pub bench: Bench<'a>,
    /// The runs.
    pub split: Split,
    /// χ² per value, less 1, that re-tuned constants leave on the held-out runs; known after [`calibrated`](Self::calibrated).
    pub unexplained: f64,
    /// Told what is being tried.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

/// What fitting a candidate on top of the constants gave.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The candidate.
    pub candidate: usize,
    /// The model with it.
    pub scored: Scored,
}

/// What causes would do if the model were linear.
pub struct Screened {
    /// By how much every start of every candidate would lower χ², and the model to fit from, best first.
    pub ranked: Vec<(f64, Model)>,
    /// Every start with what it adds to the residuals beside the model's own coordinates.
    columns: Vec<(Term, DVector<f64>)>,
    /// The residuals beside the model's own coordinates.
    rest: DVector<f64>,
}

impl Search<'_> {
    /// The candidate's name.
    pub fn id(&self, candidate: usize) -> &'static str {
        self.bench.plant.candidates()[candidate].id
    }

    /// Scores a model as it is.
    pub fn score(&self, fit: Fit) -> Result<Scored, String> {
        let all: Vec<usize> = (0..self.bench.plant.signals().len()).collect();
        let residuals = self.bench.residuals_of(&fit.model, &all)?;
        let sum = |runs: &[usize]| runs.iter().map(|run| square(&residuals[*run])).sum();
        Ok(Scored { held: sum(&self.split.held), fitted: sum(&self.split.fit), fit, residuals })
    }

    /// Fits a model and scores it.
    pub fn fitted(&self, model: &Model) -> Result<Scored, String> {
        self.score(self.bench.fit(model, &self.split.fit, Care::Full)?)
    }

    /// Fits a model well enough to rank it.
    fn ranked(&self, model: &Model) -> Result<Scored, String> {
        self.score(self.bench.fit(model, &self.split.fit, Care::Rank)?)
    }

    /// Fits the runs' nuisances to a model and the model to them, by turns until nothing changes.
    pub fn settle(&mut self, scored: Scored) -> Result<Scored, String> {
        let mut scored = scored;
        let all = self.split.all();
        for _ in 0..MOST_TURNS {
            let before = scored.total();
            self.bench.fit_nuisances(scored.model(), &all)?;
            scored = self.fitted(scored.model())?;
            if before - scored.total() < 1e-3 * (before - self.bench.count(&all) as f64).max(self.bench.count(&all) as f64) {
                break;
            }
        }
        Ok(scored)
    }

    /// How far the χ² of `worse` lies above that of `better` on `runs`, in standard errors and in itself.
    ///
    /// With a the residuals of the better model and d the difference of the predictions, both in units of the noise, Δχ² = Σ (2 a d + d²). Noise of
    /// unit variance makes it scatter by 2 |d|, and structure that is left in a by 2 √Σ (Σ a d)² with inner sums over blocks of values that
    /// may hang together; the larger of the two counts.
    pub fn gap(&self, better: &Scored, worse: &Scored, runs: &[usize]) -> (f64, f64) {
        let (mut sum, mut apart, mut structure) = (0.0, 0.0, 0.0);
        for run in runs {
            for (a, b) in better.residuals[*run].chunks(BLOCK).zip(worse.residuals[*run].chunks(BLOCK)) {
                let mut along = 0.0;
                for (a, b) in a.iter().zip(b) {
                    sum += b * b - a * a;
                    apart += (b - a) * (b - a);
                    along += a * (b - a);
                }
                structure += along * along;
            }
        }
        (sum / (2.0 * f64::max(apart, structure).sqrt()).max(1e-9), sum)
    }

    /// Whether `more` is worth its additional parameters beside `less`.
    pub fn is_worth(&self, more: &Scored, less: &Scored) -> bool {
        let runs = if self.split.held.is_empty() { &self.split.fit } else { &self.split.held };
        let (sigmas, gain) = self.gap(more, less, runs);
        let count = self.bench.count(runs) as f64;
        gain > count * LEAST_GAIN.max(LEAST_SHARE * self.unexplained)
            && sigmas > LEAST_SIGMAS
            && more.bic() < less.bic() - LEAST_BIC
    }

    /// Whether two models cannot be told apart by any run.
    pub fn is_tied(&self, better: &Scored, other: &Scored) -> bool {
        let (sigmas, gap) = self.gap(better, other, &self.split.all());
        gap < TIED_CHI2 || sigmas < 2.0
    }

    fn constants(&self) -> Vec<Term> {
        // Areal mass enters all motion only by its ratio to the stiffness: one of the two is enough.
        let candidates = self.bench.plant.candidates().iter().enumerate();
        let constants = candidates.filter(|(_, c)| c.is_constant && c.id != "areal-mass");
        constants
            .map(|(candidate, c)| Term { candidate, x: c.parameters.iter().map(|p| p.off.unwrap_or(p.bounds[0])).collect() })
            .collect()
    }

    /// A model with all constants free; those that it has not are added at the end.
    pub fn with_constants(&self, model: &Model) -> Model {
        let mut all = model.clone();
        all.terms.extend(self.constants().into_iter().filter(|c| model.terms.iter().all(|term| term.candidate != c.candidate)));
        all
    }

    /// The nominal model with its constants free.
    pub fn calibrated(&mut self, resolution: f64) -> Result<Scored, String> {
        let scored = self.fitted(&Model { terms: self.constants(), resolution, fine: false })?;
        let scored = self.settle(scored)?;
        let (chi2, runs) =
            if self.split.held.is_empty() { (scored.fitted, &self.split.fit) } else { (scored.held, &self.split.held) };
        self.unexplained = (chi2 / self.bench.count(runs).max(1) as f64 - 1.0).max(0.0);
        Ok(scored)
    }

    /// How much every start of every candidate would lower χ² on all runs if the model were linear, beside what the model's own coordinates could do.
    pub fn screen(&self, from: &Scored) -> Result<Screened, String> {
        let runs = self.split.all();
        let base = from.model();
        let used: Vec<&str> = base.terms.iter().map(|term| self.id(term.candidate)).collect();
        let candidates = self.bench.plant.candidates();
        let mut starts = Vec::new();
        for (candidate, c) in candidates.iter().enumerate().filter(|(_, c)| !used.contains(&c.id)) {
            starts.extend(c.starts.iter().map(|x| Term { candidate, x: x.clone() }));
        }
        let plain = DVector::from_vec(runs.iter().flat_map(|run| from.residuals[*run].clone()).collect());
        let own = self.tangents(base, &runs, &plain)?;
        let columns: Vec<Option<DVector<f64>>> = starts
            .par_iter()
            .map(|term| {
                let model = with(base, [term.clone()]);
                let residuals = self.bench.residuals_of(&model, &runs).ok()?;
                let column = without(&own, &(DVector::from_vec(residuals.concat()) - &plain));
                (column.norm_squared() > 1e-12).then_some(column)
            })
            .collect();
        let rest = without(&own, &plain);
        let mut ranked = Vec::new();
        let columns: Vec<(Term, DVector<f64>)> =
            starts.into_iter().zip(columns).filter_map(|(term, column)| Some((term, column?))).collect();
        for (term, column) in &columns {
            let along = -rest.dot(column) / column.norm_squared();
            let (moved, right) = self.moved(term, along);
            let gain = if right { rest.dot(column).powi(2) / column.norm_squared() } else { 0.0 };
            ranked.push((gain, with(base, [moved])));
        }
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(Screened { ranked, columns, rest })
    }

    /// The two screened causes that would lower χ² most together, if they do by more than twice what the best does alone: others will be found one
    /// after the other.
    fn pair(&self, base: &Model, screened: &Screened) -> Option<Model> {
        let Screened { ranked, columns, rest } = screened;
        let mut least = 2.0 * ranked.first().map_or(0.0, |(gain, _)| *gain);
        let sizes: Vec<[f64; 2]> = columns.iter().map(|(_, u)| [u.norm_squared(), u.dot(rest)]).collect();
        let mut pair = None;
        for (index, (first, u)) in columns.iter().enumerate() {
            for (other, (second, v)) in columns[..index].iter().enumerate() {
                // Least squares of −rest on the two.
                let ([uu, ur], [vv, vr], uv) = (sizes[index], sizes[other], u.dot(v));
                let determinant = uu * vv - uv * uv;
                if self.id(first.candidate) == self.id(second.candidate) || determinant < LEAST_ANGLE * uu * vv {
                    continue;
                }
                let (a, b) = ((uv * vr - vv * ur) / determinant, (uv * ur - uu * vr) / determinant);
                let ((first, right), (second, also)) = (self.moved(first, a), self.moved(second, b));
                let gain = -(a * ur + b * vr);
                if right && also && gain > least {
                    least = gain;
                    pair = Some(with(base, [first, second]));
                }
            }
        }
        pair
    }

    /// A start that is moved along the way from where its cause does nothing, and whether it can go that way: a cause that is asked for with the wrong
    /// sign stays where it was tried.
    fn moved(&self, start: &Term, along: f64) -> (Term, bool) {
        let parameters = &self.bench.plant.candidates()[start.candidate].parameters;
        if parameters.iter().all(|p| p.off.is_none_or(|off| off <= p.bounds[0] || off >= p.bounds[1])) && along < 0.05 {
            return (start.clone(), false);
        }
        let moved = |(x, p): (&f64, &Free)| match p.off {
            Some(off) => (off + along.clamp(-1.5, 2.0) * (x - off)).clamp(p.bounds[0], p.bounds[1]),
            None => *x,
        };
        (Term { candidate: start.candidate, x: start.x.iter().zip(parameters).map(moved).collect() }, true)
    }

    /// Derivatives of the residuals by the model's coordinates, made orthogonal.
    fn tangents(&self, model: &Model, runs: &[usize], plain: &DVector<f64>) -> Result<Vec<DVector<f64>>, String> {
        let columns: Vec<DVector<f64>> = places(model)
            .par_iter()
            .map(|place| {
                let mut shifted = model.clone();
                shifted.terms[place.0].x[place.1] += self.bench.step(model, *place);
                Ok(DVector::from_vec(self.bench.residuals_of(&shifted, runs)?.concat()) - plain)
            })
            .collect::<Result<_, String>>()?;
        let mut orthogonal: Vec<DVector<f64>> = Vec::new();
        for column in columns {
            let size = column.norm();
            let rest = without(&orthogonal, &column);
            let left = rest.norm();
            if left > 1e-6 * size && left > 0.0 {
                orthogonal.push(rest / left);
            }
        }
        Ok(orthogonal)
    }

    /// The best screened starts of different candidates, `count` of them.
    fn finalists<'m>(&self, screened: impl IntoIterator<Item = &'m (f64, Model)>, count: usize) -> Vec<Model> {
        let mut chosen: Vec<Model> = Vec::new();
        for (_, model) in screened {
            let last = |model: &Model| model.terms.last().map(|term| term.candidate);
            if chosen.len() < count && !chosen.iter().any(|other| last(other) == last(model)) {
                chosen.push(model.clone());
            }
        }
        chosen
    }

    /// The best screened candidates fitted on top of `from`, best on held-out runs first; and what was screened.
    pub fn trials(&self, from: &Scored) -> Result<(Vec<Trial>, Screened), String> {
        (self.progress)("screening all candidates");
        let screened = self.screen(from)?;
        let finalists = self.finalists(&screened.ranked, FINALISTS);
        let mut trials = Vec::new();
        for model in finalists {
            let Some(term) = model.terms.last() else { continue };
            (self.progress)(&format!("fitting {}", self.id(term.candidate)));
            // What cannot be fitted is no explanation.
            if let Ok(scored) = self.ranked(&model) {
                trials.push(Trial { candidate: term.candidate, scored });
            }
        }
        // Those that may win are fitted to the end: a fit that is cut short may look better on held-out runs than one that goes further.
        let best = |by: &dyn Fn(&Scored) -> f64| {
            (0..trials.len()).min_by(|a, b| by(&trials[*a].scored).total_cmp(&by(&trials[*b].scored)))
        };
        let mut ahead = vec![best(&|scored| self.judged(scored)), best(&|scored| scored.total())];
        ahead.dedup();
        for index in ahead.into_iter().flatten() {
            let model = trials[index].scored.model().clone();
            trials[index].scored = self.fitted(&model)?;
        }
        trials.sort_by(|a, b| self.judged(&a.scored).total_cmp(&self.judged(&b.scored)));
        Ok((trials, screened))
    }

    /// What models are ranked by: χ² of the held-out runs, or of all where there are none.
    pub fn judged(&self, scored: &Scored) -> f64 {
        if self.split.held.is_empty() { scored.bic() } else { scored.held }
    }

    /// Adds causes while they are worth it. Returns the last model and the first round's trials.
    pub fn forward(&mut self, from: Scored) -> Result<(Scored, Vec<Trial>), String> {
        let mut best = from;
        let mut first: Option<Vec<Trial>> = None;
        for _ in 0..MOST_CAUSES {
            let (trials, screened) = self.trials(&best)?;
            let top = trials.first().map(|trial| trial.scored.clone());
            let worthy = match top.filter(|top| self.is_worth(top, &best)) {
                Some(top) => Some(top),
                None => match self.seen_by_fit_runs(&mut best, &trials)? {
                    Some(seen) => Some(seen),
                    None => self.both(&screened, &best),
                },
            };
            let Some(worthy) = worthy else {
                first.get_or_insert(trials);
                break;
            };
            best = self.settle(worthy)?;
            if first.is_none() {
                first = Some(trials);
            }
        }
        Ok((best, first.unwrap_or_default()))
    }

    /// Two causes that hide one another: neither is worth it alone. What cannot be fitted is no explanation.
    fn both(&self, screened: &Screened, base: &Scored) -> Option<Scored> {
        let pair = self.pair(base.model(), screened)?;
        if let [.., first, second] = &pair.terms[..] {
            (self.progress)(&format!("fitting {} and {} together", self.id(first.candidate), self.id(second.candidate)));
        }
        let both = self.ranked(&pair).ok().filter(|both| self.is_worth(both, base))?;
        self.fitted(both.model()).ok()
    }

    /// Whether the fit runs miss what `less` leaves out.
    fn is_seen_by_fit(&self, more: &Scored, less: &Scored) -> bool {
        less.fitted - more.fitted > SEEN_BY_FIT.max(LEAST_SHARE * self.unexplained) * self.bench.count(&self.split.fit) as f64
    }

    /// A cause may show in runs that are fitted and in none that is held out. If one does much for the fit, the run it does most for is held out as
    /// well: the cause, fitted to the others, has to do for it too. Keeps the new split if it does.
    fn seen_by_fit_runs(&mut self, base: &mut Scored, trials: &[Trial]) -> Result<Option<Scored>, String> {
        let Some(trial) = trials.iter().min_by(|a, b| a.scored.fitted.total_cmp(&b.scored.fitted)) else { return Ok(None) };
        let gain = |run: &usize| square(&base.residuals[*run]) - square(&trial.scored.residuals[*run]);
        let most = self.split.fit.iter().copied().max_by(|a, b| gain(a).total_cmp(&gain(b)));
        let Some(run) = most.filter(|_| self.split.fit.len() > 2 && self.is_seen_by_fit(&trial.scored, base)) else {
            return Ok(None);
        };
        (self.progress)(&format!("{} on another split", self.id(trial.candidate)));
        let before = self.split.clone();
        self.split.fit.retain(|other| *other != run);
        self.split.held.push(run);
        self.split.held.sort_unstable();
        let plain = self.fitted(base.model())?;
        let with = self.fitted(trial.scored.model())?;
        if self.is_worth(&with, &plain) {
            *base = plain;
            return Ok(Some(with));
        }
        self.split = before;
        Ok(None)
    }

    /// Takes out what is not worth it, the least needed first.
    pub fn backward(&self, from: Scored) -> Result<Scored, String> {
        let mut best = from;
        loop {
            let shorter = |index: usize| {
                let mut model = best.model().clone();
                let term = model.terms.remove(index);
                (self.progress)(&format!("doing without {}", self.id(term.candidate)));
                self.ranked(&model)
            };
            // What the discretisation could do as well goes first.
            let plant = self.bench.plant;
            let idle = best.model().terms.iter().position(|term| !plant.is_credible(term, best.model().resolution));
            if let Some(idle) = idle {
                best = self.fitted(shorter(idle)?.model())?;
                continue;
            }
            let shorter = (0..best.model().terms.len()).map(shorter).collect::<Result<Vec<_>, _>>()?;
            let Some(least) = shorter.into_iter().min_by(|a, b| a.total().total_cmp(&b.total())) else { return Ok(best) };
            let least = self.fitted(least.model())?;
            if self.is_worth(&best, &least) || self.is_seen_by_fit(&best, &least) {
                return Ok(best);
            }
            best = least;
        }
    }

    /// Puts every other candidate in the place of every cause: what does better, or as well.
    pub fn replacements(&self, best: &Scored, most: usize) -> Result<Vec<(usize, Trial)>, String> {
        let mut found = Vec::new();
        for index in 0..best.model().terms.len() {
            let mut model = best.model().clone();
            let removed = model.terms.remove(index);
            (self.progress)(&format!("trying others in the place of {}", self.id(removed.candidate)));
            let without = self.fitted(&model)?;
            let screened = self.screen(&without)?.ranked;
            let others = screened.iter().filter(|(_, m)| m.terms.last().is_some_and(|term| term.candidate != removed.candidate));
            for model in self.finalists(others, most) {
                let Some(term) = model.terms.last() else { continue };
                let candidate = term.candidate;
                if let Ok(scored) = self.ranked(&model) {
                    found.push((index, Trial { candidate, scored }));
                }
            }
        }
        Ok(found)
    }

    /// The number of joints that fits best, near the one at hand: χ² over all runs decides, for it has no other parameter.
    pub fn resolve(&mut self, best: Scored) -> Result<Scored, String> {
        let ladder = self.bench.plant.resolutions();
        let mut best = best;
        let mut tried = vec![best.model().resolution];
        loop {
            let Some(at) = ladder.iter().position(|r| *r == best.model().resolution) else { return Ok(best) };
            let beside = [at.checked_sub(1), Some(at + 1)].into_iter().flatten().filter_map(|k| ladder.get(k).copied());
            let mut moved = false;
            for resolution in beside.filter(|r| !tried.contains(r)).collect::<Vec<_>>() {
                tried.push(resolution);
                (self.progress)(&format!("{resolution} joints per actuator"));
                let other = self.fitted(&Model { resolution, ..best.model().clone() })?;
                if other.total() < best.total() {
                    best = other;
                    moved = true;
                    break;
                }
            }
            if !moved {
                return Ok(best);
            }
        }
    }
}

/// A model with more terms.
fn with(base: &Model, terms: impl IntoIterator<Item = Term>) -> Model {
    let mut model = base.clone();
    model.terms.extend(terms);
    model
}

/// What of a vector is orthogonal to unit vectors.
fn without(unit: &[DVector<f64>], vector: &DVector<f64>) -> DVector<f64> {
    let mut rest = vector.clone();
    for direction in unit {
        let along = direction.dot(&rest);
        rest.axpy(-along, direction, 1.0);
    }
    rest
}

/// Covariance of a fit's coordinates; infinite variances where the data say nothing.
pub fn covariance(information: &DMatrix<f64>) -> DMatrix<f64> {
    let n = information.nrows();
    if n == 0 {
        return information.clone();
    }
    let scale: Vec<f64> = (0..n).map(|k| information[(k, k)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let by = scale[i] * scale[j];
        if by > 0.0 { information[(i, j)] / by } else { f64::from(u8::from(i == j)) }
    });
    let eigen = scaled.symmetric_eigen();
    let mut result = DMatrix::zeros(n, n);
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        let v = eigen.eigenvectors.column(k);
        result += v * v.transpose() / value.max(1e-12);
    }
    DMatrix::from_fn(n, n, |i, j| {
        let by = scale[i] * scale[j];
        if by > 0.0 {
            result[(i, j)] / by
        } else if i == j {
            f64::INFINITY
        } else {
            0.0
        }
    })
}

/// Splits runs: those whose role is given as given. Of the others, runs whose input jumps and runs whose input is smooth are split alike: put in
/// the order of how fast their inputs are, one of every three neighbours is held out, by turns the one with the largest and the one with the
/// smallest input; the slowest and the fastest never are. Of two or three runs in all, the middle or last one is.
pub fn split(plant: &dyn Plant, roles: &[Role]) -> Split {
    let signals = plant.signals();
    let (mut fit, mut held) = (Vec::new(), Vec::new());
    let mut kinds: [Vec<Pace>; 2] = [Vec::new(), Vec::new()];
    for (run, signal) in signals.iter().enumerate() {
        match roles.get(run).copied().unwrap_or_default() {
            Role::Fit => fit.push(run),
            Role::HeldOut => held.push(run),
            Role::Auto => {
                let pace = Pace::of(run, signal);
                kinds[usize::from(pace.jumps)].push(pace);
            }
        }
    }
    for mut order in kinds {
        order.sort_by(|a, b| a.speed.total_cmp(&b.speed).then(a.range.total_cmp(&b.range)));
        let count = order.len();
        let inner = if count < 3 { 0..0 } else { 1..count - 1 };
        let mut out = Vec::new();
        for (index, group) in order[inner].chunks(3).enumerate() {
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            out.extend(group.iter().max_by(|a, b| (sign * a.range).total_cmp(&(sign * b.range))).map(|pace| pace.run));
        }
        for pace in order {
            if out.contains(&pace.run) { held.push(pace.run) } else { fit.push(pace.run) }
        }
    }
    fit.sort_unstable();
    held.sort_unstable();
    if fit.is_empty() {
        std::mem::swap(&mut fit, &mut held);
    }
    if held.is_empty() && fit.len() >= 2 && roles.iter().all(|role| *role == Role::Auto) {
        held.extend(fit.pop());
    }
    Split { fit, held }
}

/// How a run's input goes.
struct Pace {
    run: usize,
    /// Swings per second.
    speed: f64,
    range: f64,
    /// Whether it changes by a good part of its range from one row to the next.
    jumps: bool,
}

impl Pace {
    fn of(run: usize, signal: &Signal) -> Self {
        let (low, high) =
            signal.inputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(*u), high.max(*u)));
        let range = (high - low).max(1e-9);
        let (mut way, mut time, mut largest) = (0.0, 0.0, 0.0_f64);
        for (u, t) in signal.inputs.windows(2).zip(signal.times.windows(2)).filter(|(_, t)| t[1] > t[0]) {
            way += (u[1] - u[0]).abs();
            largest = largest.max((u[1] - u[0]).abs());
            time += t[1] - t[0];
        }
        let rows = signal.inputs.len().max(1) as f64;
        // A smooth input changes by π/2 times its mean change at most, a triangle by its mean.
        let jumps = largest > 6.0 * way / rows && largest > 0.05 * range;
        Self { run, speed: way / range / f64::max(time, 1e-9), range, jumps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::Candidate;

    /// Two slow waves that differ little, as far as candidates go; runs of their sum with noise.
    struct Waves {
        signals: Vec<Signal>,
        candidates: Vec<Candidate>,
    }

    const VALUES: usize = 400;

    fn wave(id: &str, run: usize, at: usize) -> f64 {
        let t = at as f64 / VALUES as f64 + 0.1 * run as f64;
        match id {
            "first" => (7.0 * t).sin(),
            "second" => -(7.0 * t + 0.12).sin(),
            _ => (23.0 * t).cos(),
        }
    }

    impl Waves {
        fn new(of: &[(&str, f64)]) -> Self {
            let signal = |run: usize| {
                let value = |at: usize| {
                    let noise = (1.0 + (run * VALUES + at) as f64).sin() * 43_758.545_3;
                    // Uniform noise of unit variance.
                    let noise = (noise - noise.floor() - 0.5) * 12_f64.sqrt();
                    of.iter().map(|(id, x)| x * wave(id, run, at)).sum::<f64>() + noise
                };
                Signal {
                    id: format!("run {run}"),
                    values: (0..VALUES).map(value).collect(),
                    sigmas: vec![1.0; VALUES],
                    times: (0..VALUES).map(|at| at as f64).collect(),
                    channels: vec![0; VALUES],
                    inputs: (0..VALUES).map(|at| (at as f64 * (1.0 + run as f64) / 50.0).sin()).collect(),
                }
            };
            let candidate = |id: &'static str| Candidate {
                id,
                kind: "test",
                cause: "A wave.",
                is_constant: false,
                parameters: vec![Free {
                    name: "x",
                    unit: "",
                    off: Some(0.0),
                    bounds: [-100.0, 100.0],
                    scale: 1.0,
                    inverse: false,
                }],
                fixed: Vec::new(),
                starts: vec![vec![1.0]],
            };
            Self { signals: (0..6).map(signal).collect(), candidates: ["other", "first", "second"].map(candidate).to_vec() }
        }
    }

    impl Plant for Waves {
        fn signals(&self) -> &[Signal] {
            &self.signals
        }

        fn channels(&self) -> Vec<String> {
            vec!["y".into()]
        }

        fn unit(&self) -> &'static str {
            ""
        }

        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }

        fn predict(&self, model: &Model, run: usize, _nuisances: &[f64]) -> Result<Vec<f64>, String> {
            let of = |term: &Term, at| term.x[0] * wave(self.candidates[term.candidate].id, run, at);
            Ok((0..VALUES).map(|at| model.terms.iter().map(|term| of(term, at)).sum()).collect())
        }
    }

    fn found(plant: &Waves) -> Vec<&'static str> {
        let progress = |_: &str| {};
        let bench = Bench::new(plant);
        let mut search = Search { bench, split: split(plant, &[Role::Auto; 6]), unexplained: 0.0, progress: &progress };
        let plain = search.calibrated(1.0).unwrap();
        let (best, _) = search.forward(plain).unwrap();
        best.model().terms.iter().map(|term| search.id(term.candidate)).collect()
    }

    #[test]
    fn two_causes_that_hide_one_another_are_found_together() {
        // Together they make a wave of amplitude 0.12 × 12; one of them alone can take up 0.4 % of its square.
        let mut both = found(&Waves::new(&[("first", 12.0), ("second", 12.0)]));
        both.sort_unstable();
        assert_eq!(both, ["first", "second"]);
    }

    #[test]
    fn one_cause_stays_one_and_noise_stays_noise() {
        assert_eq!(found(&Waves::new(&[("other", 1.0)])), ["other"]);
        assert_eq!(found(&Waves::new(&[("first", 1.0)])), ["first"]);
        assert!(found(&Waves::new(&[])).is_empty());
    }
}
