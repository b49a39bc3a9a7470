//! The whole loop, from a plant to a [`Diagnosis`].

use nalgebra::DMatrix;
use serde::Serialize;

use super::dataset::Role;
use super::fit::{Bench, Residuals, places};
use super::plant::{Model, Plant, Term};
use super::search::{Scored, Search, Split, Trial, covariance, split};
use super::tests::{ResidualTest, residual_tests};

/// Joints per actuator that the search begins with, if the plant has so many: what finer ones change, re-tuned constants take up.
const SEARCH_RESOLUTION: f64 = 10.0;
/// Structure is left if χ² per value is above 1 by so much (a misfit of half the noise), ...
const LEFT_OVER: f64 = 0.25;
/// ... and by so much of what the refined nominal model leaves: true causes in other equations than the library's left 0.6 % at most. With three or
/// more causes it takes less, in inverse proportion to one less than their number: a handful of causes that still leave something are the shadow
/// of one that is not in the library.
const LEFT_SHARE: f64 = 0.02;
/// Above this share nothing is named at all.
const NOTHING_NAMED: f64 = 0.5;
/// Replacements are looked at again, at the full precision, if their χ² is above the best one's by no more than this.
const NEAR_TIE: f64 = 500.0;
/// χ² of one degree of freedom that noise exceeds in 5 % of cases.
const CHI2_95: f64 = 3.841_458_820_694_124;

/// What the data say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The nominal model, finely enough discretised, explains the data to the noise.
    None,
    /// The causes are named.
    Named,
    /// Two or more causes that these data cannot tell apart.
    Tied,
    /// Structure is left that nothing in the library explains.
    Unexplained,
}

/// A parameter of an adopted cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Its name in `[[effect]]` tables.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// The range that holds the true value in 95 % of cases; an end may be missing where the data say nothing.
    pub ci95: [Option<f64>; 2],
    /// Whether it stands at the end of its range.
    pub at_bound: bool,
}

/// A cause that the data ask for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adopted {
    /// Its name.
    pub id: String,
    /// Where it acts.
    pub kind: String,
    /// What it is, in a sentence.
    pub cause: String,
    /// Its numbers.
    pub parameters: Vec<Estimate>,
    /// Causes that would do as well.
    pub tied_with: Vec<String>,
    /// Share of the held-out squared error above the noise that it removes.
    pub gain_heldout: f64,
    /// What is given of it: parameters that were not fitted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<(String, f64)>,
}

/// Error of a model on one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunError {
    /// The run.
    pub id: String,
    /// `fit` or `held-out`.
    pub role: &'static str,
    /// Root of the mean squared residual.
    pub rmse_mm: f64,
    /// The same in multiples of the noise.
    pub rmse_noises: f64,
}

/// A model beside the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// Over all runs.
    pub rmse_mm: f64,
    /// Over the held-out runs.
    pub rmse_heldout_mm: f64,
    /// The range of that, by leaving out held-out runs one at a time.
    pub rmse_heldout_ci95_mm: [f64; 2],
    /// Run by run.
    pub runs: Vec<RunError>,
    /// What the residuals look like.
    pub residual_tests: Vec<ResidualTest>,
    /// Fitted numbers.
    pub parameters: Vec<Estimate>,
}

/// How well a candidate does on top of re-tuned constants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// The candidate.
    pub id: String,
    /// Error of the held-out runs with it.
    pub rmse_heldout_mm: f64,
    /// Change of Bayes's information criterion against re-tuned constants alone; negative is better.
    pub delta_bic: f64,
}

/// Two constants that the data hardly tell apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlation {
    /// The two, as cause and parameter.
    pub between: [String; 2],
    /// Coefficient of correlation (–).
    pub coefficient: f64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Of this object.
    pub schema: u32,
    /// The data's name.
    pub dataset: String,
    /// In a word.
    pub verdict: Verdict,
    /// In a sentence.
    pub summary: String,
    /// Every cause adopted, numerics and constants included.
    pub effects: Vec<Adopted>,
    /// Share of the squared error above the noise that is left of the refined nominal model's.
    pub unexplained_fraction: f64,
    /// What is left looks like this.
    pub unexplained: Vec<String>,
    /// One standard deviation, the mean over channels.
    pub noise_mm: f64,
    /// The nominal model.
    pub baseline: Stage,
    /// With re-tuned constants and refined discretisation.
    pub calibrated: Stage,
    /// With all causes adopted.
    pub extended: Stage,
    /// Candidates on top of re-tuned constants, best first.
    pub candidates: Vec<Ranked>,
    /// Constants that hardly differ in what they do.
    pub correlations: Vec<Correlation>,
    /// Ratio of the largest to the smallest eigenvalue of the scaled information of the extended model.
    pub condition: f64,
    /// What to measure to tell tied causes apart.
    pub next_experiment: Option<String>,
    /// What was noticed about the data.
    pub data_quality: Vec<String>,
    /// What was noticed about the analysis.
    pub remarks: Vec<String>,
}

/// The diagnosis with the models behind it, for figures and for going on.
pub struct Outcome {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// The nominal model as it was given.
    pub nominal: Scored,
    /// Re-tuned constants, refined discretisation.
    pub calibrated: Scored,
    /// All causes.
    pub extended: Scored,
    /// Models that do as well as the extended one.
    pub tied: Vec<Scored>,
    /// The runs.
    pub split: Split,
    /// Moments of jumps as they were found.
    pub unknowns: super::fit::Unknowns,
    /// Which values counted.
    pub used: Vec<Vec<bool>>,
}

/// Diagnoses a plant's measured runs. `name` and `quality` are passed on; `roles` say what runs are for; `progress` is told what is tried;
/// `separate` proposes what to measure next, given the models that are tied.
///
/// # Errors
/// If the nominal model cannot be simulated, in words.
pub fn diagnose(
    plant: &dyn Plant,
    name: &str,
    roles: &[Role],
    quality: Vec<String>,
    progress: &(dyn Fn(&str) + Sync),
    separate: &dyn Fn(&[Model]) -> Option<String>,
) -> Result<Outcome, String> {
    let split = split(plant, roles);
    let mut remarks = Vec::new();
    let ladder = plant.resolutions();
    let nominal_resolution = ladder.first().copied().unwrap_or(1.0);
    let start = ladder.iter().copied().find(|r| *r >= SEARCH_RESOLUTION).unwrap_or(nominal_resolution);
    let mut search = Search { bench: Bench::new(plant), split, progress, unexplained: 0.0 };

    progress("the nominal model");
    let nominal = search.fitted(&Model { terms: Vec::new(), resolution: nominal_resolution, fine: true })?;
    progress("constants of the nominal model");
    let mut calibrated = search.calibrated(start)?;
    let spikes = search.bench.leave_out_spikes(calibrated.model())?;
    if spikes > 0 {
        calibrated = search.calibrated(start)?;
    }
    let poor = poverty(plant, &search.split);
    // Data that cannot tell causes apart get none.
    let (mut best, trials) = if poor.is_some() {
        (search.fitted(&Model { terms: Vec::new(), ..calibrated.model().clone() })?, Vec::new())
    } else {
        search.forward(calibrated.clone())?
    };
    let more = search.bench.leave_out_spikes(best.model())?;
    if more > 0 {
        best = search.settle(best)?;
    }
    best = search.resolve(best)?;
    best = search.backward(best)?;
    best = search.resolve(best)?;

    // What could stand in the place of every cause.
    let mut replaced: Vec<(usize, Trial)> = Vec::new();
    for _ in 0..2 {
        if poor.is_some() || best.model().terms.is_empty() {
            break;
        }
        replaced = search.replacements(&best, 4)?;
        let better = replaced
            .iter()
            .filter(|(_, trial)| {
                let other = &trial.scored;
                let simpler = other.freedom() < best.freedom() && search.is_tied(&best, other);
                simpler || (other.total() < best.total() && !search.is_tied(other, &best))
            })
            .min_by(|a, b| a.1.scored.total().total_cmp(&b.1.scored.total()))
            .map(|(_, trial)| trial.scored.clone());
        let Some(better) = better else { break };
        best = search.settle(better)?;
        best = search.backward(best)?;
    }
    let coarse_total = best.total();
    progress("the last digits");
    best = search.fitted(&Model { fine: true, ..best.model().clone() })?;
    best = search.resolve(best)?;
    best = search.backward(best)?;
    best = search.settle(best)?;
    if spikes + more > 0 {
        remarks.push(format!("{} single values far off their neighbours' residuals were left out", spikes + more));
    }

    // Refined, but without any cause: what the causes have to explain.
    let bare = search.fitted(&Model { terms: Vec::new(), resolution: best.model().resolution, fine: true })?;
    let all = search.split.all();
    let count = search.bench.count(&all) as f64;
    let above = |scored: &Scored| (scored.total() / count - 1.0).max(0.0);
    let (left, whole) = (above(&best), above(&bare));
    let unexplained_fraction = if whole > 0.0 { (left / whole).min(1.0) } else { 0.0 };
    let handful = best.model().terms.len().max(2) as f64 - 1.0;
    let is_unexplained = left > LEFT_OVER && unexplained_fraction > LEFT_SHARE / handful;
    let unnamed = is_unexplained && unexplained_fraction > NOTHING_NAMED;
    if unnamed && !best.model().terms.is_empty() {
        let names: Vec<_> = best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
        remarks.push(format!(
            "nothing is named: the nearest, {}, leaves {:.0} % of the misfit",
            names.join(" with "),
            100.0 * unexplained_fraction
        ));
        best = bare.clone();
    }

    // Is it the discretisation?
    let coarse = search.fitted(&Model { resolution: nominal_resolution, ..best.model().clone() })?;
    let refined = best.model().resolution != nominal_resolution && search.is_worth(&best, &coarse);
    if best.model().resolution != nominal_resolution && !refined && above(&coarse) <= above(&best) + 0.01 {
        best = coarse.clone();
    }

    progress("intervals");
    let mut numerics = numerics(&search, &best)?;
    // What is left may pull at the causes: by no more than its share of what they explain.
    let free = best.model().terms.iter().flat_map(|term| {
        let parameters = &plant.candidates()[term.candidate].parameters;
        term.x.iter().zip(parameters).map(|(x, p)| x - p.off.unwrap_or(*x))
    });
    for (numerics, reach) in numerics.iter_mut().zip(free) {
        *numerics = numerics.hypot(reach * unexplained_fraction.sqrt());
    }
    let intervals = intervals_of(&search, &best, &numerics)?;
    let tied = ties(&search, &best, &replaced, coarse_total);
    let mut effects = Vec::new();
    if refined {
        effects.push(discretisation(&search, &best, &coarse));
    }
    for (index, term) in best.model().terms.iter().enumerate() {
        effects.push(adopted(&search, &best, index, term, &intervals, &tied)?);
    }
    let physics = best.model().terms.len();
    let verdict = match () {
        () if is_unexplained => Verdict::Unexplained,
        () if physics == 0 && poor.is_some() && above(&best) > LEFT_OVER => Verdict::Unexplained,
        () if physics == 0 => Verdict::None,
        () if effects.iter().any(|effect| !effect.tied_with.is_empty()) => Verdict::Tied,
        () => Verdict::Named,
    };
    if let Some(poor) = &poor {
        remarks.push(poor.clone());
    }
    let models: Vec<Model> =
        std::iter::once(best.model().clone()).chain(tied.iter().map(|(_, t)| t.scored.model().clone())).collect();
    let next_experiment = if verdict == Verdict::Tied { separate(&models) } else { None };
    let unexplained = if is_unexplained { super::tests::describe(plant, &search.split, &best.residuals) } else { Vec::new() };

    let stage = |scored: &Scored, parameters: Vec<Estimate>| stage(plant, &search.split, &search.bench.used, scored, parameters);
    let constants = intervals_of(&search, &calibrated, &[])?;
    let parameters = |scored: &Scored, found: &Intervals| -> Vec<Estimate> {
        let terms = scored.model().terms.iter().enumerate();
        terms.flat_map(|(index, term)| estimates(&search, index, term, found)).collect()
    };
    let ranked = |trial: &Trial| Ranked {
        id: search.id(trial.candidate).to_owned(),
        rmse_heldout_mm: rmse(plant, &search.bench.used, &trial.scored.residuals, &search.split.held),
        delta_bic: trial.scored.bic() - calibrated.bic(),
    };
    let sigmas: Vec<f64> = plant.signals().iter().flat_map(|signal| signal.sigmas.iter().copied()).collect();
    let diagnosis = Diagnosis {
        schema: 1,
        dataset: name.to_owned(),
        verdict,
        summary: summary(verdict, &effects, unexplained_fraction, poor.as_deref(), best.model().resolution, refined),
        // Where what is left is no more than noise, its share of a small misfit says nothing: it is given as a share of the noise then.
        unexplained_fraction: if is_unexplained { unexplained_fraction } else { unexplained_fraction.min(left.min(1.0)) },
        unexplained,
        noise_mm: sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64,
        baseline: stage(&nominal, Vec::new()),
        calibrated: stage(&calibrated, parameters(&calibrated, &constants)),
        extended: stage(&best, parameters(&best, &intervals)),
        candidates: trials.iter().map(ranked).collect(),
        correlations: intervals.correlations.clone(),
        condition: intervals.condition,
        effects,
        next_experiment,
        data_quality: quality,
        remarks,
    };
    Ok(Outcome {
        diagnosis,
        nominal,
        calibrated,
        extended: best,
        tied: tied.into_iter().map(|(_, trial)| trial.scored).collect(),
        unknowns: search.bench.unknowns.clone(),
        used: search.bench.used.clone(),
        split: search.split,
    })
}

/// Why the data cannot decide, if so.
fn poverty(plant: &dyn Plant, split: &Split) -> Option<String> {
    let signals = plant.signals();
    if signals.len() < 2 || split.held.is_empty() {
        return Some(format!(
            "{} run is too little to tell causes apart: a cause has to be judged on a run that it was not fitted to",
            signals.len()
        ));
    }
    let still = |run: &usize| {
        let inputs = &signals[*run].inputs;
        inputs.iter().all(|u| (u - inputs[0]).abs() < 1e-9)
    };
    let levels: Vec<f64> = signals.iter().filter_map(|signal| signal.inputs.first().copied()).collect();
    if split.all().iter().all(still) && levels.iter().all(|level| (level - levels[0]).abs() < 1e-9) {
        return Some("the voltage never changes: nothing can be told from these data but an offset".into());
    }
    None
}

/// Intervals of a model's coordinates and how they hang together.
struct Intervals {
    /// Per coordinate, in order: lower and upper end, in coordinates.
    ends: Vec<[f64; 2]>,
    /// Number of coordinates of each term.
    sizes: Vec<usize>,
    correlations: Vec<Correlation>,
    condition: f64,
}

/// Half widths by the sandwich of information and of what the residuals' structure adds, checked by profiles: the coordinate is put to its end, all
/// others are fitted again, and the end is moved to where χ² has grown by what 95 % asks for. `numerics`, what is not noise, is added in quadrature.
fn intervals_of(search: &Search, scored: &Scored, numerics: &[f64]) -> Result<Intervals, String> {
    let model = scored.model();
    let places = places(model);
    let n = places.len();
    let naive = covariance(&scored.fit.information);
    let inflation = search.bench.inflation(model, &search.split.fit, &naive)?;
    let name = |k: usize| {
        let (term, parameter) = places[k];
        let candidate = &search.bench.plant.candidates()[model.terms[term].candidate];
        format!("{} {}", candidate.id, candidate.parameters[parameter].name)
    };
    let (mut ends, mut correlations) = (Vec::new(), Vec::new());
    for k in 0..n {
        let free = &search.bench.plant.candidates()[model.terms[places[k].0].candidate].parameters[places[k].1];
        let x = model.terms[places[k].0].x[places[k].1];
        let spread = (naive[(k, k)] * inflation[k]).sqrt();
        let mut sides = [x, x];
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let mut reach = CHI2_95.sqrt() * spread;
            if n > 1 && reach.is_finite() && reach > 0.0 {
                let to = (x + sign * reach).clamp(free.bounds[0], free.bounds[1]);
                if (to - x).abs() > 0.5 * reach
                    && let Ok(chi2) = search.bench.profile(model, places[k], to, &search.split.fit)
                {
                    let grown = (chi2 - scored.fit.chi2) / inflation[k];
                    let asked = CHI2_95 * ((to - x) / reach).powi(2);
                    if grown > 0.0 {
                        reach *= (asked / grown).sqrt().clamp(0.5, 3.0);
                    }
                }
            }
            reach = reach.hypot(numerics.get(k).copied().unwrap_or(0.0));
            sides[side] =
                if reach.is_finite() { (x + sign * reach).clamp(free.bounds[0], free.bounds[1]) } else { free.bounds[side] };
        }
        ends.push(sides);
        for j in 0..k {
            let coefficient = naive[(k, j)] / (naive[(k, k)] * naive[(j, j)]).sqrt();
            if coefficient.abs() > 0.95 {
                correlations.push(Correlation { between: [name(j), name(k)], coefficient });
            }
        }
    }
    let sizes = model.terms.iter().map(|term| term.x.len()).collect();
    Ok(Intervals { ends, sizes, correlations, condition: condition(&scored.fit.information) })
}

/// How far each coordinate moves with the discretisation, to the next coarser number of joints (if it was refined) and with the time step, and with constants that are
/// nominal because the discretisation could do what they did.
fn numerics(search: &Search, best: &Scored) -> Result<Vec<f64>, String> {
    let coordinates = |model: &Model| -> Vec<f64> { model.terms.iter().flat_map(|term| term.x.clone()).collect() };
    let own = coordinates(best.model());
    let ladder = search.bench.plant.resolutions();
    let at = ladder.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let mut moved = vec![0.0; own.len()];
    let mut others = Vec::new();
    if !own.is_empty() {
        (search.progress)("how far the discretisation matters");
        if at > 0 {
            others.push(search.fitted(&Model { resolution: ladder[at - 1], ..best.model().clone() })?);
        }
        others.push(search.fitted(&Model { fine: false, ..best.model().clone() })?);
        others.push(search.fitted(&search.with_constants(best.model()))?);
    }
    for other in &others {
        for (moved, (a, b)) in moved.iter_mut().zip(own.iter().zip(coordinates(other.model()))) {
            *moved = f64::hypot(*moved, a - b);
        }
    }
    Ok(moved)
}

/// Condition of the information scaled to a unit diagonal.
fn condition(information: &DMatrix<f64>) -> f64 {
    let n = information.nrows();
    if n == 0 {
        return 1.0;
    }
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let by = (information[(i, i)] * information[(j, j)]).sqrt();
        if by > 0.0 { information[(i, j)] / by } else { f64::from(u8::from(i == j)) }
    });
    let values = scaled.symmetric_eigenvalues();
    values.max() / values.min().max(1e-16)
}

fn estimates(search: &Search, index: usize, term: &Term, found: &Intervals) -> Vec<Estimate> {
    let candidate = &search.bench.plant.candidates()[term.candidate];
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
                at_bound: x <= free.bounds[0] || x >= free.bounds[1],
            }
        })
        .collect()
}

fn adopted(
    search: &Search,
    best: &Scored,
    index: usize,
    term: &Term,
    found: &Intervals,
    tied: &[(usize, Trial)],
) -> Result<Adopted, String> {
    let candidate = &search.bench.plant.candidates()[term.candidate];
    let mut without = best.model().clone();
    without.terms.remove(index);
    let without = search.fitted(&without)?;
    let mut tied_with: Vec<String> =
        tied.iter().filter(|(at, _)| *at == index).map(|(_, trial)| search.id(trial.candidate).to_owned()).collect();
    tied_with.sort();
    tied_with.dedup();
    tied_with.retain(|id| id != candidate.id);
    // Which actuator it is was found by trying all of them; other given numbers tell the form of the equation.
    let (found_by_trying, form): (Vec<_>, Vec<_>) = candidate.fixed.iter().copied().partition(|(name, _)| *name == "actuator");
    let which = found_by_trying.into_iter().map(|(name, value)| Estimate {
        name: name.to_owned(),
        value,
        unit: String::new(),
        ci95: [Some(value); 2],
        at_bound: false,
    });
    Ok(Adopted {
        id: candidate.id.to_owned(),
        kind: candidate.kind.to_owned(),
        cause: candidate.cause.to_owned(),
        parameters: which.chain(estimates(search, index, term, found)).collect(),
        tied_with,
        gain_heldout: gain(search, best, &without),
        fixed: form.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
    })
}

/// Share of the held-out χ² above the noise that `best` removes from `without`.
fn gain(search: &Search, best: &Scored, without: &Scored) -> f64 {
    let count = search.bench.count(&search.split.held) as f64;
    let above = without.held - count;
    if above > 0.0 { ((without.held - best.held) / above).clamp(0.0, 1.0) } else { 0.0 }
}

fn discretisation(search: &Search, best: &Scored, coarse: &Scored) -> Adopted {
    let ladder = search.bench.plant.resolutions();
    let at = ladder.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let beside = [at.saturating_sub(1), (at + 1).min(ladder.len() - 1)].map(|k| Some(ladder[k]));
    Adopted {
        id: "discretisation".into(),
        kind: "numerics".into(),
        cause: "Finitely many joints and a finite time step stand for a continuum.".into(),
        parameters: vec![Estimate {
            name: "motors_per_actuator".into(),
            value: best.model().resolution,
            unit: String::new(),
            ci95: beside,
            at_bound: at + 1 == ladder.len(),
        }],
        tied_with: Vec::new(),
        gain_heldout: gain(search, best, coarse),
        fixed: Vec::new(),
    }
}

/// Replacements that do as well as the cause they replace.
fn ties(search: &Search, best: &Scored, replaced: &[(usize, Trial)], coarse_total: f64) -> Vec<(usize, Trial)> {
    let near = |(index, trial): &&(usize, Trial)| {
        best.model().terms.get(*index).is_some_and(|term| search.id(term.candidate) != search.id(trial.candidate))
            && trial.scored.freedom() <= best.freedom()
            && trial.scored.total() < coarse_total + NEAR_TIE
    };
    let again = |(index, trial): &(usize, Trial)| {
        let Model { resolution, fine, .. } = *best.model();
        let scored = search.fitted(&Model { resolution, fine, ..trial.scored.model().clone() }).ok()?;
        search.is_tied(best, &scored).then_some((*index, Trial { scored, ..trial.clone() }))
    };
    replaced.iter().filter(near).filter_map(again).collect()
}

fn rmse(plant: &dyn Plant, used: &[Vec<bool>], residuals: &[Residuals], runs: &[usize]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for &run in runs {
        for ((r, sigma), used) in residuals[run].iter().zip(&plant.signals()[run].sigmas).zip(&used[run]) {
            if *used {
                sum += (r * sigma) * (r * sigma);
                count += 1.0;
            }
        }
    }
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}

fn stage(plant: &dyn Plant, split: &Split, used: &[Vec<bool>], scored: &Scored, parameters: Vec<Estimate>) -> Stage {
    let all = split.all();
    let runs = all.iter().map(|&run| {
        let r = &scored.residuals[run];
        let count = used[run].iter().filter(|used| **used).count().max(1) as f64;
        RunError {
            id: plant.signals()[run].id.clone(),
            role: if split.held.contains(&run) { "held-out" } else { "fit" },
            rmse_mm: rmse(plant, used, &scored.residuals, &[run]),
            rmse_noises: (r.iter().map(|r| r * r).sum::<f64>() / count).sqrt(),
        }
    });
    // Jackknife over runs.
    let held = rmse(plant, used, &scored.residuals, &split.held);
    let without: Vec<f64> = split
        .held
        .iter()
        .map(|out| rmse(plant, used, &scored.residuals, &split.held.iter().copied().filter(|run| run != out).collect::<Vec<_>>()))
        .collect();
    let n = without.len() as f64;
    let mean = without.iter().sum::<f64>() / n.max(1.0);
    let error = ((n - 1.0).max(0.0) / n.max(1.0) * without.iter().map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt();
    Stage {
        rmse_mm: rmse(plant, used, &scored.residuals, &all),
        rmse_heldout_mm: held,
        rmse_heldout_ci95_mm: [(held - 1.96 * error).max(0.0), held + 1.96 * error],
        runs: runs.collect(),
        residual_tests: residual_tests(plant, split, &scored.residuals),
        parameters,
    }
}

fn summary(verdict: Verdict, effects: &[Adopted], left: f64, poor: Option<&str>, resolution: f64, refined: bool) -> String {
    let finely = if refined { format!(", with {resolution} joints per actuator,") } else { String::new() };
    let name = |effect: &Adopted| {
        let numbers: Vec<_> = effect
            .parameters
            .iter()
            .map(|p| {
                let range = match p.ci95 {
                    [Some(low), Some(high)] if low == high => return format!("{} = {}", p.name, p.value),
                    [Some(low), Some(high)] => format!(" ({low:.4} to {high:.4})"),
                    _ => String::new(),
                };
                format!("{} = {:.4}{range}{}{}", p.name, p.value, if p.unit.is_empty() { "" } else { " " }, p.unit)
            })
            .collect();
        format!("{} ({})", effect.id, numbers.join(", "))
    };
    let physics: Vec<&Adopted> = effects.iter().filter(|effect| effect.id != "discretisation").collect();
    let names = physics.iter().map(|effect| name(effect)).collect::<Vec<_>>().join("; ");
    match verdict {
        Verdict::None => match poor {
            Some(poor) => format!("Nothing stands out, but {poor}."),
            None => format!("Nothing is missing: the nominal model{finely} explains the data to the noise."),
        },
        Verdict::Named => format!("The simulation lacks {names}."),
        Verdict::Tied => {
            let ties: Vec<_> = physics
                .iter()
                .filter(|effect| !effect.tied_with.is_empty())
                .map(|effect| format!("{} cannot be told from {}", effect.id, effect.tied_with.join(", ")))
                .collect();
            format!("The simulation lacks {names}; in these data {}.", ties.join("; "))
        }
        Verdict::Unexplained => match (poor, physics.is_empty()) {
            (Some(poor), _) => format!("The nominal model does not explain the data, and {poor}."),
            (None, true) => "Something is wrong that nothing in the library explains.".into(),
            (None, false) => format!(
                "{names} explains a part, but {:.0} % of the misfit is left that nothing in the library explains.",
                100.0 * left
            ),
        },
    }
}
